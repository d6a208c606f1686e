"""What of every sensor had been delivered when a sweep was: what a pipeline has that does not look ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Int64

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan, Measurement
from simbench.recording import Recording
from simbench.view.caps import MOST_STREAMS

Kind = Literal["sweep", "image", "boxes", "motion"]
NONE = -1


@dataclass(frozen=True, kw_only=True, eq=False)
class Stream:
    """The messages of one kind from one sensor. latest [sweeps]: places among all messages of the one that
    had been delivered last when each sweep was (of the LiDAR: the sweep itself); NONE: there was none yet."""

    sensor: str
    kind: Kind
    latest: Int64[np.ndarray, " sweeps"]


def streams_of(recording: Recording, sweeps: Int64[np.ndarray, " sweeps"]) -> tuple[Stream, ...]:
    """One stream per sensor and kind, sorted; at most MOST_STREAMS. sweeps: places among the messages."""
    places: dict[tuple[Kind, str], list[int]] = {}
    for place, message in enumerate(recording.messages):
        places.setdefault((kind_of(message), message.sensor), []).append(place)
    order: list[Kind] = ["sweep", "image", "boxes", "motion"]
    keys = sorted(places, key=lambda key: (order.index(key[0]), key[1]))[:MOST_STREAMS]
    found = []
    for kind, sensor in keys:
        own = np.array(places[kind, sensor], dtype=np.int64)
        before = np.searchsorted(own, sweeps, side="right") - 1
        latest = np.where(before >= 0, own[before], NONE)
        found.append(Stream(sensor=sensor, kind=kind, latest=latest))
    return tuple(found)


def kind_of(message: Measurement) -> Kind:
    """What a message is, in a word."""
    match message:
        case LidarScan():
            return "sweep"
        case CameraImage():
            return "image"
        case Detections():
            return "boxes"
        case EgoMotion():
            return "motion"


def latest_of(
    streams: Sequence[Stream], kind: Kind, sensor: str, sweeps: int
) -> Int64[np.ndarray, " sweeps"]:
    """The latest of one stream; NONE throughout where there is no such stream."""
    for stream in streams:
        if (stream.kind, stream.sensor) == (kind, sensor):
            return stream.latest
    return np.full(sweeps, NONE, dtype=np.int64)
