"""Ray casting in time: nearest hits on MuJoCo's primitive geoms, every ray at its own instant.

`cast` takes groups of any rays (a group shares an origin and an instant). `cast_fans` is the fast way for
sensors that look along planes: the columns of a spinning LiDAR, the rows of a camera. All are analytic in
float64. Inside starts return the exit, planes are hit from above only: as `mj_ray` does, which is the oracle
in the tests (ranges equal to 1e-9 m).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int, Int32, Int64

from fusion.geometry import readonly
from simbench.sensors import ray_kernel as kernel
from simbench.sensors.compiled import jit as jit
from simbench.sensors.ray_kernel import BOX as BOX
from simbench.sensors.ray_kernel import CAPSULE as CAPSULE
from simbench.sensors.ray_kernel import CYLINDER as CYLINDER
from simbench.sensors.ray_kernel import ELLIPSOID as ELLIPSOID
from simbench.sensors.ray_kernel import LANES, NOWHERE
from simbench.sensors.ray_kernel import PLANE as PLANE
from simbench.sensors.ray_kernel import SPHERE as SPHERE

SUN_CELLS = 192  # along either side of the grid of what the sun sees
BINS_PER_STEP = 2  # of the table that turns a slope into a step of a fan


@dataclass(frozen=True, kw_only=True, eq=False)
class Geoms:
    """Primitive geoms, each fixed to a body. Sizes in metres as MuJoCo defines them."""

    kind: Int[np.ndarray, " g"]
    size_m: Float64[np.ndarray, "g 3"]
    body: Int[np.ndarray, " g"]
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
    kernel._cast(
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Geoms in the world over time: still ones once, moving ones at key instants, linear between them.

    still [g 12]: rotation row by row, then centre in metres; of a moving geom, at the first key. row [g]: its
    row in `keys`, -1 for a still one. path_m [t m]: how far any
    point of each came since the first key, at most.
    """

    geoms: Geoms
    still: Float64[np.ndarray, "g 12"]
    row: Int64[np.ndarray, " g"]
    keys: Float64[np.ndarray, "t m 12"]
    path_m: Float64[np.ndarray, "t m"]


