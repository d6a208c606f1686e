#!/usr/bin/env python3
"""What a campaign costs beside its cases: ledger and executor per case, the driver's memory, bytes on disk.

    python3 dev.py run python tests/benchmarks/campaign.py [--count 10000] [--workers 2] [--real 8]

Tiny cases do nothing, so that all of their time is overhead. The rival is `ProcessPoolExecutor` with as
many spawned workers, without ledger, time limit or second tries. Real cases are recordings of `overtake-
approach`, car, two pipelines; their row is that of a stress test. With `--cluster` the driver holds
dask's scheduler too, whose memory is shown and not judged.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

from simbench.campaign.executor import open_executor
from simbench.campaign.key import task_key
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.run import campaign
from simbench.case import Job
from simbench.stress.ledger import Task, key_of
from simbench.stress.run import row_of

MUST_MS = 20.0
FLAT_MB = 10.0
ROW = '{"x": "' + "x" * 2000 + '"}'


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Of many cases. rss_mb: the driver's, after a tenth of them and after all."""

    name: str
    count: int
    wall_s: float
    rss_mb: tuple[float, float]
    disk_bytes: int

    @property
    def ms(self) -> float:
        return 1e3 * self.wall_s / self.count


def tiny(number: int) -> str:
    """A row of 2 kB, as long as one of a small suite."""
    return ROW + " " * (number % 10)


def tiny_key(number: int) -> str:
    return task_key(case={"number": number}, config={}, code="none")


def rss_mb() -> float:
    """Resident memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


def counted(name: str, count: int, rows: Iterable[object], folder: Path | None) -> Cost:
    """Draw all rows, keep none. The clock starts at the first."""
    begun, early = 0.0, 0.0
    for number, _ in enumerate(rows, start=1):
        if number == 1:
            begun = time.perf_counter()
        if number == max(1, count // 10):
            early = rss_mb()
    wall_s = time.perf_counter() - begun
    size = sum(path.stat().st_size for path in folder.iterdir()) if folder is not None else 0
    return Cost(name=name, count=count - 1, wall_s=wall_s, rss_mb=(early, rss_mb()), disk_bytes=size)


def warm(executor: Executor, workers: int) -> None:
    """All workers are there, which takes seconds: one that comes later would make the rest look faster."""
    for future in [executor.submit(time.sleep, 1.0) for _ in range(workers)]:
        future.result()


def ours(count: int, workers: int, cluster: str | None = None) -> Cost:
    """A campaign of tiny cases."""
    where = cluster or ("this process" if workers == 1 else f"{workers} workers")
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        with Ledger(folder, {"benchmark": count}) as ledger, open_executor(workers, cluster) as executor:
            warm(executor, workers)
            rows = campaign(tiny, range(count), tiny_key, executor, ledger)
            return counted(f"campaign, {where}", count, rows, folder)


def again(count: int) -> Cost:
    """A campaign that is done already: what it costs to find that out."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        with Ledger(folder, {}) as ledger, open_executor(1) as executor:
            ledger._base.execute("BEGIN")  # not row by row: this is not what is measured
            for number in range(count):
                ledger.add(Done(key=tiny_key(number), value=tiny(number)), number)
            ledger._base.execute("COMMIT")
            return counted(
                "campaign, all there", count, campaign(tiny, range(count), tiny_key, executor, ledger), folder
            )


def rival(count: int, workers: int) -> Cost:
    """The standard library's pool, all tasks at once."""
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        warm(pool, workers)
        return counted(f"ProcessPoolExecutor, {workers} workers", count, pool.map(tiny, range(count)), None)


def real(count: int, workers: int) -> Cost:
    """Recordings, scored."""
    tasks: Sequence[Task] = [
        (
            (float(offset),),
            Job(
                scenario="overtake-approach", system="car", seed=seed,
                pipelines=("static_projection", "probabilistic"),
                faults=(f"timing.trigger_offset_ms={offset}",),
            ),
        )
        for seed in range(count)
        for offset in (0, 50)
    ][:count]  # fmt: skip
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        with Ledger(folder, {}) as ledger, open_executor(workers) as executor:
            for row in campaign(row_of, tasks[:workers], key_of, executor, ledger):
                assert row.status == "ok", row  # compiled kernels and imports are not counted
            rows = campaign(row_of, tasks, key_of, executor, ledger)
            cost = counted(f"recordings, {workers} workers", count, rows, folder)
            sizes = [len(row.value or "") for row in ledger.rows()]
    name = f"{cost.name} (a row: {sum(sizes) / len(sizes):.0f} bytes)"
    return Cost(
        name=name, count=count - workers, wall_s=cost.wall_s, rss_mb=cost.rss_mb, disk_bytes=cost.disk_bytes
    )


def main() -> int:
    """The exit code: 0 where the bounds hold."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--real", type=int, default=8, help="how many recordings; 0: none")
    parser.add_argument("--cluster", action="store_true", help="dask on loopback too")
    asked = parser.parse_args()
    costs = [ours(asked.count, asked.workers), ours(asked.count, 1)]
    if asked.cluster:
        costs.append(ours(asked.count, asked.workers, "local"))
    bounded, held = list(costs), costs[:2]
    costs += [again(asked.count), rival(asked.count, asked.workers)]
    if asked.real > asked.workers:
        costs.append(real(asked.real, asked.workers))
    print(
        f"{'':48}{'cases':>8}{'ms a case':>11}{'driver MB, early':>18}{'at the end':>12}{'bytes a case':>14}"
    )
    for cost in costs:
        early, late = cost.rss_mb
        each = cost.disk_bytes / (cost.count + 1)
        print(f"{cost.name:48}{cost.count:8}{cost.ms:11.2f}{early:18.1f}{late:12.1f}{each:14.0f}")
    slow = [cost.name for cost in bounded if cost.ms > MUST_MS]
    fat = [cost.name for cost in held if cost.rss_mb[1] - cost.rss_mb[0] > FLAT_MB]
    print(f"at most {MUST_MS:g} ms a case: {'no: ' + ', '.join(slow) if slow else 'yes'}")
    print(f"memory flat within {FLAT_MB:g} MB: {'no: ' + ', '.join(fat) if fat else 'yes'}")
    return 1 if slow or fat else 0


if __name__ == "__main__":
    sys.exit(main())
