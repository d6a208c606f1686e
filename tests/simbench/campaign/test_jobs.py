"""Jobs on several processes: the same bytes as on one, in the order of the jobs."""

from __future__ import annotations

import json

import pytest

from scenarios.errors import BadInput
from scenarios.load import load_scenario
from simbench.campaign.jobs import run_jobs
from simbench.case import Job, JobResult
from simbench.result_file import document
from simbench.results import record_of
from tests.simbench.cheats import named
from tests.simbench.support import write_scenario


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list[Job]:
    """Half a second of the manoeuvre: as a user's file, so that a fresh process finds it."""
    scenario = load_scenario("overtake-recede").resolve(0)
    systems = {
        name: system.model_copy(update={"duration_s": 0.6}) for name, system in scenario.systems.items()
    }
    short = scenario.model_copy(
        update={"name": "short", "systems": systems, "background": scenario.background[:3]}
    )
    path = write_scenario(tmp_path_factory.mktemp("jobs"), short)
    return [
        Job(
            scenario=str(path),
            system=system,
            seed=seed,
            pipelines=("static_projection", "probabilistic", *named("Raises")),
            faults=faults,
            size_px=(320, 200),
        )
        for system, seed, faults in (
            ("car", 0, ("none",)),
            ("wearable", 1, ("timing.trigger_offset_ms=50", "motion.vibration_deg=1")),
            ("wearable", 0, ("detector.edge_error=0.03",)),
        )
    ]


def text(results: tuple[JobResult, ...]) -> str:
    content = document(map(record_of, results), {})
    assert content.pop("timings")
    return json.dumps(content, allow_nan=False)


def test_two_processes_give_the_bytes_of_one(jobs: list[Job]) -> None:
    heard: list[JobResult] = []
    one = run_jobs(jobs, 1)
    two = run_jobs(jobs, 2, heard.append)
    assert text(one) == text(two)
    assert [result.job for result in two] == jobs
    assert [result.job for result in heard] == jobs


def test_bad_input_of_a_worker_comes_home_in_one_piece(jobs: list[Job]) -> None:
    wrong = Job(scenario="overtake-aproach", system="car", seed=0, pipelines=())
    with pytest.raises(BadInput) as caught:
        run_jobs([wrong, jobs[0]], 2)
    assert caught.value.hint == "overtake-approach"


def test_no_jobs_give_no_results() -> None:
    assert run_jobs([], 4) == ()
