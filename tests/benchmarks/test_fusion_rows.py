"""The fusion benchmark says what it measured, and measures what it says."""

from __future__ import annotations

import json
import os

import cv2
import pytest

from fusion.pipelines.static_projection import StaticProjection
from tests.benchmarks import fusion_rows
from tests.benchmarks.fusion_rows import Cost, cost, main, recorded, table

SWEEPS = fusion_rows.WARM_UP + 4


@pytest.fixture(autouse=True)
def any_core() -> object:
    cores, threads = os.sched_getaffinity(0), cv2.getNumThreads()
    yield
    os.sched_setaffinity(0, cores)
    cv2.setNumThreads(threads)


def test_every_answer_but_those_of_the_warm_up_is_counted() -> None:
    cv2.setNumThreads(2)
    found = cost(StaticProjection(), recorded(SWEEPS))
    assert cv2.getNumThreads() == 1 and len(os.sched_getaffinity(0)) == 1
    assert found.answers >= fusion_rows.WARM_UP + 1
    assert 0.0 < found.p50_ms <= found.p99_ms
    assert set(found.steps_ms) == {"ground", "aoi", "localize"}
    assert found.peak_mb > 0.1


def test_json_has_the_keys_by_pipeline(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--json", "--only", "static_projection", "--sweeps", str(SWEEPS)]) == 0
    found = json.loads(capsys.readouterr().out)
    per_pipeline = ("p50_ms", "p99_ms", "vs_static_projection", "peak_mb", "steps_ms")
    assert set(found) == {"machine", *(f"static_projection_{what}" for what in per_pipeline)}
    assert found["static_projection_vs_static_projection"] == 1.0


def test_the_table_says_what_does_not_hold() -> None:
    slow = Cost(p50_ms=11.0, p99_ms=12.0, steps_ms={"ground": 1.0}, peak_mb=2.0, answers=9)
    text = table({"probabilistic": slow})
    assert "p50 <= 10 ms: NO" in text
    assert "p99 <= 20 ms: yes" in text
    base = Cost(p50_ms=5.0, p99_ms=6.0, steps_ms={}, peak_mb=1.0, answers=9)
    assert "2.2x" in table({"static_projection": base, "probabilistic": slow})


def test_an_unknown_pipeline_is_refused() -> None:
    with pytest.raises(SystemExit) as raised:
        main(["--only", "nobody"])
    assert raised.value.code == 2
