"""When every sensor measures, what its stamps claim, and when the host has it: one clock for all.

True time in integer nanoseconds; 0 is the first firing of the LiDAR's first sweep. Faults come on top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.scenario import CameraSensor, ends

BEHIND_NS = 1_000  # one that catches up with the one before comes this much later


@dataclass(frozen=True, kw_only=True)
class CameraTiming:
    """All exposures of one camera in a run [f], without faults: true times, but for `stamp_ns`.

    mid_ns: the middle of the middle row's exposure. start_ns: the first row starts. stamp_ns: what the image
    claims. host_ns: the host has the image. arrival_ns: its detections are delivered.
    Row r of h is exposed for `exposure_ns` around mid_ns + (r - (h - 1) / 2) * line_delay_ns.
    """

    mid_ns: Int64[np.ndarray, " f"]
    start_ns: Int64[np.ndarray, " f"]
    stamp_ns: Int64[np.ndarray, " f"]
    host_ns: Int64[np.ndarray, " f"]
    arrival_ns: Int64[np.ndarray, " f"]
    exposure_ns: int
    line_delay_ns: float  # 0 for a global shutter

    def row_mid_ns(self, frame: int, rows: int) -> Float64[np.ndarray, " {rows}"]:
        """The middle of every row's exposure of one frame, top row first."""
        middle: np.ndarray = self.mid_ns[frame] + (np.arange(rows) - 0.5 * (rows - 1)) * self.line_delay_ns
        return middle


def camera_timing(
    sensor: CameraSensor, first_ns: int, period_ns: int, frames: int, rng: np.random.Generator
) -> CameraTiming:
    """Exposures of a camera whose first starts at `first_ns`. `rng` draws the host's delays, the same number
    whatever the sensor is."""
    start = first_ns + period_ns * np.arange(frames, dtype=np.int64)
    open_ns, readout_ns = round(sensor.exposure_ms * 1e6), round(sensor.readout_ms * 1e6)
    mid = start + (open_ns + readout_ns) // 2
    read = start + open_ns + readout_ns
    host = _at_host_ns(sensor, mid, rng) if sensor.stamp == "arrival" else read
    claimed = {
        "trigger": start - round(sensor.delay_ms * 1e6),
        "exposure_start": start,
        "mid_exposure": mid,
        "end_of_readout": read,
        "arrival": host,
    }
    return CameraTiming(
        mid_ns=mid,
        start_ns=start,
        stamp_ns=claimed[sensor.stamp],
        host_ns=host,
        arrival_ns=host + round(sensor.latency_ms * 1e6),
        exposure_ns=open_ns,
        line_delay_ns=readout_ns / max(sensor.height_px - 1, 1),
    )


def _at_host_ns(
    sensor: CameraSensor, mid_ns: Int64[np.ndarray, " f"], rng: np.random.Generator
) -> Int64[np.ndarray, " f"]:
    """When the host has each image: a delay of the run and a wait of the frame, in order, as a queue does."""
    delay_ms = rng.uniform(*ends(sensor.stamp_delay_ms))
    wait_ms = rng.uniform(*ends(sensor.stamp_jitter_ms)) * rng.standard_exponential(len(mid_ns))
    alone = mid_ns + np.round((delay_ms + wait_ms) * 1e6).astype(np.int64)
    return queued_ns(alone)


def queued_ns(at_ns: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """The same instants, none before the one ahead of it."""
    behind = BEHIND_NS * np.arange(len(at_ns))
    queue: np.ndarray = np.maximum.accumulate(at_ns - behind) + behind
    return queue


def drawn_ns(value_ms: float | tuple[float, float], rng: np.random.Generator) -> int:
    """A declared number of milliseconds, drawn where it is low and high."""
    return round(float(rng.uniform(*ends(value_ms))) * 1e6)


def ticks_ns(rate_hz: float, phase_ns: int, end_ns: int) -> Int64[np.ndarray, " n"]:
    """The instants of a sensor with a steady rate, from its first at `phase_ns` to `end_ns` inclusive."""
    return np.arange(phase_ns, end_ns + 1, round(1e9 / rate_hz), dtype=np.int64)


def newest_tick_ns(rate_hz: float, phase_ns: int, t_ns: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """The newest instant of such a sensor that is not after each t. It has always been running."""
    period_ns = round(1e9 / rate_hz)
    newest: np.ndarray = phase_ns + (t_ns - phase_ns) // period_ns * period_ns
    return newest
