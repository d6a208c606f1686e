"""All faults of a room at once, from the command's words to scores."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from scenarios.load import load_scenario
from simbench.case import Job
from simbench.run import run_job
from tests.simbench.support import write_scenario

ROOMS = {
    "detector": (
        "detector.class_confusion_percent=40",
        "detector.misses_percent={percent: 30, burst_frames: 2}",
        "detector.merged_percent=50",
        "detector.split_percent=30",
        "detector.false_boxes_per_image=1",
        "detector.lag_frames=0.5",
        "detector.identity_switches_per_s=2",
    ),
    "reference": (
        "reference.lever_arm_m=0.5",
        "reference.bias_cm=20",
        "reference.noise_cm=5",
        "reference.float_s=0.5",
        "reference.heading_deg=2",
        "reference.period_s=0.4",
        "reference.outage_s={duration_s: 0.5, at_s: 0.7}",
        "reference.lag_ms=100",
    ),
}


@pytest.mark.parametrize("room", ROOMS)
def test_a_run_with_every_fault_of_a_room_is_scored(room: str, tmp_path: Path) -> None:
    scenario = load_scenario("overtake-approach").resolve(0)
    systems = {name: s.model_copy(update={"duration_s": 1.5}) for name, s in scenario.systems.items()}
    cut = scenario.model_copy(update={"name": "short", "systems": systems})
    job = Job(
        scenario=str(write_scenario(tmp_path, cut)), system="wearable", seed=0,
        pipelines=("static_projection",), faults=ROOMS[room], images="none", size_px=(320, 200),
    )  # fmt: skip
    result = run_job(job)
    (case,) = (case for case in result.cases if case.pipeline == "static_projection")
    assert case.status == "ok", case.why
    assert {r.fault for r in result.receipts} == {words.split("=")[0] for words in ROOMS[room]}
    assert all(r.status in ("ok", "unverifiable") for r in result.receipts)
    for row in case.rows:
        assert math.isfinite(row.value) if row.value is not None else row.why