def place(
    geoms: Geoms,
    body_rotation: Float64[np.ndarray, "t b 3 3"],
    body_position_m: Float64[np.ndarray, "t b 3"],
) -> Placed:
    """Carry every geom to the world at the bodies' poses T_world_body of all keys."""
    rotation, position = np.ascontiguousarray(body_rotation), np.ascontiguousarray(body_position_m)
    moves = (rotation != rotation[:1]).any(axis=(0, 2, 3)) | (position != position[:1]).any(axis=(0, 2))

    def carried(which: Int64[np.ndarray, " m"], keys: int) -> tuple[np.ndarray, np.ndarray]:
        out, path_m = np.empty((keys, len(which), 12)), np.empty((keys, len(which)))
        kernel._place(
            geoms.body, geoms.rotation, geoms.position_m, geoms.bound_m, rotation, position, which, out,
            path_m,
        )  # fmt: skip
        return out, path_m

    moving = np.flatnonzero(moves[geoms.body])
    still, _ = carried(np.arange(len(geoms.kind)), 1)
    keys, path_m = carried(moving, len(rotation))
    row = np.full(len(geoms.kind), -1, dtype=np.int64)
    row[moving] = np.arange(len(moving))
    return Placed(geoms=geoms, still=still[0], row=row, keys=keys, path_m=path_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fans:
    """Directions of a sensor as fans: ray j of fan f looks along e + slope u + skew n, frame = (e, u, n).

    frame [f 3 3]: R_sensor_fan, columns e, u, n. slope, skew [f/4 k 4]: of four fans side by side (`packed`);
    slopes ascend along k. Fans that are alike have one row (g = 1) for all, no skew, and slopes times their
    scale [f], which is 1 elsewhere. pose [f]: index of each fan's pose. out_at [f], out_stride: where its
    rays go in the flat result. low, bins_per_slope, first_step, last_step [f/4 n]: from a slope to the
    first and last steps that reach it. slack: by how much slopes and skews given to `cast_fans` may differ
    from these.
    """

    frame: Float64[np.ndarray, "f 3 3"]
    slope: Float64[np.ndarray, "g k l"]
    skew: Float64[np.ndarray, "g k l"]
    scale: Float64[np.ndarray, " f"]
    pose: Int64[np.ndarray, " f"]
    out_at: Int64[np.ndarray, " f"]
    out_stride: int
    low: float
    bins_per_slope: float
    first_step: Int32[np.ndarray, "g n"]
    last_step: Int32[np.ndarray, "g n"]
    skew_max: float
    slack: float


def packed(per_fan: Float64[np.ndarray, "f k"]) -> Float64[np.ndarray, "g k l"]:
    """Rows of fans, four side by side; the last row repeats where they do not fill up."""
    padding = -len(per_fan) % LANES
    rows = np.concatenate([per_fan, np.repeat(per_fan[-1:], padding, axis=0)]) if padding else per_fan
    return np.ascontiguousarray(rows.reshape(-1, LANES, rows.shape[1]).transpose(0, 2, 1))


def make_fans(
    frame: Float64[np.ndarray, "f 3 3"],
    slope: Float64[np.ndarray, "f k"],
    skew: Float64[np.ndarray, "f k"],
    pose: Int64[np.ndarray, " f"],
    out_at: Int64[np.ndarray, " f"],
    out_stride: int,
    slack: float = 0.0,
) -> Fans:
    """Tabulate fans. ValueError: slopes that do not ascend, or that are not finite."""
    return _tabulated(frame, slope, skew, np.ones(len(frame)), pose, out_at, out_stride, slack)


def make_alike_fans(
    frame: Float64[np.ndarray, "f 3 3"],
    slope: Float64[np.ndarray, " k"],
    scale: Float64[np.ndarray, " f"],
    pose: Int64[np.ndarray, " f"],
    out_at: Int64[np.ndarray, " f"],
    out_stride: int,
) -> Fans:
    """The same for flat fans whose slopes differ by a scale only: small tables, which stay in the cache."""
    return _tabulated(frame, slope[None], np.zeros((1, len(slope))), scale, pose, out_at, out_stride, 0.0)


def _tabulated(
    frame: np.ndarray, slope: np.ndarray, skew: np.ndarray, scale: np.ndarray, pose: np.ndarray,
    out_at: np.ndarray, out_stride: int, slack: float,
) -> Fans:  # fmt: skip
    if not (np.isfinite(slope).all() and np.isfinite(skew).all()):
        raise ValueError("slopes and skews must be finite: a fan spans less than half a turn")
    if (np.diff(slope, axis=1) < 0.0).any():
        raise ValueError("the slopes of a fan must ascend")
    padding = -len(frame) % LANES
    low, high = float(slope.min()), float(slope.max())
    bins = BINS_PER_STEP * slope.shape[1] + 1
    width = max((high - low) / (bins - 1), 1e-9)
    first = np.empty((len(slope), bins), dtype=np.int32)
    last = np.empty_like(first)
    kernel._bins(np.ascontiguousarray(slope), low, width, first, last)

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.repeat(values[-1:], -len(values) % LANES, axis=0)])

    return Fans(
        frame=readonly(padded(frame)),
        slope=readonly(packed(slope)),
        skew=readonly(packed(skew)),
        scale=readonly(padded(scale)),
        pose=readonly(padded(pose)),
        out_at=readonly(np.concatenate([out_at, np.full(padding, NOWHERE)])),
        out_stride=out_stride,
        low=low,
        bins_per_slope=1.0 / width,
        first_step=readonly(padded(first).reshape(-1, LANES, bins).min(axis=1)),
        last_step=readonly(padded(last).reshape(-1, LANES, bins).max(axis=1)),
        skew_max=float(np.abs(skew).max()),
        slack=slack,
    )


