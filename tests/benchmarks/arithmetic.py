"""How much arithmetic a sweep needs at least, and how fast this machine's arithmetic is."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numba
import numpy as np

from simbench.sensors import rays
from tests.benchmarks.rivals import fans_of
from tests.benchmarks.scene import Primitives

# Operations of one ray against one primitive (+ - * / sqrt abs and comparisons count as one), counted by hand
# in the `_fans_*` functions of simbench/sensors/ray_kernel.py; not counted: what all rays of a fan share.
OPERATIONS = {
    rays.PLANE: 25,
    rays.BOX: 43,
    rays.SPHERE: 50,
    rays.ELLIPSOID: 50,
    rays.CYLINDER: 45,
    rays.CAPSULE: 48,
}
CHAIN = 16  # multiply-adds on one number in the loop that measures the peak


@dataclass(frozen=True, kw_only=True)
class Needed:
    """What no culling by bounding spheres can save: tests of the rays, and the operations in them."""

    rays: int
    tests: int
    operations: int


def needed(scene: Primitives) -> Needed:
    """Counts pairs of a ray and a primitive whose bounding sphere the ray enters before its nearest hit; with
    a plane, the rays that point down."""
    range_m = fans_of(scene)().range_m.ravel()
    direction = scene.flat_direction
    tests = operations = 0
    for kind, bound_m, position in zip(scene.kind, scene.bound_m, scene.position_m, strict=True):
        if kind == rays.PLANE:
            count = int(np.sum(direction[:, 2] < 0.0))
        else:
            centre = position - scene.origin_m
            along_m = direction @ centre
            aside2 = centre @ centre - along_m**2
            reached = (aside2 <= bound_m**2) & (along_m > -bound_m) & (along_m - bound_m <= range_m)
            count = int(np.sum(reached))
        tests += count
        operations += count * OPERATIONS[int(kind)]
    return Needed(rays=len(direction), tests=tests, operations=operations)


@numba.njit(fastmath={"contract"})  # fused, but not folded into one multiply-add
def _chains(x, factor, term, rounds):  # type: ignore[no-untyped-def]
    for _ in range(rounds):
        for i in range(x.shape[0]):
            v = x[i]
            for _ in range(CHAIN):
                v = v * factor + term
            x[i] = v


def peak_operations_per_s(seconds: float = 0.5) -> float:
    """Float64 operations per second of one core, measured: independent chains of multiply-adds on 64 numbers,
    the best of the rounds within `seconds` of CPU time."""
    x, rounds = np.ones(64), 20_000
    _chains(x, 0.999, 1e-3, 1)
    best, started = 0.0, process_time()
    while process_time() - started < seconds:
        begun = process_time()
        _chains(x, 0.999, 1e-3, rounds)
        best = max(best, 2.0 * CHAIN * len(x) * rounds / (process_time() - begun))
    return best
