"""Gyro on the ego's body and wheel odometer, as measured `EgoMotion` messages.

The gyro reads the body's true angular rate (shake included, in the body's axes) plus a constant bias and
white noise of the given density; the odometer reads the scripted speed with a scale error, in steps.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import EgoMotion
from scenarios.scenario import ImuSensor
from simbench.motion import Motion

HALF_STEP_NS = 250_000


def body_rate_radps(motion: Motion, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
    """Angular rate of the shaking ego body in its own axes, by a central difference over 0.5 ms."""
    before, _ = motion.shaken_ego(t_ns - HALF_STEP_NS)
    after, _ = motion.shaken_ego(t_ns + HALF_STEP_NS)
    turn = np.einsum("nji,njk->nik", before, after)
    vector = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    return vector / (2.0 * HALF_STEP_NS * 1e-9)


def measure(
    name: str, sensor: ImuSensor, motion: Motion, end_ns: int, rng: np.random.Generator
) -> tuple[EgoMotion, ...]:
    """Messages from t = 0 to `end_ns` at the sensor's rate."""
    t_ns = np.arange(0, end_ns + 1, round(1e9 / sensor.rate_hz), dtype=np.int64)
    bias = np.deg2rad(sensor.gyro_bias_dps) * rng.standard_normal(3)
    white = np.deg2rad(sensor.gyro_noise_dps_rthz) * np.sqrt(0.5 * sensor.rate_hz)
    rate = body_rate_radps(motion, t_ns) + bias + white * rng.standard_normal((len(t_ns), 3))
    scale = 1.0 + sensor.odometer_scale_error * rng.standard_normal()
    speed = motion.world.actors[motion.ego_actor].track.speed_at(t_ns) * scale
    if sensor.odometer_step_mps > 0.0:
        speed = np.round(speed / sensor.odometer_step_mps) * sensor.odometer_step_mps
    latency_ns = round(sensor.latency_ms * 1e6)
    return tuple(
        EgoMotion(
            sensor=name,
            seq=i,
            stamp_ns=int(t),
            arrival_ns=int(t) + latency_ns,
            velocity_mps=np.array([speed[i], 0.0, 0.0]),
            rate_radps=rate[i],
        )
        for i, t in enumerate(t_ns)
    )
