"""Boxes of images whose rows have their own times, or whose lens bends: against the images themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simbench.motion import at
from simbench.sensors.boxes import View, true_box
from simbench.sensors.camera import look
from simbench.sensors.row_view import RowView, view_at
from simbench.sensors.rows import exposure_at, row_times_ns
from simbench.world import GROUND
from tests.simbench.scenes import SystemName, scripted_motion, shaken_motion, staged

BARREL = (-0.25, 0.06, 0.001, -0.001, 0.0)

CASES: tuple[tuple[str, SystemName, str, float, float, tuple[float, float, float, float, float]], ...] = (
    ("overtake-approach", "car", "cam-front-right", 3.0, 33_000.0, (0.0, 0.0, 0.0, 0.0, 0.0)),
    ("overtake-recede", "wearable", "cam-centre", 0.9, 33_000.0, (0.0, 0.0, 0.0, 0.0, 0.0)),
    ("overtake-recede", "wearable", "cam-left", 4.4, 33_000.0, BARREL),
    ("overtake-approach", "car", "cam-front", 0.7, 0.0, BARREL),
)


@pytest.mark.parametrize(("scenario", "system", "name", "t_s", "delay_ns", "distortion"), CASES)
def test_boxes_are_the_extent_of_the_id_mask(
    scenario: str,
    system: SystemName,
    name: str,
    t_s: float,
    delay_ns: float,
    distortion: tuple[float, float, float, float, float],
) -> None:
    """Those of what is hidden in part exactly; else within a pixel. A tip thinner than a pixel may fall
    between the pixels' centres: 1.5 px for one box in a hundred."""
    of = staged(scenario, system, 2)
    motion, t_ns = shaken_motion(of), round(t_s * 1e9)
    lens = replace(of.rig.pinholes[name], distortion=distortion)
    hits = look(lens, exposure_at(motion, name, row_times_ns(t_ns, delay_ns, lens.height_px)))
    owner = np.append(of.world.geom_object, np.int32(GROUND))[hits.geom]
    view = view_at(motion, name, lens, t_ns, delay_ns)
    assert isinstance(view, RowView)
    error, compared = [], 0
    for info in of.world.objects:
        if info.name == of.system.ego:
            continue
        rows, columns = np.nonzero(owner == info.object_id)
        box = true_box(view, info.object_id, np.flatnonzero(of.world.masks[info.object_id]), 4.0)
        if box is None or box.visible_px is None:
            assert len(rows) < 40
            continue
        reach_m = np.array([np.linalg.norm(info.size_m)])
        assert view.may_show(np.array([of.world.first_geom[info.object_id]]), reach_m).all()
        extent = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
        compared += 1
        if box.visible_fraction == 1.0:
            error.append(np.abs(extent - box.visible_px))
        else:
            assert np.array_equal(extent, box.visible_px)
    assert compared >= 3
    if error:
        assert np.mean(np.array(error) <= 1.0) >= 0.97
        assert np.max(error) <= 1.5


def test_with_one_time_for_all_rows_the_boxes_are_those_of_one_instant() -> None:
    of = staged("overtake-recede", "car", 5)
    motion, lens = scripted_motion(of), of.rig.pinholes["cam-front-left"]
    t_ns = np.array([1_500_000_000])
    R, p = motion.poses(t_ns)
    frozen = View(of.world.geoms, R[0], p[0], at(motion.sensor("cam-front-left", t_ns)), lens)
    by_rows = RowView(exposure_at(motion, "cam-front-left", np.repeat(t_ns, 600)), lens)
    compared = 0
    for info in of.world.objects:
        mask = of.world.masks[info.object_id]
        a, b = (true_box(view, info.object_id, np.flatnonzero(mask), 4.0) for view in (frozen, by_rows))
        assert (a is None) == (b is None)
        if a is None or b is None:
            continue
        assert a.visible_px is not None
        np.testing.assert_allclose(a.visible_px, np.array(b.visible_px, float), atol=0.6)
        assert a.visible_fraction == pytest.approx(b.visible_fraction, abs=0.05)
        np.testing.assert_allclose(a.amodal_px, b.amodal_px, atol=0.6)
        compared += 1
    assert compared > 3


def test_a_straight_lens_and_a_global_shutter_need_no_rows() -> None:
    of = staged("overtake-recede", "car", 5)
    assert type(view_at(scripted_motion(of), "cam-front", of.rig.pinholes["cam-front"], 10**9, 0.0)) is View