def cast_fans(
    placed: Placed,
    key: Int64[np.ndarray, " p"],
    weight: Float64[np.ndarray, " p"],
    R_world_sensor: Float64[np.ndarray, "p 3 3"],
    origin_m: Float64[np.ndarray, "p 3"],
    fans: Fans,
    out: Hits,
    slope: Float64[np.ndarray, "g k l"] | None = None,
    skew: Float64[np.ndarray, "g k l"] | None = None,
) -> None:
    """Nearest hit of every ray of the fans, into `out` (its arrays seen as flat).

    Pose i of the sensor is R_world_sensor[i], origin_m[i], at the instant between keys key[i] and key[i] + 1
    of `placed`, `weight[i]` of the way. `slope`, `skew`: packed as the fans', within their slack of them.
    """
    geoms = placed.geoms
    kernel._cast_fans(
        geoms.kind,
        geoms.size_m,
        geoms.bound_m,
        placed.row,
        placed.still,
        placed.keys,
        placed.path_m,
        np.ascontiguousarray(key, dtype=np.int64),
        np.ascontiguousarray(weight, dtype=np.float64),
        np.ascontiguousarray(R_world_sensor, dtype=np.float64),
        np.ascontiguousarray(origin_m, dtype=np.float64),
        fans.pose,
        fans.frame,
        fans.slope if slope is None else slope,
        fans.skew if skew is None else skew,
        fans.scale,
        fans.first_step,
        fans.last_step,
        fans.low,
        fans.bins_per_slope,
        fans.slack,
        fans.skew_max,
        fans.out_at,
        fans.out_stride,
        0,
        len(fans.pose),
        0,
        fans.slope.shape[1],
        out.range_m.reshape(-1),
        out.geom.reshape(-1),
        out.cosine.reshape(-1),
    )


def cast_window(
    placed: Placed,
    wanted: Int[np.ndarray, " n"],
    key: Int64[np.ndarray, " p"],
    weight: Float64[np.ndarray, " p"],
    R_world_sensor: Float64[np.ndarray, "p 3 3"],
    origin_m: Float64[np.ndarray, "p 3"],
    fans: Fans,
    pose: Int64[np.ndarray, " f"],
    window: tuple[int, int, int, int],
) -> Hits:
    """What rays [r c] of a part of the fans meet first, among the geoms `wanted`.

    window: (first ray, first fan, last ray, last fan), the last ones not in it. pose: of each fan, in place
    of `fans.pose`; the rest is as for `cast_fans`.
    """
    geoms, (begin, top, end, bottom) = placed.geoms, window
    start, stop = top - top % LANES, min(bottom + (-bottom) % LANES, len(fans.pose))
    hits = empty_hits((bottom - top, end - begin))
    out_at = np.full(len(fans.pose), NOWHERE)
    out_at[top:bottom] = (end - begin) * np.arange(bottom - top) - begin
    kernel._cast_fans(
        geoms.kind[wanted], geoms.size_m[wanted], geoms.bound_m[wanted], placed.row[wanted],
        placed.still[wanted], placed.keys, placed.path_m, key, weight,
        np.ascontiguousarray(R_world_sensor), np.ascontiguousarray(origin_m), pose, fans.frame, fans.slope,
        fans.skew, fans.scale, fans.first_step, fans.last_step, fans.low, fans.bins_per_slope, fans.slack,
        fans.skew_max, out_at, 1, start, stop, begin, end,
        hits.range_m.reshape(-1), hits.geom.reshape(-1), hits.cosine.reshape(-1),
    )  # fmt: skip
    named = np.append(wanted, -1).astype(np.int32)[hits.geom]
    return Hits(range_m=hits.range_m, geom=named, cosine=hits.cosine)


