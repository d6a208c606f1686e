"""Differences between two versions of a pipeline, run by run."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float64

Better: TypeAlias = Literal["higher", "lower"]
Values: TypeAlias = Mapping[Hashable, float | None]
"""A metric's value by run (its key, usually the seed); None: the run is there, but has no value."""

NAMED = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Differences:
    """D = new - old over the runs that have both values, turned so that higher is better.

    d: in the order of the runs' keys as text, so that the order in which they came decides nothing; keys:
    those. old, new:
    means over the same runs, as they were given; None without any. missing: runs without a value on either
    side; lost: with the old value only; gained: with the new one only; only_old, only_new: runs that
    the other side does not have at all.
    """

    d: Float64[np.ndarray, " n"]
    keys: tuple[Hashable, ...]
    old: float | None
    new: float | None
    missing: tuple[Hashable, ...]
    lost: tuple[Hashable, ...]
    gained: tuple[Hashable, ...]
    only_old: tuple[Hashable, ...]
    only_new: tuple[Hashable, ...]


def differences(old: Values, new: Values, better: Better) -> Differences:
    """Pair two sides by run. ValueError: a value is not finite, or `better` is no direction."""
    if better not in ("higher", "lower"):
        raise ValueError(f"better is 'higher' or 'lower', not {better!r}")
    for side in (old, new):
        bad = [run for run, value in side.items() if value is not None and not np.isfinite(value)]
        if bad:
            raise ValueError(f"the value of run {bad[0]} is not finite; use None for a run without a value")
    shared = [run for run in old if run in new]
    pairs = [
        (run, a, b)
        for run, a, b in ((run, old[run], new[run]) for run in sorted(shared, key=repr))
        if a is not None and b is not None
    ]
    before = np.array([a for _, a, _ in pairs], dtype=np.float64)
    after = np.array([b for _, _, b in pairs], dtype=np.float64)
    return Differences(
        d=after - before if better == "higher" else before - after,
        keys=tuple(run for run, _, _ in pairs),
        old=float(before.mean()) if pairs else None,
        new=float(after.mean()) if pairs else None,
        missing=tuple(run for run in shared if old[run] is None and new[run] is None),
        lost=tuple(run for run in shared if old[run] is not None and new[run] is None),
        gained=tuple(run for run in shared if old[run] is None and new[run] is not None),
        only_old=tuple(run for run in old if run not in new),
        only_new=tuple(run for run in new if run not in old),
    )


def runs(keys: Iterable[Hashable]) -> str:
    """`3 runs (0, 4, 7)`: the first few by name."""
    names = [str(key) for key in keys]
    shown = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
    return f"{len(names)} run{'' if len(names) == 1 else 's'} ({shown})"
