"""The files of a suite's run: result.json, values.json, junit.xml, summary.md, report.html."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.errors import BadInput
from simbench.files import write_text
from simbench.report.suite_page import write_page
from simbench.result_file import NAME as RESULT
from simbench.suite.coverage import Coverage
from simbench.suite.gate import Answer
from simbench.suite.junit import junit
from simbench.suite.markdown import markdown
from simbench.suite.pools import pools_of
from simbench.suite.side import NAME, Side, read_side, write_side

JUNIT, SUMMARY = "junit.xml", "summary.md"


@dataclass(frozen=True, kw_only=True)
class Told:
    """What the files say about how a run was made. seconds: of work by case (group/seed). against: the
    baseline's name."""

    description: str
    command: str
    cost: str
    against: str | None = None
    coverage: Coverage | None = None
    seconds: Mapping[str, float] = dataclasses.field(default_factory=dict)


def write_answer(answer: Answer, new: Side, old: Side | None, out: Path, told: Told) -> Path:
    """junit.xml, summary.md and report.html; the path of the last."""
    write_text(out / JUNIT, junit(answer, new, told.seconds))
    write_text(out / SUMMARY, markdown(answer, new, command=told.command, against=told.against))
    return write_page(
        answer, new, old, out, description=told.description, against=told.against, coverage=told.coverage,
        command=told.command, cost=told.cost,
    )  # fmt: skip


def write_values(side: Side, out: Path) -> None:
    """values.json: what `compare` and `baseline save` read."""
    write_side(side, out / NAME, commands=True)


def verdict_of(answer: Answer) -> dict[str, Any]:
    """The answer as plain data."""
    return {
        "outcome": answer.outcome,
        "exit_code": answer.exit_code,
        "sentence": answer.sentence,
        "problems": list(answer.problems),
        "notes": list(answer.notes),
        "gates": [_finite(dataclasses.asdict(gate)) for gate in answer.gates],
    }


def _finite(gate: dict[str, Any]) -> dict[str, Any]:
    return {
        k: (None if isinstance(v, float) and v in (float("inf"), float("-inf")) else v)
        for k, v in gate.items()
    }


def failed_cases(path: Path) -> set[str]:
    """Ids of the cases that `--lf` runs again: runs that did not end well, and all runs of gates that were
    missed or not decided. BadInput: no run of a suite lies there."""
    side = read_side(path)
    try:
        verdict = json.loads((path / RESULT).read_text(encoding="utf-8"))["verdict"]
        gates: Sequence[Mapping[str, Any]] = verdict["gates"]
        bad = {gate["group"] for gate in gates if gate["outcome"] != "PASS" and gate["kind"] != "runs"}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput("is no result of a suite", file=str(path / RESULT)) from error
    missed = {name for pool in pools_of(side.groups) if pool.name in bad for name in pool.groups} | bad
    return {
        f"{name}/{seed}"
        for name, of in side.groups.items()
        for seed, run in of.runs.items()
        if name in missed or run.status != "ok"
    }
