#!/usr/bin/env python3
"""What the end of a suite costs by its size: judging, result.json, values.json and junit.xml, the page.

    python3 dev.py run python tests/benchmarks/suite_size.py [--groups 50 500] [--seeds 20]

Recordings are not made: the row of a real one (`overtake-approach`, car, `robust`) stands in the ledger under
every group and seed, its values moved at random. The driver's memory is the peak of the whole process.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from scenarios.seeding import stream
from scenarios.suite import load_suite
from simbench.campaign.ledger import Done, Ledger
from simbench.files import write_text
from simbench.report.suite_page import NAME as PAGE
from simbench.report.suite_page import write_page
from simbench.result_file import Record, write_result
from simbench.suite.coverage import coverage
from simbench.suite.judge import Asked, answer
from simbench.suite.junit import junit
from simbench.suite.plan import Group, groups_of, recordings_of
from simbench.suite.run import record_text, runs_of
from simbench.suite.side import Side, side_of
from simbench.suite.write import verdict_of, write_values

MOST_S, MOST_BYTES = 20.0, 5_000_000
SUITE = """\
name: size
description: One drive in many blocks.
seeds: 0
pipelines: [robust]
limits: {precision: ">= 0.5", recall: ">= 0.5", coverage.smooth: ">= 0.5"}
blocks:
"""
BLOCK = "  b%d: {scenarios: [overtake-approach]}\n"


def main(groups: Sequence[int], seeds: int) -> None:
    print(
        f"{'groups':>7s} {'cases':>7s} {'judge s':>8s} {'result s':>9s} {'result MB':>9s} {'values s':>8s} "
        f"{'page s':>7s} {'page MB':>8s} {'driver MB':>9s}"
    )
    for count in groups:
        with tempfile.TemporaryDirectory() as folder:
            print(row(count, seeds, Path(folder)))


def row(count: int, seeds: int, out: Path) -> str:
    """One line: all of it for so many groups."""
    write_text(out / "suite.yaml", SUITE + "".join(BLOCK % i for i in range(count)))
    planned = [replace(g, seeds=tuple(range(seeds))) for g in groups_of(load_suite(str(out / "suite.yaml")))]
    real = json.loads(record_text(recordings_of([(planned[0], 0)])[0]))
    with Ledger(out, {}) as ledger:
        _fill(ledger, planned, real)
        old, new = (_side(ledger, planned, shift) for shift in (0.0, 0.001))
        times = [time.perf_counter()]
        found = answer(new, old, Asked())
        times.append(time.perf_counter())
        records = (dict(json.loads(done.value or "")) for done in ledger.rows())
        result = write_result(out, records, {}, verdict=verdict_of(found))
        times.append(time.perf_counter())
        write_values(new, out)
        write_text(out / "junit.xml", junit(found, new, {}))
        times.append(time.perf_counter())
        write_page(
            found, new, old, out, description="", against="old", coverage=coverage(planned), command="",
            cost="",
        )  # fmt: skip
        times.append(time.perf_counter())
    judged, written, listed, shown = np.diff(times)
    size = (out / PAGE).stat().st_size
    bad = "" if shown <= MOST_S and size <= MOST_BYTES else "  over the bound of 20 s and 5 MB"
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return (
        f"{count:7d} {count * seeds:7d} {judged:8.1f} {written:9.1f} {result.stat().st_size * 1e-6:9.1f} "
        f"{listed:8.1f} {shown:7.1f} {size * 1e-6:8.2f} {peak_mb:9.0f}{bad}"
    )


def _fill(ledger: Ledger, planned: Sequence[Group], real: Record) -> None:
    """One transaction, as it is not the campaign that is measured."""
    ledger._base.execute("BEGIN")
    for place, (group, seed) in enumerate(_cases(planned)):
        moved = stream(seed, "size", group.block).normal(0.0, 0.01)
        ledger.add(Done(key=f"{place:08d}", value=json.dumps(_moved(real, group, seed, moved))), place)
    ledger._base.execute("COMMIT")


def _cases(planned: Sequence[Group]) -> Iterator[tuple[Group, int]]:
    for group in planned:
        for seed in group.seeds:
            yield group, seed


def _moved(real: Record, group: Group, seed: int, by: float) -> Record:
    head = {"block": group.block, "seed": seed}
    moved = {part: [{**entry, **head} for entry in entries] for part, entries in real.items()}
    for entry in moved["rows"]:
        entry["value"] = None if entry["value"] is None else entry["value"] + by
    return moved


def _side(ledger: Ledger, planned: Sequence[Group], shift: float) -> Side:
    """As the driver makes it, row by row; `shift` so that two sides differ."""
    ran: dict[str, dict[int, object]] = {}
    names = {group.name: group for group in planned}
    for (group, seed), done in zip(_cases(planned), ledger.rows(), strict=True):
        (recording,) = recordings_of([(group, seed)])
        (one,) = runs_of(recording, json.loads(done.value or ""), names).values()
        values = {name: None if v is None else v + shift * (seed % 3) for name, v in one.values.items()}
        ran.setdefault(group.name, {})[seed] = one.model_copy(
            update={"values": values, "outputs": f"{one.outputs}{shift}"}
        )
    return side_of("size", planned, ran, whole=True)  # type: ignore[arg-type]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--groups", type=int, nargs="+", default=[50, 500])
    parser.add_argument("--seeds", type=int, default=20)
    words = parser.parse_args()
    main(words.groups, words.seeds)
