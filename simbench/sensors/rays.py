"""The ray kernel: nearest hits on MuJoCo's primitive geoms, every group of rays at its own time.

A *group* is a set of rays that share an origin and an instant: one LiDAR column, or one tile of an image.
Per group, geoms are culled by a cone and a wedge around its rays, ordered by distance, and tested
analytically in float64. Inside starts return the exit, planes are hit from above only: as `mj_ray` does,
which is the oracle in the tests (ranges equal to 1e-9 m).

All helpers of the kernel live in this file: numba's cache does not notice a change in another file.
"""

from __future__ import annotations

import inspect
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64

from fusion.geometry import readonly


def _writable_cache() -> None:
    """numba raises at decoration when it can write neither beside this file nor in the home folder."""
    if "NUMBA_CACHE_DIR" in os.environ or os.access(Path(__file__).parent, os.W_OK):
        return
    home_cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    nearest = next((p for p in (home_cache, *home_cache.parents) if p.exists()), None)
    if nearest is None or not os.access(nearest, os.W_OK):
        os.environ["NUMBA_CACHE_DIR"] = str(Path(tempfile.gettempdir()) / f"simbench-numba-{os.getuid()}")


_writable_cache()

import numba  # noqa: E402  (after the cache folder is known)

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6  # as mujoco.mjtGeom


