"""How each key of the table is measured."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tests.benchmarks import camera_rows, ray_rows, realtime_rows
from tests.benchmarks.size import Size
from tests.benchmarks.table import Measured

MEASURES: dict[str, Callable[[Size], Measured]] = {
    **{key: partial(ray_rows.against, key) for key in ray_rows.RIVALS},
    "rolling_vs_frozen": ray_rows.rolling_vs_frozen,
    "geoms_600_vs_150": ray_rows.geoms_600_vs_150,
    "cameras_vs_gl": camera_rows.cameras_vs_gl,
    "realtime_full_rig": lambda size: realtime_rows.full_rig(size, effects=False),
    "realtime_full_rig_all_effects": lambda size: realtime_rows.full_rig(size, effects=True),
    "realtime_lidar_boxes": lambda size: realtime_rows.lidar_boxes(size, effects=False),
    "realtime_lidar_boxes_all_effects": lambda size: realtime_rows.lidar_boxes(size, effects=True),
    "peak_rss_mb_60s": realtime_rows.peak_rss,
}
