"""The 2-D detector and tracker, as a model on the visible boxes.

Recall is logistic in box height and falls with the visible fraction; misses come in bursts (a two-state
Markov chain with the right stationary share). Box order, confidence and track ids carry no information about
truth. Every object and the false boxes have streams of their own, drawn for every frame whether an object is
in view or not: one object's fate never moves another's, nor the false boxes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx, Detection
from scenarios.scenario import DetectorSpec
from scenarios.seeding import stream
from simbench.truth import ObjectInfo, TrueBox

RECALL_SLOPE = 0.2  # logistic width in box height, relative to the half-recall height [judgement]
TRACK_IDS = 1_000_000  # ids are drawn below this, those of objects and those of false boxes


@dataclass(frozen=True, kw_only=True)
class Detected:
    """The boxes of one image and, aligned with them, the object behind each (-1: a false box)."""

    boxes: tuple[Detection, ...]
    object_id: tuple[int, ...]


def recall(spec: DetectorSpec, height_px: float, visible_fraction: float) -> float:
    """Chance that an object of this height and visibility is found, 0 below the detector's floors."""
    if height_px < spec.min_height_px or visible_fraction < spec.min_visible_fraction:
        return 0.0
    half = spec.recall_half_height_px
    by_height = 1.0 / (1.0 + np.exp(-(height_px - half) / (RECALL_SLOPE * half)))
    span = max(1.0 - spec.min_visible_fraction, 1e-9)
    rise = 0.5 * (visible_fraction - spec.min_visible_fraction) / span
    by_visibility = min(1.0, spec.recall_at_least_visible + rise)
    return float(spec.recall_at_best * by_height * by_visibility)


def perfect(spec: DetectorSpec) -> DetectorSpec:
    """The same detector without a miss above its floors and without a false box."""
    sure = {"recall_at_best": 1.0, "recall_at_least_visible": 1.0, "recall_half_height_px": 1e-9}
    return spec.model_copy(update={**sure, "miss_burst_frames": 1.0, "false_boxes_per_image": 0.0})


def draw_track_ids(objects: tuple[ObjectInfo, ...], seed: int) -> dict[int, int]:
    """A random track id for every object, global over cameras; no two are the same."""
    ids = stream(seed, "tracks").choice(TRACK_IDS, size=max(len(objects), 1), replace=False)
    return {info.object_id: int(ids[info.object_id]) for info in objects}


class Detector:
    """The detector on one camera: holds the bursts of misses of each object. `edge_errors`: relative errors
    of the four edges [frames 4] by object, in units of the box's side."""

    def __init__(
        self,
        spec: DetectorSpec,
        camera_name: str,
        camera: PinholeCamera,
        objects: tuple[ObjectInfo, ...],
        frames: int,
        seed: int,
        edge_errors: dict[int, Float64[np.ndarray, "f 4"]],
    ) -> None:
        self.spec, self.camera, self.edge_errors = spec, camera, edge_errors
        self.objects = {o.object_id: o for o in objects if o.category in spec.categories}
        self.track_id = draw_track_ids(objects, seed)
        self._taken = set(self.track_id.values())
        # Per frame: two for the bursts, the confidence, the place in the list.
        self._chance = {
            i: stream(seed, "detector", camera_name, o.name).random((frames, 4))
            for i, o in self.objects.items()
        }
        self._false = [stream(seed, "detector", camera_name, "frame", str(f)) for f in range(frames)]
        self._missed: dict[int, bool] = {}

    def detect(self, frame: int, boxes: tuple[TrueBox, ...]) -> Detected:
        """Detections of one image from the true boxes in it. Call with ascending frames."""
        found: list[tuple[float, Detection, int]] = []  # place in the list, box, object
        visible = {b.object_id: b for b in boxes if b.visible_px is not None}
        for object_id, info in self.objects.items():
            box = visible.get(object_id)
            if box is None or box.visible_px is None:
                self._missed.pop(object_id, None)
                continue
            height_px = box.visible_px[3] - box.visible_px[1]
            if self._misses(object_id, frame, recall(self.spec, height_px, box.visible_fraction)):
                continue
            edges = self._disturb(box.visible_px, object_id, frame)
            if edges is not None:
                confidence, place = self._chance[object_id][frame, 2:]
                box_seen = _detection(self.track_id[object_id], info.category, edges, confidence)
                found.append((float(place), box_seen, object_id))
        rng = self._false[frame]
        for _ in range(int(rng.poisson(self.spec.false_boxes_per_image))):
            category = self.spec.categories[int(rng.integers(len(self.spec.categories)))]
            edges, (confidence, place) = self._false_box(rng), rng.random(2)
            found.append((float(place), _detection(self._false_track(rng), category, edges, confidence), -1))
        found.sort(key=lambda item: item[0])
        return Detected(boxes=tuple(item[1] for item in found), object_id=tuple(item[2] for item in found))

    def _misses(self, object_id: int, frame: int, hit_share: float) -> bool:
        enter, leave = self._chance[object_id][frame, :2]
        if hit_share <= 0.0:
            self._missed[object_id] = True
            return True
        miss_share = 1.0 - hit_share
        # Hits last a frame or more, so that misses as frequent as these cannot come in shorter bursts.
        burst = max(self.spec.miss_burst_frames, miss_share / hit_share)
        if object_id not in self._missed:
            missed = bool(enter < miss_share)
        elif self._missed[object_id]:
            missed = bool(leave >= 1.0 / burst)
        else:
            missed = bool(enter < miss_share / (hit_share * burst))
        self._missed[object_id] = missed
        return missed

    def _disturb(self, box: BoxPx, object_id: int, frame: int) -> BoxPx | None:
        """Edge errors, then truncation at the image's border; None when nothing is left."""
        x0, y0, x1, y1 = box
        if object_id in self.edge_errors:
            e = self.edge_errors[object_id][frame]
            w, h = x1 - x0, y1 - y0
            x0, y0, x1, y1 = x0 + e[0] * w, y0 + e[1] * h, x1 + e[2] * w, y1 + e[3] * h
        width, height = float(self.camera.width_px), float(self.camera.height_px)
        x0, x1 = min(max(x0, 0.0), width), min(max(x1, 0.0), width)
        y0, y1 = min(max(y0, 0.0), height), min(max(y1, 0.0), height)
        if x1 - x0 < 1.0 or y1 - y0 < 1.0:
            return None
        return (float(x0), float(y0), float(x1), float(y1))

    def _false_box(self, rng: np.random.Generator) -> BoxPx:
        height = float(np.exp(rng.uniform(np.log(20.0), np.log(200.0))))
        width = height * float(rng.uniform(0.4, 2.0))
        x = float(rng.uniform(0.0, self.camera.width_px))
        y = float(rng.uniform(0.35, 0.75) * self.camera.height_px)
        box = np.clip(
            [x - width / 2, y - height / 2, x + width / 2, y + height / 2],
            0.0,
            [self.camera.width_px, self.camera.height_px] * 2,
        )
        return (float(box[0]), float(box[1]), float(box[2]), float(box[3]))

    def _false_track(self, rng: np.random.Generator) -> int:
        """An id as an object's could be, but no object's."""
        while (track_id := int(rng.integers(TRACK_IDS))) in self._taken:
            pass
        return track_id


def _detection(track_id: int, category: str, box: BoxPx, chance: float) -> Detection:
    """A box with a confidence of 0.5 to 1 by an even chance."""
    confidence = 0.5 + 0.5 * float(chance)
    return Detection(track_id=track_id, category=category, box_px=box, confidence=confidence)
