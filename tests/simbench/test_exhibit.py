"""What the pictures of a report are drawn from: the pairs, as the fusion saw them."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest

from scenarios.faults import TriggerOffset
from simbench.capture import Captured
from simbench.exhibit import MARGIN, PairView, pair_views
from simbench.run import run_case
from simbench.score.frames import frames_of
from simbench.score.pairs import eligible_pairs
from tests.simbench import cheats
from tests.simbench.support import recorded, staged


def seen(captured: Captured, *names: str) -> tuple[PairView, ...]:
    cheats.handed(captured.recording)
    cases = [run_case(name, captured, "none") for name in names]
    outputs = {case.pipeline: case.driven.outputs for case in cases if case.driven is not None}
    return pair_views(captured.recording, outputs)


@pytest.fixture(scope="module")
def captured() -> Captured:
    with mock.patch("simbench.sensors.detector.recall", lambda *_: 1.0):
        at = staged(
            scenario="overtake-recede", duration_s=1.5, columns=256, size_px=(320, 200), background=True
        )
        return recorded(at)


def test_there_is_one_view_per_eligible_pair_in_order(captured: Captured) -> None:
    views = seen(captured, "static_projection")
    frames = frames_of(captured.recording)
    pairs = eligible_pairs(captured.recording, frames)
    assert [(v.scan_seq, v.camera) for v in views] == [(frames[p.frame].scan.seq, p.camera) for p in pairs]
    assert len(views) >= 5


def test_a_view_shows_the_points_around_the_box_and_who_mapped_them(captured: Captured) -> None:
    truth, silent = cheats.named("TruthHandedOver", "Silent")
    for view in seen(captured, truth, silent):
        k = len(view.uv_px)
        assert k == len(view.distance_m) == len(view.on_target) == len(view.right)
        assert view.box_px is not None
        width = view.box_px[2] - view.box_px[0]
        assert (view.uv_px[:, 0] > view.box_px[0] - MARGIN * width - 1e-3).all()
        assert view.on_target.any()
        # The cheat maps the points that lie in the true picture; the view shows also those just outside.
        assert (view.on_target | ~view.mapped[truth]).all()
        assert view.mapped[truth].any()
        assert not view.mapped[silent].any()
        assert np.isfinite(view.true_px).all() and np.isfinite(view.told_px).all()


def test_without_errors_points_lie_where_the_target_is_and_a_delay_moves_them_off() -> None:
    gaps = []
    for specs in ((), (TriggerOffset(offset_ms=200.0),)):
        at = staged(specs=specs, duration_s=1.5, columns=256, size_px=(320, 200), scenario="overtake-recede")
        views = seen(recorded(at), "static_projection")
        assert len(views) >= 5
        gaps.append(np.mean([np.hypot(*np.subtract(v.true_px, v.told_px)) for v in views]))
    assert gaps[1] > 2.0 * gaps[0]


def test_without_a_target_there_is_nothing_to_show() -> None:
    captured = recorded(staged(scenario="empty-road", duration_s=0.3, columns=32, background=True))
    assert seen(captured, "static_projection") == ()
