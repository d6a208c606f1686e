"""The parts of the writer that need no recording, by hand and by their laws."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.geometry import rotation_exp, rotation_rpy
from fusion.messages import LidarScan
from simbench.formats.kitti_write.files import kitti_order
from simbench.formats.kitti_write.kinds import kind_of, occlusion
from simbench.formats.kitti_write.lines import tracking_words
from simbench.formats.kitti_write.objects import Labelled
from simbench.formats.kitti_write.outline import outside_share
from simbench.formats.kitti_write.oxts import lat_lon_deg, roll_pitch_yaw, velocity_north_east
from simbench.formats.kitti_write.rectify import straight, straight_box, straight_image
from simbench.formats.kitti_write.text import time_text
from simbench.formats.kitti_write.tracklets import heading_of, levels

LENS = PinholeCamera(fx_px=500.0, fy_px=480.0, cx_px=320.0, cy_px=200.0, width_px=640, height_px=400)
BARREL = replace(LENS, distortion=(-0.12, 0.02, 0.001, -0.0005, 0.0))
SHARES = {0: 1.0, 1: 0.6, 2: 0.3}


@pytest.mark.parametrize(
    ("category", "kind"),
    [("rider", "Cyclist"), ("car", "Car"), ("board", "Misc"), ("tree", None), ("building", None)],
)
def test_kinds(category: str, kind: str | None) -> None:
    assert kind_of(category) == kind


@pytest.mark.parametrize(
    ("visible", "outside", "level"),
    [
        (1.0, 0.0, 0), (0.85, 0.0, 0), (0.7, 0.0, 1), (0.46, 0.0, 1), (0.4, 0.0, 2), (0.01, 0.0, 2),
        (1.0, 0.5, 0),  # all that is in the image is seen
        (0.5, 0.5, 0),  # read from a label "0.5 0": not occluded
        (0.3, 0.5, 1),  # read from a label "0.5 1"
    ],
)  # fmt: skip
def test_levels_of_occlusion(visible: float, outside: float, level: int) -> None:
    assert occlusion(visible, outside, SHARES) == level


@pytest.mark.parametrize(
    ("x_m", "z_m", "share"),
    [
        (0.0, 10.0, 0.0),
        (6.4, 10.0, 0.5),  # its middle is on the right border: 0.64 = 320 / 500
        (-6.4, 10.0, 0.5),
        (9.0, 10.0, 1.0),
        (0.0, -10.0, 1.0),  # behind
    ],
)
def test_truncation_of_a_thin_plate_by_hand(x_m: float, z_m: float, share: float) -> None:
    plate = np.array([x_m, 0.0, z_m]), 0.0, (2.0, 1e-9, 1.0)
    assert outside_share(*plate, LENS) == pytest.approx(share, abs=1e-6)


def test_a_box_around_the_camera_is_nearly_all_outside() -> None:
    share = outside_share(np.array([0.0, 0.5, 1.0]), 0.0, (4.0, 4.0, 1.5), LENS)
    assert 0.9 < share < 1.0


def test_points_that_lie_ring_by_ring_or_have_no_ring_stay() -> None:
    xyz_m = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    for ring in (np.full(50, -1), np.repeat(np.arange(5), 10), np.zeros(50)):
        scan = LidarScan(
            sensor="lidar", seq=0, stamp_ns=0, arrival_ns=0, xyz_m=xyz_m,
            intensity=np.zeros(50, np.float32), offset_ns=np.zeros(50, np.int32), ring=ring.astype(np.int16),
        )  # fmt: skip
        np.testing.assert_array_equal(kitti_order(scan), np.arange(50))


@given(st.integers(-(10**15), 10**15))
def test_a_time_is_written_to_the_nanosecond(t_ns: int) -> None:
    text = time_text(t_ns)
    whole, rest = text.split(".")
    since = datetime.fromisoformat(whole) - datetime(2000, 1, 1, 12)
    assert (since.days * 86_400 + since.seconds) * 10**9 + int(rest) == t_ns


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    assert roll_pitch_yaw(rotation_rpy(roll, pitch, yaw)) == pytest.approx((roll, pitch, yaw), abs=1e-6)


@given(st.floats(-3.1, 3.1), st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3))
def test_a_heading_about_the_lidars_axis_is_the_yaw_about_the_cameras(yaw: float, tilt: list[float]) -> None:
    rotation = np.array([[0, -1.0, 0], [0, 0, -1.0], [1.0, 0, 0]]) @ rotation_exp(np.array(tilt))
    heading = heading_of(yaw, rotation)
    ahead = rotation @ [np.cos(heading), np.sin(heading), 0.0]
    assert np.exp(1j * np.arctan2(-ahead[2], ahead[0])) == pytest.approx(np.exp(1j * yaw), abs=1e-9)


def test_a_straightened_picture_shows_a_point_where_the_straight_camera_does() -> None:
    """A bright spot at a known direction, drawn where the lens puts it."""
    rng = np.random.default_rng(3)
    for x, y in rng.uniform((-0.5, -0.3), (0.5, 0.3), (20, 2)):
        (bent,) = BARREL.project(np.array([[x, y, 1.0]]))
        (wanted,) = straight(BARREL).project(np.array([[x, y, 1.0]]))
        columns, rows = np.meshgrid(np.arange(640) + 0.5, np.arange(400) + 0.5)
        spot = 250.0 * np.exp(-((columns - bent[0]) ** 2 + (rows - bent[1]) ** 2) / 18.0)
        out = straight_image(np.repeat(spot.astype(np.uint8)[..., None], 3, axis=2), BARREL)[..., 0]
        weight = out.astype(float)
        found = (weight * columns).sum() / weight.sum(), (weight * rows).sum() / weight.sum()
        np.testing.assert_allclose(found, wanted, atol=0.3)
        assert np.hypot(*(bent - wanted)) > 0.0


def test_a_lens_without_distortion_changes_nothing() -> None:
    rgb = np.random.default_rng(0).integers(0, 255, (400, 640, 3), dtype=np.uint8)
    assert straight_image(rgb, LENS) is rgb
    assert straight_box((1.0, 2.0, 3.0, 4.0), LENS) == (1.0, 2.0, 3.0, 4.0)


@given(
    st.tuples(st.floats(-0.5, 0.4), st.floats(-0.3, 0.2)),
    st.tuples(st.floats(0.01, 0.2), st.floats(0.01, 0.2)),
)
def test_a_straightened_box_holds_what_the_old_one_held(
    corner: tuple[float, float], side: tuple[float, float]
) -> None:
    """Every direction whose bent pixel is in the bent box has its straight pixel in the straight box."""
    share = np.linspace(0.0, 1.0, 9)
    x, y = np.meshgrid(corner[0] + share * side[0], corner[1] + share * side[1])
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    bent, right = BARREL.project(rays), straight(BARREL).project(rays)
    box = (*bent.min(axis=0).tolist(), *bent.max(axis=0).tolist())
    found = straight_box(box, BARREL)
    assert found is not None
    assert (right >= np.array(found[:2]) - 0.2).all() and (right <= np.array(found[2:]) + 0.2).all()
    grown = (found[2] - found[0]) * (found[3] - found[1]) / np.prod(right.max(axis=0) - right.min(axis=0))
    assert grown < 1.5


def labelled(visible: float, outside: float, *, shown: bool = True, behind: bool = False) -> Labelled:
    return Labelled(
        object_id=5, category="person_sitting", size_m=(0.8, 0.6, 1.2), centre_m=np.array([1.0, 0.5, 9.0]),
        yaw_rad=0.25, box_px=(10.5, 20.5, 30.5, 60.5) if shown else None, visible_fraction=visible,
        outside=outside, behind=behind, known=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("label", "occluded", "truncated"),
    [
        (labelled(1.0, 0.0), 0, 0),
        (labelled(1.0, 0.2), 0, 0),
        (labelled(1.0, 0.3), 0, 1),
        (labelled(0.5, 0.0), 1, 0),
        (labelled(0.5, 0.3), 0, 1),  # read from "occlusion 0, truncation 1"
        (labelled(0.2, 0.0), 2, 0),
        (labelled(0.0, 0.0), 2, 0),
        (labelled(0.0, 0.9), 2, 1),
        (labelled(0.0, 1.0, shown=False), -1, 2),
        (labelled(0.0, 1.0, shown=False, behind=True), -1, 99),
    ],
)
def test_levels_of_a_tracklet(label: Labelled, occluded: int, truncated: int) -> None:
    assert levels(label) == (occluded, truncated)


@pytest.mark.parametrize(
    ("label", "truncated", "occluded"),
    [
        (labelled(1.0, 0.0), "0", "0"),
        (labelled(1.0, 0.2), "0", "0"),
        (labelled(1.0, 0.3), "1", "0"),
        (labelled(0.3, 0.6), "1", "1"),  # read from "1 1"
        (labelled(0.0, 0.0), "2", "2"),
    ],
)
def test_levels_of_a_tracking_label(label: Labelled, truncated: str, occluded: str) -> None:
    kind, *words = tracking_words(label).split()
    assert (kind, words[0], words[1]) == ("Person", truncated, occluded)
    assert [float(word) for word in words[3:]] == [
        10.0, 20.0, 30.0, 60.0, 1.2, 0.6, 0.8, 1.0, 0.5 + 0.6, 9.0, 0.25,
    ]  # fmt: skip


def test_a_hundred_metres_east_and_north_by_the_devkits_formula() -> None:
    lat, lon = lat_lon_deg(np.array([100.0, 70.0, 0.0]))
    scale = np.cos(np.deg2rad(49.0)) * 6378137.0
    north = [scale * np.log(np.tan((90 + v) * np.pi / 360)) for v in (49.0, lat)]
    assert scale * np.deg2rad(lon - 8.4) == pytest.approx(100.0, abs=1e-6)
    assert north[1] - north[0] == pytest.approx(70.0, abs=1e-6)


def test_ahead_is_north_for_who_looks_north() -> None:
    north, east = velocity_north_east(rotation_rpy(0.0, 0.0, np.pi / 2), np.array([5.0, 1.0, 0.0]))
    assert (north, east) == pytest.approx((5.0, -1.0))


def test_a_straightened_ramp_has_the_height_that_the_lens_drew_there() -> None:
    """Brightness tells the column to a thirtieth of a pixel, at the border of a strong lens."""
    strong = replace(LENS, distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    bent_column = strong.project(np.array([[0.5, 0.0, 1.0]]))[0, 0]
    start = round(bent_column - 4.0)
    ramp = np.clip(30.0 * (np.arange(640) - start), 0, 250)
    picture = np.repeat(np.tile(ramp, (400, 1))[..., None], 3, axis=2).astype(np.uint8)
    found = straight_image(picture, strong)[200, :, 0].astype(float)
    inner = np.flatnonzero((found > 20) & (found < 230))
    assert len(inner) >= 5
    x = (inner + 0.5 - LENS.cx_px) / LENS.fx_px
    y = np.full_like(x, (200.5 - LENS.cy_px) / LENS.fy_px)
    wanted = strong.project(np.stack([x, y, np.ones_like(x)], axis=1))[:, 0] - 0.5
    np.testing.assert_allclose(start + found[inner] / 30.0, wanted, atol=0.05)
