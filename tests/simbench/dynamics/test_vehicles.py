"""The car and the e-scooter as mechanics: rest, modes, energy, time steps, sides, bends, roughness."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from scenarios.faults import RoadEvent, Roughness
from scenarios.scenario import Path
from scenarios.severity import ROAD_PITCH_RMS_DEG, Profile
from simbench.dynamics import vehicle as car_file
from simbench.dynamics.body import Vehicle
from simbench.dynamics.integrate import Course, States, attitude_rad, course, integrate
from simbench.dynamics.linear import linearised
from simbench.dynamics.ride import Ride, drive_over, vehicle_for
from simbench.dynamics.road import Road, draw_road, mirrored
from simbench.path import Track, make_track

PROFILES: tuple[Profile, ...] = ("car", "rider")
PIVOT = {"car": (-0.5, 0.0, 0.4), "rider": (-0.34, 0.0, 0.4)}
SPEED_MPS = {"car": 12.5, "rider": 5.2}
S = 1_000_000_000


@cache
def built(profile: Profile) -> Vehicle:
    return vehicle_for(profile, PIVOT[profile][:2])


def flat(vehicle: Vehicle, seconds: float, step_s: float = 1e-3) -> Course:
    return course(np.zeros((round(seconds / step_s), len(vehicle.wheels))), step_s)


def raised(vehicle: Vehicle, **joints: float) -> np.ndarray:
    """A start off the rest pose by these joints' values."""
    qpos = np.array(vehicle.model.qpos0)
    for name, value in joints.items():
        qpos[vehicle.model.joint(name).qposadr[0]] = value
    return qpos


def dropped(profile: Profile, seconds: float, step_s: float = 1e-3) -> tuple[Vehicle, States]:
    """After a fall from 2 cm above its rest pose."""
    vehicle = vehicle_for(profile, PIVOT[profile][:2], step_s)
    return vehicle, integrate(vehicle, flat(vehicle, seconds, step_s), raised(vehicle, heave=0.02))


def straight(speed_mps: float) -> Track:
    return make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=speed_mps))


def driven(
    profile: Profile, road: Road, seconds: float = 6.0, track: Track | None = None, step_ns: int = 1_000_000
) -> Ride:
    way = track or straight(SPEED_MPS[profile])
    return drive_over(road, "C", profile, way, PIVOT[profile], 0, round(seconds * S), step_ns)


def rough(roughness: Roughness = "C", seed: int = 0, *events: RoadEvent) -> Road:
    return draw_road(np.random.default_rng(seed), roughness, events)


def bump(track: str = "left", height_m: float = 0.05) -> RoadEvent:
    return RoadEvent.model_validate(
        {"kind": "bump", "at_m": 20.0, "height_m": height_m, "length_m": 1.0, "track": track}
    )


# -- rest -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_at_rest_on_flat_ground_nothing_moves(profile: Profile) -> None:
    vehicle = built(profile)
    states = integrate(vehicle, flat(vehicle, 10.0))
    assert np.abs(states.qvel[-1]).max() < 1e-6
    assert np.abs(states.qpos).max() < 1e-6  # no sag: the springs are preloaded


def test_a_dropped_car_comes_to_rest_within_ten_seconds() -> None:
    _, states = dropped("car", 10.0)
    assert np.abs(states.qvel[0:2000]).max() > 0.05
    assert np.abs(states.qvel[-1]).max() < 1e-6


@pytest.mark.parametrize("profile", PROFILES)
def test_the_tyres_carry_the_weight(profile: Profile) -> None:
    vehicle = built(profile)
    weight = 9.81 * float(np.sum(vehicle.model.body_mass))
    assert sum(w.preload_n for w in vehicle.wheels) == pytest.approx(weight, rel=1e-12)
    assert all(0.15 * weight < w.preload_n for w in vehicle.wheels)


# -- modes ------------------------------------------------------------------------------------------------


def ringing(signal: np.ndarray, step_s: float, order: int) -> np.ndarray:
    """Complex frequencies (1/s) of a sum of `order` decaying exponentials, by the matrix pencil."""
    rows = len(signal) // 2
    hankel = np.lib.stride_tricks.sliding_window_view(signal, rows)
    _, _, v = np.linalg.svd(hankel, full_matrices=False)
    basis = v[:order].T
    poles = np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])
    return np.asarray(np.log(poles.astype(np.complex128)) / step_s)


def two_masses(
    sprung: float, unsprung: float, spring: float, damper: float, tyre: float, tyre_damper: float
) -> np.ndarray:
    """Eigenvalues of a mass on a spring and damper on a mass on another pair, slow one first."""
    A = np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-spring / sprung, spring / sprung, -damper / sprung, damper / sprung],
            [
                spring / unsprung,
                -(spring + tyre) / unsprung,
                damper / unsprung,
                -(damper + tyre_damper) / unsprung,
            ],
        ]
    )
    found = np.linalg.eigvals(A)
    return np.asarray(sorted((x for x in found if x.imag > 0), key=abs))


