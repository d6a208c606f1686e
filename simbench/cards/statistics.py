"""What a recording holds: a row for every object in the sweeps, two a second, that see it or show it.

The same function for simulated and recorded data, so that the two can stand side by side. Where a recording
does not know something (a single frame has no speed, an object without points no noise) the value is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float64

from fusion.camera import project_points
from simbench.recording import Recording
from simbench.score.frames import Frame, frames_of
from simbench.truth import ObjectInfo, TrueBox

EVERY_NS = 500_000_000
HALF_STEP_NS = 50_000_000  # of the central difference for speeds
NEAREST_M, FARTHEST_M = 1.0, 120.0  # nearer is what carries the sensors
MIN_TRIPLES = 8  # second differences that a spread is taken of
WIDEST_STEP = 2.5  # between neighbours in a ring, in usual steps


@dataclass(frozen=True, kw_only=True)
class Sight:
    """One object in one sweep.

    range_m: planar, from the LiDAR to the centre of its box, at the sweep's stamp. points: of it, in the
    sweep. visible: share of its outline in the camera that shows most of it, height_px: of that box;
    shift_px: from the centre of that box to the mean of its points, projected as the fusion was told, along
    the image's rows. speed_mps: over ground. intensity: median of its points. noise_m: spread of its points'
    ranges about neighbours in their ring, 1 SD (`range_noise_m`).
    """

    sweep: int
    object: str
    category: str
    range_m: float
    points: int
    visible: float
    height_px: float
    shift_px: float
    speed_mps: float
    intensity: float
    noise_m: float


COLUMNS = tuple(field.name for field in fields(Sight))


def sights(recording: Recording) -> tuple[Sight, ...]:
    """All rows of a recording, by sweep and then object."""
    every = max(1, round(EVERY_NS / recording.truth.period_ns))
    frames = frames_of(recording)[::every]
    places = _places(recording, np.array([frame.scan.stamp_ns for frame in frames], dtype=np.int64))
    return tuple(row for n, frame in enumerate(frames) for row in _of_frame(recording, frame, places, n))


def _places(recording: Recording, t_ns: np.ndarray) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """By object, planar range [m] and speed [m/s] at some times [n] each."""
    truth, moving = recording.truth, len(recording.truth.scans) > 1
    lidar = next((scan.sensor for scan in truth.scans), "")
    found = {}
    for info in truth.objects:
        _, lidar_m = truth.poses.sensor(lidar, t_ns)
        _, centre_m = truth.poses.object_centre(info.object_id, t_ns)
        speed = np.full(len(t_ns), np.nan)
        if moving:
            _, before_m = truth.poses.object_centre(info.object_id, t_ns - HALF_STEP_NS)
            _, after_m = truth.poses.object_centre(info.object_id, t_ns + HALF_STEP_NS)
            speed = np.hypot(*(after_m - before_m)[:, :2].T) / (2e-9 * HALF_STEP_NS)
        found[info.object_id] = np.hypot(*(centre_m - lidar_m)[:, :2].T), speed
    return found


def _of_frame(
    recording: Recording, frame: Frame, places: dict[int, tuple[np.ndarray, np.ndarray]], number: int
) -> list[Sight]:
    points: dict[int, np.ndarray] = {
        int(i): np.flatnonzero(frame.truth.object_id == i) for i in np.unique(frame.truth.object_id) if i >= 0
    }
    shown = _shown(frame)
    rows = []
    for info in recording.truth.objects:
        mine, best = points.get(info.object_id), shown.get(info.object_id)
        if mine is None and best is None:
            continue
        range_m, speed_mps = (float(values[number]) for values in places[info.object_id])
        if NEAREST_M <= range_m <= FARTHEST_M:
            own = np.empty(0, dtype=np.int64) if mine is None else mine
            rows.append(_sight(recording, frame, info, own, best, range_m, speed_mps))
    return rows


def _shown(frame: Frame) -> dict[int, tuple[str, TrueBox]]:
    """By object, the camera in which the largest part of it is visible, and its box there."""
    best: dict[int, tuple[str, TrueBox]] = {}
    for camera, view in frame.views.items():
        for box in view.truth.boxes:
            known = best.get(box.object_id)
            if known is None or box.visible_fraction > known[1].visible_fraction:
                best[box.object_id] = (camera, box)
    return best


def _sight(
    recording: Recording, frame: Frame, info: ObjectInfo, points: np.ndarray,
    best: tuple[str, TrueBox] | None, range_m: float, speed_mps: float,
) -> Sight:  # fmt: skip
    scan = frame.scan
    height_px = shift_px = visible = float("nan")
    if best is not None:
        camera, box = best
        visible, height_px = box.visible_fraction, box.amodal_px[3] - box.amodal_px[1]
        if len(points):
            told = recording.calibration
            uv = project_points(
                scan.xyz_m[points], told.T_camera_lidar(camera, scan.sensor), told.cameras[camera]
            )
            u = uv[np.isfinite(uv).all(axis=1), 0]
            shift_px = float(u.mean() - 0.5 * (box.amodal_px[0] + box.amodal_px[2])) if len(u) else shift_px
    return Sight(
        sweep=frame.index,
        object=info.name,
        category=info.category,
        range_m=range_m,
        points=len(points),
        visible=visible,
        height_px=height_px,
        shift_px=shift_px,
        speed_mps=speed_mps,
        intensity=float(np.median(scan.intensity[points])) if len(points) else float("nan"),
        noise_m=range_noise_m(scan.xyz_m[points], scan.ring[points]),
    )


def range_noise_m(xyz_m: np.ndarray, ring: np.ndarray) -> float:
    """Spread of ranges about their neighbours in a ring, 1 SD, of points [n 3] with rings [n].

    Second differences of range over three neighbours cancel a plane's slope; of independent noise their
    variance is six times that of a range. Robust (median), so that edges do not count. NaN where fewer than
    `MIN_TRIPLES` triples lie close together, or the rings are not known (-1).
    """
    known = ring >= 0
    xyz, ring = np.asarray(xyz_m, dtype=np.float64)[known], ring[known]
    if len(xyz) < MIN_TRIPLES + 2:
        return float("nan")
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    order = np.lexsort((azimuth, ring))
    azimuth, ring, ranges = azimuth[order], ring[order], np.linalg.norm(xyz[order], axis=1)
    step = np.diff(azimuth)
    same = ring[1:] == ring[:-1]
    if not same.any():
        return float("nan")
    close = same & (step <= WIDEST_STEP * np.median(step[same]))
    triples = close[1:] & close[:-1]
    bends = (ranges[2:] - 2.0 * ranges[1:-1] + ranges[:-2])[triples]
    if len(bends) < MIN_TRIPLES:
        return float("nan")
    return float(1.4826 * np.median(np.abs(bends - np.median(bends))) / np.sqrt(6.0))


def column(rows: tuple[Sight, ...], name: str) -> Float64[np.ndarray, " n"]:
    """The finite values of a column."""
    values = np.array([getattr(row, name) for row in rows], dtype=np.float64)
    found: np.ndarray = values[np.isfinite(values)]
    return found
