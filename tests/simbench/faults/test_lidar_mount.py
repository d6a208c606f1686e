"""The LiDAR's bracket bends, is knocked, creeps: points and receipts show it, what is told does not."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.faults import Drift, FaultSpec, Flex, Knock, Vibration
from scenarios.load import load_sensor
from scenarios.scenario import LidarSensor
from simbench.faults.lidar_pose import turned
from simbench.faults.motion import bracket_shake
from simbench.faults.mounts import drifting, knocked
from simbench.faults.receipt import MISMATCH, OK, Receipt
from simbench.motion import Motion
from simbench.mount import Ramp, Together
from simbench.sensors import lidar, rays
from simbench.sensors.render import place
from tests.simbench.scenes import Shape, straight, toy_motion, toy_world
from tests.simbench.scenes import staged as scene_of
from tests.simbench.support import bytes_of, posed, posed_under, receipts_of, recorded, staged

MS = 1_000_000
ABOVE = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.85]))
SENSORS = ("os1-64", "vlp-16")


def sensor_of(name: str) -> LidarSensor:
    sensor = load_sensor(name)
    assert isinstance(sensor, LidarSensor)
    return sensor


def before_a_wall(flex: Ramp | Together | None) -> Motion:
    """A standing ego; the face of a wall is at x = 20 m."""
    wall = Shape(kind=rays.BOX, size_m=(0.5, 15.0, 5.0), xyz_m=(20.5, 0.0, 4.0), reflectivity=0.8)
    motion = toy_motion(toy_world([wall], [straight((0.0, 0.0), 0.0, 0.0)]), ABOVE)
    return motion if flex is None else replace(motion, flex={"lidar": flex})


# -- by hand ------------------------------------------------------------------------------------------------


def test_a_knock_by_two_degrees_moves_a_wall_at_20_m_by_70_cm_from_its_instant_on() -> None:
    """2 * 20 m * sin(1 deg) = 0.698 m to the right, as told by the calibration at rest."""
    motion = before_a_wall(knocked(Knock(angle_deg=2.0, axis="yaw", at_s=0.25, rise_ms=1.0, sensors="lidar")))
    still = before_a_wall(None)
    for seq in (0, 1, 3, 4):
        scan, _ = lidar.sweep("lidar", sensor_of("os1-64"), motion, seq * 100 * MS, seq, None)
        told = scan.xyz_m.astype(np.float64) + ABOVE.translation_m
        assert len(told) > 1000
        if seq < 2:
            rest, _ = lidar.sweep("lidar", sensor_of("os1-64"), still, seq * 100 * MS, seq, None)
            assert np.array_equal(scan.xyz_m, rest.xyz_m)  # nothing before
            continue
        c, s = np.cos(np.deg2rad(2.0)), np.sin(np.deg2rad(2.0))
        x, y = c * told[:, 0] - s * told[:, 1], s * told[:, 0] + c * told[:, 1]  # where they really are
        np.testing.assert_allclose(x, 20.0, atol=2e-5)
        ahead = np.abs(y) < 0.5
        moved = told[ahead, :2] - np.stack([x, y], axis=1)[ahead]
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.698, atol=1e-3)
        assert (moved[:, 1] < 0.0).all()


def test_within_a_sweep_every_firing_has_its_own_bracket() -> None:
    """A creep of 10 cm towards the wall within a sweep: each point is nearer by its own share of it."""
    creep = Ramp(begin_ns=0, end_ns=100 * MS, end=np.array([0, 0, 0, 0.1, 0, 0.0]), smooth=False)
    scan, truth = lidar.sweep("lidar", sensor_of("os1-64"), before_a_wall(creep), 0, 0, None)
    expected = 20.0 - 0.1 * truth.fire_ns / (100.0 * MS)
    np.testing.assert_allclose(scan.xyz_m[:, 0], expected, rtol=0, atol=5e-6)
    assert np.ptp(expected) > 0.01


# -- MuJoCo -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SENSORS)
def test_beams_of_a_knocked_and_creeping_lidar_meet_what_mujocos_rays_meet(name: str) -> None:
    """From a pose composed here: script, then the rest, then the knock's half cosine and the drift's line."""
    of, sensor = scene_of("overtake-approach", "car", 2), sensor_of(name)
    knock = Knock(angle_deg=3.0, axis="pitch", at_s=1.33, rise_ms=40.0, sensors="lidar")
    drift = Drift(angle_deg=2.0, axis="yaw", shift_cm=20.0, along="z", sensors="lidar")
    script = Motion(
        world=of.world, ego_actor=next(i for i, a in enumerate(of.world.actors) if a.name == of.system.ego),
        T_ego_root=of.rig.T_ego_root, T_ego_sensor=of.rig.T_ego_sensor,
    )  # fmt: skip
    motion = replace(script, flex={"lidar": Together(parts=(knocked(knock), drifting(drift, 2.0)))})
    start_ns = 1_300 * MS
    scan, truth = lidar.sweep("lidar", sensor, motion, start_ns, 0, None)
    table, rest = lidar.beam_table(sensor), of.rig.T_ego_sensor["lidar"]
    model, data = of.world.model, mujoco.MjData(of.world.model)
    shown = np.array([1, 1, 0, 1, 1, 1], dtype=np.uint8)
    geom, off = np.empty(1, np.int32), []
    for point in np.random.default_rng(0).choice(len(scan.xyz_m), 150, replace=False):
        t_ns = int(truth.fire_ns[point])
        t_s = 1e-9 * t_ns
        u = np.clip((t_s - 1.33) / 0.04, 0.0, 1.0)
        roll_pitch_yaw = [0.0, 3.0 * (1.0 - np.cos(np.pi * u)) / 2.0, 2.0 * t_s / 2.0]
        (R_ego,), (p_ego,) = script.ego(np.array([t_ns]))
        R = R_ego @ Rotation.from_euler("xyz", roll_pitch_yaw, degrees=True).as_matrix() @ rest.rotation
        p = p_ego + R_ego @ (rest.translation_m + np.array([0.0, 0.0, 0.20 * t_s / 2.0]))
        column = np.searchsorted(table.column_offset_ns, scan.offset_ns[point], side="right") - 1
        place(data, motion, t_ns)
        mujoco.mj_kinematics(model, data)
        along = R @ table.direction[column, scan.ring[point]]
        distance = mujoco.mj_ray(model, data, p, along, shown, True, -1, geom)
        off.append(abs(distance - truth.true_range_m[point]) / max(distance, 1.0))
    assert np.quantile(off, 0.95) < 1e-6  # an edge may fall to its other side


# -- the estimator ------------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(
    turn=st.tuples(*[st.floats(-0.4, 0.4)] * 3), shift=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    name=st.sampled_from(SENSORS),
)  # fmt: skip
def test_plates_show_any_turn_and_shift(
    turn: tuple[float, float, float], shift: tuple[float, float, float], name: str
) -> None:
    at = staged()
    script = posed(at).script
    bent = Ramp(begin_ns=-2, end_ns=-1, end=np.array([*turn, *shift]), smooth=True)
    found = turned("lidar", sensor_of(name), replace(script, flex={"lidar": bent}), script, 2)
    assert len(found.taken_ns) == 8
    true = Rotation.from_euler("xyz", turn).as_rotvec()  # about fixed axes, roll first
    np.testing.assert_allclose(np.rad2deg(found.turn_rad - true), 0.0, atol=1e-3)
    np.testing.assert_allclose(found.shift_m - shift, 0.0, atol=1e-4)


@pytest.mark.parametrize("name", SENSORS)
def test_plates_show_a_bracket_that_bends_within_a_column(name: str) -> None:
    script = posed(staged()).script
    shake = bracket_shake(Flex(rms_deg=0.5), "lidar", 2.0, 0)
    found = turned("lidar", sensor_of(name), replace(script, flex={"lidar": shake}), script, 10)
    left_deg = np.rad2deg(found.turn_rad - shake.at(found.taken_ns))
    assert np.sqrt(np.mean(left_deg**2)) < 0.01  # turns about three axes do not commute: 0.5 deg squared
    assert np.rad2deg(found.turn_rad).std() > 0.3


# -- receipts -----------------------------------------------------------------------------------------------


def found(
    *specs: FaultSpec, asked: tuple[FaultSpec, ...] | None = None, drawn: bool = True
) -> tuple[Receipt, ...]:
    """Receipts of `asked` (default: what acted) where `specs` acted; drawn: with what really was drawn."""
    captured, asked = posed_under(*specs), specs if asked is None else asked
    if not drawn:
        captured = replace(captured, drawn=posed_under(*asked).drawn)
    return receipts_of(captured, staged(specs=asked))


BRACKETS: dict[str, FaultSpec] = {
    "knock": Knock(angle_deg=-1.0, axis="pitch", at_s=0.9, sensors="lidar"),
    "drift": Drift(angle_deg=0.5, axis="roll", shift_cm=4.0, along="y", sensors="lidar"),
    "flex": Flex(rms_deg=0.2, sensors="lidar"),
    "drift of the cameras, across their arm": Drift(angle_deg=1.0, axis="yaw", shift_cm=5.0, along="y"),
}


@pytest.mark.parametrize("which", BRACKETS)
def test_what_the_bracket_does_is_found(which: str) -> None:
    spec = BRACKETS[which]
    honest = found(spec)
    assert {r.status for r in honest} == {OK}, honest
    assert any(r.requested for r in honest)
    factors = (0.0, 0.5, 2.0) if isinstance(spec, Flex) else (0.0, 0.5, 2.0, -1.0)
    for factor in factors:
        wrong = spec.model_copy(update={name: factor * getattr(spec, name) for name in spec.zero_when_off})
        for drawn in (True, False):
            assert MISMATCH in {r.status for r in found(wrong, asked=(spec,), drawn=drawn)}, (factor, drawn)


@pytest.mark.parametrize("which", ["knock", "drift", "flex"])
def test_the_wrong_sensor_is_found(which: str) -> None:
    on_lidar = BRACKETS[which]
    one = on_lidar.model_copy(update={"sensors": ("cam-front",)})
    for wrong, asked in (
        (on_lidar, one),
        (one, on_lidar),
        (on_lidar.model_copy(update={"sensors": "cameras"}), on_lidar),
    ):
        for drawn in (True, False):
            assert MISMATCH in {r.status for r in found(wrong, asked=(asked,), drawn=drawn)}


def test_a_lidar_that_is_knocked_beside_the_cameras_that_were_asked_for_is_found() -> None:
    spec = Knock(angle_deg=1.0, at_s=0.9)
    captured = posed(staged(specs=(spec,)))
    knock = captured.drawn.knocks["cam-front"]
    also = replace(captured, motion=replace(captured.motion, flex={**captured.motion.flex, "lidar": knock}))
    assert MISMATCH not in {r.status for r in receipts_of(captured, staged(specs=(spec,)))}
    (worst,) = [r for r in receipts_of(also, staged(specs=(spec,))) if r.status == MISMATCH]
    assert worst.quantity == "step of the other sensors" and worst.measured == pytest.approx(1.0, abs=1e-3)


def test_the_bracket_is_found_among_other_motions() -> None:
    specs = (
        BRACKETS["knock"], BRACKETS["drift"], Flex(rms_deg=0.1), Vibration(rms_deg=0.3),
    )  # fmt: skip
    receipts = found(*specs)
    assert not [r for r in receipts if r.status == MISMATCH]
    verified = {r.quantity for r in receipts if r.status == OK and r.requested}
    assert verified >= {"lidar pitch", "lidar roll", "lidar y"}


# -- what moves ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("which", ["knock", "drift", "flex"])
def test_points_move_and_nothing_else_does_least_of_all_what_is_told(which: str) -> None:
    spec = BRACKETS[which]
    if isinstance(spec, Knock):
        spec = spec.model_copy(update={"at_s": 0.1})
    clean, bent = recorded(staged(duration_s=0.4)), recorded(staged(specs=(spec,), duration_s=0.4))
    was, now = bytes_of(clean.recording), bytes_of(bent.recording)
    assert {part for part in was if was[part] != now[part]} == {"messages", "scans", "true scans", "poses"}
    told: Calibration = bent.recording.calibration
    assert np.array_equal(
        told.T_ego_sensor["lidar"].rotation, clean.recording.calibration.T_ego_sensor["lidar"].rotation
    )


@pytest.mark.parametrize("kind", [Knock, Drift, Flex])
def test_cameras_brackets_move_no_point(kind: type[FaultSpec]) -> None:
    spec = kind.model_validate({kind.strength: 1.0})
    clean, bent = recorded(staged(duration_s=0.4)), recorded(staged(specs=(spec,), duration_s=0.4))
    assert bytes_of(clean.recording)["scans"] == bytes_of(bent.recording)["scans"]
