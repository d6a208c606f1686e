"""Step 4 of the paper: the shape similarity filter.

Shape descriptor: the shares of a cluster's projected points in the 3 x 3 equal cells of their bounding
rectangle in the image (our reading of "divided into nine sections evenly"), row by row from the top left.
Before that the points are rotated so that their main direction, by PCA, stands upright (people and riders)
or lies level (vehicles); by more than 40 degrees nothing is rotated ("constrained PCA").

Similarity to the benchmark shape S* of the category, with every cell smoothed by 1e-3:

    D(P || Q) = sum P ln(P / Q),        s = 2 / (1 + exp(D)),     0 < s <= 1.

The paper prints neither its "modified sigmoid" nor a sign: it takes "argmax of D_KL" of what it calls the
highest score. Taken literally that is the *least* similar cluster; `pick` can be that, to show it, or the
cluster of most points, to show what the filter is worth.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Float, Float64, Int

from fusion.geometry import readonly

MainAxis = Literal["vertical", "horizontal"]
Pick = Literal["most_similar", "least_similar", "most_points"]
SHAPES_SCHEMA = "fusion-shapes/1"

_CELL_NUMBER = np.array([1, 3])  # of (column, row), row by row

_HORIZONTAL = frozenset({"car", "truck", "bus", "van"})


@dataclass(frozen=True, kw_only=True)
class ShapeConfig:
    """Hyper-parameters of step 4."""

    max_rotation_deg: float = 40.0  # paper
    smoothing: float = 1e-3  # ours: added to every cell, then normalised
    pick: Pick = "most_similar"  # paper's equation as printed: least_similar; see the module's text


def main_axis(category: str) -> MainAxis:
    """How objects of a category stand in an image: vehicles level, everything else upright."""
    return "horizontal" if category in _HORIZONTAL else "vertical"


def tilt_rad(uv_px: Float[np.ndarray, "k 2"], axis: MainAxis) -> float:
    """Angle in (-pi/2, pi/2] from the axis to the points' main direction, positive from u (right) to v.

    0 where the points have no main direction (fewer than two, or equally spread).
    """
    if len(uv_px) < 2:
        return 0.0
    u, v = (uv_px - np.add.reduce(uv_px, axis=0) / len(uv_px)).T
    uu, vv, uv = float(u @ u), float(v @ v), float(u @ v)
    if math.hypot(uu - vv, 2.0 * uv) <= 1e-12 * (uu + vv):
        return 0.0
    angle = 0.5 * math.atan2(2.0 * uv, uu - vv) - (math.pi / 2 if axis == "vertical" else 0.0)
    return angle + math.pi if angle <= -math.pi / 2 else angle


def upright(
    uv_px: Float[np.ndarray, "k 2"], axis: MainAxis, max_rotation_deg: float
) -> tuple[Float64[np.ndarray, "k 2"], float]:
    """The points turned so that their main direction lies along the axis, and the angle turned in radians.

    Unchanged, with angle 0, where that would take more than the maximum.
    """
    angle = tilt_rad(uv_px, axis)
    if angle == 0.0 or abs(angle) > math.radians(max_rotation_deg):
        return np.asarray(uv_px, dtype=np.float64), 0.0
    c, s = math.cos(angle), math.sin(angle)
    return uv_px @ np.array([[c, -s], [s, c]]), -angle  # row vectors: turned by -angle


def descriptor(uv_px: Float[np.ndarray, "k 2"]) -> Float64[np.ndarray, "9"]:
    """Shares of the points in the 3 x 3 cells of their bounding rectangle, row by row from the top left.

    They sum to one. A side without length puts all points in its middle third. ValueError without points.
    """
    if len(uv_px) == 0:
        raise ValueError("a shape needs at least one point")
    low = np.minimum.reduce(uv_px, axis=0)
    side = np.maximum.reduce(uv_px, axis=0) - low
    width, height = side.tolist()
    rounding = 1e-9 * max(width, height)  # a side no longer than that has no length
    if width > rounding and height > rounding:
        share = (uv_px - low) / side
    else:
        long = side > rounding
        share = np.where(long, (uv_px - low) / np.where(long, side, 1.0), 0.5)
    cells = (3.0 * share).astype(np.int64)
    np.minimum(cells, 2, out=cells)
    return np.bincount(cells @ _CELL_NUMBER, minlength=9) / len(uv_px)


def kl_divergence(
    p: Float[np.ndarray, "9"], q: Float[np.ndarray, "9"], smoothing: float = ShapeConfig.smoothing
) -> float:
    """D(P || Q) in nats of two distributions over the same cells, both smoothed."""
    p, q = p + smoothing, q + smoothing
    p, q = p / np.add.reduce(p), q / np.add.reduce(q)
    return max(float(p @ np.log(p / q)), 0.0)


def similarity(divergence: float) -> float:
    """s = 2 / (1 + exp(D)): one for equal shapes, towards zero for unequal ones."""
    return 2.0 / (1.0 + math.exp(min(divergence, 700.0)))


def select(divergences: Float[np.ndarray, " m"], counts: Int[np.ndarray, " m"], pick: Pick) -> int:
    """The chosen cluster (ties: the first): the most similar one, the paper's printed argmax of D, or that of
    most points."""
    if pick == "most_points":
        return int(np.argmax(counts))
    return int(np.argmax(divergences) if pick == "least_similar" else np.argmin(divergences))


def learn_shape(
    uv_px_of_objects: Iterable[Float[np.ndarray, "_ 2"]],
    category: str,
    max_rotation_deg: float = ShapeConfig.max_rotation_deg,
) -> Float64[np.ndarray, "9"]:
    """Benchmark shape S*: the mean descriptor of the rotated pixels [k 2] of selected objects of a category.

    Objects without points are left out; ValueError if none is left.
    """
    shapes = [
        descriptor(upright(uv_px, main_axis(category), max_rotation_deg)[0])
        for uv_px in uv_px_of_objects
        if len(uv_px) > 0
    ]
    if not shapes:
        raise ValueError(f"no points of any {category} to learn a shape from")
    mean_shape: np.ndarray = np.mean(shapes, axis=0)
    return mean_shape


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchmarkShapes:
    """S* by category, [9] each, and where they come from."""

    provenance: Mapping[str, object]
    shapes: Mapping[str, Float64[np.ndarray, "9"]]

    def of(self, category: str) -> Float64[np.ndarray, "9"]:
        """S* of a category; one that was never learned gets the uniform shape, which prefers no cell."""
        return self.shapes.get(category, _UNIFORM)


_UNIFORM = readonly(np.full(9, 1.0 / 9.0))


@cache
def load_benchmark_shapes() -> BenchmarkShapes:
    """The shapes in `fusion/shapes.json`, read once."""
    text = resources.files("fusion").joinpath("shapes.json").read_text(encoding="utf-8")
    return parse_benchmark_shapes(text)


def parse_benchmark_shapes(text: str) -> BenchmarkShapes:
    """Shapes from JSON {schema, provenance: {...}, shapes: {category: [9 numbers]}}, or ValueError."""
    document = json.loads(text)
    if not isinstance(document, dict) or document.get("schema") != SHAPES_SCHEMA:
        raise ValueError(f"benchmark shapes must have schema {SHAPES_SCHEMA!r}")
    provenance, listed = document.get("provenance"), document.get("shapes")
    if not isinstance(provenance, dict) or not isinstance(listed, dict) or not listed:
        raise ValueError("benchmark shapes need a provenance and at least one shape")
    shapes = {}
    for category, numbers in listed.items():
        shape = np.asarray(numbers, dtype=np.float64)
        if shape.shape != (9,) or not (shape >= 0.0).all() or abs(float(shape.sum()) - 1.0) > 1e-3:
            raise ValueError(f"the shape of {category!r} must be 9 shares that sum to one")
        shapes[category] = readonly(shape / shape.sum())
    return BenchmarkShapes(provenance=MappingProxyType(provenance), shapes=MappingProxyType(shapes))


def format_benchmark_shapes(
    shapes: Mapping[str, Float[np.ndarray, "9"]], provenance: Mapping[str, object]
) -> str:
    """The JSON text of `fusion/shapes.json`: one shape a line, four decimals, as reviewed by people."""
    rows = ",\n".join(
        f"    {json.dumps(name)}: [{', '.join(f'{share:.4f}' for share in shape)}]"
        for name, shape in sorted(shapes.items())
    )
    head = json.dumps({"schema": SHAPES_SCHEMA, "provenance": dict(provenance)}, indent=2)
    return f'{head[:-2]},\n  "shapes": {{\n{rows}\n  }}\n}}\n'