def jit(function: Callable[..., Any]) -> Any:
    """Compile a kernel: the function as written, without the argument checks that tests wrap around it."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(inspect.unwrap(function))


@dataclass(frozen=True, kw_only=True, eq=False)
class Geoms:
    """Primitive geoms, each fixed to a body. Sizes in metres as MuJoCo defines them."""

    kind: Int32[np.ndarray, " g"]
    size_m: Float64[np.ndarray, "g 3"]
    body: Int32[np.ndarray, " g"]
    rotation: Float64[np.ndarray, "g 3 3"]  # R_body_geom
    position_m: Float64[np.ndarray, "g 3"]  # in the body's frame
    bound_m: Float64[np.ndarray, " g"]  # radius of the bounding sphere; infinite for planes

    def __post_init__(self) -> None:
        for name, dtype in (
            ("kind", np.int32),
            ("size_m", np.float64),
            ("body", np.int32),
            ("rotation", np.float64),
            ("position_m", np.float64),
            ("bound_m", np.float64),
        ):
            object.__setattr__(self, name, readonly(getattr(self, name), dtype))
        unknown = set(np.unique(self.kind)) - {PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX}
        if unknown:
            raise ValueError(f"geom types {sorted(map(int, unknown))} cannot be ray-cast; allowed: plane, "
                             "sphere, capsule, ellipsoid, cylinder, box")  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """Per ray [g k]: range along the ray (inf: no hit), geom (-1: none), cosine of the incidence angle."""

    range_m: Float64[np.ndarray, "g k"]
    geom: Int32[np.ndarray, "g k"]
    cosine: Float32[np.ndarray, "g k"]


def cast(
    geoms: Geoms,
    body_rotation: Float64[np.ndarray, "t b 3 3"],
    body_position_m: Float64[np.ndarray, "t b 3"],
    time_index: Int64[np.ndarray, " g"],
    origin_m: Float64[np.ndarray, "g 3"],
    direction: Float64[np.ndarray, "g k 3"],
) -> Hits:
    """Nearest hit of each ray. Group i starts at `origin_m[i]`, with the bodies at row `time_index[i]`.

    Directions are unit vectors in the world frame; the bodies' poses are T_world_body.
    """
    groups, rays = direction.shape[:2]
    range_m = np.full((groups, rays), np.inf)
    geom = np.full((groups, rays), -1, dtype=np.int32)
    cosine = np.zeros((groups, rays), dtype=np.float32)
    _cast(
        geoms.kind,
        geoms.size_m,
        geoms.body,
        geoms.rotation,
        geoms.position_m,
        geoms.bound_m,
        np.ascontiguousarray(body_rotation, dtype=np.float64),
        np.ascontiguousarray(body_position_m, dtype=np.float64),
        np.ascontiguousarray(time_index, dtype=np.int64),
        np.ascontiguousarray(origin_m, dtype=np.float64),
        np.ascontiguousarray(direction, dtype=np.float64),
        range_m,
        geom,
        cosine,
    )
    return Hits(range_m=range_m, geom=geom, cosine=cosine)


def cast_pixels(
    geoms: Geoms,
    wanted: Bool[np.ndarray, " g"],
    body_rotation: Float64[np.ndarray, "b 3 3"],
    body_position_m: Float64[np.ndarray, "b 3"],
    R_world_camera: Float64[np.ndarray, "3 3"],
    camera_position_m: Float64[np.ndarray, " 3"],
    x: Float64[np.ndarray, " c"],
    y: Float64[np.ndarray, " r"],
) -> Hits:
    """Nearest hits [c r] of the pixel rays (x, y, 1) of one camera at one instant, among the geoms in
    `wanted`."""
    shape = (len(x), len(y))
    range_m, geom = np.empty(shape), np.empty(shape, dtype=np.int32)
    cosine = np.empty(shape, dtype=np.float32)
    _cast_pixels(
        geoms.kind,
        geoms.size_m,
        geoms.body,
        geoms.rotation,
        geoms.position_m,
        geoms.bound_m,
        wanted,
        np.ascontiguousarray(body_rotation),
        np.ascontiguousarray(body_position_m),
        np.ascontiguousarray(R_world_camera),
        np.ascontiguousarray(camera_position_m),
        np.ascontiguousarray(x, dtype=np.float64),
        np.ascontiguousarray(y, dtype=np.float64),
        range_m,
        geom,
        cosine,
    )
    return Hits(range_m=range_m, geom=geom, cosine=cosine)


@jit
def _first_positive(a: float, b: float, c: float) -> tuple[float, float]:
    """Roots of a t^2 + 2 b t + c, ascending; inf, inf where there is none."""
    disc = b * b - a * c
    if disc < 0.0 or a < 1e-300:
        return np.inf, np.inf
    root = np.sqrt(disc)
    return (-b - root) / a, (-b + root) / a


@jit
def _hit_ellipsoid(o, d, sx, sy, sz, n):  # type: ignore[no-untyped-def]
    ox, oy, oz = o[0] / sx, o[1] / sy, o[2] / sz
    dx, dy, dz = d[0] / sx, d[1] / sy, d[2] / sz
    near, far = _first_positive(
        dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0
    )
    t = near if near >= 0.0 else far
    if not (0.0 <= t < np.inf):
        return np.inf
    n[0], n[1], n[2] = (ox + t * dx) / sx, (oy + t * dy) / sy, (oz + t * dz) / sz
    return t


@jit
def _hit_box(o, d, size, n):  # type: ignore[no-untyped-def]
    near, far = -np.inf, np.inf
    near_axis, far_axis = 0, 0
    for i in range(3):
        if d[i] == 0.0:
            if abs(o[i]) > size[i]:
                return np.inf
            continue
        inv = 1.0 / d[i]
        half = abs(inv) * size[i]
        middle = -o[i] * inv
        if middle - half > near:
            near, near_axis = middle - half, i
        if middle + half < far:
            far, far_axis = middle + half, i
    if near > far or far < 0.0:
        return np.inf
    n[0], n[1], n[2] = 0.0, 0.0, 0.0
    if near >= 0.0:
        n[near_axis] = -1.0 if d[near_axis] > 0 else 1.0
        return near
    n[far_axis] = 1.0 if d[far_axis] > 0 else -1.0
    return far


@jit
def _hit_cylinder(o, d, radius, half, capped, n):  # type: ignore[no-untyped-def]
    """The tube of a cylinder or capsule, with flat ends where `capped`."""
    best = np.inf
    t0, t1 = _first_positive(
        d[0] * d[0] + d[1] * d[1],
        o[0] * d[0] + o[1] * d[1],
        o[0] * o[0] + o[1] * o[1] - radius * radius,
    )
    for t in (t0, t1):
        if 0.0 <= t < best and abs(o[2] + t * d[2]) <= half:
            best = t
            n[0], n[1], n[2] = (o[0] + t * d[0]) / radius, (o[1] + t * d[1]) / radius, 0.0
    if capped and d[2] != 0.0:
        for side in (-1.0, 1.0):
            t = (side * half - o[2]) / d[2]
            if 0.0 <= t < best:
                x, y = o[0] + t * d[0], o[1] + t * d[1]
                if x * x + y * y <= radius * radius:
                    best = t
                    n[0], n[1], n[2] = 0.0, 0.0, side
    return best


@jit
def _hit_capsule(o, d, radius, half, n):  # type: ignore[no-untyped-def]
    best = _hit_cylinder(o, d, radius, half, False, n)
    for side in (-1.0, 1.0):
        oz = o[2] - side * half
        t0, t1 = _first_positive(
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
            o[0] * d[0] + o[1] * d[1] + oz * d[2],
            o[0] * o[0] + o[1] * o[1] + oz * oz - radius * radius,
        )
        for t in (t0, t1):
            z = oz + t * d[2]
            if 0.0 <= t < best and z * side >= 0.0:
                best = t
                n[0], n[1], n[2] = (o[0] + t * d[0]) / radius, (o[1] + t * d[1]) / radius, z / radius
    return best


@jit
def _hit_plane(o, d, size, n):  # type: ignore[no-untyped-def]
    if d[2] > -1e-15:
        return np.inf
    t = -o[2] / d[2]
    if t < 0.0:
        return np.inf
    if size[0] > 0.0 and abs(o[0] + t * d[0]) > size[0]:
        return np.inf
    if size[1] > 0.0 and abs(o[1] + t * d[1]) > size[1]:
        return np.inf
    n[0], n[1], n[2] = 0.0, 0.0, 1.0
    return t


@jit
def _hit(kind, size, o, d, n):  # type: ignore[no-untyped-def]
    if kind == BOX:
        return _hit_box(o, d, size, n)
    if kind == CAPSULE:
        return _hit_capsule(o, d, size[0], size[1], n)
    if kind == CYLINDER:
        return _hit_cylinder(o, d, size[0], size[1], True, n)
    if kind == ELLIPSOID:
        return _hit_ellipsoid(o, d, size[0], size[1], size[2], n)
    if kind == SPHERE:
        return _hit_ellipsoid(o, d, size[0], size[0], size[0], n)
    return _hit_plane(o, d, size, n)


@jit
def _half_height(kind, size, up):  # type: ignore[no-untyped-def]
    """Half the extent of a geom along the world's z, given the z row of its rotation; a little generous."""
    x, y, z = abs(up[0]), abs(up[1]), abs(up[2])
    if kind == BOX:
        half = x * size[0] + y * size[1] + z * size[2]
    elif kind == ELLIPSOID:
        half = np.sqrt((x * size[0]) ** 2 + (y * size[1]) ** 2 + (z * size[2]) ** 2)
    elif kind == CAPSULE:
        half = z * size[1] + size[0]
    elif kind == CYLINDER:
        half = z * size[1] + np.sqrt(max(1.0 - z * z, 0.0)) * size[0]
    elif kind == SPHERE:
        half = size[0]
    else:
        return np.inf
    return half * (1.0 + 1e-9) + 1e-9


