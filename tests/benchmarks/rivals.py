"""Who casts the rays: ours and the rivals, each set up on the same primitives, each as one call.

Every set-up (models, trees, uploaded angles) is done before the clock starts, also where a moving scene would
need it again for every sweep. A rival that is not installed raises ImportError.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from simbench.sensors import rays
from tests.benchmarks.scene import Primitives, angles, mujoco_model, our_geoms
from tests.benchmarks.table import WrongAnswerError
from tests.benchmarks.triangles import TOLERANCE_M, world_mesh

FAR_M = 1e6  # beyond everything: no side may drop a far hit


@dataclass(frozen=True, kw_only=True, eq=False)
class Caster:
    """`cast` is what is timed: one range per ray, in the scene's order; `miss` tells which hit nothing.
    tolerance_m: how far the ranges may be off the exact ones."""

    name: str
    cast: Callable[[], np.ndarray]
    miss: Callable[[np.ndarray], np.ndarray]
    tolerance_m: float
    notes: tuple[str, ...] = ()

    def ranges_m(self) -> Float64[np.ndarray, " n"]:
        """Cast once: ranges of all rays, infinite where nothing is hit."""
        got = np.asarray(self.cast(), dtype=np.float64).ravel()
        return np.where(self.miss(got), np.inf, got)


def ours(scene: Primitives) -> Caster:
    """The bench's ray kernel, as its LiDAR calls it: one fan per column, into new arrays."""
    cast = fans_of(scene)
    return Caster(name="simbench", cast=lambda: cast().range_m, miss=np.isinf, tolerance_m=0.0)


def fans_of(scene: Primitives) -> Callable[[], rays.Hits]:
    """A call that carries the primitives to their place and casts the sweep: hits [c k]."""
    geoms = our_geoms(scene)
    body_rotation, body_position = np.eye(3)[None, None], np.zeros((1, 1, 3))
    columns = len(scene.direction)
    key, weight = np.zeros(columns, dtype=np.int64), np.zeros(columns)
    rotation = np.tile(scene.R_world_lidar, (columns, 1, 1))
    origin = np.tile(scene.origin_m, (columns, 1))

    def cast() -> rays.Hits:
        hits = rays.empty_hits(scene.direction.shape[:2])
        placed = rays.place(geoms, body_rotation, body_position)
        rays.cast_fans(placed, key, weight, rotation, origin, scene.table.fans, hits)
        return hits

    return cast


def multi_ray(scene: Primitives) -> Caster:
    """MuJoCo's own: one call for all rays, no normals, nothing else asked for."""
    import mujoco

    model, data = mujoco_model(scene)
    n = len(scene.flat_direction)
    origin, direction = scene.origin_m.reshape(3, 1), scene.flat_direction.reshape(-1, 1).copy()
    geom, range_m = np.empty((n, 1), dtype=np.int32), np.empty((n, 1))

    def cast() -> np.ndarray:
        mujoco.mj_multiRay(model, data, origin, direction, None, True, -1, geom, range_m, None, n, FAR_M)
        return range_m

    return Caster(name="mj_multiRay", cast=cast, miss=_negative, tolerance_m=1e-9)


def mujoco_lidar(scene: Primitives) -> Caster:
    """Its `warp` backend on the CPU with its tree, fastest of its four: see docs/performance.md. Its tree is
    built beforehand."""
    import warp
    from mujoco_lidar import MjLidarWrapper

    warp.config.quiet = True
    model, data = mujoco_model(scene)
    sensor = MjLidarWrapper(
        model, "lidar", backend="warp", cutoff_dist=FAR_M, args={"device": "cpu", "use_bvh": True}
    )
    azimuth, elevation = angles(scene)
    sensor.trace_rays(data, azimuth, elevation)
    backend = sensor._backend_instance
    pose = np.eye(4, dtype=np.float32)
    pose[:3, 3] = scene.origin_m

    def cast() -> np.ndarray:
        backend.trace_rays(pose, azimuth, elevation)
        return np.asarray(backend.get_distances())

    return Caster(
        name="mujoco-lidar",
        cast=cast,
        miss=_negative,
        tolerance_m=1e-3,
        notes=(
            f"mujoco-lidar: its warp backend (warp {warp.__version__}) on the CPU; its tree is set up before",
        ),
    )


def embree(scene: Primitives) -> Caster:
    """Embree's nearest distance of single rays over one mesh: the fastest query that the package offers
    (packets are not), without its slower `robust` mode."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    vertices, faces = world_mesh(scene.kind, scene.size_m, scene.rotation, scene.position_m)
    tree = EmbreeScene()
    TriangleMesh(tree, vertices.astype(np.float32), faces)
    origin = np.tile(scene.origin_m.astype(np.float32), (len(scene.flat_direction), 1))
    direction = scene.flat_direction.astype(np.float32)
    started = time.perf_counter()
    tree.run(origin[:1], direction[:1], query="DISTANCE")
    built_s = time.perf_counter() - started

    def cast() -> np.ndarray:
        return np.asarray(tree.run(origin, direction, query="DISTANCE"))

    text = (
        f"embree: {len(faces):,} triangles, chords at most {TOLERANCE_M * 1e3:.0f} mm inside; building its "
        f"tree ({built_s * 1e3:.0f} ms, again for every sweep that moves) is not in its time"
    )
    return Caster(
        name="embreex",
        cast=cast,
        miss=lambda range_m: range_m > FAR_M,
        tolerance_m=TOLERANCE_M,
        notes=(text,),
    )


def _negative(range_m: np.ndarray) -> np.ndarray:
    return range_m < 0.0


def check(
    caster: Caster,
    expected_m: Float64[np.ndarray, " n"],
    cosine: Float64[np.ndarray, " n"],
    allowed_share: float,
) -> float:
    """Share of rays whose range differs from the expected one by more than the caster's tolerance.

    A difference along the ray counts by how far the surfaces are apart: times `cosine` of the incidence.
    Raises WrongAnswerError where the share is above `allowed_share` (rays past an edge may fall on
    either side).
    """
    got = caster.ranges_m()
    hit = np.isfinite(expected_m)
    same = ~hit & ~np.isfinite(got)
    with np.errstate(invalid="ignore"):
        same |= hit & (np.abs(got - expected_m) * np.where(hit, cosine, 1.0) <= caster.tolerance_m)
    share = float(np.mean(~same))
    if share > allowed_share:
        raise WrongAnswerError(
            f"{caster.name}: {share:.3%} of the ranges are off by more than {caster.tolerance_m} m "
            f"(allowed: {allowed_share:.3%})"
        )
    return share
