"""A drive integrated: where the road has the sensors' mount at every millisecond, and at any time between.

The vehicle is put on the road four seconds before the first instant that is asked for, the road growing from
flat under it for the first 1.5 s, so that all its modes have died away; it drives on past the last one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import CubicSpline

from scenarios.faults import Roughness
from scenarios.severity import Profile
from simbench.dynamics.body import Vehicle
from simbench.dynamics.integrate import Course, States, attitude_rad, integrate, rotated
from simbench.dynamics.linear import linearised
from simbench.dynamics.road import Road, roughness_m3
from simbench.dynamics.scooter import scooter
from simbench.dynamics.vehicle import car
from simbench.path import Track
from simbench.shake import rms_about_line, times_ns

STEP_NS = 1_000_000
LEAD_S, GROWING_S = 4.0, 1.5
FALLEN_RAD = np.deg2rad(45.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ride:
    """States every `step_ns` from `start_ns`, each row (roll, pitch, yaw in rad, heave in m) against the
    script: attitude as Rz(yaw) Ry(pitch) Rx(roll), heave of the body's point that rests at the pivot.

    base: chassis or deck. body: chassis or torso. mount: what the sensors ride on. linear: the mount of the
    linearised vehicle on the same road, its tyres letting go where they did. roughness, roughness_m3: the
    class of the road, and Gd(0.1 cycles/m) found in its table. events: how many there are on it.
    """

    start_ns: int
    step_ns: int
    base: Float64[np.ndarray, "n 4"]
    body: Float64[np.ndarray, "n 4"]
    mount: Float64[np.ndarray, "n 4"]
    linear: Float64[np.ndarray, "n 4"]
    roughness: Roughness
    roughness_m3: float
    events: int

    @cached_property
    def _spline(self) -> CubicSpline:
        """In seconds from the first state: C2."""
        return CubicSpline(np.arange(len(self.mount)) * (self.step_ns * 1e-9), self.mount)

    def _seconds(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        t_ns = np.asarray(t_ns, dtype=np.int64)
        last_ns = self.start_ns + (len(self.mount) - 1) * self.step_ns
        if len(t_ns) and not (self.start_ns <= t_ns.min() and t_ns.max() <= last_ns):
            raise ValueError(
                f"the ride was integrated from {self.start_ns * 1e-9:.3f} to {last_ns * 1e-9:.3f} s, not at "
                f"{t_ns.min() * 1e-9:.3f} to {t_ns.max() * 1e-9:.3f} s"
            )
        seconds: np.ndarray = (t_ns - self.start_ns) * 1e-9
        return seconds

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 4"]:
        """The mount at the true times t_ns [n]. ValueError: before or after what was integrated."""
        value: np.ndarray = self._spline(self._seconds(t_ns))
        return value

    def rate_at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 4"]:
        """Time derivatives of `at`, per second."""
        value: np.ndarray = self._spline(self._seconds(t_ns), 1)
        return value

    def rms(self, duration_s: float) -> Float64[np.ndarray, "4"]:
        """RMS per axis about its straight-line fit over [0, duration_s], sampled every millisecond."""
        return rms_about_line(self.at(times_ns(duration_s)))

    def rate_rms(self, duration_s: float) -> Float64[np.ndarray, "4"]:
        """RMS per axis of the time derivative over [0, duration_s]."""
        rms: np.ndarray = np.std(self.rate_at(times_ns(duration_s)), axis=0)
        return rms

    def linear_rms(self, duration_s: float) -> Float64[np.ndarray, "4"]:
        """What `rms` is for the linearised vehicle."""
        first = round(-self.start_ns / self.step_ns)
        return rms_about_line(self.linear[first : first + len(times_ns(duration_s))])


class Overturned(ValueError):  # noqa: N818 (what happened, not a failure of the program)
    """The vehicle or its rider fell."""


def vehicle_for(profile: Profile, ego_xy_m: tuple[float, float], step_s: float = 1e-3) -> Vehicle:
    """The model of a profile, its sensors above `ego_xy_m` in the part's root frame."""
    return car(ego_xy_m, step_s) if profile == "car" else scooter(ego_xy_m, step_s)


