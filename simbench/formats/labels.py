"""KITTI's labels, in the frame that they are written in (rectified camera: x right, y down, z forward).

Object layout: type, truncation, occlusion, alpha, box (left, top, right, bottom), height, width, length,
x, y, z of the box's bottom centre, rotation_y; a 16th number is a score and is ignored. The tracking layout
puts frame and track id before that. DontCare marks a region, not an object.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from fusion.messages import BoxPx, CategorySize
from scenarios.errors import nearest
from simbench.formats.folder import Line

REGION = "DontCare"
CATEGORY: Mapping[str, str] = MappingProxyType(
    {
        "Car": "car",
        "Van": "van",
        "Truck": "truck",
        "Pedestrian": "pedestrian",
        "Person_sitting": "person_sitting",
        "Person": "person_sitting",  # the tracking layout's name for it
        "Cyclist": "rider",
        "Tram": "tram",
        "Misc": "misc",
    }
)
"""The bench's word for each type that is an object."""

SIZES: Mapping[str, CategorySize] = MappingProxyType(
    {
        # mean over the data set's training labels, as users of the data set publish them; spread: judgement
        "car": CategorySize(mean_m=(3.88, 1.63, 1.53), spread=0.11),
        "van": CategorySize(mean_m=(5.07, 1.90, 2.21), spread=0.15),
        "truck": CategorySize(mean_m=(10.14, 2.59, 3.25), spread=0.3),
        "pedestrian": CategorySize(mean_m=(0.84, 0.66, 1.76), spread=0.2),
        "person_sitting": CategorySize(mean_m=(0.80, 0.60, 1.27), spread=0.2),
        "rider": CategorySize(mean_m=(1.76, 0.60, 1.74), spread=0.1),
        "tram": CategorySize(mean_m=(16.17, 2.53, 3.53), spread=0.4),
        "misc": CategorySize(mean_m=(3.64, 1.54, 1.92), spread=0.5),  # trailers and the like
    }
)

UNKNOWN = 3
VISIBLE_SHARE = (1.0, 0.6, 0.3, 1.0)
"""Visible share of the outline by occlusion level: fully visible, partly, largely occluded, unknown.

Judgement: the levels have no numbers. Where the level is unknown, the points alone decide (see docs)."""
OUTSIDE_SHARE = (0.0, 0.5, 1.0)
"""Share outside the image by the tracking layout's truncation level (judgement); 2 marks what the labellers
left out."""
FIELDS = 15


@dataclass(frozen=True, kw_only=True)
class Label:
    """One labelled box. `track`: the tracking layout's id; the label's number in the frame in the object
    layout. `box_px`: KITTI's pixels, the centre of the first one is (0, 0); None where the object is not in
    the image. `visible_fraction`: by occlusion and truncation; `occlusion_known`: False where the labellers
    could not tell.
    """

    frame: int
    track: int
    category: str
    box_px: BoxPx | None
    visible_fraction: float
    occlusion_known: bool
    size_m: tuple[float, float, float]  # length, width, height
    bottom_m: tuple[float, float, float]
    yaw_rad: float  # rotation_y


def object_labels(lines: Sequence[Line], frame: int) -> tuple[Label, ...]:
    """The objects of one frame of the object layout. BadInput: a line that is no label."""
    found = []
    for number, line in enumerate(lines):
        _check_length(line, FIELDS)
        if line.words[0] == REGION:
            continue
        truncated = line.number_at(1, "truncated")
        if not 0.0 <= truncated <= 1.0:
            raise line.error(f"must lie in 0 to 1, is {truncated:g}", field="truncated")
        found.append(_label(line, 0, frame, number, truncated))
    return tuple(found)


def tracking_labels(lines: Sequence[Line]) -> tuple[Label, ...]:
    """The objects of all frames of a sequence. BadInput: a line that is no label, or a track that is labelled
    twice in one frame.
    """
    found: dict[tuple[int, int], Label] = {}
    for line in lines:
        _check_length(line, FIELDS + 2)
        if line.words[2] == REGION:
            continue
        frame, track = line.whole_at(0, "frame"), line.whole_at(1, "track")
        if frame < 0:
            raise line.error(f"must not be negative, is {frame}", field="frame")
        if (frame, track) in found:
            raise line.error(f"track {track} is labelled twice in frame {frame}")
        level = line.whole_at(3, "truncated")
        if not 0 <= level < len(OUTSIDE_SHARE):
            raise line.error(f"unknown level {level}", field="truncated", allowed="0, 1, 2")
        found[frame, track] = _label(line, 2, frame, track, OUTSIDE_SHARE[level])
    return tuple(found.values())


def _check_length(line: Line, fields: int) -> None:
    if len(line.words) not in (fields, fields + 1):
        raise line.error(f"holds {len(line.words)} words, a label has {fields}")


def _label(line: Line, first: int, frame: int, track: int, truncated: float) -> Label:
    kind = line.words[first]
    if kind not in CATEGORY:
        known = [*CATEGORY, REGION]
        hint = nearest(kind, known)
        allowed = ", ".join(known)
        raise line.error(
            f"unknown type '{kind[:40]}'" + (f", near '{hint}'" if hint else ""), allowed=allowed
        )
    occluded = line.whole_at(first + 2, "occluded")
    if not 0 <= occluded < len(VISIBLE_SHARE):
        raise line.error(f"unknown level {occluded}", field="occluded", allowed="0, 1, 2, 3")
    names = ("left", "top", "right", "bottom", "height", "width", "length", "x", "y", "z", "rotation_y")
    x0, y0, x1, y1, height, width, length, x, y, z, yaw = (
        line.number_at(first + 4 + i, name) for i, name in enumerate(names)
    )
    if not (x0 < x1 and y0 < y1):
        raise line.error(
            f"the box ({x0:g}, {y0:g}, {x1:g}, {y1:g}) is empty", field="left, top, right, bottom"
        )
    for name, value in (("height", height), ("width", width), ("length", length)):
        if not 0.0 < value < 100.0:
            raise line.error(f"must lie between 0 and 100 m, is {value:g}", field=name)
    if max(abs(x), abs(y), abs(z)) > 1000.0:
        raise line.error("lies more than 1000 m away", field="x, y, z")
    return Label(
        frame=frame,
        track=track,
        category=CATEGORY[kind],
        box_px=(x0, y0, x1, y1),
        visible_fraction=VISIBLE_SHARE[occluded] * (1.0 - truncated),
        occlusion_known=occluded != UNKNOWN,
        size_m=(length, width, height),
        bottom_m=(x, y, z),
        yaw_rad=yaw,
    )
