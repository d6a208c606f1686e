"""From the messages of a bag, in order of arrival, to those of the bench: numbered, paired, in ego axes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypedDict, cast

import numpy as np
from jaxtyping import Float64

from fusion.messages import (
    BoxPx,
    CameraImage,
    Detection,
    Detections,
    EgoMotion,
    LidarScan,
    Measurement,
)
from scenarios.errors import BadInput, printable
from simbench.formats.ros2.cdr import MessageError
from simbench.formats.ros2.clouds import Cloud
from simbench.formats.ros2.decode import Box
from simbench.formats.ros2.frames import FrameTree
from simbench.formats.ros2.taken import Item, refused
from simbench.formats.ros2.topics import TopicMap

CORNERS_PX = 1e-6  # how far exact corners may be from those of centre and size
MOST_CLASSES = 50  # that are told one by one


class _Stamps(TypedDict):
    sensor: str
    seq: int
    stamp_ns: int
    arrival_ns: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled:
    """counts: how many of what were left out, by (what, of whom)."""

    messages: tuple[Measurement, ...]
    counts: Counter[tuple[str, str]]


def assemble(items: Sequence[Item], topics: TopicMap, tree: FrameTree, epoch_ns: int, file: str) -> Assembled:
    """The bench's messages. BadInput: stamps of a topic do not rise, or a frame leads nowhere."""
    state = _State(topics=topics, tree=tree, epoch_ns=epoch_ns, categories=topics.categories_by_id())
    messages = []
    for item in items:
        try:
            message = state.message(item)
        except MessageError as error:
            raise refused(item.topic, item.number, str(error), file) from None
        if message is not None:
            messages.append(message)
    if not messages:
        raise BadInput("holds no message that a pipeline could be told", file=file)
    return Assembled(messages=tuple(messages), counts=state.counts)


@dataclass(kw_only=True)
class _State:
    """What the messages before say about the next one."""

    topics: TopicMap
    tree: FrameTree
    epoch_ns: int
    categories: Mapping[str, str]
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    last_ns: dict[str, int] = field(default_factory=dict)  # stamp by topic
    seqs: dict[str, dict[int, int]] = field(default_factory=dict)  # by sensor: number by stamp
    corners: dict[str, Item] = field(default_factory=dict)
    velocity: dict[str, Float64[np.ndarray, "3"]] = field(default_factory=dict)
    turns: dict[str, Float64[np.ndarray, "3 3"]] = field(default_factory=dict)  # R_ego_frame
    tracks: dict[str, int] = field(default_factory=dict)
    fresh: int = 0  # track numbers given to texts and to boxes without a track, all below 0

    def message(self, item: Item) -> Measurement | None:
        sensor = item.role.sensor
        match item.role.kind:
            case "points":
                return self._scan(item, item.content)
            case "image":
                return CameraImage(rgb=item.content, **self._stamps(item))
            case "detections":
                return Detections(boxes=self._boxes(item), **self._stamps(item))
            case "imu":
                return self._motion(item)
            case "corners":
                self.corners[sensor] = item
            case "velocity":
                self.velocity[sensor] = self._turned(item.frame, item.content)
            case _:
                pass  # calibration, which is known by now
        return None

    def _stamps(self, item: Item) -> _Stamps:
        """What all messages have. Image and boxes of a stamp have the same number."""
        sensor = item.role.sensor
        seq = item.sequence
        if self.topics.sequence == "count":
            before = self.last_ns.get(item.topic)
            if before is not None and item.stamp_ns <= before:
                raise MessageError(
                    f"its stamp ({item.stamp_ns} ns) does not come after that of the one before ({before} ns)"
                )
            self.last_ns[item.topic] = item.stamp_ns
            known = self.seqs.setdefault(sensor, {})
            seq = known.setdefault(item.stamp_ns, len(known))
        return {
            "sensor": sensor,
            "seq": seq,
            "stamp_ns": item.stamp_ns - self.epoch_ns,
            "arrival_ns": item.log_ns - self.epoch_ns,
        }

    def _scan(self, item: Item, cloud: Cloud) -> LidarScan:
        self.counts["misses", item.role.sensor] += cloud.misses
        self.counts["cut", item.role.sensor] += cloud.cut
        stamps = self._stamps(item)
        stamps["stamp_ns"] = cloud.stamp_ns - self.epoch_ns
        return LidarScan(
            xyz_m=cloud.xyz_m, intensity=cloud.intensity, offset_ns=cloud.offset_ns, ring=cloud.ring, **stamps
        )

    def _motion(self, item: Item) -> EgoMotion | None:
        velocity = self.velocity.get(item.role.sensor)
        if velocity is None:
            self.counts["early", item.role.sensor] += 1
            return None
        rate, force = item.content
        return EgoMotion(
            velocity_mps=velocity, rate_radps=self._turned(item.frame, rate),
            specific_force_mps2=self._turned(item.frame, force), **self._stamps(item),
        )  # fmt: skip

    def _turned(self, frame: str, vector: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """A vector of a frame in the ego's axes."""
        if frame == self.topics.ego_frame:
            return vector
        if frame not in self.turns:
            self.turns[frame] = self.tree.between(self.topics.ego_frame, frame).rotation
        return np.asarray(self.turns[frame] @ vector)

    def _boxes(self, item: Item) -> tuple[Detection, ...]:
        exact = self.corners.pop(item.role.sensor, None)
        if exact is not None and (exact.sequence, exact.log_ns) != (item.sequence, item.log_ns):
            exact = None
        if exact is not None:
            self._check_corners(exact, item.content)
        found = []
        for i, box in enumerate(item.content):
            category = self._category(box, item.role.sensor)
            if category is not None:
                box_px = box.box_px if exact is None else cast(BoxPx, tuple(exact.content[i].tolist()))
                track = self._track(box, item.role.sensor)
                found.append(
                    Detection(track_id=track, category=category, box_px=box_px, confidence=box.confidence)
                )
        return tuple(found)

    def _check_corners(self, exact: Item, boxes: Sequence[Box]) -> None:
        told = np.array([box.box_px for box in boxes], dtype=np.float64).reshape(-1, 4)
        if told.shape != exact.content.shape or np.abs(told - exact.content).max(initial=0.0) > CORNERS_PX:
            raise MessageError(f"its boxes are not those of {exact.topic}")

    def _category(self, box: Box, sensor: str) -> str | None:
        if box.class_id is None:
            self.counts["unclassed", sensor] += 1
            return None
        category = self.categories.get(box.class_id)
        if category is None:
            shown = printable(box.class_id[:40])
            named = ("class", shown) in self.counts or len(self.counts) < MOST_CLASSES
            self.counts["class", shown if named else "and others"] += 1
        return category

    def _track(self, box: Box, sensor: str) -> int:
        """A whole number is the track's number; another text, or none, gets one below 0."""
        text = box.track
        if text.isascii() and text.lstrip("-").isdigit() and len(text) <= 18 and str(int(text)) == text:
            if int(text) >= 0:
                return int(text)
        if not text:
            self.counts["untracked", sensor] += 1
        elif text in self.tracks:
            return self.tracks[text]
        self.fresh -= 1
        if text:
            self.tracks[text] = self.fresh
        return self.fresh
