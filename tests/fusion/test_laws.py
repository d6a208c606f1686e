"""Laws that every pipeline of ours keeps: not how the scene is turned, listed or scaled decides."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from fusion.messages import FusionOutput, LidarScan
from fusion.pipelines.static_projection import StaticProjection
from tests.fusion.make import lidar_scan
from tests.fusion.ours import OURS
from tests.fusion.street import CALIBRATION, CAMERA, answer, same, scene, seen, with_points


@cache
def sweep() -> LidarScan:
    """The street with 60 % of its points on the ground, too few for the paper's acceptance rule, and nothing
    about 0.2 m high: so step 1 decides the same from whichever points it draws its planes."""
    scan, hit = scene(rings=24)
    height_m = scan.xyz_m[:, 2] + CALIBRATION.T_ego_sensor["lidar"].translation_m[2]
    above = np.flatnonzero((hit >= 0) & ((height_m < 0.05) | (height_m > 0.4)))
    ground = np.flatnonzero(hit < 0)
    step = len(ground) / (1.5 * len(above))
    assert step >= 1.0
    thinned = ground[np.arange(0.0, len(ground), step).astype(np.int64)]
    return with_points(scan, np.union1d(above, thinned))


@cache
def plain(name: str) -> FusionOutput:
    found = answer(OURS[name](), sweep(), seen())
    assert [thing.track_id for thing in found.objects] == [1, 2]
    return found


@pytest.mark.parametrize("name", OURS)
@settings(max_examples=6)
@given(yaw_rad=st.floats(-np.pi, np.pi))
def test_turning_the_scene_and_the_rig_about_the_vertical_turns_the_result(name: str, yaw_rad: float) -> None:
    turn = Transform(rotation=rotation_rpy(0, 0, yaw_rad), translation_m=np.zeros(3))
    turned = replace(
        CALIBRATION, T_ego_sensor={sensor: turn @ T for sensor, T in CALIBRATION.T_ego_sensor.items()}
    )
    moved = answer(OURS[name](), sweep(), seen(), turned)
    for a, b in zip(plain(name).objects, moved.objects, strict=True):
        assert np.array_equal(a.points, b.points) and a.stamp_ns == b.stamp_ns
        np.testing.assert_allclose(turn.apply(a.position_ego_m), b.position_ego_m, atol=1e-6)


@pytest.mark.parametrize("name", OURS)
@settings(max_examples=5)
@given(seed=st.integers(0, 10**6))
def test_permuting_the_points_permutes_the_mapping_and_moves_no_object(name: str, seed: int) -> None:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(sweep().xyz_m))
    shuffled = answer(OURS[name](), with_points(sweep(), order), seen())
    for a, b in zip(plain(name).objects, shuffled.objects, strict=True):
        assert np.array_equal(a.points, np.sort(order[b.points])) and a.stamp_ns == b.stamp_ns
        np.testing.assert_allclose(a.position_ego_m, b.position_ego_m, atol=1e-6)


@pytest.mark.parametrize("name", OURS)
@settings(max_examples=5)
@given(pixels=st.integers(15, 240))
def test_scaling_the_image_with_its_intrinsics_changes_nothing(name: str, pixels: int) -> None:
    """From a quarter to four times as many pixels along a side, always a whole number of them."""
    scale = pixels / 60
    camera = replace(
        CAMERA,
        fx_px=CAMERA.fx_px * scale,
        fy_px=CAMERA.fy_px * scale,
        cx_px=CAMERA.cx_px * scale,
        cy_px=CAMERA.cy_px * scale,
        width_px=round(CAMERA.width_px * scale),
        height_px=round(CAMERA.height_px * scale),
    )
    boxes = []
    for box in seen().boxes:
        x0, y0, x1, y1 = box.box_px
        boxes.append(replace(box, box_px=(x0 * scale, y0 * scale, x1 * scale, y1 * scale)))
    scaled = answer(
        OURS[name](),
        sweep(),
        replace(seen(), boxes=tuple(boxes)),
        replace(CALIBRATION, cameras={"front": camera}),
    )
    for a, b in zip(plain(name).objects, scaled.objects, strict=True):
        assert np.array_equal(a.points, b.points) and a.stamp_ns == b.stamp_ns
        np.testing.assert_allclose(a.position_ego_m, b.position_ego_m, atol=1e-6)
        assert a.confidence == pytest.approx(b.confidence, abs=1e-6)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), share=st.floats(0.0, 1.0), more=st.integers(0, 300))
def test_points_outside_all_boxes_change_nothing_for_the_static_projection(
    seed: int, share: float, more: int
) -> None:
    """Some of them are taken away, and others, behind the camera, come before the rest."""
    rng = np.random.Generator(np.random.PCG64(seed))
    scan, found = sweep(), plain("static_projection")
    used = np.unique(np.concatenate([thing.points for thing in found.objects]))
    others = np.setdiff1d(np.arange(len(scan.xyz_m)), used)
    index = np.union1d(used, others[rng.random(len(others)) < share])
    behind_m = rng.uniform([-30.0, -10.0, -1.8], [-1.0, 10.0, 2.0], (more, 3))
    changed = lidar_scan(
        np.concatenate([behind_m, scan.xyz_m[index]]),
        offset_ns=np.concatenate([np.zeros(more), scan.offset_ns[index]]),
    )
    origin = np.concatenate([np.full(more, -1), index])
    assert same(found, answer(StaticProjection(), changed, seen()), origin)
