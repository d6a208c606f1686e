"""A campaign on this machine: every task once and in order, whatever its workers do."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from unittest import mock

import pytest

from scenarios.errors import BadInput
from simbench.campaign.executor import in_flight, open_executor
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.local import Here, LocalPool
from simbench.campaign.run import answer, campaign
from tests.simbench.campaign.support import keep_first, rows_in
from tests.simbench.campaign.tasks import ABOUT, key_of, odd, tiny, word_key


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    with Ledger(tmp_path, ABOUT) as made:
        yield made


def run_odd(
    ledger: Ledger, tasks: list[tuple[str, str]], workers: int, limit_s: float | None = None
) -> list[Done]:
    with open_executor(workers, timeout_s=limit_s) as executor:
        return list(campaign(odd, tasks, word_key, executor, ledger))


def values(rows: list[Done]) -> list[str | None]:
    return [row.value for row in rows]


# -- in order, once, the same ------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_tasks_and_are_kept(workers: int, tmp_path: Path) -> None:
    told: list[str] = []
    with Ledger(tmp_path, ABOUT) as ledger, open_executor(workers) as executor:
        rows = list(campaign(tiny, range(50), key_of, executor, ledger, lambda done: told.append(done.key)))
    assert values(rows) == [tiny(number) for number in range(50)]
    assert sorted(told) == sorted(row.key for row in rows)
    assert list(rows_in(tmp_path)) == [row.key for row in rows]


def test_what_is_kept_is_not_made_again(tmp_path: Path) -> None:
    with Ledger(tmp_path, ABOUT) as ledger:
        whole = list(campaign(tiny, range(20), key_of, Here(), ledger))
    keep_first(tmp_path, 12)
    told: list[str] = []
    with Ledger(tmp_path, ABOUT) as ledger:
        rows = list(campaign(tiny, range(20), key_of, Here(), ledger, lambda done: told.append(done.key)))
    assert rows == whole and told == [row.key for row in whole[12:]]


def test_a_task_that_is_asked_for_twice_is_made_once(ledger: Ledger) -> None:
    told: list[Done] = []
    rows = list(campaign(tiny, [3, 5, 3, 3], key_of, Here(), ledger, told.append))
    assert values(rows) == [tiny(3), tiny(5), tiny(3), tiny(3)] and len(told) == 2


def test_any_executor_will_do(ledger: Ledger) -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as executor:
        assert values(list(campaign(tiny, range(5), key_of, executor, ledger))) == [tiny(i) for i in range(5)]


def test_few_tasks_are_handed_out_at_a_time(ledger: Ledger) -> None:
    drawn: list[int] = []

    def endless() -> Iterator[int]:
        number = 0
        while True:
            drawn.append(number)
            yield number
            number += 1

    with open_executor(2) as executor:
        rows = campaign(tiny, endless(), key_of, executor, ledger)
        for _ in range(30):
            next(rows)
            assert len(drawn) <= len(ledger) + in_flight(executor) + 1
        rows.close()  # type: ignore[attr-defined]


# -- what goes wrong in a task -----------------------------------------------------------------------------


def test_a_task_that_kills_its_worker_every_time_fails_after_three_tries_and_no_other_does(
    ledger: Ledger,
) -> None:
    tasks = [("good", str(number)) for number in range(12)]
    tasks[4:4] = [("kill", "")]
    tasks[9:9] = [("exit", "3"), ("exit", "0")]
    rows = run_odd(ledger, tasks, 2)
    failed = {task: row for task, row in zip(tasks, rows, strict=True) if row.failure is not None}
    assert {task: row.failure for task, row in failed.items()} == {
        ("kill", ""): "its worker died 3 times: signal 9",
        ("exit", "3"): "its worker died 3 times: exit code 3",
        ("exit", "0"): "its worker died 3 times: exit code 0",
    }
    assert all(row.status == "died" and row.value is None for row in failed.values())
    good = [(task, row) for task, row in zip(tasks, rows, strict=True) if task not in failed]
    assert [json.loads(row.value or "") for _, row in good] == [list(task) for task, _ in good]
    assert run_odd(ledger, tasks, 1) == rows, "and none of it is tried again"


def test_the_third_try_is_alone_and_after_all_others(ledger: Ledger) -> None:
    class Counts(LocalPool):
        tries: list[tuple[str, int]] = []

        def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
            self.tries.append((args[1][0], len(ledger)))
            return super().submit(fn, *args, **kwargs)

    with Counts(2) as executor:
        list(
            campaign(odd, [("kill", ""), *(("good", str(i)) for i in range(20))], word_key, executor, ledger)
        )
        kills = [kept for what, kept in executor.tries if what == "kill"]
    assert len(kills) == 3 and kills[-1] == 20


def test_a_task_whose_worker_died_once_is_done(ledger: Ledger, tmp_path: Path) -> None:
    (row,) = run_odd(ledger, [("kill once", str(tmp_path / "mark"))], 2)
    assert row.status == "ok"


def test_a_worker_that_is_killed_from_outside_in_mid_task_costs_no_row(
    ledger: Ledger, tmp_path: Path
) -> None:
    told = tmp_path / "pid"

    def kill() -> None:
        while not (told.exists() and (text := told.read_text(encoding="utf-8"))):
            time.sleep(0.02)
        Path(f"{told}.go").touch()
        os.kill(int(text), signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    rows = run_odd(ledger, [("tell", str(told)), *(("good", str(i)) for i in range(5))], 2)
    killer.join()
    assert [row.status for row in rows] == ["ok"] * 6


def test_a_task_over_its_limit_is_stopped_though_it_ignores_sigterm(ledger: Ledger) -> None:
    rows = run_odd(ledger, [("good", "a"), ("hang", ""), ("good", "b")], 1, limit_s=0.5)
    assert [row.status for row in rows] == ["ok", "timeout", "ok"]
    assert rows[1].failure == "took longer than 0.5 s" and rows[1].value is None


@pytest.mark.parametrize("workers", [1, 2])
def test_a_task_that_raises_is_a_failure_with_the_reason(workers: int, ledger: Ledger) -> None:
    rows = run_odd(ledger, [("raise", "word"), ("leave", "now"), ("number", ""), ("good", "")], workers)
    assert [row.status for row in rows] == ["raised", "raised", "raised", "ok"]
    assert [row.failure for row in rows[:3]] == [
        "KeyError: 'word'",
        "SystemExit: now",
        "TypeError: the work gave int, not JSON text",
    ]


@pytest.mark.parametrize("workers", [1, 2])
def test_bad_input_of_a_task_ends_the_campaign_in_one_piece(workers: int, ledger: Ledger) -> None:
    with pytest.raises(BadInput) as caught:
        run_odd(ledger, [("good", ""), ("bad input", "overtake-aproach")], workers)
    assert caught.value.hint == "overtake-approach"


def test_a_worker_with_other_code_is_refused() -> None:
    with pytest.raises(BadInput, match="a worker runs other code than the driver"):
        answer(tiny, 3, "another digest")


# -- clocks ------------------------------------------------------------------------------------------------


def test_a_clock_that_goes_back_changes_no_row_no_order_and_no_time_limit(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def measured(name: str) -> list[Done]:
        folder = tmp_path / name
        folder.mkdir()
        tasks = [("good", str(number)) for number in range(10)]
        tasks[5:5] = [("hang", "")]
        with Ledger(folder, ABOUT) as ledger:
            return run_odd(ledger, tasks, 2, limit_s=1.0)

    before = measured("before")
    now = [2e9]

    def backwards() -> float:
        now[0] -= 3600.0
        return now[0]

    with mock.patch("time.time", backwards):
        after = measured("after")
    assert after == before and before[5].status == "timeout"
    assert rows_in(tmp_path / "after") == rows_in(tmp_path / "before")


def test_a_clock_that_leaps_ahead_stops_no_task(ledger: Ledger) -> None:
    now = [2e9]

    def leaps() -> float:
        now[0] += 86400.0
        return now[0]

    with mock.patch("time.time", leaps):
        rows = run_odd(ledger, [("good", str(number)) for number in range(5)], 2, limit_s=60.0)
    assert {row.status for row in rows} == {"ok"}


# -- executors ---------------------------------------------------------------------------------------------


def test_one_worker_is_this_process_unless_there_is_a_limit() -> None:
    with open_executor(1) as executor:
        assert executor.submit(os.getpid).result() == os.getpid() and in_flight(executor) == 1
    with open_executor(1, timeout_s=60.0) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()


def test_workers_live_on_from_task_to_task_and_end_with_the_block() -> None:
    with open_executor(2) as executor:
        pids = {executor.submit(os.getpid).result() for _ in range(20)}
    assert len(pids) <= 2
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_an_error_in_the_block_stops_a_worker_that_hangs() -> None:
    with pytest.raises(KeyError), open_executor(2) as executor:
        executor.submit(odd, ("hang", ""))
        executor.submit(os.getpid).result()
        raise KeyError


def test_a_pool_that_is_shut_takes_nothing() -> None:
    with LocalPool(1) as pool:
        waits = pool.submit(tiny, 3)
    assert waits.result() == tiny(3), "what was handed in before is done"
    with pytest.raises(RuntimeError, match="after shutdown"):
        pool.submit(tiny, 4)