@jit
def _bounds(direction, axis, side):  # type: ignore[no-untyped-def]
    """Mean direction of a group, a sideways axis, and the cosine and sine that bound its rays."""
    k = direction.shape[0]
    axis[:] = 0.0
    for j in range(k):
        for i in range(3):
            axis[i] += direction[j, i]
    norm = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    if norm < 1e-9:
        return -1.0, 1.0
    for i in range(3):
        axis[i] /= norm
    # The rays of a column spread along first-to-last; sideways is across that.
    ux, uy, uz = (
        direction[k - 1, 0] - direction[0, 0],
        direction[k - 1, 1] - direction[0, 1],
        direction[k - 1, 2] - direction[0, 2],
    )
    side[0] = axis[1] * uz - axis[2] * uy
    side[1] = axis[2] * ux - axis[0] * uz
    side[2] = axis[0] * uy - axis[1] * ux
    norm = np.sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    cosine, sine = 1.0, 0.0
    for j in range(k):
        c = direction[j, 0] * axis[0] + direction[j, 1] * axis[1] + direction[j, 2] * axis[2]
        cosine = min(cosine, c)
        if norm > 1e-9:
            s = abs(direction[j, 0] * side[0] + direction[j, 1] * side[1] + direction[j, 2] * side[2]) / norm
            sine = max(sine, s)
    if norm > 1e-9:
        for i in range(3):
            side[i] /= norm
    else:
        sine = 1.0
    return cosine, sine


