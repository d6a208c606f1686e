"""Whole runs with every fault of stamps and of transport at once: proved, scored, and no crash."""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import pytest

from simbench.case import Job
from simbench.faults.receipt import MISMATCH
from simbench.run import run_job
from simbench.stage import Stage, stage
from tests.simbench.support import staged

STAMPS = {
    "timing.clock_offset_ms": "offset_ms: 20",
    "timing.clock_drift_ppm": "rate_ppm: 50",
    "timing.stamp_jitter_ms": "sd_ms: 5, distribution: heavy_tailed",
    "timing.stamp_on_save_ms": "delay_ms: 30",
    "timing.stamp_meaning_share": "share: 0.5",
    "timing.stamp_step_ms": "step_ms: -150, at_s: 0.6",
    "timing.stamp_quantum_ms": "quantum_ms: 7",
}
TRANSPORT = {
    "timing.stale_frames": "frames: 1",
    "timing.frozen_percent": "percent: 30",
    "timing.dropped_percent": "percent: 20",
    "timing.duplicated_percent": "percent: 30",
    "timing.latency_ms": "latency_ms: 80, jitter_ms: 10",
    "timing.reordered_percent": "percent: 20",
}


def cut(job: Job) -> Stage:
    """A second with a coarse LiDAR and small pictures."""
    at = stage(job)
    coarse = staged(
        job.system, job.seed, scenario=job.scenario, duration_s=1.2, columns=64, size_px=(320, 200)
    )
    return replace(coarse, faults=at.faults)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("sensors", ["cameras", "lidar"])
@pytest.mark.parametrize("room", [STAMPS, TRANSPORT], ids=["stamps", "transport"])
def test_a_run_with_every_fault_of_the_room_is_proved_and_scored(room: dict[str, str], sensors: str) -> None:
    pictures = ("timing.stale_frames", "timing.frozen_percent")
    texts = tuple(
        f"{name}={{{fields}, sensors: {sensors}}}"
        for name, fields in room.items()
        if sensors == "cameras" or name not in pictures
    )
    job = Job(
        scenario="overtake-recede", system="wearable", seed=0, pipelines=("static_projection", "robust"),
        faults=texts,
    )  # fmt: skip
    with mock.patch("simbench.run.stage", cut):
        result = run_job(job)
    assert [r for r in result.receipts if r.status == MISMATCH] == []
    assert {r.fault for r in result.receipts} == {text.partition("=")[0] for text in texts}
    assert [(case.status, case.why) for case in result.cases] == [("ok", None)] * 3
    for case in result.cases:
        assert all((row.value is None) == (row.why is not None) for row in case.rows)
