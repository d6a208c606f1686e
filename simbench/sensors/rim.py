"""The outline of primitives as sampled points, and the extent of its image row by row.

A sphere, an ellipsoid and the cross-sections of a capsule are seen by the circle where sight lines touch
them, a cylinder by its circles, a box by its edges. Error of a rim of radius r px: below
r (1 - cos(pi / RIM)), 0.1 px for 100 px.
"""

# mypy: no-check-untyped-defs
from __future__ import annotations

import math
from functools import lru_cache
from itertools import product

import numpy as np
from jaxtyping import Float64, Int, Int64

from fusion.camera import PinholeCamera
from fusion.geometry import readonly
from fusion.messages import BoxPx
from simbench.sensors import lens_kernel, outline
from simbench.sensors.compiled import jit, jit_inline, jit_with
from simbench.sensors.lens_kernel import _distorted
from simbench.sensors.outline import NEAR_M
from simbench.sensors.rays import BOX, CAPSULE, CYLINDER, ELLIPSOID

RIM = 72  # points around a rim


def rim_points(
    kind: Int[np.ndarray, " g"],
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "k g 3 3"],
    centre_m: Float64[np.ndarray, "k g 3"],
    stations: int,
) -> Float64[np.ndarray, "k n 3"] | None:
    """Points whose hull's image is the primitives' image, at k instants, in the optical frame.

    Point n is the same one at every instant, or glides over the surface with the sight line. `stations`:
    points along a straight edge, its ends included. None when the camera is inside a primitive.
    """
    along, edges = np.linspace(-1.0, 1.0, stations), _edges(stations)
    each = np.where(
        kind == BOX, len(edges), np.where((kind == CYLINDER) | (kind == CAPSULE), stations, 1) * RIM
    )
    points = np.empty((len(rotation), int(each.sum()), 3))
    if not _rims(kind, size_m, rotation, centre_m, along, edges, _circle(), points):
        return None
    return points


def extent_px(
    points: Float64[np.ndarray, "k n 3"],
    row: Int64[np.ndarray, " k"],
    camera: PinholeCamera,
    slope_most: float,
) -> BoxPx | None:
    """Extent of n points, given when k rows of the image are exposed, each where it is when the row under it
    is exposed. None when one is nearer than NEAR_M.

    Beyond the corners of the image, at slope_most from the axis, a lens that bends is not defined: there a
    point is drawn in to the corners' distance.
    """
    lens = (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, *camera.distortion)
    most = slope_most if any(camera.distortion) else math.inf
    x0, y0, x1, y1, near = _extent(points, row, np.array(lens), most)
    return None if near else (x0, y0, x1, y1)


@lru_cache(maxsize=4)
def _edges(stations: int) -> Float64[np.ndarray, "n 3"]:
    """Points along the edges of the cube from -1 to 1, every one once."""
    square = np.array(list(product((-1.0, 1.0), repeat=2)))
    places = [
        np.insert(square, axis, a, axis=1) for axis in range(3) for a in np.linspace(-1.0, 1.0, stations)
    ]
    found: np.ndarray = np.unique(np.concatenate(places), axis=0)
    return readonly(found)


@lru_cache(maxsize=1)
def _circle() -> Float64[np.ndarray, "j 2"]:
    turn = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
    return readonly(np.stack([np.cos(turn), np.sin(turn)], axis=1))


@jit_inline
def _turned(R, x, y, z):  # type: ignore[no-untyped-def]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@jit_inline
def _across(x, y, z, axis):  # type: ignore[no-untyped-def]
    """The cross product with a unit vector along an axis, of length one."""
    cx, cy, cz = (0.0, z, -y) if axis == 0 else ((-z, 0.0, x) if axis == 1 else (y, -x, 0.0))
    length = math.sqrt(cx * cx + cy * cy + cz * cz)
    return cx / length, cy / length, cz / length


@jit_inline
def _eye(R, size, c):  # type: ignore[no-untyped-def]
    """The camera, seen from an ellipsoid about c that is scaled to a unit sphere."""
    return (
        -(R[0, 0] * c[0] + R[1, 0] * c[1] + R[2, 0] * c[2]) / size[0],
        -(R[0, 1] * c[0] + R[1, 1] * c[1] + R[2, 1] * c[2]) / size[1],
        -(R[0, 2] * c[0] + R[1, 2] * c[1] + R[2, 2] * c[2]) / size[2],
    )


