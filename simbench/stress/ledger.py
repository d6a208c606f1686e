"""What a stress test has measured so far: a file that grows line by line, so that it can go on after a stop.

One line of JSON per recording, written whole and flushed to disk; a last line that was cut off counts as not
measured. The first line says what is measured: a ledger of another test is refused.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenarios.errors import BadInput
from simbench.stress.axes import Point, Value

NAME = "ledger.jsonl"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One pipeline on one recording. values: by metric, None where there is none. seconds: of the recording,
    by part of the flow, the same for all of its pipelines."""

    point: Point
    seed: int
    pipeline: str
    status: str
    why: str | None
    values: Mapping[str, float | None]
    command: str
    seconds: Mapping[str, float]


class Ledger:
    """A ledger in a folder. BadInput: the one that lies there belongs to another test."""

    def __init__(self, folder: Path, what: Mapping[str, Any]) -> None:
        self._path, self._head = folder / NAME, json.dumps({"stress": what}, sort_keys=True)
        self.done: dict[tuple[Point, int], tuple[Outcome, ...]] = {}
        if self._path.exists():
            self._read()
        else:
            self._append(self._head)

    def _read(self) -> None:
        text = self._path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1]
        lines = whole.splitlines()
        if not lines or lines[0] != self._head:
            raise BadInput(
                f"{self._path} holds another stress test; give another --out, or remove it to start anew"
            )
        for number, line in enumerate(lines[1:], start=2):
            try:
                outcomes = tuple(_outcome(entry) for entry in json.loads(line))
                self.done[(outcomes[0].point, outcomes[0].seed)] = outcomes
            except (ValueError, TypeError, KeyError, IndexError) as error:
                raise BadInput(f"{self._path}, line {number}: is no outcome of a stress test") from error
        if len(whole) < len(text):  # cut off while it was written
            os.truncate(self._path, len(whole.encode("utf-8")))

    def add(self, outcomes: tuple[Outcome, ...]) -> None:
        """Keep the outcomes of one recording."""
        self.done[(outcomes[0].point, outcomes[0].seed)] = outcomes
        self._append(json.dumps([asdict(outcome) for outcome in outcomes], allow_nan=False))

    def _append(self, line: str) -> None:
        with self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
            file.flush()
            os.fsync(file.fileno())


def _outcome(entry: Mapping[str, Any]) -> Outcome:
    point: tuple[Value, ...] = tuple(entry["point"])
    return Outcome(**{**entry, "point": point})
