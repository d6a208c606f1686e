"""A dask cluster on loopback, each part a process that a test may kill."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True, kw_only=True)
class Processes:
    """A scheduler and its workers."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: tuple[subprocess.Popen[bytes], ...]


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Processes]:
    """One thread per worker, no nannies: a worker that is killed stays away."""
    found = folder / "scheduler.json"
    started = [_start("dask_scheduler", "--port", "0", "--scheduler-file", str(found), folder=folder)]
    try:
        address = _address(found)
        for number in range(workers):
            words = (address, "--nthreads", "1", "--no-nanny", "--name", f"w{number}", "--memory-limit", "0")
            started.append(_start("dask_worker", *words, folder=folder))
        yield Processes(address=address, scheduler=started[0], workers=tuple(started[1:]))
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def _start(program: str, *words: str, folder: Path) -> subprocess.Popen[bytes]:
    where = ("--host", "127.0.0.1", "--no-dashboard")
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{program}", *words, *where],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _address(file: Path, limit_s: float = 60.0) -> str:
    until_s = time.monotonic() + limit_s
    while time.monotonic() < until_s:
        try:
            return str(json.loads(file.read_text(encoding="utf-8"))["address"])
        except (OSError, ValueError):
            time.sleep(0.05)
    raise AssertionError("the scheduler did not start")