def hiders(
    placed: Placed,
    geom: Int[np.ndarray, " n"],
    eye_m: Float64[np.ndarray, " 3"],
    R_world_view: Float64[np.ndarray, "3 3"],
    slopes: tuple[float, float, float, float],
) -> Int64[np.ndarray, " m"]:
    """Other geoms that may stand before one of the geoms `geom` at the first key, seen from eye_m in a part
    (x0, y0, x1, y1: slopes x / z, y / z) of a view's optical frame.

    Leaves out none that does, but the ground before what has sunk into it by less than a millimetre.
    """
    geoms = placed.geoms
    out, mask = np.empty(len(geoms.kind), dtype=np.int64), np.zeros(len(geoms.kind), dtype=np.bool_)
    mask[geom] = True
    count = kernel._hiders(
        geoms.kind, geoms.size_m, placed.still, mask, eye_m, np.ascontiguousarray(R_world_view),
        np.array(slopes), out,
    )  # fmt: skip
    return out[:count]


def empty_hits(shape: tuple[int, ...]) -> Hits:
    """Room for the result of `cast_fans`."""
    return Hits(
        range_m=np.empty(shape),
        geom=np.empty(shape, dtype=np.int32),
        cosine=np.empty(shape, dtype=np.float32),
    )


def sunlit(
    placed: Placed,
    key: Int64[np.ndarray, " p"],
    weight: Float64[np.ndarray, " p"],
    R_world_sensor: Float64[np.ndarray, "p 3 3"],
    origin_m: Float64[np.ndarray, "p 3"],
    fans: Fans,
    hits: Hits,
    toward_sun: Float64[np.ndarray, " 3"],
) -> Bool[np.ndarray, "..."]:
    """Whether the sun reaches what each ray of `cast_fans` hit, by one exact shadow ray each; in the hits'
    shape.

    toward_sun: unit vector, world frame. Where a surface looks away from the sun its own geom does not count:
    the caller's cosine says so. Geoms are sorted into cells of the plane across the sun's direction, so that
    a ray meets only those before it.
    """
    geoms = placed.geoms
    a = np.cross(toward_sun, np.eye(3)[np.argmin(np.abs(toward_sun))])
    a /= np.linalg.norm(a)
    axes = np.stack([a, np.cross(toward_sun, a), toward_sun])
    footprint = np.zeros((len(geoms.kind), 8))
    kernel._sun_footprints(
        geoms.kind, geoms.size_m, geoms.bound_m, placed.row, placed.still, placed.keys, placed.path_m, axes,
        footprint,
    )  # fmt: skip
    solid = footprint[geoms.kind != PLANE]
    if len(solid) == 0:
        return np.ones(hits.geom.shape, dtype=np.bool_)
    low = (solid[:, :2] - solid[:, 2:4]).min(axis=0)
    cells_per_m = SUN_CELLS / np.maximum((solid[:, :2] + solid[:, 2:4]).max(axis=0) - low, 1e-6)
    first = np.zeros(SUN_CELLS * SUN_CELLS + 1, dtype=np.int64)
    entries = kernel._sun_cells(geoms.kind, footprint, low, cells_per_m, first, np.empty(0, dtype=np.int64))
    member = np.empty(max(entries, 1), dtype=np.int64)
    kernel._sun_cells(geoms.kind, footprint, low, cells_per_m, first, member)
    lit = np.empty(hits.geom.shape, dtype=np.bool_)
    kernel._sunlit(
        geoms.kind, geoms.size_m, placed.row, placed.still, placed.keys,
        np.ascontiguousarray(key, dtype=np.int64), np.ascontiguousarray(weight, dtype=np.float64),
        np.ascontiguousarray(R_world_sensor, dtype=np.float64),
        np.ascontiguousarray(origin_m, dtype=np.float64),
        fans.pose, fans.frame, fans.slope, fans.skew, fans.scale, fans.out_at, fans.out_stride,
        axes, footprint, low, cells_per_m, first, member,
        hits.range_m.reshape(-1), hits.geom.reshape(-1), lit.reshape(-1),
    )  # fmt: skip
    return lit
