"""The robust pipeline as a whole: its laws, its promises, and the edges of the contract."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.check import check_pipeline, synthetic_run
from fusion.geometry import Transform, rotation_rpy
from fusion.messages import (
    Calibration,
    CategorySize,
    Detection,
    Detections,
    EgoMotion,
    FusionOutput,
    LidarScan,
    Measurement,
    Trajectory,
)
from fusion.object_track import TrackConfig
from fusion.pipelines.robust import Robust, RobustConfig
from fusion.scene import SceneConfig
from fusion.synthetic import Block, beams, cast

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CAMERA = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)
LIDAR = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8]))
CALIBRATION = Calibration(
    T_ego_sensor={
        "lidar": LIDAR,
        "front": Transform(rotation=OPTICAL, translation_m=np.array([0.2, 0.0, 1.6])),
    },
    cameras={"front": CAMERA},
)
CATEGORIES = {
    "car": CategorySize(mean_m=(4.5, 1.8, 1.5), spread=0.08),
    "pedestrian": CategorySize(mean_m=(0.5, 0.5, 1.75), spread=0.08),
}
PERIOD_NS = 100_000_000
RINGS, COLUMNS = 48, 900

Scene = Mapping[int, tuple[str, Block]]  # track id -> category and what it is


def street(time_s: float) -> Scene:
    """Relative to an ego that drives at 8 m/s: an oncoming car, a car ahead, people, a parked car."""
    return {
        1: ("car", Block(centre_m=(24.0 - 6.0 * time_s, -3.0, 0.75), size_m=(4.5, 1.8, 1.5))),
        2: ("pedestrian", Block(centre_m=(13.0 - 8.0 * time_s, 4.0, 0.9), size_m=(0.3, 0.5, 1.75))),
        3: (
            "car",
            Block(centre_m=(30.0 - 8.0 * time_s, 8.0, 0.75), size_m=(4.5, 1.8, 1.5), yaw_rad=0.2),
        ),
        4: ("pedestrian", Block(centre_m=(20.0 - 8.0 * time_s, 2.0, 0.9), size_m=(0.3, 0.5, 1.75))),
    }


def sweep(seq: int, scene: Scene) -> tuple[LidarScan, np.ndarray]:
    """A sweep of what stands still while it is taken, and the track id hit by each point (0: none)."""
    rays = beams(RINGS, COLUMNS, np.deg2rad(16.0))
    ids = np.array([*scene, 0])
    range_m, hit = cast(LIDAR.translation_m, rays, tuple(block for _, block in scene.values()))
    seen = range_m < 50.0
    column = np.arange(len(rays)) // RINGS
    scan = LidarScan(
        sensor="lidar",
        seq=seq,
        stamp_ns=seq * PERIOD_NS,
        arrival_ns=seq * PERIOD_NS + 108_000_000,
        xyz_m=(rays[seen] * range_m[seen, None]).astype(np.float32),
        intensity=np.zeros(int(seen.sum()), dtype=np.float32),
        # all at once: the scenes of these tests do not move within a sweep
        offset_ns=(column[seen] * 0).astype(np.int32),
        ring=(np.arange(len(rays)) % RINGS)[seen].astype(np.int16),
    )
    return scan, ids[hit[seen]]


def boxes(
    seq: int, scene: Scene, shift_px: float = 0.0, calibration: Calibration = CALIBRATION
) -> Detections:
    found = []
    for track_id, (category, block) in scene.items():
        uv = CAMERA.project(calibration.T_ego_sensor["front"].inverse().apply(block.corners_m()))
        if not np.isfinite(uv).all():
            continue
        (x0, y0), (x1, y1) = uv.min(axis=0), uv.max(axis=0)
        x0, x1 = max(x0 + shift_px, 0.0), min(x1 + shift_px, 960.0)
        if x1 - x0 > 4.0:
            box_px = (float(x0), max(float(y0), 0.0), float(x1), min(float(y1), 600.0))
            found.append(Detection(track_id=track_id, category=category, box_px=box_px, confidence=0.9))
    stamp_ns = seq * PERIOD_NS
    return Detections(
        sensor="front", seq=seq, stamp_ns=stamp_ns, arrival_ns=stamp_ns + 40_000_000, boxes=tuple(found)
    )


def odometer(seq: int, speed_mps: float = 8.0) -> EgoMotion:
    return EgoMotion(
        sensor="imu",
        seq=seq,
        stamp_ns=seq * 10_000_000,
        arrival_ns=seq * 10_000_000 + 1_000_000,
        velocity_mps=np.array([speed_mps, 0.0, 0.0]),
        rate_radps=np.zeros(3),
        specific_force_mps2=np.array([0.0, 0.0, 9.81]),
    )


def drive(scans: int = 8, *, shift_px: float = 0.0, missed: tuple[int, ...] = ()) -> tuple[Measurement, ...]:
    """Messages of a drive in order of arrival; in the scans `missed` the detector finds nothing."""
    messages: list[Measurement] = [odometer(k) for k in range(scans * 10 + 12)]
    for seq in range(scans):
        scene = street(0.1 * seq)
        messages.append(sweep(seq, scene)[0])
        messages.append(boxes(seq, {} if seq in missed else scene, shift_px))
    return tuple(sorted(messages, key=lambda m: m.arrival_ns))


def run(
    messages: Sequence[Measurement],
    *,
    config: RobustConfig | None = None,
    calibration: Calibration = CALIBRATION,
) -> tuple[list[FusionOutput], tuple[Trajectory, ...]]:
    pipeline = Robust(config)
    pipeline.reset(calibration, CATEGORIES)
    outputs = [pipeline.update(message) for message in messages]
    return [output for output in outputs if output is not None], pipeline.trajectories()


DRIVE = drive()
RAW = RobustConfig(
    association=None,
    shift=None,
    use_motion=False,
    track=TrackConfig(push=False, backward=False, filter=False, gather=False, shake=None),
)


@cache
def plain_run() -> tuple[list[FusionOutput], tuple[Trajectory, ...]]:
    return run(DRIVE)


# -- it does what it is for -------------------------------------------------------------------------------


@pytest.mark.parametrize("config", [RobustConfig(), RAW], ids=["all of it", "raw"])
def test_it_keeps_the_contract(config: RobustConfig) -> None:
    assert check_pipeline(lambda: Robust(config)) == ()


def test_objects_get_their_own_points_and_nearly_all_of_them() -> None:
    outputs, _ = plain_run()
    assert len(outputs) == 8
    for output in outputs:
        truth = sweep(output.scan_seq, street(0.1 * output.scan_seq))[1]
        assert {found.track_id for found in output.objects} == {1, 2, 3, 4}
        for found in output.objects:
            own = truth[found.points] == found.track_id
            assert own.mean() > 0.99
            assert own.sum() > 0.8 * (truth == found.track_id).sum()


def test_the_smooth_path_is_that_of_the_centres() -> None:
    _, paths = plain_run()
    assert [path.track_id for path in paths] == [1, 2, 3, 4]
    for path in paths:
        assert len(path.stamp_ns) == 8 and path.inlier.all()
        for at_ns, position in zip(path.stamp_ns, path.position_ego_m, strict=True):
            centre = np.array(street(at_ns * 1e-9)[path.track_id][1].centre_m)
            # far off, beams that pass the roof leave the rear corner to a few points
            assert np.linalg.norm(position[:2] - centre[:2]) < 0.2
            assert abs(position[2] - centre[2]) < 0.1


def test_where_the_detector_misses_a_car_the_path_goes_on() -> None:
    _, paths = run(drive(missed=(0, 1, 6)))
    car = next(path for path in paths if path.track_id == 1)
    assert len(car.stamp_ns) == 8  # followed forward by the LiDAR alone, and back before the first box
    centres = np.array([street(t * 1e-9)[1][1].centre_m for t in car.stamp_ns])
    assert np.linalg.norm(car.position_ego_m[:, :2] - centres[:, :2], axis=1).max() < 0.2


def test_without_following_the_path_ends_where_the_boxes_do() -> None:
    config = RobustConfig(track=TrackConfig(coast_s=0.0), look_back=0)
    _, paths = run(drive(missed=(0, 1, 4, 7)), config=config)
    car = next(path for path in paths if path.track_id == 1)
    assert [round(t / PERIOD_NS) for t in car.stamp_ns] == [2, 3, 4, 5, 6]
    assert car.inlier.tolist() == [True, True, False, True, True]


@pytest.mark.parametrize("shift_px", [-26.0, 26.0])
def test_a_turned_camera_is_found_out_by_its_boxes(shift_px: float) -> None:
    """3 degrees of yaw: boxes as wide as the people are off by three times their width."""
    outputs, _ = run(drive(scans=3, shift_px=shift_px))
    for output in outputs:
        truth = sweep(output.scan_seq, street(0.1 * output.scan_seq))[1]
        assert len(output.objects) >= 3
        for found in output.objects:
            assert (truth[found.points] == found.track_id).mean() > 0.9


def test_confidence_falls_where_a_box_shows_nothing_that_stands_there() -> None:
    scene = street(0.0)
    scan, _ = sweep(0, scene)
    alone = Detection(track_id=7, category="pedestrian", box_px=(100.0, 250.0, 160.0, 420.0), confidence=0.9)
    messages = (replace(boxes(0, scene), boxes=(*boxes(0, scene).boxes, alone)), scan)
    (output,), _ = run(messages)
    sure = [found.confidence for found in output.objects if found.track_id != 7]
    doubtful = [found.confidence for found in output.objects if found.track_id == 7]
    assert min(sure) > 0.9 and max(doubtful, default=0.0) < 0.5


# -- laws -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw_rad", [0.4, np.pi / 2, -2.5])
def test_turning_the_scene_and_the_rig_about_the_vertical_turns_the_result(yaw_rad: float) -> None:
    turn = Transform(rotation=rotation_rpy(0, 0, yaw_rad), translation_m=np.zeros(3))
    turned = replace(
        CALIBRATION, T_ego_sensor={name: turn @ T for name, T in CALIBRATION.T_ego_sensor.items()}
    )
    messages = [
        replace(m, velocity_mps=turn.rotation @ m.velocity_mps) if isinstance(m, EgoMotion) else m
        for m in DRIVE
    ]
    plain, paths = plain_run()
    moved, moved_paths = run(messages, calibration=turned)
    for a, b in zip(plain, moved, strict=True):
        for one, other in zip(a.objects, b.objects, strict=True):
            assert np.array_equal(one.points, other.points) and one.stamp_ns == other.stamp_ns
            np.testing.assert_allclose(turn.apply(one.position_ego_m), other.position_ego_m, atol=1e-6)
    for path, moved_path in zip(paths, moved_paths, strict=True):
        np.testing.assert_allclose(turn.apply(path.position_ego_m), moved_path.position_ego_m, atol=1e-6)


@settings(max_examples=5)
@given(seed=st.integers(0, 10**6))
def test_permuting_the_points_permutes_the_mapping_and_moves_no_object(seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    orders: dict[int, np.ndarray] = {}

    def shuffled(message: Measurement) -> Measurement:
        if not isinstance(message, LidarScan):
            return message
        order = orders.setdefault(message.seq, rng.permutation(len(message.xyz_m)))
        return replace(
            message,
            xyz_m=message.xyz_m[order],
            intensity=message.intensity[order],
            offset_ns=message.offset_ns[order],
            ring=message.ring[order],
        )

    short = DRIVE[:60]
    plain, _ = run(short)
    moved, _ = run([shuffled(message) for message in short])
    assert plain
    for a, b in zip(plain, moved, strict=True):
        for one, other in zip(a.objects, b.objects, strict=True):
            assert np.array_equal(one.points, np.sort(orders[b.scan_seq][other.points]))
            np.testing.assert_allclose(one.position_ego_m, other.position_ego_m, atol=1e-6)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_scaling_the_image_with_its_intrinsics_changes_nothing(scale: float) -> None:
    camera = PinholeCamera(
        fx_px=500.0 * scale, fy_px=500.0 * scale, cx_px=480.0 * scale, cy_px=300.0 * scale,
        width_px=int(960 * scale), height_px=int(600 * scale),
    )  # fmt: skip

    def scaled(box: Detection) -> Detection:
        x0, y0, x1, y1 = box.box_px
        return replace(box, box_px=(x0 * scale, y0 * scale, x1 * scale, y1 * scale))

    messages = [
        replace(m, boxes=tuple(scaled(b) for b in m.boxes)) if isinstance(m, Detections) else m for m in DRIVE
    ]
    plain, _ = plain_run()
    other, _ = run(messages, calibration=replace(CALIBRATION, cameras={"front": camera}))
    for a, b in zip(plain, other, strict=True):
        for one, two in zip(a.objects, b.objects, strict=True):
            assert np.array_equal(one.points, two.points)


def test_what_is_answered_knows_nothing_of_later_messages() -> None:
    whole, _ = plain_run()
    half, _ = run(DRIVE[: len(DRIVE) // 2])
    assert 0 < len(half) < len(whole)
    for a, b in zip(half, whole, strict=False):
        for one, other in zip(a.objects, b.objects, strict=True):
            assert np.array_equal(one.points, other.points)
            assert np.array_equal(one.position_ego_m, other.position_ego_m)


def test_the_paths_are_in_the_sweeps_and_nothing_is_extrapolated() -> None:
    _, paths = run(drive(missed=(3,)))
    for path in paths:
        assert (np.diff(path.stamp_ns) > 0).all()
        assert path.stamp_ns[0] >= 0 and path.stamp_ns[-1] <= 7 * PERIOD_NS


SWITCHES: dict[str, Callable[[], RobustConfig]] = {
    "scan by scan": lambda: RobustConfig(association=None),
    "no shift": lambda: RobustConfig(shift=None),
    "no ego motion": lambda: RobustConfig(use_motion=False),
    "one plane": lambda: RobustConfig(scene=SceneConfig(local=False, deskew=False)),
    "raw": lambda: RAW,
}


@pytest.mark.parametrize("switch", SWITCHES)
def test_every_ingredient_can_be_left_out(switch: str) -> None:
    outputs, paths = run(DRIVE, config=SWITCHES[switch]())
    assert all(len(output.objects) >= 3 for output in outputs) and len(paths) == 4


# -- edges ------------------------------------------------------------------------------------------------


def test_a_scan_without_points_has_no_objects() -> None:
    scan, _ = sweep(0, street(0.0))
    empty = replace(
        scan, xyz_m=scan.xyz_m[:0], intensity=scan.intensity[:0], offset_ns=scan.offset_ns[:0],
        ring=scan.ring[:0],
    )  # fmt: skip
    (output,), paths = run((boxes(0, street(0.0)), empty))
    assert output.objects == () and paths == ()


def test_points_that_are_not_finite_are_nobodys() -> None:
    scan, truth = sweep(0, street(0.0))
    xyz_m = scan.xyz_m.copy()
    xyz_m[::5] = np.nan
    xyz_m[1::5, 2] = np.inf
    (output,), _ = run((boxes(0, street(0.0)), replace(scan, xyz_m=xyz_m)))
    assert len(output.objects) >= 3
    for found in output.objects:
        assert np.isfinite(xyz_m[found.points]).all() and np.isfinite(found.position_ego_m).all()
        assert (truth[found.points] == found.track_id).mean() > 0.95


@pytest.mark.parametrize(
    "box_px",
    [(400.0, 300.0, 400.0, 400.0), (-90.0, 0.0, -10.0, 60.0), (np.nan, 0.0, 5.0, 5.0), (9.0, 9.0, 5.0, 5.0)],
    ids=["no area", "outside", "not finite", "upside down"],
)
def test_what_is_no_box_has_no_object(box_px: tuple[float, float, float, float]) -> None:
    scan, _ = sweep(0, street(0.0))
    bad = Detection(track_id=1, category="car", box_px=box_px, confidence=0.9)
    (output,), _ = run((replace(boxes(0, street(0.0)), boxes=(bad,)), scan))
    assert output.objects == ()


def test_detections_before_any_scan_wait_for_it() -> None:
    scan, _ = sweep(0, street(0.0))
    pipeline = Robust()
    pipeline.reset(CALIBRATION, CATEGORIES)
    assert pipeline.update(boxes(0, street(0.0))) is None
    assert pipeline.trajectories() == ()
    assert pipeline.update(scan) is not None


def test_unknown_names_are_refused_in_one_sentence() -> None:
    scan, _ = sweep(0, street(0.0))
    pipeline = Robust()
    with pytest.raises(RuntimeError, match="update before reset"):
        pipeline.update(scan)
    pipeline.reset(CALIBRATION, CATEGORIES)
    with pytest.raises(ValueError, match="camera 'rear' has no calibration; known: front"):
        pipeline.update(replace(boxes(0, street(0.0)), sensor="rear"))
    with pytest.raises(ValueError, match="LiDAR 'top' has no calibration; known: front, lidar"):
        pipeline.update(replace(scan, sensor="top"))
    tram = Detection(track_id=1, category="tram", box_px=(400.0, 300.0, 500.0, 400.0), confidence=0.9)
    pipeline.update(replace(boxes(0, street(0.0)), boxes=(tram,)))
    with pytest.raises(ValueError, match="category 'tram' has no size; known: car, pedestrian"):
        pipeline.update(scan)


def test_without_measured_ego_motion_it_still_answers() -> None:
    outputs, paths = run([m for m in DRIVE if not isinstance(m, EgoMotion)])
    assert len(outputs) == 8 and all(len(output.objects) >= 3 for output in outputs) and len(paths) == 4


def test_every_step_is_timed_once_per_scan() -> None:
    pipeline = Robust()
    calibration, categories, messages = synthetic_run()
    pipeline.reset(calibration, categories)
    answers = [pipeline.update(message) for message in messages]
    pipeline.trajectories()
    timings = pipeline.timings_ns()
    scans = sum(answer is not None for answer in answers)
    assert set(timings) == {*Robust.steps, "smooth"}
    assert all(len(timings[step]) == scans for step in Robust.steps) and len(timings["smooth"]) == 1
