"""motion.vibration_deg and motion.flex_deg: scripted shake of the body, and of each sensor's bracket.

Vibration: roll, pitch, yaw and heave of the ego's body, each a sum of sinusoids whose density is resonances
(a second-order mode's |H|^2) over band noise falling with 1/f^2; rescaled so that this run's RMS about its
straight-line fit is the request. Flex: roll, pitch, yaw of one bracket, one mode drawn per bracket and axis.
Receipts: gyro (and camera heights) for the body; attitude (a camera's by PnP, the LiDAR's by
plates) less the gyro's for the brackets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial.transform import Rotation

from scenarios.faults import Flex, Vibration
from scenarios.seeding import stream
from scenarios.severity import Profile, road_class
from simbench.faults.estimate import (
    BodyAttitude,
    PoseEvidence,
    bracket_turn_rad,
    detrended,
    gain,
    lever_shift_m,
    others_of,
)
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.shake import BodyShake, Shake, draw_shake

VIBRATION, FLEX = "motion.vibration_deg", "motion.flex_deg"
NOTE = "{} attitude by {} less the body's by gyro"
PNP_DEG = 1e-4
TO_DEG_AND_M = np.array([np.rad2deg(1.0)] * 3 + [1.0])
AXES = (  # of a body shake: name, unit, what measures it
    ("roll", "deg", "integrated gyro"),
    ("pitch", "deg", "integrated gyro"),
    ("yaw", "deg", "integrated gyro"),
    ("heave", "m", "camera heights by PnP"),
)
LINES = 64  # sinusoids per axis
# Modes per axis (roll, pitch, yaw, heave): (frequency Hz, damping ratio, share of the power). Car: sprung-
# mass modes and wheel hop, so that rate RMS / angle RMS is about 8 1/s as computed for road classes A-E;
# rider: torso sway below 1.5 Hz and a little of the deck's 4-20 Hz [judgement].
MODES: Mapping[str, tuple[tuple[tuple[float, float, float], ...], ...]] = {
    "car": (
        ((1.5, 0.25, 0.99), (11.0, 0.10, 0.01)),
        ((1.3, 0.25, 0.99), (11.0, 0.10, 0.01)),
        ((0.9, 0.30, 1.00),),
        ((1.3, 0.25, 0.98), (11.0, 0.10, 0.02)),
    ),
    "rider": (
        ((0.6, 0.25, 0.97), (7.0, 0.20, 0.03)),
        ((0.8, 0.25, 0.97), (8.0, 0.20, 0.03)),
        ((0.5, 0.25, 0.98), (5.0, 0.20, 0.02)),
        ((1.5, 0.25, 0.95), (8.0, 0.20, 0.05)),
    ),
}
BAND_HZ: Mapping[str, tuple[float, float]] = {"car": (0.5, 20.0), "rider": (0.3, 20.0)}
BAND_NOISE_SHARE = 0.03


def describe_shake(shake: Shake, profile: Profile, duration_s: float) -> str:
    """One sentence on what a scripted shake is in the world: size, rate, band and the road that gives it."""
    road = road_class(float(np.rad2deg(shake.rms(duration_s)[1])), profile)
    source = road if road.startswith("beyond") else f"ISO 8608 road class {road} on this vehicle"
    return shake_sizes(shake, BAND_HZ[profile], duration_s) + f": {source}"


def shake_sizes(shake: BodyShake, band_hz: tuple[float, float], duration_s: float) -> str:
    """Sizes, rate and band of a body shake in words."""
    rms, rate = np.rad2deg(shake.rms(duration_s)), np.rad2deg(shake.rate_rms(duration_s))
    return (
        f"pitch {rms[1]:.2f} deg RMS ({rate[1]:.1f} deg/s), roll {rms[0]:.2f}, yaw {rms[2]:.2f} deg, heave "
        f"{shake.rms(duration_s)[3] * 1e3:.0f} mm, {band_hz[0]:g}-{band_hz[1]:g} Hz"
    )


def mode_density(
    frequency_hz: Float64[np.ndarray, " k"], mode: tuple[float, float, float]
) -> Float64[np.ndarray, " k"]:
    natural, damping, share = mode
    ratio = frequency_hz / natural
    response = 1.0 / ((1.0 - ratio**2) ** 2 + (2.0 * damping * ratio) ** 2)
    density: np.ndarray = share * response / np.trapezoid(response, frequency_hz)
    return density


def body_shake(spec: Vibration, profile: Profile, duration_s: float, seed: int) -> Shake:
    """(roll, pitch, yaw in rad, heave in m) of the body. `profile`: car or rider."""
    low, high = BAND_HZ[profile]
    rng = stream(seed, "fault", VIBRATION)
    edges = np.geomspace(low, high, LINES + 1)
    frequency = edges[:-1] + np.diff(edges) * rng.uniform(0.0, 1.0, LINES)
    noise = frequency**-2.0
    noise = noise / np.trapezoid(noise, frequency)
    density = np.stack(
        [
            (1.0 - BAND_NOISE_SHARE) * sum(mode_density(frequency, m) for m in modes)
            + BAND_NOISE_SHARE * noise
            for modes in MODES[profile]
        ]
    )
    return draw_shake(rng, frequency, density, requested_rms(spec), duration_s)


def requested_rms(spec: Vibration) -> Float64[np.ndarray, "4"]:
    """RMS of roll, pitch, yaw in rad and heave in m."""
    pitch = np.deg2rad(spec.rms_deg)
    heave = spec.rms_deg * spec.heave_m_per_deg
    return np.array([pitch * spec.roll_ratio, pitch, pitch * spec.yaw_ratio, heave])


def bracket_shake(spec: Flex, sensor: str, duration_s: float, seed: int) -> Shake:
    """(roll, pitch, yaw in rad) of one sensor's bracket."""
    low, high = {"stiff": (20.0, 60.0), "soft": (8.0, 20.0)}[spec.stiffness]
    rng = stream(seed, "fault", FLEX, sensor)
    edges = np.geomspace(0.5 * low, 2.0 * high, LINES + 1)
    frequency = edges[:-1] + np.diff(edges) * rng.uniform(0.0, 1.0, LINES)
    density = np.stack([mode_density(frequency, (rng.uniform(low, high), 0.05, 1.0)) for _ in range(3)])
    return draw_shake(rng, frequency, density, np.full(3, np.deg2rad(spec.rms_deg)), duration_s)


