"""Gyro, accelerometer and wheel odometer of the ego's body, as measured `EgoMotion` messages.

Gyro and accelerometer read the motion itself, shake included, in the body's axes: the angular rate, and the
specific force f = R^T (a - g) of the point where the IMU is mounted (lever arm included). Each adds white
noise of a given density and a bias that starts at random and wanders as a random walk. The odometer reads the
scripted speed with a scale error, in steps, at its own rate; a message holds its newest sample.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import EgoMotion
from scenarios.scenario import ImuSensor
from simbench.motion import Motion
from simbench.sensors.clock import newest_tick_ns, ticks_ns
from simbench.sensors.rig import Phases

GYRO_STEP_NS = 250_000  # to either side, of the central differences
ACCEL_STEP_NS = 1_000_000  # the finest step of an integrated motion
GRAVITY_MPS2 = 9.81


def body_rate_radps(motion: Motion, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
    """Angular rate of the shaking ego body in its own axes, by a central difference over 0.5 ms."""
    before, _ = motion.shaken_ego(t_ns - GYRO_STEP_NS)
    after, _ = motion.shaken_ego(t_ns + GYRO_STEP_NS)
    turn = np.einsum("nji,njk->nik", before, after)
    vector = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    return vector / (2.0 * GYRO_STEP_NS * 1e-9)


def specific_force_mps2(
    motion: Motion, place_m: Float64[np.ndarray, "3"], t_ns: Int64[np.ndarray, " n"]
) -> Float64[np.ndarray, "n 3"]:
    """Acceleration less gravity of the point `place_m` (ego frame, at rest) of the shaking body, in the
    body's axes: by a second difference over 1 ms to either side."""
    positions = []
    for shift_ns in (-ACCEL_STEP_NS, 0, ACCEL_STEP_NS):
        rotation, origin = motion.shaken_ego(t_ns + shift_ns)
        positions.append(origin + rotation @ place_m)
        if shift_ns == 0:
            attitude = rotation
    before, here, after = positions
    force = ((after - here) - (here - before)) / (ACCEL_STEP_NS * 1e-9) ** 2
    force[:, 2] += GRAVITY_MPS2
    felt: np.ndarray = np.einsum("nji,nj->ni", attitude, force)
    return felt


def measure(
    name: str, sensor: ImuSensor, motion: Motion, end_ns: int, rng: np.random.Generator, phases: Phases
) -> tuple[EgoMotion, ...]:
    """Messages of the IMU that the rig calls `name` up to `end_ns`.

    The draws of a run are the same whatever the noise, and a longer run begins with the numbers of a shorter
    one.
    """
    t_ns = ticks_ns(sensor.rate_hz, phases.imu_ns, end_ns)
    start = rng.standard_normal(7)
    white = rng.standard_normal((len(t_ns), 12))
    gyro = body_rate_radps(motion, t_ns) + np.deg2rad(
        sensor.gyro_bias_dps * start[0:3]
        + _noise(
            sensor.rate_hz, white[:, 0:3], white[:, 3:6], sensor.gyro_noise_dps_rthz, sensor.gyro_walk_dps_rts
        )
    )
    accel = (
        specific_force_mps2(motion, motion.T_ego_sensor[name].translation_m, t_ns)
        + sensor.accel_bias_mps2 * start[3:6]
        + _noise(
            sensor.rate_hz,
            white[:, 6:9],
            white[:, 9:12],
            sensor.accel_noise_mps2_rthz,
            sensor.accel_walk_mps2_rts,
        )
    )
    speed = _odometer_mps(sensor, motion, t_ns, phases.odometer_ns, float(start[6]))
    latency_ns = round(sensor.latency_ms * 1e6)
    return tuple(
        EgoMotion(
            sensor=name,
            seq=i,
            stamp_ns=int(t),
            arrival_ns=int(t) + latency_ns,
            velocity_mps=np.array([speed[i], 0.0, 0.0]),
            rate_radps=gyro[i],
            specific_force_mps2=accel[i],
        )
        for i, t in enumerate(t_ns)
    )


def _noise(
    rate_hz: float,
    white: Float64[np.ndarray, "n 3"],
    steps: Float64[np.ndarray, "n 3"],
    density_rthz: float,
    walk_rts: float,
) -> Float64[np.ndarray, "n 3"]:
    """White noise of a one-sided density up to the Nyquist frequency, and a random walk that starts at 0."""
    walk = np.cumsum(steps, axis=0) - steps[:1]
    noise: np.ndarray = density_rthz * np.sqrt(0.5 * rate_hz) * white + walk_rts / np.sqrt(rate_hz) * walk
    return noise


def _odometer_mps(
    sensor: ImuSensor, motion: Motion, t_ns: Int64[np.ndarray, " n"], phase_ns: int, draw: float
) -> Float64[np.ndarray, " n"]:
    """The odometer's newest sample at each t that is at least its latency old."""
    known_ns = t_ns - round(sensor.odometer_latency_ms * 1e6)
    sampled_ns = newest_tick_ns(sensor.odometer_rate_hz, phase_ns, known_ns)
    scale = 1.0 + sensor.odometer_scale_error * draw
    speed = motion.world.actors[motion.ego_actor].track.speed_at(sampled_ns) * scale
    if sensor.odometer_step_mps > 0.0:
        speed = np.round(speed / sensor.odometer_step_mps) * sensor.odometer_step_mps
    return speed
