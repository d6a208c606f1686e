"""Frames (delivered scans) with the image of each camera that is paired with them.

The image paired with a scan is the one of that camera whose claimed stamp is nearest to the scan's claimed
stamp (the first firing), ties to the earlier, within half a LiDAR period (inclusive).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from fusion.messages import CameraImage, Detection, Detections, LidarScan
from simbench.recording import Recording
from simbench.truth import ImageTruth, ScanTruth, TrueBox


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One camera's image that is paired with a frame. `detections` is None where none were delivered."""

    truth: ImageTruth
    detections: Detections | None

    def detection(self, track_id: int) -> tuple[Detection, int] | None:
        """The box with this track id and the true object behind it (-1: a false box), or None."""
        if self.detections is None:
            return None
        for box, object_id in zip(self.detections.boxes, self.truth.detection_object_id, strict=True):
            if box.track_id == track_id:
                return box, object_id
        return None

    def true_box(self, object_id: int) -> TrueBox | None:
        return next((box for box in self.truth.boxes if box.object_id == object_id), None)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One delivered scan, its truth, and by camera the image that is paired with it."""

    index: int
    scan: LidarScan
    truth: ScanTruth
    views: Mapping[str, View]

    @property
    def key(self) -> tuple[str, int]:
        return self.scan.sensor, self.scan.seq


def nearest(stamps_ns: Int64[np.ndarray, " n"], at_ns: int, within_ns: float) -> int | None:
    """Index of the stamp nearest to at_ns, not farther than within_ns; of two equally near, the earlier."""
    if len(stamps_ns) == 0:
        return None
    gap = np.abs(stamps_ns - at_ns)
    best = int(np.lexsort((stamps_ns, gap))[0])
    return best if gap[best] <= within_ns else None


def frames_of(recording: Recording) -> tuple[Frame, ...]:
    """The frames of a recording in order of their claimed stamps.

    A scan or image delivered twice under one (sensor, seq) counts once. ValueError where a delivered message
    has no truth or the truth does not fit it: then the recording is broken.
    """
    truth = recording.truth
    scan_truth = {(s.sensor, s.seq): s for s in truth.scans}
    image_truth = {(i.sensor, i.seq): i for i in truth.images}
    scans: dict[tuple[str, int], LidarScan] = {}
    detections: dict[tuple[str, int], Detections] = {}
    stamps: dict[str, dict[int, int]] = {}  # camera -> seq -> claimed stamp
    for message in recording.messages:
        key = (message.sensor, message.seq)
        if isinstance(message, LidarScan):
            if key not in scan_truth or len(scan_truth[key].object_id) != len(message.xyz_m):
                raise ValueError(f"scan {key} has no truth, or truth of another number of points")
            scans.setdefault(key, message)
        elif isinstance(message, (Detections, CameraImage)):
            if key not in image_truth:
                raise ValueError(f"image {key} has no truth")
            stamps.setdefault(message.sensor, {}).setdefault(message.seq, message.stamp_ns)
            if isinstance(message, Detections):
                if len(message.boxes) != len(image_truth[key].detection_object_id):
                    raise ValueError(f"detections {key} and their truth differ in number")
                detections.setdefault(key, message)
    seqs = {camera: np.array(list(by_seq), dtype=np.int64) for camera, by_seq in stamps.items()}
    claimed = {camera: np.array(list(by_seq.values()), dtype=np.int64) for camera, by_seq in stamps.items()}
    frames: list[Frame] = []
    for scan in sorted(scans.values(), key=lambda s: (s.stamp_ns, s.sensor, s.seq)):
        views: dict[str, View] = {}
        for camera in sorted(claimed):
            at = nearest(claimed[camera], scan.stamp_ns, truth.period_ns / 2)
            if at is not None:
                key = (camera, int(seqs[camera][at]))
                views[camera] = View(truth=image_truth[key], detections=detections.get(key))
        frames.append(
            Frame(index=len(frames), scan=scan, truth=scan_truth[scan.sensor, scan.seq], views=views)
        )
    return tuple(frames)
