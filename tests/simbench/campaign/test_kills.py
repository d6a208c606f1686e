"""The driver killed at twenty moments, and the disk full: nothing lost, nothing twice, nothing other."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from scenarios.seeding import stream
from tests.simbench.campaign.support import rows_in
from tests.simbench.campaign.tasks import key_of, main, tiny

ROOT = Path(__file__).resolve().parents[3]
COUNT = 200


def driver(folder: Path, workers: int = 1) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.simbench.campaign.tasks", str(folder), str(COUNT), str(workers)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def test_a_driver_that_is_killed_at_twenty_moments_ends_with_the_rows_of_one_that_was_not(
    tmp_path: Path,
) -> None:
    rng = stream(0, "campaign", "kills")
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    killed.mkdir()
    whole.mkdir()
    seen: set[str] = set()
    for moment in range(20):
        lines, wait_s = int(rng.integers(0, 12)), float(rng.uniform(0.0, 0.01))
        process = driver(killed, workers=2 if moment % 7 == 6 else 1)
        assert process.stdout is not None
        told = [line.strip() for _, line in zip(range(lines), process.stdout, strict=False)]
        # Before it says that it is ready it makes the ledger: some moments are there.
        time.sleep(wait_s if lines else float(rng.uniform(0.0, 0.6)))
        process.kill()
        told += [line.strip() for line in process.stdout.read().splitlines()]
        process.wait()
        process.stdout.close()
        fresh = {line for line in told if len(line) == 64}
        assert not fresh & seen, "a row that was told is not made again"
        seen |= fresh
        if (killed / "ledger.sqlite").exists() and seen:
            assert seen <= rows_in(killed).keys(), "a row that was told is on the disk"
    assert 20 <= len(seen) < COUNT, "the kills fell into the campaign"
    main(str(killed), str(COUNT), "1")
    main(str(whole), str(COUNT), "1")
    assert rows_in(killed) == rows_in(whole)
    assert list(rows_in(killed)) == [key_of(number) for number in range(COUNT)]
    assert [value for _, value in rows_in(killed).values()] == [tiny(number) for number in range(COUNT)]


def test_a_second_run_in_a_folder_is_refused_while_the_first_works_and_not_after_it_was_killed(
    tmp_path: Path,
) -> None:
    first = driver(tmp_path, workers=2)
    assert first.stdout is not None and first.stdout.readline() == "ready\n"
    os.kill(first.pid, 19)  # SIGSTOP: it holds the folder for as long as the test wants
    with pytest.raises(ValueError, match=f"another run \\(process {first.pid}\\) works in"):
        main(str(tmp_path), str(COUNT), "1")
    first.kill()
    first.wait()
    first.stdout.close()
    main(str(tmp_path), str(COUNT), "1")
    assert len(rows_in(tmp_path)) == COUNT


def small_disk(folder: Path, what: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tests.simbench.campaign.small_disk", str(folder), what],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=200,
    )


@pytest.mark.parametrize("what", ["limit", "tmpfs"])
def test_a_full_disk_costs_one_sentence_and_the_campaign_goes_on_when_there_is_room(
    tmp_path: Path, what: str
) -> None:
    done = small_disk(tmp_path, what)
    if done.returncode == 77:
        pytest.skip("nothing may be mounted here")
    assert done.returncode == 2, done
    (sentence,) = done.stderr.splitlines()
    assert sentence.startswith("simbench: cannot write ") and "the same command goes on" in sentence
    artifact, kept = done.stdout.splitlines()
    assert artifact.startswith("artifact: cannot write ") and artifact.endswith("nothing is left of it")
    assert 0 < int(kept.removeprefix("kept: ")) == len(rows_in(tmp_path)) < 3000
    from tests.simbench.campaign.small_disk import long, on

    rows = on(tmp_path, range(300))
    assert [row.value for row in rows] == [long(number) for number in range(300)]


HANGS = """
import sys
from simbench.campaign.executor import open_executor
from tests.simbench.campaign.tasks import odd
if __name__ == "__main__":
    with open_executor(2) as executor:
        executor.submit(odd, ("tell", sys.argv[1])).result()
"""


def test_a_worker_in_mid_task_ends_soon_after_a_driver_that_was_killed(tmp_path: Path) -> None:
    program, told = tmp_path / "hangs.py", tmp_path / "pid"
    program.write_text(HANGS, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(program), str(told)], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    _wait_for(lambda: told.exists() and bool(told.read_text(encoding="utf-8")), "no worker began")
    pid = int(told.read_text(encoding="utf-8"))
    assert _lives(pid)
    process.kill()
    process.wait()
    _wait_for(lambda: not _lives(pid), "the worker outlived its driver")


def _wait_for(what: Callable[[], bool], otherwise: str) -> None:
    until_s = time.monotonic() + 60.0
    while not what():
        assert time.monotonic() < until_s, otherwise
        time.sleep(0.05)


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
