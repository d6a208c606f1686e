"""Answers that agree are told from answers that do not, by what was put in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import (
    Calibration,
    Detection,
    Detections,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Trajectory,
)
from simbench.imported.consistency import METRICS, consistency
from simbench.log import Log
from simbench.score.metrics import Row

STEP_NS = 100_000_000
CAMERA = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=320.0, cy_px=240.0, width_px=640, height_px=480)
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x right, y down, z ahead


def log(sweeps: int, shift_px: float = 0.0) -> Log:
    """A point 10 m ahead in every sweep, and a box around its pixel in two cameras at the same place."""
    messages: list[LidarScan | Detections] = []
    for seq in range(sweeps):
        at = seq * STEP_NS
        messages.append(
            LidarScan(
                sensor="lidar", seq=seq, stamp_ns=at, arrival_ns=at,
                xyz_m=np.array([[10.0, 0.0, 0.0]], np.float32),
                intensity=np.ones(1, np.float32), offset_ns=np.zeros(1, np.int32), ring=np.zeros(1, np.int16),
            )
        )  # fmt: skip
        box = (310.0 + shift_px, 230.0, 330.0 + shift_px, 250.0)
        for camera in ("one", "two"):
            found = Detection(track_id=7, category="rider", box_px=box, confidence=1.0)
            messages.append(Detections(sensor=camera, seq=seq, stamp_ns=at, arrival_ns=at, boxes=(found,)))
    there = Transform(rotation=np.eye(3), translation_m=np.zeros(3))
    looking = Transform(rotation=OPTICAL, translation_m=np.zeros(3))
    calibration = Calibration(
        T_ego_sensor={"lidar": there, "one": looking, "two": looking}, cameras={"one": CAMERA, "two": CAMERA}
    )
    return Log(calibration=calibration, categories={}, messages=tuple(messages))


Place = Callable[[int, str], tuple[float, float] | None]


def answers(sweeps: int, place: Place) -> list[FusionOutput]:
    outputs = []
    for seq in range(sweeps):
        objects = []
        for camera in ("one", "two"):
            xy = place(seq, camera)
            if xy is None:
                continue
            objects.append(
                LocalizedObject(
                    track_id=7, category="rider", sensor=camera, stamp_ns=seq * STEP_NS, points=np.array([0]),
                    position_ego_m=np.array([*xy, 0.0]), distance_m=10.0, azimuth_rad=0.0, confidence=0.5,
                )
            )  # fmt: skip
        outputs.append(FusionOutput(scan_sensor="lidar", scan_seq=seq, objects=tuple(objects)))
    return outputs


def rows(found: Log, outputs: list[FusionOutput], paths: tuple[Trajectory, ...] = ()) -> dict[str, Row]:
    return {row.metric: row for row in consistency(found, outputs, paths)}


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-50, 50))
@settings(max_examples=30, deadline=None)
def test_straight_motion_has_no_noise_wherever_it_goes(vx: float, vy: float, x0: float) -> None:
    found = rows(log(8), answers(8, lambda seq, _: (x0 + 0.1 * vx * seq, 0.1 * vy * seq)))
    assert found["position_noise_m"].value == pytest.approx(0.0, abs=1e-9)
    assert found["between_cameras_m"].value == 0.0
    assert found["located_rate"].value == 1.0


def test_noise_put_in_comes_out() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    noise = 0.2 * rng.standard_normal((600, 2))
    found = rows(log(600), answers(600, lambda seq, _: (10.0 - 0.5 * seq + noise[seq, 0], noise[seq, 1])))
    assert found["position_noise_m"].value == pytest.approx(0.2, rel=0.08)
    assert found["position_noise_m"].n == 598


def test_sweeps_that_do_not_follow_each_other_are_not_compared() -> None:
    every_third = answers(12, lambda seq, _: (10.0, 0.0) if seq % 3 == 0 else None)
    found = rows(log(12), every_third)
    assert found["position_noise_m"].value is None and "three sweeps in a row" in str(
        found["position_noise_m"].why
    )
    assert found["located_rate"].value == pytest.approx(1 / 3)


def test_cameras_that_disagree_by_a_metre_are_told() -> None:
    found = rows(log(5), answers(5, lambda seq, camera: (10.0, 1.0 if camera == "two" else 0.0)))
    assert found["between_cameras_m"].value == pytest.approx(1.0)
    assert found["between_cameras_m"].n == 5


@given(st.floats(-60, 60))
@settings(max_examples=20, deadline=None)
def test_a_box_beside_its_points_is_as_far_as_it_was_put(shift_px: float) -> None:
    found = rows(log(3, shift_px), answers(3, lambda seq, _: (10.0, 0.0)))
    assert found["box_offset_px"].value == pytest.approx(abs(shift_px), abs=1e-4)


def test_a_trajectory_is_held_against_the_raw_positions_of_its_stamps() -> None:
    path = Trajectory(
        track_id=7, stamp_ns=np.arange(4) * STEP_NS, inlier=np.array([True, True, True, False]),
        position_ego_m=np.tile([10.0, 0.3, 0.0], (4, 1)),
    )  # fmt: skip
    found = rows(log(4), answers(4, lambda seq, _: (10.0, 0.0)), (path,))
    assert found["smoothing_m"].value == pytest.approx(0.3) and found["smoothing_m"].n == 4
    assert found["inlier_rate"].value == 0.75


def test_no_answer_gives_no_number_but_the_share() -> None:
    found = rows(log(4), [])
    assert set(found) == {metric.name for metric in METRICS}
    assert found["located_rate"].value == 0.0
    assert all(row.value is None and row.why for name, row in found.items() if name != "located_rate")