def test_a_dropped_car_rings_as_two_masses_do() -> None:
    """Heave of the chassis and of the hubs after the drop, against the eigenvalues of sums of masses and
    springs: both natural frequencies within 5 %.
    """
    vehicle, states = dropped("car", 1.5)
    springs = 2.0 * sum(car_file.SPRING_NPM.values())
    dampers = 2.0 * sum(car_file.DAMPER_NSPM.values())
    slow, fast = two_masses(
        car_file.SPRUNG_KG + car_file.RACK_KG, 4 * car_file.UNSPRUNG_KG, springs, dampers,
        4 * car_file.TYRE_NPM, 4 * car_file.TYRE_NSPM,
    )  # fmt: skip
    joint = vehicle.model.joint
    travel = states.qpos[:, [joint(w.body).qposadr[0] for w in vehicle.wheels]].mean(axis=1)
    found = ringing(travel[50:600:5], 5e-3, 6)
    found = found[found.imag > 1.0]
    for expected in (slow, fast):
        nearest = found[np.argmin(np.abs(found - expected))]
        assert abs(nearest) == pytest.approx(abs(expected), rel=0.05)
        assert nearest.imag == pytest.approx(expected.imag, rel=0.05)


def test_the_cars_modes_are_those_of_a_full_car_written_out_by_hand() -> None:
    """Heave, pitch, roll and four hubs: M q'' + C q' + K q = 0 from the numbers alone. Within 1 %, as the
    rack rides rigidly on the roof here.
    """
    c, rack = car_file, np.array([-0.5, 0.0, car_file.ROOF_Z_M + car_file.RACK_ABOVE_ROOF_M])
    centre, inertia = np.array(c.CENTRE_M), np.array(c.SPRUNG_INERTIA_KGM2[:2])
    arm = rack - centre
    roll_inertia = inertia[0] + c.RACK_KG * (arm[1] ** 2 + arm[2] ** 2) + c.RACK_OWN_INERTIA_KGM2[0]
    pitch_inertia = inertia[1] + c.RACK_KG * (arm[0] ** 2 + arm[2] ** 2) + c.RACK_OWN_INERTIA_KGM2[1]
    M = np.diag([c.SPRUNG_KG + c.RACK_KG, pitch_inertia, roll_inertia, *[c.UNSPRUNG_KG] * 4])
    M[0, 1] = M[1, 0] = -c.RACK_KG * arm[0]
    corners = [(axle, x, y) for axle, x in (("f", c.FRONT_X_M), ("r", c.REAR_X_M)) for y in (0.75, -0.75)]
    K, C = np.zeros((7, 7)), np.zeros((7, 7))
    for i, (axle, x, y) in enumerate(corners):
        stretch = np.zeros(7)  # of the strut: hub less the chassis above it
        stretch[[0, 1, 2, 3 + i]] = -1.0, x - centre[0], -y, 1.0
        hub = np.eye(7)[3 + i]
        K += c.SPRING_NPM[axle] * np.outer(stretch, stretch) + c.TYRE_NPM * np.outer(hub, hub)
        C += c.DAMPER_NSPM[axle] * np.outer(stretch, stretch) + c.TYRE_NSPM * np.outer(hub, hub)
    bar = np.zeros(7)
    bar[[2, 3, 4]] = -1.5, 1.0, -1.0
    K += c.ANTI_ROLL_NPM * np.outer(bar, bar)
    # Wheels hang below the centre, the rack stands above it: pendulums, carried from below.
    down = centre[2] - c.HUB_Z_M
    topples = 9.81 * ((c.SPRUNG_KG + c.RACK_KG) * down + c.RACK_KG * arm[2])
    for axis in (1, 2):
        K[axis, axis] -= topples
        M[axis, axis] += 4 * c.UNSPRUNG_KG * down**2
    A = np.block([[np.zeros((7, 7)), np.eye(7)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    expected = np.linalg.eigvals(A)
    expected = expected[expected.imag > 0]
    expected = expected[np.argsort(np.abs(expected))]
    found = linearised(built("car"), np.array(PIVOT["car"])).modes()[:7]
    np.testing.assert_allclose(np.abs(found), np.abs(expected), rtol=0.01)
    np.testing.assert_allclose(found.real, expected.real, rtol=0.03)


def test_the_mounts_first_modes_are_stiff_on_the_car_and_soft_on_the_rider() -> None:
    for profile, low, high in (("car", 20.0, 60.0), ("rider", 8.0, 20.0)):
        modes = np.abs(linearised(built(profile), np.array(PIVOT[profile])).modes()) / (2.0 * np.pi)
        assert np.sum((modes > low) & (modes < high)) >= 2


# -- energy and time steps --------------------------------------------------------------------------------


def energy_j(vehicle: Vehicle, states: States) -> np.ndarray:
    """Kinetic, weight, springs and tyres (a tyre pressed with F holds F^2 / 2k)."""
    model = vehicle.model
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    total = np.empty(len(states.qpos))
    for i in range(len(total)):
        data.qpos[:], data.qvel[:] = states.qpos[i], states.qvel[i]
        mujoco.mj_forward(model, data)
        total[i] = data.energy.sum()
        for wheel in vehicle.wheels:
            sunk = wheel.radius_m - data.body(wheel.body).xpos[2]
            total[i] += max(wheel.preload_n + wheel.stiffness_npm * sunk, 0.0) ** 2 / (
                2 * wheel.stiffness_npm
            )
    return total


@pytest.mark.parametrize("profile", PROFILES)
def test_after_a_drop_on_a_flat_road_energy_only_falls(profile: Profile) -> None:
    vehicle, states = dropped(profile, 1.5, 2.5e-4)
    energy = energy_j(vehicle, states)
    spent = energy[0] - energy[-1]
    assert spent > 5.0
    assert np.diff(energy).max() < 1e-5 * spent


@pytest.mark.parametrize("profile", PROFILES)
def test_steps_of_a_millisecond_and_of_a_quarter_agree_to_a_hundredth_of_a_degree(profile: Profile) -> None:
    coarse = driven(profile, rough("C"), 2.0)
    fine = driven(profile, rough("C"), 2.0, step_ns=250_000)
    difference = np.rad2deg(np.abs(coarse.mount[:, :3] - fine.mount[::4, :3])).max()
    assert 0.0 < difference < 0.01
    assert np.abs(coarse.mount[:, 3] - fine.mount[::4, 3]).max() < 1e-4


@pytest.mark.parametrize("profile", PROFILES)
def test_on_a_good_road_mujoco_and_the_linearised_vehicle_agree(profile: Profile) -> None:
    ride = driven(profile, rough("A"))
    for axis in (1, 3) if profile == "rider" else (0, 1, 3):
        error = np.std(ride.mount[:, axis] - ride.linear[:, axis])
        assert error < 0.02 * np.std(ride.linear[:, axis])


def test_the_linear_response_to_a_ramp_is_the_matrix_exponential() -> None:
    """z' = [[A, B r], [0, 0]] z + ... with the input r t as a further state: exact for straight lines."""
    linear, vehicle = linearised(built("car"), np.array(PIVOT["car"])), built("car")
    rate = np.zeros(linear.B.shape[1])
    rate[:4] = [0.03, 0.01, 0.02, 0.0]
    n = len(linear.A)
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n], whole[n, n + 1] = linear.A, linear.B @ rate, 1.0
    over = flat(vehicle, 0.5, 1e-2)
    over = replace(over, road_m=np.outer(np.arange(len(over.road_m)) * 1e-2, rate[:4]))
    expected = linear.C @ expm(whole * 0.49)[:n, n + 1]
    np.testing.assert_allclose(linear.response(over, 1e-2)[-1], expected, rtol=1e-8, atol=1e-14)


# -- sides and bends --------------------------------------------------------------------------------------


def test_a_bump_under_the_left_wheels_rolls_the_car_to_the_right() -> None:
    ride = driven("car", rough("smooth", 0, bump("left")), 4.0)
    roll = ride.base[:, 0]
    first = roll[np.argmax(np.abs(roll) > 0.2 * np.abs(roll).max())]
    assert first > 0.0 and np.rad2deg(roll.max()) > 0.2  # left side up


def test_a_bump_lifts_the_nose_first_and_then_the_tail() -> None:
    pitch = driven("car", rough("smooth", 0, bump("both")), 4.0).base[:, 1]
    assert 0 < np.argmin(pitch) < np.argmax(pitch)


@pytest.mark.parametrize("seed", range(2))
def test_a_mirrored_road_gives_a_mirrored_ride(seed: int) -> None:
    road = rough("D", seed, bump("left"), RoadEvent(kind="pothole", at_m=30.0, height_m=0.05, length_m=0.8))
    one, other = driven("car", road, 4.0), driven("car", mirrored(road), 4.0)
    sign = np.array([-1.0, 1.0, -1.0, 1.0])
    for part in ("base", "body", "mount"):
        np.testing.assert_allclose(getattr(other, part), sign * getattr(one, part), atol=1e-9)
    assert np.rad2deg(np.std(one.mount[:, 0])) > 0.1


def test_a_single_track_vehicle_does_not_roll_on_a_straight_road() -> None:
    assert np.abs(driven("rider", rough("C")).mount[:, 0]).max() < 1e-9


def held(profile: Profile, ahead_mps2: float = 0.0, left_mps2: float = 0.0) -> np.ndarray:
    """(roll, pitch, yaw) of the base after ten seconds of a constant acceleration, in degrees."""
    vehicle = built(profile)
    over = flat(vehicle, 10.0)
    over = Course(
        road_m=over.road_m, road_rate_mps=over.road_rate_mps,
        ahead_mps2=over.ahead_mps2 + ahead_mps2, left_mps2=over.left_mps2 + left_mps2,
    )  # fmt: skip
    return np.asarray(np.rad2deg(attitude_rad(integrate(vehicle, over).quaternion[:, 0])[-1]))


def test_a_braking_car_dives_by_the_moment_of_its_weight_over_the_springs() -> None:
    """M a h on springs of sum k x^2; tyres in series; 3 %."""
    c = car_file
    total_h = (c.SPRUNG_KG * 0.55 + 4 * c.UNSPRUNG_KG * 0.33 + c.RACK_KG * 1.75) * 3.0
    stiffness = sum(
        2.0 * x * x / (1.0 / c.SPRING_NPM[a] + 1.0 / c.TYRE_NPM)
        for a, x in (("f", c.FRONT_X_M - 0.02), ("r", c.REAR_X_M - 0.02))
    )
    assert held("car", ahead_mps2=-3.0)[1] == pytest.approx(np.rad2deg(total_h / stiffness), rel=0.03)
    assert held("car", ahead_mps2=3.0)[1] < -0.5


def test_in_a_left_bend_the_car_rolls_to_the_right_and_the_rider_leans_to_the_left() -> None:
    assert 0.5 < held("car", left_mps2=2.0)[0] < 4.0
    lean = held("rider", left_mps2=2.0)[0]
    assert lean == pytest.approx(-np.rad2deg(np.arctan2(2.0, 9.81)), rel=0.02)


def test_a_drive_along_a_bend_feels_its_acceleration() -> None:
    angle = np.deg2rad(np.arange(0, 271, 5))
    circle = make_track(
        Path(
            waypoints_m=tuple((float(20 * np.sin(a)), float(20 - 20 * np.cos(a))) for a in angle),
            speed_mps=5.0,
        )
    )
    ride = driven("rider", rough("smooth"), 10.0, circle)
    asked = -np.arctan2(5.0**2 / 20.0, 9.81)
    assert np.median(ride.base[6000:, 0]) == pytest.approx(asked, rel=0.03)


def test_a_standing_vehicle_stands_still_whatever_the_road() -> None:
    ride = driven("car", rough("E"), 2.0, straight(0.0))
    assert np.rad2deg(np.ptp(ride.mount[:, :3], axis=0)).max() < 1e-3


# -- how rough it gets ------------------------------------------------------------------------------------


@cache
def long_drive(profile: Profile, roughness: Roughness) -> np.ndarray:
    """RMS in degrees of (base, mount) x (roll, pitch, yaw), and of their rates, over 40 s."""
    ride = driven(profile, rough(roughness, 3), 40.0)
    angles = np.stack([ride.base[:, :3], ride.mount[:, :3]])
    return np.rad2deg(np.stack([angles.std(axis=1), np.diff(angles, axis=1).std(axis=1) * 1e3]))


@pytest.mark.parametrize(("profile", "share"), [("car", 0.1), ("rider", 0.25)])
def test_pitch_per_class_is_near_the_table(profile: Profile, share: float) -> None:
    """A car at 12.5 m/s, the deck at 5.2 m/s. The deck comes out lower: this scooter is 1.2 m long."""
    for roughness, expected in zip(("A", "E"), ROAD_PITCH_RMS_DEG[profile][::4], strict=True):
        pitch = long_drive(profile, roughness)[0, 0, 1]  # type: ignore[arg-type]
        assert pitch == pytest.approx(expected, rel=share)


def test_the_cars_pitch_rate_is_near_the_computed_one() -> None:
    """0.55 to 8.9 deg/s for A to E."""
    assert long_drive("car", "A")[1, 0, 1] == pytest.approx(0.55, rel=0.15)
    assert long_drive("car", "E")[1, 0, 1] == pytest.approx(8.9, rel=0.15)


def test_a_rider_on_a_parking_lot_sways_below_a_degree() -> None:
    assert 0.1 < long_drive("rider", "A")[0, 1, 1] < 0.5  # and so below one on class B


def test_sixteen_times_as_rough_is_sixteen_times_as_much_until_tyres_let_go() -> None:
    ratio = long_drive("car", "E")[0, 0, 1] / long_drive("car", "A")[0, 0, 1]
    assert ratio == pytest.approx(16.0, rel=0.05) and ratio != pytest.approx(16.0, rel=1e-4)