def shake_receipts(
    fault: str,
    asked_rms: Float64[np.ndarray, "4"],
    realised: BodyShake | None,
    duration_s: float,
    body: BodyAttitude | None,
    evidence: Sequence[PoseEvidence],
    *,
    allowed: float = 0.01,
) -> tuple[Receipt, ...]:
    """What was asked for (RMS of roll, pitch, yaw in rad and heave in m), drawn and found, wherever something
    was asked for or drawn. allowed: share of the request by which the draw may differ."""
    asked = asked_rms * TO_DEG_AND_M
    least = 1e-6 * float(asked.max())  # what is left of an axis by rounding was not asked for
    drawn = drawn_rms(realised, duration_s)
    found = found_rms(realised, duration_s, body, evidence)
    return tuple(
        judge(
            fault=fault,
            quantity=f"{name} RMS",
            unit=unit,
            requested=float(asked[axis]),
            realised=float(drawn[axis]),
            measured=found[axis].value,
            estimator_sd=found[axis].sd,
            systematic=found[axis].systematic,
            allowed=allowed * float(asked[axis]),
            note=note,
        )
        for axis, (name, unit, note) in enumerate(AXES)
        if max(asked[axis], drawn[axis]) > least
    )


def drawn_rms(realised: BodyShake | None, duration_s: float) -> Float64[np.ndarray, "4"]:
    """RMS of roll, pitch, yaw in degrees and heave in metres; 0 where nothing was drawn."""
    rms: np.ndarray = np.zeros(4) if realised is None else realised.rms(duration_s) * TO_DEG_AND_M
    return rms


@dataclass(frozen=True, kw_only=True)
class Found:
    """An RMS, what it errs by at random (1 SD), and what else at most; None without the sensors for it."""

    value: float | None = None
    sd: float = 0.0
    systematic: float = 0.0


def found_rms(
    realised: BodyShake | None,
    duration_s: float,
    body: BodyAttitude | None,
    evidence: Sequence[PoseEvidence],
) -> list[Found]:
    """Of roll, pitch, yaw in degrees and heave in metres.

    Roll, pitch and yaw by the integrated gyro; heave, which no gyro sees, by the cameras' height (PnP) less
    what their lever arm explains. Each is how often the drawn shake is contained in what was measured, times
    its RMS: signed, and near 0 when something else shook.
    """
    drawn = drawn_rms(realised, duration_s)
    found = [Found()] * 4
    if body is not None:
        inside = (body.stamp_ns >= 0) & (body.stamp_ns < duration_s * 1e9)
        t_ns = body.stamp_ns[inside]
        expected = np.zeros_like(body.angle_rad) if realised is None else body.expected_rad(realised)
        signal, angle = body.seen(expected[inside], t_ns), body.seen(body.angle_rad[inside], t_ns)
        for axis in range(3):
            one = signal[:, axis : axis + 1]
            still = drawn[axis] == 0.0 or not np.any(one)
            found[axis] = Found(
                value=_contained(angle[:, axis], signal[:, axis], drawn[axis], TO_DEG_AND_M[axis]),
                sd=float(np.rad2deg(body.sd_rad)) if still else float(drawn[axis]) * body.gain_sd(one, t_ns),
                systematic=body.noise.biased_share() * float(drawn[:3].max()),
            )
    if evidence:
        height = np.concatenate([detrended(e.shift_m[:, 2:] - lever_shift_m(e)[:, 2:]) for e in evidence])
        signal = np.concatenate([detrended(_at(realised, e.taken_ns)[:, 3:]) for e in evidence])
        found[3] = Found(
            value=_contained(height, signal, drawn[3], 1.0), systematic=_most_bent_m(evidence, body)
        )
    return found


