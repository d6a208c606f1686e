"""What a drive must hold to be kept: `visible_frames>=0.5` and the like, measured on its truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.errors import Where
from simbench.recording import Recording
from simbench.score.frames import frames_of
from simbench.score.pairs import MIN_VISIBLE_FRACTION

OPTION = "--require"
MEASURES: Mapping[str, str] = {
    "visible_frames": f"share of sweeps in whose images the target is visible to {MIN_VISIBLE_FRACTION:g}",
    "points": "median number of its points in a sweep",
    "nearest_m": "its smallest planar distance from the LiDAR, centre of its box",
    "farthest_m": "its largest",
}


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """One bound on a measure. at_least: the value is a lower bound, else an upper one."""

    measure: str
    at_least: bool
    value: float

    def __str__(self) -> str:
        return f"{self.measure}{'>=' if self.at_least else '<='}{self.value:g}"


def parse_requirement(text: str) -> Requirement:
    """Of `NAME>=VALUE` or `NAME<=VALUE`. BadInput: it is neither, or the name is unknown."""
    where = Where(file=OPTION)
    for sign in (">=", "<="):
        name, found, value = (part.strip() for part in text.partition(sign))
        if not found:
            continue
        if name not in MEASURES:
            raise where.unknown("measure", name, tuple(MEASURES))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise where.error(f"'{value}' is no number", (name,))
        return Requirement(measure=name, at_least=sign == ">=", value=number)
    raise where.error(f"'{text}' is no bound", allowed="NAME>=VALUE or NAME<=VALUE")


def missed(required: Sequence[Requirement], recording: Recording) -> str | None:
    """The first bound that a recording does not hold, with what was measured; None: it holds all."""
    if not required:
        return None
    if recording.truth.target_id is None:
        return "there is no target"
    for one in required:
        value = _MEASURED[one.measure](recording)
        if not (value >= one.value if one.at_least else value <= one.value):
            return f"{one}: {value:.3g}"
    return None


def _visible_frames(recording: Recording) -> float:
    frames, target = frames_of(recording), recording.truth.target_id
    seen = [
        any(
            box.object_id == target and box.visible_fraction >= MIN_VISIBLE_FRACTION
            for view in frame.views.values()
            for box in view.truth.boxes
        )
        for frame in frames
    ]
    return float(np.mean(seen)) if seen else math.nan


def _points(recording: Recording) -> float:
    target = recording.truth.target_id
    counts = [int((scan.object_id == target).sum()) for scan in recording.truth.scans]
    return float(np.median(counts)) if counts else math.nan


def _ranges_m(recording: Recording) -> np.ndarray:
    truth = recording.truth
    assert truth.target_id is not None
    scans = sorted((int(s.fire_ns.min()), s.sensor) for s in truth.scans if len(s.fire_ns))
    if not scans:
        return np.array([np.nan])
    t_ns = np.array([t for t, _ in scans], dtype=np.int64)
    _, lidar_m = truth.poses.sensor(scans[0][1], t_ns)
    _, centre_m = truth.poses.object_centre(truth.target_id, t_ns)
    found: np.ndarray = np.hypot(*(centre_m - lidar_m)[:, :2].T)
    return found


_MEASURED: Mapping[str, Callable[[Recording], float]] = {
    "visible_frames": _visible_frames,
    "points": _points,
    "nearest_m": lambda recording: float(_ranges_m(recording).min()),
    "farthest_m": lambda recording: float(_ranges_m(recording).max()),
}
