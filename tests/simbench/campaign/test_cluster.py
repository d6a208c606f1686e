"""Dask on loopback: the rows of this machine's own workers, and what a lost worker or scheduler costs."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import pytest

from scenarios.errors import BadInput
from simbench.campaign.executor import open_executor
from simbench.campaign.job_key import job_key
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.run import campaign
from simbench.case import Job
from tests.simbench.campaign.dask_here import cluster
from tests.simbench.campaign.support import rows_in
from tests.simbench.campaign.tasks import ABOUT, drive, key_of, odd, slow, tiny, word_key

JOBS = [
    Job(
        scenario="overtake-approach",
        system="car",
        seed=0,
        pipelines=("static_projection",),
        faults=faults,
        changes=("systems.car.duration_s=0.3",),
    )
    for faults in (("none",), ("timing.trigger_offset_ms=50", "motion.vibration_deg=1"))
]


def test_one_worker_two_workers_and_a_cluster_of_two_processes_give_the_same_rows(tmp_path: Path) -> None:
    with cluster(tmp_path, 2) as dask:
        for name, workers, address in (("one", 1, None), ("two", 2, None), ("dask", None, dask.address)):
            (tmp_path / name).mkdir()
            with Ledger(tmp_path / name, ABOUT) as ledger, open_executor(workers, address) as executor:
                for row in campaign(drive, JOBS, job_key, executor, ledger):
                    assert row.status == "ok"
                for row in campaign(tiny, range(40), key_of, executor, ledger):
                    assert row.status == "ok"
    one, two, many = (rows_in(tmp_path / name) for name in ("one", "two", "dask"))
    assert len(one) == len(JOBS) + 40
    assert one == two == many
    assert list(one) == list(two) == list(many)
    assert all(json.loads(one[job_key(job)][1])["rows"] for job in JOBS)


def test_a_worker_that_is_lost_in_mid_task_costs_no_row(tmp_path: Path) -> None:
    told: list[Done] = []
    with cluster(tmp_path, 2) as dask:

        def done(row: Done) -> None:
            told.append(row)
            if len(told) == 10:
                dask.workers[0].kill()

        with Ledger(tmp_path, ABOUT) as ledger, open_executor(cluster=dask.address) as executor:
            rows = list(campaign(slow, range(40), key_of, executor, ledger, done))
    assert [row.value for row in rows] == [tiny(number) for number in range(40)]
    assert len(told) == 40


def test_a_scheduler_that_is_lost_costs_one_sentence_and_the_ledger_goes_on_without_it(
    tmp_path: Path,
) -> None:
    told: list[Done] = []
    with cluster(tmp_path, 2) as dask:

        def done(row: Done) -> None:
            told.append(row)
            if len(told) == 10:
                dask.scheduler.kill()

        with Ledger(tmp_path, ABOUT) as ledger:
            with (
                pytest.raises(BadInput, match="is lost; what was measured is kept") as caught,
                open_executor(cluster=dask.address) as executor,
            ):
                list(campaign(slow, range(40), key_of, executor, ledger, done))
            assert "\n" not in str(caught.value)
            kept = len(ledger)
    assert 10 <= kept < 40
    again: list[Done] = []
    with Ledger(tmp_path, ABOUT) as ledger, open_executor(1) as executor:
        rows = list(campaign(tiny, range(40), key_of, executor, ledger, again.append))
    assert [row.value for row in rows] == [tiny(number) for number in range(40)]
    assert len(again) == 40 - kept


def test_a_poisoned_task_and_one_that_hangs_are_the_only_ones_to_fail_on_a_cluster_of_our_own(
    tmp_path: Path,
) -> None:
    tasks = [("good", str(number)) for number in range(8)]
    tasks[3:3] = [("kill", ""), ("hang on", "")]
    begun = time.monotonic()
    with Ledger(tmp_path, ABOUT) as ledger, open_executor(2, "local", timeout_s=5.0) as executor:
        rows = list(campaign(odd, tasks, word_key, executor, ledger))
    failed = {task: row.failure for task, row in zip(tasks, rows, strict=True) if row.failure is not None}
    assert failed == {
        ("kill", ""): "its worker died 3 times: it was lost",
        ("hang on", ""): "took longer than 5 s",
    }
    assert time.monotonic() - begun < 200, "it did not wait for the task that hangs"


def test_nobody_there_costs_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbench.campaign.cluster.ANSWER_S", 0.5)
    with pytest.raises(BadInput, match=r"no cluster answers at tcp://127\.0\.0\.1:9"):
        with open_executor(cluster="tcp://127.0.0.1:9"):
            pass


def test_without_dask_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(BadInput, match=r"pip install 'simbench\[cluster\]'"):
        with open_executor(cluster="local"):
            pass


@pytest.mark.parametrize("word", ["", "localhost", "127.0.0.1:8786"])
def test_a_word_that_is_no_address_costs_one_sentence(word: str) -> None:
    with pytest.raises(BadInput, match="is no cluster"):
        with open_executor(cluster=word):
            pass
