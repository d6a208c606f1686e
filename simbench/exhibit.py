"""What pictures of a run need, kept small: per eligible pair, the points around the target's box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32

from fusion.camera import project_points
from fusion.geometry import readonly
from fusion.messages import BoxPx, FusionOutput
from simbench.recording import Recording
from simbench.score.mapping import window_m
from simbench.score.pairs import frames_and_pairs

MARGIN = 2.5  # how far around the box points are kept, in box widths


@dataclass(frozen=True, kw_only=True, eq=False)
class PairView:
    """One eligible pair as the fusion saw it. Pixels [k 2] by the calibration that the fusion was told.

    box_px: the delivered box, None when the detector missed. outline_px: the true amodal box. mapped: by
    pipeline, which of the points it gave to the target. right: within the paper's window. true_px, told_px:
    where the target's points really are in the image and where the told calibration puts them (mean). target:
    which of several targets, by its place among them.
    """

    scan_seq: int
    scan_stamp_ns: int
    camera: str
    image_seq: int
    capture_ns: int
    box_px: BoxPx | None
    outline_px: BoxPx
    uv_px: Float32[np.ndarray, "k 2"]
    distance_m: Float32[np.ndarray, " k"]
    on_target: Bool[np.ndarray, " k"]
    right: Bool[np.ndarray, " k"]
    mapped: Mapping[str, Bool[np.ndarray, " k"]]
    true_px: tuple[float, float]
    told_px: tuple[float, float]
    target: int = 0


def pair_views(recording: Recording, outputs: Mapping[str, Sequence[FusionOutput]]) -> tuple[PairView, ...]:
    """One view per eligible pair, by target and then in the order of frames. Empty without a target."""
    parts = enumerate(recording.by_target)
    return tuple(view for number, part in parts for view in _views_of(part, number, outputs))


def _views_of(
    recording: Recording, number: int, outputs: Mapping[str, Sequence[FusionOutput]]
) -> tuple[PairView, ...]:
    truth = recording.truth
    if truth.target_id is None:
        return ()
    frames, eligible = frames_and_pairs(recording)
    answers = {
        name: {(o.scan_sensor, o.scan_seq): o.objects for o in given} for name, given in outputs.items()
    }
    half_window_m = window_m(recording)
    result = []
    for pair in eligible:
        frame = frames[pair.frame]
        view = frame.views[pair.camera]
        image, detections = view.truth, view.detections
        told = recording.calibration
        camera = told.cameras[pair.camera]
        xyz = frame.scan.xyz_m
        uv = project_points(xyz, told.T_camera_lidar(pair.camera, frame.scan.sensor), camera)
        box, track_id = None, None
        if detections is not None:
            for detection, object_id in zip(detections.boxes, image.detection_object_id, strict=True):
                if object_id == truth.target_id:
                    box, track_id = detection.box_px, detection.track_id
        around = box or pair.box_px
        width, height = around[2] - around[0], around[3] - around[1]
        with np.errstate(invalid="ignore"):
            near = (
                (uv[:, 0] > around[0] - MARGIN * width)
                & (uv[:, 0] < around[2] + MARGIN * width)
                & (uv[:, 1] > around[1] - height)
                & (uv[:, 1] < around[3] + height)
            )
        distance = np.hypot(xyz[:, 0], xyz[:, 1])
        mapped = {}
        for name, by_scan in answers.items():
            chosen = np.zeros(len(xyz), dtype=bool)
            for found in by_scan.get(frame.key, ()):
                if found.sensor == pair.camera and found.track_id == track_id:
                    chosen[found.points] = True
            mapped[name] = readonly(chosen[near])
        result.append(
            PairView(
                scan_seq=frame.scan.seq,
                scan_stamp_ns=frame.scan.stamp_ns,
                camera=pair.camera,
                image_seq=image.seq,
                capture_ns=image.capture_ns,
                box_px=box,
                outline_px=pair.box_px,
                uv_px=readonly(uv[near], np.float32),
                distance_m=readonly(distance[near], np.float32),
                on_target=readonly(frame.truth.object_id[near] == truth.target_id),
                right=readonly(np.abs(distance[near] - pair.surface_distance_m) <= half_window_m),
                mapped=mapped,
                true_px=_mean_px(pair.true_uv_px),
                told_px=_mean_px(uv[pair.points]),
                target=number,
            )
        )
    return tuple(result)


def _mean_px(uv: np.ndarray) -> tuple[float, float]:
    seen = uv[np.isfinite(uv).all(axis=1)]
    return (float(seen[:, 0].mean()), float(seen[:, 1].mean())) if len(seen) else (float("nan"),) * 2
