"""What can be said of answers without truth: whether they agree, with each other and with what was given.

Good values do not make an answer right; two wrong answers may agree. Bad ones make it suspect.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion.camera import project_points
from fusion.messages import BoxPx, Detections, FusionOutput, LidarScan, LocalizedObject, Trajectory
from simbench.log import Log
from simbench.score.frames import nearest
from simbench.score.metrics import Better, Estimate, Metric, Row, mean_of, null, ratio_of

GAP = 1.5  # periods between sweeps that still follow each other
RAYLEIGH = float(np.sqrt(2.0 * np.log(2.0)))  # median length of a vector whose axes have SD 1
LOWER: Better = "lower"

METRICS = (
    Metric(
        name="located_rate", unit="1", better="higher", per="boxes of images paired with a sweep",
        definition="Share of the delivered boxes that got a position.",
    ),
    Metric(
        name="between_cameras_m", unit="m", better=LOWER, per="sweeps and tracks that several cameras show",
        definition="Largest planar distance between the positions that cameras give one track in one sweep.",
    ),
    Metric(
        name="position_noise_m", unit="m", better=LOWER, per="three sweeps in a row of one track",
        definition="Spread of raw positions about straight motion, 1 SD an axis, by the median: a position "
        "against the line between those before and after.",
    ),
    Metric(
        name="box_offset_px", unit="px", better=LOWER, per="positions with points and a box",
        definition="Distance along the rows between the box's centre and the mean of the points that were "
        "given to it, projected as told.",
    ),
    Metric(
        name="smoothing_m", unit="m", better=LOWER, per="samples of trajectories that have a raw position",
        definition="Planar distance between a trajectory and the raw position of the same stamp.",
    ),
    Metric(
        name="inlier_rate", unit="1", better="higher", per="samples of trajectories",
        definition="Share of a trajectory's samples that the smoother did not throw away.",
    ),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shown:
    """The boxes of the image that is paired with a sweep, by camera and track."""

    scan: LidarScan
    boxes: Mapping[tuple[str, int], BoxPx]


def period_ns(log: Log) -> int:
    """Between two sweeps: the median; 0.1 s where there are fewer than two."""
    stamps = np.sort([m.stamp_ns for m in log.messages if isinstance(m, LidarScan)])
    return int(np.median(np.diff(stamps))) if len(stamps) > 1 else 100_000_000


def consistency(
    log: Log, outputs: Sequence[FusionOutput], trajectories: Sequence[Trajectory]
) -> tuple[Row, ...]:
    """A row per metric of `METRICS`; null with the reason where nothing can be said."""
    shown = {(s.scan.sensor, s.scan.seq): s for s in _shown(log)}
    known = [(shown[o.scan_sensor, o.scan_seq], o.objects) for o in outputs]
    values = {
        "located_rate": _located(shown.values(), outputs),
        "between_cameras_m": _between_cameras(known),
        "position_noise_m": _noise(known, GAP * period_ns(log)),
        "box_offset_px": _offset(log, known),
        "smoothing_m": _smoothing(known, trajectories),
        "inlier_rate": mean_of(
            np.concatenate([np.empty(0), *(t.inlier.astype(float) for t in trajectories)]),
            of="samples of trajectories", spread=False,
        ),
    }  # fmt: skip
    return tuple(_row(metric, values[metric.name]) for metric in METRICS)


def _row(metric: Metric, found: Estimate) -> Row:
    return Row(
        metric=metric.name, value=found.value, unit=metric.unit, better=metric.better, n=found.n,
        sd=found.sd, why=found.why,
    )  # fmt: skip


def _shown(log: Log) -> Iterator[_Shown]:
    """Every sweep with the boxes of the images that are paired with it (as `score/frames.py` pairs them)."""
    half_ns = period_ns(log) / 2
    by_camera: dict[str, list[Detections]] = {}
    for message in log.messages:
        if isinstance(message, Detections):
            by_camera.setdefault(message.sensor, []).append(message)
    stamps = {name: np.array([m.stamp_ns for m in found]) for name, found in by_camera.items()}
    for scan in (m for m in log.messages if isinstance(m, LidarScan)):
        boxes: dict[tuple[str, int], BoxPx] = {}
        for camera, found in by_camera.items():
            at = nearest(stamps[camera], scan.stamp_ns, half_ns)
            if at is not None:
                boxes |= {(camera, box.track_id): box.box_px for box in found[at].boxes}
        yield _Shown(scan=scan, boxes=boxes)


Known = Sequence[tuple[_Shown, Sequence[LocalizedObject]]]


def _located(shown: Iterable[_Shown], outputs: Sequence[FusionOutput]) -> Estimate:
    answered = {
        (o.scan_sensor, o.scan_seq): {(found.sensor, found.track_id) for found in o.objects} for o in outputs
    }
    total = hit = 0
    for one in shown:
        found = answered.get((one.scan.sensor, one.scan.seq), set())
        total += len(one.boxes)
        hit += len(found & set(one.boxes))
    return ratio_of(hit, total, of="boxes of images paired with a sweep")


def _between_cameras(known: Known) -> Estimate:
    apart = []
    for _, objects in known:
        by_track: dict[int, list[np.ndarray]] = {}
        for one in objects:
            by_track.setdefault(one.track_id, []).append(one.position_ego_m[:2])
        for places in by_track.values():
            if len(places) > 1:
                all_xy = np.array(places)
                apart.append(float(np.linalg.norm(all_xy[:, None] - all_xy[None], axis=2).max()))
    return mean_of(apart, of="tracks that several cameras located in one sweep")


def _noise(known: Known, longest_ns: float) -> Estimate:
    by_track: dict[int, list[tuple[int, np.ndarray]]] = {}
    for _, objects in known:
        best: dict[int, LocalizedObject] = {}
        for one in objects:
            if one.track_id not in best or one.confidence > best[one.track_id].confidence:
                best[one.track_id] = one
        for track, one in best.items():
            by_track.setdefault(track, []).append((one.stamp_ns, one.position_ego_m[:2]))
    bends = []
    for samples in by_track.values():
        samples.sort(key=lambda sample: sample[0])
        t_ns, xy = np.array([t for t, _ in samples]), np.array([p for _, p in samples])
        follows = np.diff(t_ns) <= longest_ns
        for i in np.flatnonzero(follows[1:] & follows[:-1]):
            share = (t_ns[i + 1] - t_ns[i]) / (t_ns[i + 2] - t_ns[i])  # of the way: steps are not even
            weight = np.sqrt(1.0 + (1.0 - share) ** 2 + share**2)  # what independent noise becomes
            bends.append(
                float(np.linalg.norm(xy[i + 1] - (1.0 - share) * xy[i] - share * xy[i + 2]) / weight)
            )
    if not bends:
        return null("no track has positions in three sweeps in a row")
    return Estimate(value=float(np.median(bends)) / RAYLEIGH, n=len(bends))


def _offset(log: Log, known: Known) -> Estimate:
    away = []
    for shown, objects in known:
        for one in objects:
            box = shown.boxes.get((one.sensor, one.track_id))
            if box is None or not len(one.points):
                continue
            told = log.calibration
            T_camera_lidar = told.T_camera_lidar(one.sensor, shown.scan.sensor)
            uv = project_points(shown.scan.xyz_m[one.points], T_camera_lidar, told.cameras[one.sensor])
            u = uv[np.isfinite(uv).all(axis=1), 0]
            if len(u):
                away.append(abs(float(u.mean()) - 0.5 * (box[0] + box[2])))
    return mean_of(away, of="positions with points and a box")


def _smoothing(known: Known, trajectories: Sequence[Trajectory]) -> Estimate:
    raw = {(one.track_id, one.stamp_ns): one.position_ego_m[:2] for _, objects in known for one in objects}
    moved = [
        float(np.linalg.norm(place[:2] - raw[path.track_id, int(t)]))
        for path in trajectories
        for t, place in zip(path.stamp_ns, path.position_ego_m, strict=True)
        if (path.track_id, int(t)) in raw
    ]
    return mean_of(moved, of="samples of trajectories at the stamp of a raw position")
