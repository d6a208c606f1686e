"""A rig assembled: poses, intrinsics and when cameras expose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarios.equipment import list_rigs, load_rig, rig_sensors
from scenarios.scenario import CameraSensor
from simbench.axes import R_BODY_OPTICAL
from simbench.sensors.rig import SensorRig, assemble, resized

MS = 1_000_000


def made(name: str) -> SensorRig:
    rig = load_rig(name)
    return assemble(rig, rig_sensors(rig))


def changed(rig: SensorRig, camera: str, **fields: object) -> SensorRig:
    sensors = rig_sensors(rig.rig)
    sensor = sensors[camera]
    assert isinstance(sensor, CameraSensor)
    sensors[camera] = sensor.model_copy(update=fields)
    return assemble(rig.rig, sensors)


def fired_at(rig: SensorRig, camera: str, angle_deg: float) -> SensorRig:
    mount = rig.rig.sensors[camera].model_copy(update={"trigger_deg": angle_deg})
    declared = rig.rig.model_copy(update={"sensors": {**rig.rig.sensors, camera: mount}})
    return assemble(declared, rig_sensors(rig.rig))


every_rig = pytest.mark.parametrize("name", list_rigs())


@every_rig
def test_the_calibration_holds_the_lidar_and_all_cameras_at_rest(name: str) -> None:
    rig = made(name)
    calibration = rig.calibration
    assert set(calibration.T_ego_sensor) == {rig.lidar_name, *rig.cameras}
    assert set(calibration.cameras) == set(rig.cameras)
    for sensor, T in calibration.T_ego_sensor.items():
        pose = rig.rig.sensors[sensor].pose
        np.testing.assert_allclose(T.translation_m, pose.xyz_m)
        yaw = np.deg2rad(pose.rpy_deg[2])
        axis = T.rotation[:, 2] if sensor in rig.cameras else T.rotation[:, 0]
        np.testing.assert_allclose(axis, [np.cos(yaw), np.sin(yaw), 0.0], atol=1e-12)


@every_rig
def test_the_lidar_stands_above_the_ego_origin_and_the_root_is_where_the_rig_says(name: str) -> None:
    rig = made(name)
    assert not rig.T_ego_sensor[rig.lidar_name].translation_m[:2].any()
    np.testing.assert_allclose(rig.T_ego_root.inverse().translation_m, [*rig.rig.ego_origin_m, 0.0])


def test_the_cars_cameras_look_all_round_and_share_one_pulse() -> None:
    rig = made("car-six-cameras")
    forward = {
        name: T.rotation @ [0.0, 0.0, 1.0] for name, T in rig.T_ego_sensor.items() if name in rig.cameras
    }
    assert forward["cam-back"][0] == pytest.approx(-1.0)
    assert forward["cam-front-left"][1] > 0.5
    times = [rig.timing(name, 2.0, seed=0).mid_ns for name in rig.cameras]
    assert all(np.array_equal(times[0], t) for t in times)
    # The front is passed 25 ms after a sweep's start; 0.05 ms and half of the exposure later is the middle.
    assert times[0][0] == 26 * MS + MS // 20
    assert set(np.diff(times[0])) == {100 * MS}
    np.testing.assert_allclose(rig.T_ego_sensor["cam-front"].rotation, R_BODY_OPTICAL, atol=1e-12)


def test_a_triggered_camera_exposes_when_its_own_angle_passes() -> None:
    rig = fired_at(made("car-six-cameras"), "cam-back", 180.0)
    assert rig.timing("cam-back", 1.0, seed=0).start_ns[0] == 75 * MS + MS // 20
    assert rig.timing("cam-front", 1.0, seed=0).start_ns[0] == 25 * MS + MS // 20


def test_moving_the_rigs_pulse_moves_all_cameras_but_those_with_an_angle_of_their_own() -> None:
    rig = fired_at(made("car-six-cameras"), "cam-back", 180.0)
    turned = rig.rig.model_copy(update={"pulse_deg": -90.0})
    later = assemble(turned, rig_sensors(turned))
    for name in rig.cameras:
        shift = later.timing(name, 1.0, 0).mid_ns - rig.timing(name, 1.0, 0).mid_ns
        assert set(shift) == {0 if name == "cam-back" else 25 * MS}


def test_what_a_stamp_means_is_the_sensor_files_choice() -> None:
    base = made("car-six-cameras")
    # 3 ms after the pulse the first row opens for 2 ms, the last row 10 ms later: the middle is 6 ms on.
    shape = {
        "delay_ms": 3.0,
        "exposure_ms": 2.0,
        "shutter": "rolling",
        "readout_ms": 10.0,
        "stamp_delay_ms": 40.0,
    }
    for stamp, offset_ms in (
        ("trigger", -9), ("exposure_start", -6), ("mid_exposure", 0), ("end_of_readout", 6), ("arrival", 40),
    ):  # fmt: skip
        timing = changed(base, "cam-front", stamp=stamp, **shape).timing("cam-front", 1.0, seed=0)
        assert set(timing.stamp_ns - timing.mid_ns) == {offset_ms * MS}
        assert timing.mid_ns[0] == 34 * MS


def test_free_running_cameras_start_by_seed_anywhere_in_their_phase() -> None:
    rig = made("wearable-back")
    first = np.array([[rig.timing(name, 1.0, seed=s).start_ns[0] for name in rig.cameras] for s in range(60)])
    assert first.min() >= 0 and first.max() <= 100 * MS
    assert np.ptp(first, axis=0).min() > 85 * MS
    assert np.abs(np.corrcoef(first.T)[np.triu_indices(3, 1)]).max() < 0.5
    again = rig.timing("cam-left", 1.0, seed=3)
    assert np.array_equal(again.mid_ns, rig.timing("cam-left", 1.0, seed=3).mid_ns)


@every_rig
@pytest.mark.parametrize("duration_s", [0.1, 1.0, 5.2, 5.8])
def test_whole_sweeps_are_counted_and_cameras_outlast_them(name: str, duration_s: float) -> None:
    rig = made(name)
    assert rig.sweeps(duration_s) == round(duration_s * 10)
    for camera in rig.cameras:
        mid = rig.timing(camera, duration_s, seed=1).mid_ns
        assert (mid >= 0).all()
        assert (np.diff(mid) > 0).all()
        assert mid[-1] > rig.sweeps(duration_s) * 100 * MS


def test_a_resized_rig_sees_the_same_angles() -> None:
    rig = made("wearable-front")
    small = resized(rig, 480, 300)
    for name in rig.cameras:
        a, b = rig.pinholes[name], small.pinholes[name]
        assert (b.width_px, b.height_px) == (480, 300)
        assert b.fx_px == pytest.approx(a.fx_px / 2)
        point = np.array([[0.3, -0.2, 1.0]])
        np.testing.assert_allclose(b.project(point), a.project(point) / 2)
    assert small.T_ego_sensor == rig.T_ego_sensor


def test_phases_are_drawn_by_seed_each_from_its_own_stream() -> None:
    rig = made("car-six-cameras")
    drawn = np.array([[p.gnss_ns, p.imu_ns, p.odometer_ns] for p in (rig.phases(s) for s in range(600))])
    assert (drawn >= 0).all() and (drawn.max(axis=0) <= [200 * MS, 10 * MS, 20 * MS]).all()
    assert (np.ptp(drawn, axis=0) > [180 * MS, 9 * MS, 18 * MS]).all()
    assert np.abs(np.corrcoef(drawn.T)[np.triu_indices(3, 1)]).max() < 0.25
    assert rig.phases(5) == rig.phases(5)
    assert rig.gnss is not None
    still = replace(rig, gnss=rig.gnss.model_copy(update={"phase_ms": 30.0})).phases(5)
    assert still == replace(rig.phases(5), gnss_ns=30 * MS)


def test_a_triggered_camera_without_a_pulse_is_refused() -> None:
    rig = load_rig("car-six-cameras").model_copy(update={"pulse_deg": None})
    with pytest.raises(ValueError, match="cam-front of rig car-six-cameras waits for a pulse"):
        assemble(rig, rig_sensors(rig))


def test_a_rig_with_two_lidars_is_refused() -> None:
    rig = load_rig("wearable-front")
    sensors = rig_sensors(rig)
    doubled = rig.model_copy(update={"sensors": {**rig.sensors, "second": rig.sensors["lidar"]}})
    with pytest.raises(ValueError, match="2 LiDARs; exactly one"):
        assemble(doubled, {**sensors, "second": sensors["lidar"]})
