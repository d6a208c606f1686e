"""Scores where several objects count: every one is scored on its own, then all of them together.

A pair is (frame, camera, object). Metrics over pairs and over frames take the pairs and the frames of all
objects; `lateral_clearance_error_m`, `ttc_error_s` and `time_to_first_valid_s`, which are about one object,
are means over the objects that have one. A recording of a single frame has no trajectories: what is asked of
these is null, with the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fusion.messages import FusionOutput, Trajectory
from simbench.recording import Recording
from simbench.score.budget import budget_estimates
from simbench.score.frames import Frame
from simbench.score.identity import NO_TRACKS
from simbench.score.localization import frame_estimates
from simbench.score.mapping import mapping_estimates
from simbench.score.metrics import Estimate, mean_of, null, rows_of
from simbench.score.oracle import score_oracle
from simbench.score.pairs import MIN_POINTS, MIN_VISIBLE_FRACTION, frames_and_pairs, planar_range_m
from simbench.score.score import ObjectScore, Scores, score

OF_ONE_OBJECT = ("lateral_clearance_error_m", "ttc_error_s", "time_to_first_valid_s")
ONE_FRAME = "one frame: there is no trajectory"


def score_objects(
    recording: Recording,
    outputs: Sequence[FusionOutput],
    trajectories: Sequence[Trajectory],
    *,
    known_tracks: Mapping[int, int] = NO_TRACKS,
) -> Scores:
    """`score` for a recording with any number of targets. Raises what `score` raises."""
    if not recording.truth.targets:
        return score(recording, outputs, trajectories, known_tracks=known_tracks)
    each = [score(part, outputs, trajectories, known_tracks=known_tracks) for part in recording.by_target]
    return together(recording, each)


def score_oracles(recording: Recording) -> Scores:
    """`score_oracle` for a recording with any number of targets."""
    if not recording.truth.targets:
        return score_oracle(recording)
    return together(recording, [score_oracle(part) for part in recording.by_target])


def together(recording: Recording, each: Sequence[Scores]) -> Scores:
    """The scores of all targets of a recording from those of each, in the order of its targets."""
    pairs = tuple(replace(pair, target=number) for number, one in enumerate(each) for pair in one.pairs)
    frames = tuple(replace(frame, target=number) for number, one in enumerate(each) for frame in one.frames)
    false = each[0]["false_objects_per_frame"]
    estimates = {
        **mapping_estimates(pairs, [], True),
        "false_objects_per_frame": Estimate(value=false.value, n=false.n, sd=false.sd, why=false.why),
        **frame_estimates(frames),
        **budget_estimates(None, True),
    }
    for name in OF_ONE_OBJECT:
        known = [value for one in each if (value := one[name].value) is not None]
        reasons = dict.fromkeys(one[name].why or "" for one in each)
        estimates[name] = (
            mean_of(known, of="objects")
            if known
            else null("; ".join(reasons), sum(one[name].n for one in each))
        )
    of_all, _ = frames_and_pairs(recording.by_target[0])
    if len(of_all) == 1:
        estimates |= {name: null(ONE_FRAME) for name in estimates if _needs_a_track(name)}
    return Scores(
        rows=rows_of(estimates),
        pairs=pairs,
        frames=frames,
        budget=None,
        objects=tuple(
            _of_object(part, one, of_all) for part, one in zip(recording.by_target, each, strict=True)
        ),
    )


def _needs_a_track(metric: str) -> bool:
    return ".smooth" in metric or metric in OF_ONE_OBJECT


def _of_object(part: Recording, one: Scores, frames: Sequence[Frame]) -> ObjectScore:
    truth = part.truth
    info = next(o for o in truth.objects if o.object_id == truth.target_id)
    shown = [
        (view.truth.capture_ns, box.visible_fraction)
        for frame in frames
        for view in frame.views.values()
        if (box := view.true_box(info.object_id)) is not None
    ]
    points = max((int((f.truth.object_id == info.object_id).sum()) for f in frames), default=0)
    visible = max((fraction for _, fraction in shown), default=0.0)
    distance_m = None
    if shown:
        centre = truth.target_centre_ego_m(np.array([t for t, _ in shown], dtype=np.int64))
        origin = truth.calibration.T_ego_sensor[frames[0].scan.sensor].translation_m
        distance_m = float(planar_range_m(centre - origin).min())
    off = [
        float(planar_range_m(error))
        for frame in one.frames
        if frame.raw is not None and (error := frame.raw.error_m()) is not None
    ]
    return ObjectScore(
        name=info.name,
        category=info.category,
        distance_m=distance_m,
        points=points,
        visible_fraction=visible,
        pairs=len(one.pairs),
        hits=sum(pair.hit for pair in one.pairs),
        tpr=one["tpr"].value,
        positions=len(off),
        planar_m=float(np.mean(off)) if off else None,
        why=None if one.pairs else _why_not(bool(shown), points, visible),
    )


def _why_not(shown: bool, points: int, visible: float) -> str:
    if not shown:
        return "in no image"
    if points < MIN_POINTS:
        return f"{points} points, at least {MIN_POINTS} are needed"
    if visible < MIN_VISIBLE_FRACTION:
        return (
            f"{100 * visible:.0f} % visible by its label, at least {100 * MIN_VISIBLE_FRACTION:.0f} % needed"
        )
    return f"fewer than {MIN_POINTS} of its points lie in the image where it is visible"
