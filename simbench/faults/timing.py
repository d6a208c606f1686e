"""timing.trigger_offset_ms: the camera exposes later while its stamp keeps the nominal time.

delay[f] = offset + jitter * N(0, 1), per camera and frame. Fusion cannot know it: the paper's synchronisation
error. Receipt: the delay from where the camera was (PnP on known points) along the driven path, divided by
speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.faults import TriggerOffset
from scenarios.seeding import stream
from simbench.faults.estimate import BodyAttitude, PoseEvidence, SlowEgo, capture_delay_ms, gain
from simbench.faults.receipt import Receipt, judge, untouched

KEY = "timing.trigger_offset_ms"
FLOOR_MS = 0.02  # of one estimate: PnP and a speed that changes during the delay
NOTE = "camera positions by PnP, along the path"


def delays_ns(spec: TriggerOffset, camera: str, frames: int, seed: int) -> Int64[np.ndarray, " f"]:
    """How much later than nominal each frame of one camera is taken."""
    draw = stream(seed, "fault", KEY, camera).standard_normal(frames)
    delays: np.ndarray = np.round((spec.offset_ms + spec.jitter_ms * draw) * 1e6).astype(np.int64)
    return delays


def receipts(
    spec: TriggerOffset,
    cameras: Sequence[str],
    realised_ns: Mapping[str, Int64[np.ndarray, " f"]],
    evidence: Sequence[PoseEvidence],
    body: BodyAttitude | None,
) -> tuple[Receipt, ...]:
    """Per struck camera the mean delay and, where there is jitter, its SD, found frame by frame. Where the
    fault names cameras: that the others are on time.
    """
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    for item in evidence:
        struck = item.sensor in cameras
        drawn_ms = realised_ns.get(item.sensor, np.zeros(item.frames, dtype=np.int64)) * 1e-6
        try:
            found_ms, one_sd_ms = capture_delay_ms(item, body)
        except SlowEgo as why:
            if struck:
                result += _of_one(spec, item.sensor, drawn_ms, None, 0.0, str(why))
            continue
        if struck:
            result += _of_one(spec, item.sensor, drawn_ms, found_ms, one_sd_ms, NOTE)
        else:
            others.append((float(np.abs(found_ms).max()), max(one_sd_ms, FLOOR_MS)))
    result += untouched(fault=KEY, quantity="delay of the other cameras", unit="ms", found=others, note=NOTE)
    return tuple(result)


def _of_one(
    spec: TriggerOffset,
    camera: str,
    drawn_ms: Float64[np.ndarray, " f"],
    found_ms: Float64[np.ndarray, " f"] | None,
    one_sd_ms: float,
    note: str,
) -> tuple[Receipt, ...]:
    n = len(drawn_ms)
    sd_ms = max(one_sd_ms / np.sqrt(n), FLOOR_MS)
    offset = judge(
        fault=KEY,
        quantity=f"{camera} mean delay",
        unit="ms",
        requested=spec.offset_ms,
        realised=float(np.mean(drawn_ms)),
        measured=None if found_ms is None else float(np.mean(found_ms)),
        systematic=5.0 * sd_ms,
        allowed=max(0.01 * abs(spec.offset_ms), 0.1) + 5.0 * spec.jitter_ms / np.sqrt(n),
        note=note,
    )
    if spec.jitter_ms == 0.0:
        return (offset,)
    spread_ms = float(np.std(drawn_ms))
    about_mean = drawn_ms - drawn_ms.mean()
    jitter = judge(
        fault=KEY,
        quantity=f"{camera} jitter (SD)",
        unit="ms",
        requested=spec.jitter_ms,
        realised=spread_ms,
        measured=None if found_ms is None else spread_ms * gain(found_ms - found_ms.mean(), about_mean),
        systematic=5.0 * sd_ms,
        allowed=5.0 * spec.jitter_ms / np.sqrt(2.0 * n),
        note=note,
    )
    return offset, jitter