def _at(shake: BodyShake | None, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 4"]:
    return np.zeros((len(t_ns), 4)) if shake is None else shake.at(t_ns)


def _contained(found: np.ndarray, drawn: np.ndarray, rms: float, scale: float) -> float:
    """The RMS of what is found along the drawn signal, signed; of all that is found where nothing was
    drawn.
    """
    if rms == 0.0 or not np.any(drawn):
        return scale * float(np.std(found))
    return rms * gain(found, drawn)


def _seen(
    turn_rad: Float64[np.ndarray, "f 3"], item: PoseEvidence, body: BodyAttitude | None
) -> Float64[np.ndarray, "f 3"]:
    return detrended(turn_rad) if body is None else body.seen(turn_rad, item.taken_ns)


def _most_bent_m(evidence: Sequence[PoseEvidence], body: BodyAttitude | None) -> float:
    """A bracket that bends is taken for a turn of the body: its bending times the lever arm, over all
    frames, five times.
    """
    floor_m = 1e-4
    errors = []
    for item in evidence:
        bending = item.turn_rad if body is None else bracket_turn_rad(item, body)
        arm_m = float(np.linalg.norm((item.position_ego_m - item.pivot_ego_m)[:2]))
        errors.append(arm_m * float(detrended(bending).std(axis=0).max()))
    return 5.0 * (floor_m + float(np.sqrt(np.mean(np.square(errors)) / sum(e.frames for e in evidence))))


def _turns_rad(shake: Shake, item: PoseEvidence) -> Float64[np.ndarray, "f 3"]:
    """As rotation vectors, which is what PnP is told in."""
    turns: np.ndarray = Rotation.from_euler("xyz", shake.at(item.taken_ns)[:, :3]).as_rotvec()
    return turns


def _bracket_sd_deg(
    rms_deg: float, drawn_rad: Float64[np.ndarray, "f 3"], item: PoseEvidence, body: BodyAttitude | None
) -> float:
    """Of an RMS over three axes: PnP on known points is exact, the gyro is not."""
    if body is None:
        return 0.0
    if not np.any(drawn_rad):
        return float(np.rad2deg(body.sd_rad))
    return rms_deg * body.gain_sd(drawn_rad, item.taken_ns)


def flex_receipts(
    spec: Flex,
    cameras: Sequence[str],
    realised: Mapping[str, Shake],
    duration_s: float,
    evidence: Sequence[PoseEvidence],
    body: BodyAttitude | None,
) -> tuple[Receipt, ...]:
    """Per struck sensor: how often the drawn bending is contained in its attitude against the body's
    (gyro), times its RMS over all axes. Where the fault names cameras: that the others do not bend.
    """
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    for item in evidence:
        bending = _seen(item.turn_rad if body is None else bracket_turn_rad(item, body), item, body)
        # What the gyro leaves of the body's shake: it is sampled, and turns about several axes do not
        # commute.
        left = 0.02 * float(bending.std()) if body is None else body.rms_rad * (0.005 + 0.5 * body.rms_rad)
        left_deg = float(np.rad2deg(left))
        if item.sensor not in cameras:
            noise_deg = 0.0 if body is None else float(np.rad2deg(body.sd_rad))
            others.append((float(np.rad2deg(np.std(bending))), 0.002 + left_deg + noise_deg))
            continue
        shake = realised.get(item.sensor)
        rms = 0.0 if shake is None else float(np.rad2deg(np.sqrt(np.mean(shake.rms(duration_s) ** 2))))
        drawn = np.zeros_like(bending) if shake is None else _seen(_turns_rad(shake, item), item, body)
        result.append(
            judge(
                fault=FLEX,
                quantity=f"{item.sensor} bracket RMS",
                unit="deg",
                requested=spec.rms_deg,
                realised=rms,
                measured=_contained(bending, drawn, rms, float(np.rad2deg(1.0))),
                estimator_sd=_bracket_sd_deg(rms, drawn, item, body),
                # Turns of body and bracket do not commute; nothing else errs where no gyro is needed.
                systematic=PNP_DEG
                + 5.0 * left_deg / np.sqrt(item.frames)
                + (0.0 if body is None else body.rms_rad * rms),
                allowed=0.01 * spec.rms_deg,
                note=NOTE.format(item.kind, item.by),
            )
        )
    called, by = others_of(evidence, cameras)
    result += untouched(
        fault=FLEX, quantity=f"bending of the other {called}", unit="deg", found=others,
        note=NOTE.format(called.removesuffix("s"), by),
    )  # fmt: skip
    return tuple(result)
