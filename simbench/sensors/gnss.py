"""RTK receivers on ego and target: the paper's reference, as one more sensor that can be off.

Per pass each receiver has a constant bias and each fix white noise (per horizontal axis and height); antennas
sit a lever arm away from what they stand for; the world-frame difference is turned into the ego frame by a
measured heading. Between fixes the last one holds (zero-order hold, as in the paper).
"""

from __future__ import annotations

import numpy as np

from scenarios.scenario import GnssSensor
from simbench.motion import Motion
from simbench.sensors.clock import ticks_ns
from simbench.truth import GnssReference


def reference(
    sensor: GnssSensor, ego_antenna_m: np.ndarray, motion: Motion, target_id: int, end_ns: int,
    rng: np.random.Generator, phase_ns: int,
) -> GnssReference:  # fmt: skip
    """Fixes from `phase_ns` to `end_ns` of the target relative to the ego, with the parts of their error.
    `ego_antenna_m` [3]: in the ego frame."""
    fix_ns = ticks_ns(sensor.rate_hz, phase_ns, end_ns)
    n = len(fix_ns)
    heading_error = np.deg2rad(sensor.heading_deg) * rng.standard_normal()
    bias = sensor.bias_m * rng.standard_normal((2, 1, 3))
    error_world = bias + sensor.noise_m * rng.standard_normal((2, n, 3))
    R_script, p_script = motion.ego(fix_ns)
    R_body, p_body = motion.shaken_ego(fix_ns)
    R_target, p_target = motion.object_centre(target_id, fix_ns)
    ego_arm = p_body + R_body @ ego_antenna_m - p_script
    target_arm = R_target @ np.asarray(sensor.target_lever_m)

    def into_ego(world: np.ndarray) -> np.ndarray:
        turned: np.ndarray = np.einsum("nji,nj->ni", R_script, world)
        return turned

    centre = into_ego(p_target - p_script)
    lever = into_ego(target_arm - ego_arm)
    noise = into_ego(error_world[0] - error_world[1])
    # The difference is turned into the ego frame with a heading that is too large by the error.
    c, s = np.cos(heading_error), np.sin(heading_error)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    straight = centre + lever + noise
    position = straight @ turn.T
    return GnssReference(
        fix_ns=fix_ns,
        available_ns=fix_ns + round(sensor.latency_ms * 1e6),
        position_ego_m=position,
        centre_ego_m=centre,
        lever_m=lever,
        heading_m=position - straight,
        noise_m=noise,
    )
