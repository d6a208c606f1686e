"""The rows about rays: against the rivals, against ourselves with everything frozen, and with more geoms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simbench.motion import Motion
from simbench.sensors import rays
from simbench.sensors.beams import BeamTable, beam_table
from simbench.sensors.shot import aim
from tests.benchmarks import rivals
from tests.benchmarks.clock import Duel, duel, milliseconds, one_core
from tests.benchmarks.scene import (
    INSTANT_NS,
    catalogue_stage,
    primitives,
    still_motion,
)
from tests.benchmarks.size import Size
from tests.benchmarks.table import Measured

EDGE_SHARE = 0.002  # of the rays may pass an edge on the other side of it, in float32 or between triangles
RIVALS: dict[str, tuple[Callable[..., rivals.Caster], float]] = {
    "rays_vs_mj_multiRay": (rivals.multi_ray, 0.0),
    "rays_vs_mujoco_lidar": (rivals.mujoco_lidar, EDGE_SHARE),
    "rays_vs_embreex": (rivals.embree, EDGE_SHARE),
}


def against(key: str, size: Size) -> Measured:
    """One rival: answers compared first, then times. Raises `WrongAnswerError`."""
    make, allowed_share = RIVALS[key]
    scene = primitives(150, size.columns)
    with one_core():
        own = rivals.ours(scene)
        expected_m = own.ranges_m()
        try:
            rival = make(scene)
        except ImportError as error:
            return Measured(value=None, notes=(f"{key}: the rival is not installed ({error})",))
        cosine = rivals.fans_of(scene)().cosine.ravel().astype(np.float64)
        share = rivals.check(rival, expected_m, cosine, allowed_share)
        times = duel(own.cast, rival.cast, size.turns)
    notes = rival.notes
    if share > 0.0:
        notes += (
            f"{rival.name}: {share:.3%} of the rays are off by more than {rival.tolerance_m * 1e3:.0f} mm",
        )
    return _measured(times, notes)


def geoms_600_vs_150(size: Size) -> Measured:
    """Ours at 600 primitives against ours at 150."""
    few, many = (rivals.ours(primitives(count, size.columns)) for count in (150, 600))
    with one_core():
        times = duel(few.cast, many.cast, size.turns)
    return Measured(
        value=times.ratio,
        ours=f"{milliseconds(times.second_s)} at 600",
        rival=f"{milliseconds(times.first_s)} at 150",
    )


def rolling_vs_frozen(size: Size) -> Measured:
    """A sweep in which every column has its own poses of sensor and bodies, against one with a single pose.

    Both ask the motion for the poses, carry the primitives there, and cast in the catalogue's world.
    """
    stage = catalogue_stage()
    motion, name = still_motion(stage), stage.rig.lidar_name
    table = beam_table(stage.rig.lidar)
    with one_core():
        times = duel(lambda: frozen(motion, name, table), lambda: rolling(motion, name, table), size.turns)
    return Measured(
        value=times.ratio,
        ours=f"{milliseconds(times.second_s)} rolling",
        rival=f"{milliseconds(times.first_s)} frozen",
        notes=(
            f"rolling, frozen: {len(motion.world.geoms.kind)} primitives, {len(motion.world.bodies)} moving "
            "bodies; both with finding their poses",
        ),
    )


def rolling(motion: Motion, name: str, table: BeamTable) -> rays.Hits:
    """As the LiDAR does it, without its effects."""
    no_error = np.zeros(table.fire_offset_ns.shape, dtype=np.float32)
    return aim(name, motion, table, INSTANT_NS, no_error, no_error, 0.0).cast()


def frozen(motion: Motion, name: str, table: BeamTable) -> rays.Hits:
    """All beams at the instant of the first."""
    t_ns = np.array([INSTANT_NS])
    rotation, origin = motion.sensor(name, t_ns)
    poses = len(table.group_offset_ns)
    hits = rays.empty_hits((poses, table.slots.shape[1]))
    rays.cast_fans(
        rays.place(motion.world.geoms, *motion.poses(t_ns)),
        np.zeros(poses, dtype=np.int64),
        np.zeros(poses),
        np.repeat(rotation, poses, axis=0),
        np.repeat(origin, poses, axis=0),
        table.fans,
        hits,
    )
    return hits


def _measured(times: Duel, notes: tuple[str, ...]) -> Measured:
    return Measured(
        value=times.ratio,
        ours=milliseconds(times.first_s),
        rival=milliseconds(times.second_s),
        notes=notes,
    )
