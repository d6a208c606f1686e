"""Independent estimates of what the sensors and the body really did, from what the sensors put out.

Each camera sees known points (see `sensors/fiducials.py`); OpenCV's PnP gives its pose, which is compared
with the pose that script and rest calibration predict. Of the LiDAR see `lidar_pose.py`. The gyro gives the
body's attitude. None of this shares code with an injector; a drawn signal enters only as what a measurement
is correlated with (`gain`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64, Int64

from fusion.camera import PinholeCamera
from fusion.geometry import skew
from fusion.messages import EgoMotion
from scenarios.scenario import ImuSensor
from simbench.faults.gyro import GyroNoise, ideal_rates_radps
from simbench.shake import BodyShake

SLOWEST_MPS = 0.5
PNP, PLATES = "PnP", "plates"
ROUNDS = 6  # of integrating the gyro: a swing of 1 rad leaves 1/720
LEAST_TURN_RAD = 1e-3  # of the heading: less turns no tilt into anything


class SlowEgo(Exception):  # noqa: N818 (a reason for a receipt, not a failure)
    """The ego is too slow for a delay to show."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseEvidence:
    """One sensor over the run: its pose as known points show it, against the one that the script predicts for
    it at rest on its mount.

    by: what found it, in words. taken_ns: when a picture was really taken, a beam was fired. turn_rad [f 3]:
    attitude against the predicted one at that instant, as a rotation vector in ego axes. shift_m [f 3]:
    position against the predicted one at the *claimed* mid-exposure, in ego axes. position_ego_m: at rest.
    pivot_ego_m: about what the body shakes. speed_mps [f]: of the ego by script.
    """

    sensor: str
    by: str
    taken_ns: Int64[np.ndarray, " f"]
    turn_rad: Float64[np.ndarray, "f 3"]
    shift_m: Float64[np.ndarray, "f 3"]
    position_ego_m: Float64[np.ndarray, "3"]
    pivot_ego_m: Float64[np.ndarray, "3"]
    speed_mps: Float64[np.ndarray, " f"]

    @property
    def kind(self) -> str:
        """Camera or LiDAR."""
        return "camera" if self.by == PNP else "LiDAR"

    @property
    def frames(self) -> int:
        return len(self.taken_ns)


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyAttitude:
    """The body's attitude by the gyro: small angles about the ego's axes, [n 3] in rad, less what the script
    turns and less its straight-line fit. `yaw_rad` [n]: the heading that the script turns to. `sd_rad`: what
    the gyro's own noise adds (1 SD). `noise`: that of its rates.
    """

    stamp_ns: Int64[np.ndarray, " n"]
    angle_rad: Float64[np.ndarray, "n 3"]
    yaw_rad: Float64[np.ndarray, " n"]
    sd_rad: float
    noise: GyroNoise

    @property
    def period_s(self) -> float:
        """Between two samples."""
        return float(self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9 / max(len(self.stamp_ns) - 1, 1)

    def expected_rad(self, shake: BodyShake) -> Float64[np.ndarray, "n 3"]:
        """The angles that this gyro would give without noise on a body that shakes so."""
        rates = ideal_rates_radps(shake, self.yaw_rad, self.stamp_ns)
        return integrated_rad(rates, self.yaw_rad, self.stamp_ns)

    def gain_sd(self, drawn_rad: Float64[np.ndarray, "f a"], t_ns: Int64[np.ndarray, " f"]) -> float:
        """1 SD of how often angles at t_ns (as `seen`) are found in this attitude, by the gyro's noise; inf
        where none are drawn."""
        power = float(np.sum(drawn_rad**2))
        if power == 0.0:
            return float("inf")
        place = np.interp(t_ns, self.stamp_ns, np.arange(len(self.stamp_ns)))
        left = np.minimum(place.astype(np.int64), len(self.stamp_ns) - 2)
        beyond = (place - left)[:, None]
        weight = np.zeros((len(self.stamp_ns), drawn_rad.shape[1]))
        np.add.at(weight, left, (1.0 - beyond) * drawn_rad)
        np.add.at(weight, left + 1, beyond * drawn_rad)
        return self.noise.sum_sd(weight, self.period_s) / power

    @property
    def rms_rad(self) -> float:
        """Of the worst axis."""
        return float(self.angle_rad.std(axis=0).max())

    def at(self, t_ns: Int64[np.ndarray, " f"]) -> Float64[np.ndarray, "f 3"]:
        """Interpolated linearly."""
        return np.stack([np.interp(t_ns, self.stamp_ns, self.angle_rad[:, a]) for a in range(3)], axis=1)

    def seen(
        self, value: Float64[np.ndarray, "f a"], t_ns: Int64[np.ndarray, " f"]
    ) -> Float64[np.ndarray, "f a"]:
        """What of angles at t_ns a gyro can see. It knows neither their mean nor their trend c0 + c1 t; and
        where the heading psi turns, a body that is tilted by these turns them into roll and pitch, by
        c0 psi + c1 int t dpsi. All four are fitted and taken off; measured and drawn angles alike.
        """
        t = np.linspace(-1.0, 1.0, len(t_ns))
        psi = np.interp(t_ns, self.stamp_ns, self.yaw_rad)
        turned = np.concatenate([[0.0], np.cumsum(0.5 * (t[1:] + t[:-1]) * np.diff(psi))])
        unseen = np.stack([np.ones_like(t), t, psi - psi.mean(), turned - turned.mean()], axis=1)
        unseen = unseen[:, [True, True, *(np.ptp(unseen[:, 2:], axis=0) > LEAST_TURN_RAD)]]
        rest: np.ndarray = value - unseen @ np.linalg.lstsq(unseen, value, rcond=None)[0]
        return rest


def others_of(evidence: Sequence[PoseEvidence], struck: Sequence[str]) -> tuple[str, str]:
    """What the sensors are called that a fault must leave alone, and what measured them."""
    by = sorted({item.by for item in evidence if item.sensor not in struck})
    return "cameras" if by == [PNP] else "sensors", " and ".join(by)


def camera_pose(
    xyz_world_m: Float64[np.ndarray, "m 3"], uv_px: Float64[np.ndarray, "m 2"], camera: PinholeCamera
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"]]:
    """T_world_camera (rotation, position) from known points, by cv2.solvePnP. ValueError when it fails."""
    origin = xyz_world_m.mean(axis=0)
    lens = np.array(camera.distortion)
    good, rotvec, shift = cv2.solvePnP(
        xyz_world_m - origin, uv_px, camera.matrix, lens, flags=cv2.SOLVEPNP_SQPNP
    )
    if not good:
        raise ValueError("PnP found no pose")
    rotvec, shift = cv2.solvePnPRefineLM(xyz_world_m - origin, uv_px, camera.matrix, lens, rotvec, shift)
    rotation = np.asarray(cv2.Rodrigues(rotvec)[0], dtype=np.float64).T
    return rotation, origin - rotation @ np.asarray(shift, dtype=np.float64)[:, 0]


def detrended(value: Float64[np.ndarray, "n a"]) -> Float64[np.ndarray, "n a"]:
    """The rows less their straight-line fit."""
    t = np.linspace(-1.0, 1.0, len(value))[:, None]
    mean = value.mean(axis=0)
    slope = (t * (value - mean)).sum(axis=0) / (t**2).sum()
    rest: np.ndarray = value - mean - slope * t
    return rest


def gain(found: np.ndarray, drawn: np.ndarray) -> float:
    """How often `drawn` is contained in `found` (least squares): 1 when the data hold what was drawn,
    negative when they hold its opposite, near 0 when they hold something else. Nothing drawn: 0 where nothing
    is found, else inf.
    """
    power = float(np.sum(drawn**2))
    if power == 0.0:
        return float("inf") if np.any(found != 0.0) else 0.0
    return float(np.sum(found * drawn)) / power


def gyro_attitude(
    messages: Sequence[EgoMotion],
    scripted_yaw_rad: Float64[np.ndarray, " n"],
    sensor: ImuSensor,
) -> BodyAttitude:
    """Integrate the gyro. scripted_yaw_rad: heading of the script at the messages' stamps."""
    stamp = np.array([m.stamp_ns for m in messages], dtype=np.int64)
    yaw = np.unwrap(scripted_yaw_rad)
    angle = integrated_rad(np.stack([m.rate_radps for m in messages]), yaw, stamp)
    # White noise of the rate integrates to a random walk, about its straight line 0.26 of the end's SD on
    # average.
    span_s = float(stamp[-1] - stamp[0]) * 1e-9
    walk = np.deg2rad(sensor.gyro_noise_dps_rthz) * np.sqrt(0.5 * span_s)
    noise = GyroNoise.of(sensor, span_s / (len(stamp) - 1))
    return BodyAttitude(stamp_ns=stamp, angle_rad=angle, yaw_rad=yaw, sd_rad=float(0.26 * walk), noise=noise)


def integrated_rad(
    rate_radps: Float64[np.ndarray, "n 3"],
    yaw_rad: Float64[np.ndarray, " n"],
    stamp_ns: Int64[np.ndarray, " n"],
) -> Float64[np.ndarray, "n 3"]:
    """Small angles about the ego's axes, less the script's heading and a straight line.

    A body that rolls and pitches reads a part of its pitch rate as yaw and so on; to first order of the
    angles (p + r pitch, q - r roll, r + q roll) this is undone. The angles are those sought: from round to
    round they err by the next power of the heading's swing over its factorial.
    """
    step_s = np.diff(stamp_ns)[:, None] * 1e-9

    def summed(rate: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        steps = 0.5 * (rate[1:] + rate[:-1]) * step_s
        angle = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        angle[:, 2] -= yaw_rad
        return detrended(angle)

    angle, (_, q, r) = summed(rate_radps), rate_radps.T
    for _ in range(ROUNDS):
        roll, pitch, _ = angle.T
        angle = summed(rate_radps + np.stack([r * pitch, -r * roll, q * roll], axis=1))
    return angle


def lever_shift_m(item: PoseEvidence) -> Float64[np.ndarray, "f 3"]:
    """How the body's turn about its pivot moves the sensor, to second order of the turn."""
    arm = item.position_ego_m - item.pivot_ego_m
    moved = []
    for turn in item.turn_rad:
        k = skew(turn)
        moved.append((k + 0.5 * k @ k) @ arm)
    return np.array(moved)


def bracket_turn_rad(item: PoseEvidence, body: BodyAttitude) -> Float64[np.ndarray, "f 3"]:
    """Attitude of the sensor against the body. The shake's own mean and trend over the run, which no gyro
    sees, are still in it.
    """
    turn: np.ndarray = item.turn_rad - body.at(item.taken_ns)
    return turn


def capture_delay_ms(
    item: PoseEvidence, body: BodyAttitude | None
) -> tuple[Float64[np.ndarray, " f"], float]:
    """Delay of each frame from the shift along the path, and the SD of one estimate: the bracket's own
    bending is taken for a turn of the body, which has a lever arm. Raises SlowEgo.
    """
    if item.speed_mps.min() < SLOWEST_MPS:
        raise SlowEgo(f"the ego drives {item.speed_mps.min():.2f} m/s, too slow for a delay to show")
    arm_m = float(np.linalg.norm(item.position_ego_m - item.pivot_ego_m))
    bending = item.turn_rad if body is None else bracket_turn_rad(item, body)
    noise_m = 1.5 * arm_m * float(detrended(bending).std(axis=0).max())
    along_m = item.shift_m[:, 0] - lever_shift_m(item)[:, 0]
    return 1e3 * along_m / item.speed_mps, 1e3 * noise_m / float(item.speed_mps.mean())
