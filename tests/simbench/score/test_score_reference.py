"""A reference that lies moves what is read against it, and nothing else; its budget still adds up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarios.faults.reference import (
    ReferenceBias,
    ReferenceFloat,
    ReferenceHeading,
    ReferenceLag,
    ReferenceLever,
    ReferenceNoise,
    ReferenceOutage,
    ReferencePeriod,
)
from simbench.faults.delivery import Delivery
from simbench.score.score import score
from tests.simbench.faults.laws import act, site

STRIKES = [
    ReferenceLever(forward_m=1.0, of="ego"),
    ReferenceBias(bias_cm=50.0),
    ReferenceNoise(noise_cm=20.0),
    ReferenceFloat(duration_s=10.0),
    ReferenceHeading(heading_deg=5.0),
    ReferencePeriod(period_s=0.8),
    ReferenceOutage(duration_s=1.0, at_s=0.5),
    ReferenceLag(lag_ms=300.0),
]
PART = {
    ReferenceLever: "lever_arm", ReferenceBias: "reference_noise", ReferenceNoise: "reference_noise",
    ReferenceFloat: "reference_noise", ReferenceHeading: "heading", ReferencePeriod: "reference_lag",
    ReferenceOutage: "reference_lag", ReferenceLag: "reference_lag",
}  # fmt: skip


def struck(recording, spec):
    """The same recording with a struck reference."""
    delivery = Delivery(sweeps=(), shots={}, motions=(), reference=recording.truth.reference)
    after = act(spec, delivery, site()).delivery.reference
    return replace(recording, truth=replace(recording.truth, reference=after))


def reads_the_reference(metric: str) -> bool:
    return metric.endswith(".gnss") or metric.startswith("budget_")


@pytest.mark.parametrize("spec", STRIKES, ids=[spec.name for spec in STRIKES])
def test_only_what_reads_the_reference_moves_and_the_parts_still_add_up(kit, recording, spec):
    answer = kit.Answer().run(recording)
    before, after = score(recording, *answer), score(struck(recording, spec), *answer)
    moved = {a.metric for a, b in zip(before.rows, after.rows, strict=True) if a != b}
    assert moved and all(reads_the_reference(metric) for metric in moved), moved
    assert any(metric.endswith(".gnss") for metric in moved)
    np.testing.assert_allclose(sum(after.budget.parts_m.values()), after.budget.total_m, rtol=0, atol=1e-9)
    common = [after.budget.frames.index(f) for f in before.budget.frames if f in after.budget.frames]
    rows = [before.budget.frames.index(after.budget.frames[k]) for k in common]
    changed = np.abs(
        after.budget.parts_m[PART[type(spec)]][common] - before.budget.parts_m[PART[type(spec)]][rows]
    )
    assert changed.max() > 0.01


def test_a_reference_without_any_fix_is_scored_as_none(kit, recording):
    gone = struck(recording, ReferenceOutage(duration_s=100.0, at_s=0.0))
    scores = score(gone, *kit.Answer().run(recording))
    assert all(row.value is None and row.why for row in scores.rows if row.metric.endswith(".gnss"))
