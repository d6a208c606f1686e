"""The variants of the paper's method that are run, by name: `fusion/pipelines/variants.py` holds them."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from simbench.plugins import load_pipeline

NAMES = (
    "no_ground", "paper_ground", "no_widening", "all_sides", "twice_each_side", "no_clusters",
    "plain_k_means", "half_bins", "double_bins", "no_shape", "literal_argmax", "no_rotation", "mean_point",
    "paper_smoother", "as_printed",
)  # fmt: skip


@runtime_checkable
class Variant(Protocol):
    """step: of the six that it changes (0: several). what: `removed`, or what stands in its place."""

    @property
    def step(self) -> int: ...

    @property
    def title(self) -> str: ...

    @property
    def what(self) -> str: ...


def reference_of(name: str) -> str:
    """As a job names it."""
    return f"fusion.pipelines.variants:{name}"


def variant_of(reference: str) -> Variant:
    """What a variant says of itself. BadInput: there is nothing of this reference. TypeError: it says
    nothing."""
    found: object = load_pipeline(reference)
    if not isinstance(found, Variant):
        raise TypeError(f"{reference} does not say what it changes")
    return found
