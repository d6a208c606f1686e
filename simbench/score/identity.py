"""Who is who: which true object an output object or a trajectory is scored as.

An output object is the true object behind the box of its (camera, track id) in the image paired with its
scan; a false box, an unknown id or an image that is not paired makes it a false object. A trajectory belongs
to the object of most of its track's boxes (ties: the object that was seen first).

`known_tracks` names objects by track id without any box. The oracle uses it, for what no detector found,
and results that are positions only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fusion.messages import BoxPx, Detections, FusionOutput, LocalizedObject, Trajectory
from simbench.recording import Recording
from simbench.score.frames import Frame

FALSE = -1
NO_TRACKS: Mapping[int, int] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True, eq=False)
class Identified:
    """An output object, the true object it is scored as (-1: false), and the box it is known by (None:
    none).
    """

    found: LocalizedObject
    object_id: int
    box_px: BoxPx | None


def identify(
    frame: Frame, output: FusionOutput | None, known_tracks: Mapping[int, int] = NO_TRACKS
) -> tuple[Identified, ...]:
    """The objects of a frame's output (None: no answer), in their order."""
    if output is None:
        return ()
    return tuple(_identify(frame, found, known_tracks) for found in output.objects)


def _identify(frame: Frame, found: LocalizedObject, known_tracks: Mapping[int, int]) -> Identified:
    view = frame.views.get(found.sensor)
    if view is not None and (hit := view.detection(found.track_id)) is not None:
        return Identified(found=found, object_id=hit[1], box_px=hit[0].box_px)
    if view is not None and found.track_id in known_tracks:
        object_id = known_tracks[found.track_id]
        shown = view.true_box(object_id)
        return Identified(found=found, object_id=object_id, box_px=None if shown is None else shown.amodal_px)
    return Identified(found=found, object_id=FALSE, box_px=None)


def best(candidates: Sequence[Identified], recording: Recording) -> Identified | None:
    """The one that counts: highest confidence, then box centre nearest to the image centre [px], then
    first.
    """

    def rank(i: int) -> tuple[float, float, int]:
        known = candidates[i]
        model = recording.truth.calibration.cameras[known.found.sensor]
        off_px = float("inf")
        if known.box_px is not None:
            x0, y0, x1, y1 = known.box_px
            off_px = float(np.hypot((x0 + x1 - model.width_px) / 2, (y0 + y1 - model.height_px) / 2))
        return -known.found.confidence, off_px, i

    return candidates[min(range(len(candidates)), key=rank)] if candidates else None


def owners(recording: Recording, known_tracks: Mapping[int, int] = NO_TRACKS) -> dict[int, int]:
    """Track id -> the true object of most of its boxes in the whole recording (-1: mostly false boxes)."""
    behind = {(i.sensor, i.seq): i.detection_object_id for i in recording.truth.images}
    votes: dict[int, Counter[int]] = {}
    seen: set[tuple[str, int]] = set()
    for message in recording.messages:
        key = (message.sensor, message.seq)
        if isinstance(message, Detections) and key not in seen:
            seen.add(key)
            for box, object_id in zip(message.boxes, behind[key], strict=True):
                votes.setdefault(box.track_id, Counter())[object_id] += 1
    # Counter.most_common keeps the order of first sight among equals.
    return {**known_tracks, **{track: count.most_common(1)[0][0] for track, count in votes.items()}}


def tracks_of(
    trajectories: Sequence[Trajectory], object_id: int, owner: Mapping[int, int]
) -> tuple[Trajectory, ...]:
    """The trajectories that belong to an object."""
    return tuple(t for t in trajectories if owner.get(t.track_id, FALSE) == object_id)
