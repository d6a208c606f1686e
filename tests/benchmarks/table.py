"""What is measured: one row per key, with the limit that must hold and the goal."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Row:
    """`sign` is +1 where more is better. `must`, `goal`: None where there is none."""

    key: str
    what: str
    unit: str
    sign: int
    must: float | None
    goal: float | None

    def holds(self, value: float | None) -> bool | None:
        """Does the value keep `must`? None where nothing was measured or nothing must hold."""
        if value is None or self.must is None:
            return None
        return self.sign * value >= self.sign * self.must


def _row(key: str, what: str, unit: str, sign: int, must: float | None, goal: float) -> Row:
    return Row(key=key, what=what, unit=unit, sign=sign, must=must, goal=goal)


ROWS: tuple[Row, ...] = (
    _row("rays_vs_mj_multiRay", "65,536 rays, 150 primitives, one thread", "x", 1, 50.0, 90.0),
    _row("rays_vs_mujoco_lidar", "the same, its fastest CPU set-up", "x", 1, 5.0, 10.0),
    _row("rays_vs_embreex", "the same, its fastest query, primitives as triangles", "x", 1, 2.0, 4.0),
    _row("rolling_vs_frozen", "exact rolling sweep / frozen sweep, one thread", "x", -1, 1.3, 1.1),
    _row("geoms_600_vs_150", "65,536 rays: time at 600 primitives / at 150", "x", -1, 4.0, 2.0),
    _row(
        "cameras_vs_gl", "six 960x600 cameras: rgb, ids, depth; OpenGL / ours, one thread", "x", 1, 1.5, 3.0
    ),
    _row("realtime_full_rig", "rolling LiDAR and six cameras, two cores", "s/s", 1, 0.8, 2.0),
    _row(
        "realtime_full_rig_all_effects",
        "with all of the LiDAR's, noise, blur, distortion, JPEG",
        "s/s",
        1,
        None,
        1.0,
    ),
    _row(
        "realtime_lidar_boxes",
        "whole drives: rolling LiDAR, boxes, no images, two cores",
        "s/s",
        1,
        10.0,
        30.0,
    ),
    _row("realtime_lidar_boxes_all_effects", "with all effects of the LiDAR", "s/s", 1, None, 10.0),
    _row("peak_rss_mb_60s", "60 s of scans and images written to disk, one process", "MB", -1, 1000.0, 600.0),
)
KEYS: tuple[str, ...] = tuple(row.key for row in ROWS)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """`value` is null where a rival is missing. ours, rival: in words, such as "2.61 ms"."""

    value: float | None
    ours: str = ""
    rival: str = ""
    notes: tuple[str, ...] = ()


class WrongAnswerError(Exception):
    """A side's ranges are not those of the scene: its time means nothing."""