@jit
def _cast_group(  # type: ignore[no-untyped-def]
    kind, size, body, rotation, position, bound, wanted, body_R, body_p, origin, direction,
    centre, index, nearest, frame, span, work, out_range, out_geom, out_cosine,
):  # fmt: skip
    """One group: rays `direction` [k 3] from `origin`, bodies at body_R [b 3 3], body_p [b 3].

    centre, index, nearest, frame, span, work: scratch. out_*: rows of k. Geoms where `wanted` is False are
    not there.
    """
    axis, side, o, d, n = work[0], work[1], work[2], work[3], work[4]
    cosine, sine = _bounds(direction, axis, side)
    cone_sine = np.sqrt(max(1.0 - cosine * cosine, 0.0))
    count = 0
    for i in range(kind.shape[0]):
        if not wanted[i]:
            continue
        b = body[i]
        for r in range(3):
            centre[i, r] = (
                body_p[b, r]
                + body_R[b, r, 0] * position[i, 0]
                + body_R[b, r, 1] * position[i, 1]
                + body_R[b, r, 2] * position[i, 2]
            )
        cx, cy, cz = centre[i, 0] - origin[0], centre[i, 1] - origin[1], centre[i, 2] - origin[2]
        distance = np.sqrt(cx * cx + cy * cy + cz * cz)
        radius = bound[i]
        near = 0.0
        if radius < distance:
            lateral = abs(cx * side[0] + cy * side[1] + cz * side[2])
            if sine < 1.0 and lateral > (distance + radius) * sine + radius:
                continue
            # Distance of the centre from the cone's surface, in the plane through its axis.
            along = cx * axis[0] + cy * axis[1] + cz * axis[2]
            across = np.sqrt(max(distance * distance - along * along, 0.0))
            if cosine > 0.0 and across * cosine - along * cone_sine > radius * (1.0 + 1e-9) + 1e-9:
                continue
            near = distance - radius
        # World orientation of the survivors only, kept in order of distance.
        for r in range(3):
            for c in range(3):
                frame[i, r, c] = (
                    body_R[b, r, 0] * rotation[i, 0, c]
                    + body_R[b, r, 1] * rotation[i, 1, c]
                    + body_R[b, r, 2] * rotation[i, 2, c]
                )
        # What the geom spans in height, and how far it reaches: a ray outside that span is not tested.
        half_height = _half_height(kind[i], size[i], frame[i, 2])
        span[i, 0], span[i, 1] = cz - half_height, cz + half_height
        span[i, 2], span[i, 3] = near, distance + radius
        place = count
        while place > 0 and nearest[place - 1] > near:
            nearest[place] = nearest[place - 1]
            index[place] = index[place - 1]
            place -= 1
        nearest[place] = near
        index[place] = i
        count += 1
    for k in range(direction.shape[0]):
        best = np.inf
        best_geom = -1
        best_cosine = 0.0
        dx, dy, dz = direction[k, 0], direction[k, 1], direction[k, 2]
        for m in range(count):
            if nearest[m] > best:
                break
            i = index[m]
            low, high = dz * span[i, 2], dz * span[i, 3]
            if min(low, high) > span[i, 1] or max(low, high) < span[i, 0]:
                continue
            cx, cy, cz = origin[0] - centre[i, 0], origin[1] - centre[i, 1], origin[2] - centre[i, 2]
            along = -(cx * dx + cy * dy + cz * dz)
            radius = bound[i]
            if radius < np.inf:
                if along < -radius or along - radius > best:
                    continue
                if cx * cx + cy * cy + cz * cz - along * along > radius * radius * (1.0 + 1e-9) + 1e-12:
                    continue
            for r in range(3):
                o[r] = frame[i, 0, r] * cx + frame[i, 1, r] * cy + frame[i, 2, r] * cz
                d[r] = frame[i, 0, r] * dx + frame[i, 1, r] * dy + frame[i, 2, r] * dz
            hit = _hit(kind[i], size[i], o, d, n)
            if hit < best or (hit == best and hit < np.inf and i < best_geom):
                best = hit
                best_geom = i
                norm = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
                best_cosine = abs(n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / norm
        out_range[k] = best
        out_geom[k] = best_geom
        out_cosine[k] = best_cosine


@jit
def _cast(  # type: ignore[no-untyped-def]
    kind, size, body, rotation, position, bound, body_R, body_p, time_index, origin, direction,
    out_range, out_geom, out_cosine,
):  # fmt: skip
    n = kind.shape[0]
    wanted = np.ones(n, np.bool_)
    centre, index, nearest = np.empty((n, 3)), np.empty(n, np.int64), np.empty(n)
    frame, span, work = np.empty((n, 3, 3)), np.empty((n, 4)), np.empty((5, 3))
    for g in range(direction.shape[0]):
        t = time_index[g]
        _cast_group(
            kind, size, body, rotation, position, bound, wanted, body_R[t], body_p[t], origin[g],
            direction[g], centre, index, nearest, frame, span, work, out_range[g], out_geom[g], out_cosine[g],
        )  # fmt: skip


@jit
def _cast_pixels(  # type: ignore[no-untyped-def]
    kind, size, body, rotation, position, bound, wanted, body_R, body_p, R_world_camera, origin, x, y,
    out_range, out_geom, out_cosine,
):  # fmt: skip
    """One column of pixels is one group: directions R @ (x, y, 1) for the slopes x [c], y [r]."""
    n, rows = kind.shape[0], y.shape[0]
    centre, index, nearest = np.empty((n, 3)), np.empty(n, np.int64), np.empty(n)
    frame, span, work = np.empty((n, 3, 3)), np.empty((n, 4)), np.empty((5, 3))
    direction = np.empty((rows, 3))
    for c in range(x.shape[0]):
        for r in range(rows):
            norm = 1.0 / np.sqrt(x[c] * x[c] + y[r] * y[r] + 1.0)
            for i in range(3):
                direction[r, i] = norm * (
                    R_world_camera[i, 0] * x[c] + R_world_camera[i, 1] * y[r] + R_world_camera[i, 2]
                )
        _cast_group(
            kind, size, body, rotation, position, bound, wanted, body_R, body_p, origin, direction,
            centre, index, nearest, frame, span, work, out_range[c], out_geom[c], out_cosine[c],
        )  # fmt: skip
