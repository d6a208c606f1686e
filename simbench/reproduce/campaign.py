"""Runs what is missing, and hands out what is there: the ledger of a reproduction, part by part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from simbench.campaign.executor import open_executor
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.run import campaign
from simbench.reproduce.collect import Board, Run, boards_read, key_of, row_of, runs_read
from simbench.reproduce.plan import Ask, BoardAsk, Part, Size, asks, board_asks


@dataclass(frozen=True, kw_only=True)
class Found:
    """What came of all that was asked. failures: runs that the bench could not make, in words; they are in
    no number, and the reproduction says so."""

    size: Size
    runs: dict[Ask, tuple[Run, ...]]
    boards: tuple[Board, ...]
    failures: tuple[str, ...]

    def of(self, part: Part, cell: str, pipeline: str, *point: str | float) -> tuple[Run, ...]:
        """The runs of a pipeline in a part and cell, at a point (none given: at all), that went well."""
        return tuple(
            run for at, run in self._by_pipeline.get((part, cell, pipeline), ()) if not point or at == point
        )

    def part(self, part: Part) -> Found:
        """The runs of one part only."""
        return replace(
            self, runs={ask: runs for ask, runs in self.runs.items() if ask.part == part}, boards=()
        )

    @cached_property
    def _by_pipeline(self) -> dict[tuple[Part, str, str], list[tuple[tuple[str | float, ...], Run]]]:
        index: dict[tuple[Part, str, str], list[tuple[tuple[str | float, ...], Run]]] = {}
        for ask, runs in self.runs.items():
            for run in runs:
                if run.why is None:
                    index.setdefault((ask.part, ask.cell, run.pipeline), []).append((ask.point, run))
        return index


def open_ledger(out: Path) -> Ledger:
    """The ledger in a folder; the same for --quick and the whole, so that either goes on where the other
    stopped. BadInput."""
    return Ledger(out, {"what": "shen2023"}, kind="reproduction")


def missing(size: Size, ledger: Ledger) -> list[Ask | BoardAsk]:
    """What is not there yet, once where two parts ask for the same."""
    asked = {key_of(ask): ask for ask in _everything(size)}
    return [ask for key, ask in asked.items() if key not in ledger]


def collect(size: Size, ledger: Ledger, workers: int, done: Callable[[Ask | BoardAsk, Done], None]) -> Found:
    """Run what is missing; everything that was asked."""
    wanted = _everything(size)
    by_key = {key_of(ask): ask for ask in wanted}
    useful = max(1, min(workers, len(missing(size, ledger))))
    with open_executor(useful) as executor:
        rows = {
            row.key: row
            for row in campaign(
                row_of, wanted, key_of, executor, ledger, lambda row: done(by_key[row.key], row)
            )
        }
    return _found(size, wanted, rows)


def _everything(size: Size) -> list[Ask | BoardAsk]:
    return [*board_asks(size), *asks(size)]


def _found(size: Size, wanted: Sequence[Ask | BoardAsk], rows: dict[str, Done]) -> Found:
    runs: dict[Ask, tuple[Run, ...]] = {}
    boards: list[Board] = []
    failures: list[str] = []
    for ask in wanted:
        row = rows[key_of(ask)]
        if row.value is None:
            failures.append(f"{named(ask)}: {row.failure}")
        elif isinstance(ask, BoardAsk):
            boards += boards_read(row.value)
        else:
            runs[ask] = runs_read(row.value)
            failures += [f"{named(ask)}, {run.pipeline}: {run.why}" for run in runs[ask] if run.why]
    return Found(size=size, runs=runs, boards=tuple(boards), failures=tuple(failures))


def named(ask: Ask | BoardAsk) -> str:
    """What was asked, in words."""
    if isinstance(ask, BoardAsk):
        return f"board, {ask.system}, seed {ask.seed}"
    at = ", ".join(f"{one:.4g}" if isinstance(one, float) else str(one) for one in ask.point)
    return f"{ask.part}, {ask.cell}{f', {at}' if at else ''}, seed {ask.job.seed}"
