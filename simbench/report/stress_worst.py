"""Overlays of a stress test's worst runs: each is made again, and its middle pair is drawn with its picture.

The pair is the one whose share of right points is the median of its run for that pipeline, so that no picture
is picked by hand; of pairs that are as good, the first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from simbench.case import Job
from simbench.exhibit import PairView
from simbench.report.overlay import common_field, crop_svg, cut, jpeg_uri, marks_of
from simbench.report.page import CROP_PX
from simbench.report.pictures import replay_of, take_pictures
from simbench.report.words import pipeline_words
from simbench.run import run_job
from simbench.stress.axes import Point
from simbench.stress.ledger import Outcome

PICTURED = 2  # worst runs of each pipeline that are shown


@dataclass(frozen=True, kw_only=True)
class Overlay:
    """One picture and what stands below it."""

    svg: Markup
    title: str
    note: str


def overlays(
    worst: Mapping[str, Sequence[Outcome]], jobs: Mapping[tuple[Point, int], Job]
) -> tuple[Overlay, ...]:
    """Of the first scored runs of each pipeline. `jobs`: by point and seed."""
    shown = [o for found in worst.values() for o in [o for o in found if o.status == "ok"][:PICTURED]]
    by_job: dict[Job, list[Outcome]] = {}
    for outcome in shown:
        by_job.setdefault(jobs[outcome.point, outcome.seed], []).append(outcome)
    made = {id(o): _overlay(job, o) for job, several in by_job.items() for o in several}
    return tuple(overlay for o in shown if (overlay := made[id(o)]) is not None)


def _overlay(job: Job, outcome: Outcome) -> Overlay | None:
    """None where the run has no pair to show."""
    views = run_job(job).views
    if not views:
        return None
    view = _middle(views, outcome.pipeline)
    replay = replay_of(job)
    camera = replay.pinholes[view.camera]
    marks = marks_of(view, outcome.pipeline, camera)
    field = common_field([marks], camera)
    key = (view.camera, view.capture_ns)
    picture = take_pictures(replay, [key], "raycast")[key]
    title = f"{pipeline_words(outcome.pipeline)}, seed {outcome.seed}"
    note = f"{view.camera}, t = {1e-9 * view.scan_stamp_ns:.1f} s: {len(marks.right)} points right, "
    note += f"{len(marks.wrong)} wrong, {len(marks.missed)} of the target's missed"
    if marks.box is None:
        note += "; no box was delivered"
    uri = jpeg_uri(cut(picture, field, camera.width_px, CROP_PX))
    return Overlay(svg=crop_svg(marks, field, uri, f"{title}: {note}"), title=title, note=note)


def _middle(views: Sequence[PairView], pipeline: str) -> PairView:
    def share(view: PairView) -> float:
        mapped = view.mapped.get(pipeline, np.zeros(len(view.right), dtype=bool))
        return float((mapped & view.right).sum() / max(int(mapped.sum()), 1))

    order = sorted(range(len(views)), key=lambda i: (share(views[i]), i))
    return views[order[len(order) // 2]]