def course_along(
    vehicle: Vehicle, track: Track, road: Road, t_ns: Int64[np.ndarray, " n"]
) -> tuple[Course, float]:
    """What the vehicle meets along the track at evenly spaced times t_ns [n], and the height at which it
    starts: heights count from there, and grow from flat at first.
    """
    arc_m, step_s = track.arc_m(t_ns), float(t_ns[1] - t_ns[0]) * 1e-9
    met = [road.met_m(w.side, arc_m + w.x_m, w.radius_m, w.contact_m) for w in vehicle.wheels]
    height = np.stack(met, axis=1)
    start_m = float(height[0].mean())
    grown = np.clip((t_ns - t_ns[0]) * (1e-9 / GROWING_S), 0.0, 1.0)
    height = (height - start_m) * (grown**2 * (3.0 - 2.0 * grown))[:, None]
    speed = track.speed_at(t_ns)
    _, heading = track.at(t_ns)
    return Course(
        road_m=height,
        road_rate_mps=np.gradient(height, step_s, axis=0),
        ahead_mps2=_unless_tiny(np.gradient(speed, step_s)),
        left_mps2=_unless_tiny(speed * np.gradient(heading, step_s)),
    ), start_m


def _unless_tiny(value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Rounding of a straight drive at constant speed is no acceleration."""
    return np.where(np.abs(value) < 1e-9, 0.0, value)


def pose_rows(
    states: States, which: int, rest_m: Float64[np.ndarray, " 3"], pivot_m: Float64[np.ndarray, " 3"]
) -> Float64[np.ndarray, "n 4"]:
    """(roll, pitch, yaw, heave) of one of (base, body, mount), which rests at `rest_m`."""
    quaternion = states.quaternion[:, which]
    heave = (states.position_m[:, which] + rotated(quaternion, pivot_m - rest_m))[:, 2] - pivot_m[2]
    return np.column_stack([attitude_rad(quaternion), heave])


def drive_over(
    road: Road,
    roughness: Roughness,
    profile: Profile,
    track: Track,
    pivot_m: tuple[float, float, float],
    first_ns: int,
    last_ns: int,
    step_ns: int = STEP_NS,
) -> Ride:
    """Integrate the drive of a vehicle along `track` so that `at` answers from first_ns to last_ns.

    pivot_m: in the part's root frame; the sensors stand above it. Raises Overturned, FloatingPointError where
    a state is not finite, ValueError where last_ns is not after first_ns.
    """
    if last_ns <= first_ns:
        raise ValueError(f"a ride must end after it starts: {first_ns} to {last_ns} ns")
    start_ns = first_ns // STEP_NS * STEP_NS
    steps = -((start_ns - last_ns) // step_ns) + 1
    lead = round(LEAD_S * 1e9) // step_ns
    t_ns = start_ns + step_ns * np.arange(-lead, steps, dtype=np.int64)
    step_s, pivot = step_ns * 1e-9, np.asarray(pivot_m)
    vehicle = vehicle_for(profile, (pivot_m[0], pivot_m[1]), step_s)
    over, start_m = course_along(vehicle, track, road, t_ns)
    states = integrate(vehicle, over)
    rows = []
    for which in range(3):
        row = pose_rows(states, which, states.position_m[0, which], pivot)[lead:]
        row[:, 3] += start_m
        rows.append(row)
    tilt = np.abs(np.concatenate([row[:, :2] for row in rows])).max()
    if tilt > FALLEN_RAD:
        raise Overturned(
            f"the {vehicle.name} does not stay upright: it tilts by {np.rad2deg(tilt):.0f} degrees"
        )
    # A tyre that lets go does as one that sticks to a road so much higher.
    stiffness = np.array([w.stiffness_npm for w in vehicle.wheels])
    let_go = replace(over, road_m=over.road_m + states.lift_n / stiffness)
    linear = linearised(vehicle, pivot).response(let_go, step_s)[lead:]
    linear[:, 3] += start_m
    return Ride(
        start_ns=start_ns,
        step_ns=step_ns,
        base=rows[0],
        body=rows[1],
        mount=rows[2],
        linear=linear,
        roughness=roughness,
        roughness_m3=roughness_m3(road),
        events=len(road.events),
    )