@jit_inline
def _touched(R, size, c, axis, circle, points):  # type: ignore[no-untyped-def]
    """Where sight lines touch an ellipsoid: scaled to a unit sphere with the eye at e, the circle about
    e / |e|^2 of radius sqrt(1 - 1 / |e|^2), across e. axis: the circle begins across it. False inside."""
    ex, ey, ez = _eye(R, size, c)
    square = ex * ex + ey * ey + ez * ez
    if square <= 1.0:
        return False
    length, radius = math.sqrt(square), math.sqrt(1.0 - 1.0 / square)
    ax, ay, az = _across(ex, ey, ez, axis)
    ux, uy, uz = ex / length, ey / length, ez / length
    bx, by, bz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    ox, oy, oz = _turned(R, size[0] * ex / square, size[1] * ey / square, size[2] * ez / square)
    ax, ay, az = _turned(R, size[0] * radius * ax, size[1] * radius * ay, size[2] * radius * az)
    bx, by, bz = _turned(R, size[0] * radius * bx, size[1] * radius * by, size[2] * radius * bz)
    for j in range(len(circle)):
        points[j, 0] = c[0] + ox + circle[j, 0] * ax + circle[j, 1] * bx
        points[j, 1] = c[1] + oy + circle[j, 0] * ay + circle[j, 1] * by
        points[j, 2] = c[2] + oz + circle[j, 0] * az + circle[j, 1] * bz
    return True


@jit_inline
def _least(R, size, c):  # type: ignore[no-untyped-def]
    """The axis that is least along the sight line."""
    ex, ey, ez = _eye(R, size, c)
    if abs(ex) <= abs(ey) and abs(ex) <= abs(ez):
        return 0
    return 1 if abs(ey) <= abs(ez) else 2


@jit
def _rims(kind, size_m, rotation, centre_m, along, edges, circle, points):  # type: ignore[no-untyped-def]
    """Fill points [k n 3]; False when the camera is inside a primitive."""
    middle, n = len(rotation) // 2, 0
    local, size, c = np.empty(3), np.empty(3), np.empty(3)
    for g in range(len(kind)):
        if kind[g] == BOX or kind[g] == CYLINDER:
            count = len(edges) if kind[g] == BOX else len(along) * len(circle)
            for i in range(count):
                if kind[g] == BOX:
                    local[:] = edges[i] * size_m[g]
                else:
                    local[:2] = circle[i % len(circle)] * size_m[g, 0]
                    local[2] = along[i // len(circle)] * size_m[g, 1]
                for k in range(len(rotation)):
                    x, y, z = _turned(rotation[k, g], local[0], local[1], local[2])
                    points[k, n + i, 0] = x + centre_m[k, g, 0]
                    points[k, n + i, 1] = y + centre_m[k, g, 1]
                    points[k, n + i, 2] = z + centre_m[k, g, 2]
            n += count
            continue
        size[0] = size_m[g, 0]
        size[1:] = size_m[g, 1:] if kind[g] == ELLIPSOID else size_m[g, :1]
        for station in range(len(along) if kind[g] == CAPSULE else 1):
            off_m = along[station] * size_m[g, 1] if kind[g] == CAPSULE else 0.0
            c[:] = centre_m[middle, g] + off_m * rotation[middle, g, :, 2]
            axis = _least(rotation[middle, g], size, c)  # the same at all instants
            for k in range(len(rotation)):
                c[:] = centre_m[k, g] + off_m * rotation[k, g, :, 2]
                if not _touched(rotation[k, g], size, c, axis, circle, points[k, n : n + len(circle)]):
                    return False
            n += len(circle)
    return True


@jit_with(lens_kernel, outline)
def _extent(points, row, lens, slope_most):  # type: ignore[no-untyped-def]
    """Least and greatest pixels of points [k n 3], and whether one of them is too near."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    x0 = y0 = math.inf
    x1 = y1 = -math.inf
    instants = len(row)
    u, below = np.empty(instants), np.empty(instants)
    for n in range(points.shape[1]):
        for k in range(instants):
            z = points[k, n, 2]
            if z < NEAR_M:
                return x0, y0, x1, y1, True
            x, y = points[k, n, 0] / z, points[k, n, 1] / z
            if slope_most < math.inf:
                drawn = min(1.0, slope_most / max(math.sqrt(x * x + y * y), 1e-12))
                x, y = _distorted(x * drawn, y * drawn, k1, k2, p1, p2, k3)
            u[k], below[k] = fx * x + cx, fy * y + cy - (row[k] + 0.5)  # how far below the exposed row
        before, share = 0, 0.0
        if instants > 1:
            before = 0 if below[0] <= 0.0 else instants - 2  # above the first row, or below the last
            for k in range(instants - 1):
                if below[k] > 0.0 and below[k + 1] <= 0.0:
                    before = k
                    break
            first, second = below[before], below[before + 1]
            share = min(max(first / (first - second if first != second else 1.0), 0.0), 1.0)
        after = min(before + 1, instants - 1)
        u_n = u[before] + share * (u[after] - u[before])
        v_first, v_second = below[before] + row[before] + 0.5, below[after] + row[after] + 0.5
        v_n = v_first + share * (v_second - v_first)
        x0, x1, y0, y1 = min(x0, u_n), max(x1, u_n), min(y0, v_n), max(y1, v_n)
    return x0, y0, x1, y1, False
