"""The page of a suite's run: the verdict, why, and how to see each bad run again. It summarises and links:
its size does not grow with the number of cases."""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from simbench.files import write_text
from simbench.report import palette
from simbench.report.suite_figures import LOOK, MOST_DOTS, forest, old_and_new
from simbench.suite.coverage import Coverage
from simbench.suite.gate import Answer, Gate, interval, number
from simbench.suite.side import Side

NAME = "report.html"
MOST_GATES, MOST_DRAWN, MOST_STRIPS, MOST_RUNS, MOST_SCENARIOS = 200, 40, 5, 50, 30


def write_page(
    answer: Answer, new: Side, old: Side | None, out: Path, *,
    description: str, against: str | None, coverage: Coverage | None, command: str, cost: str,
) -> Path:  # fmt: skip
    """Write `out/report.html` and return its path. against: the baseline's name. cost: what the run took, in
    words."""
    made = Environment(
        loader=PackageLoader("simbench.report", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    drawn = [gate for gate in answer.gates if gate.difference is not None and gate.margin][:MOST_DRAWN]
    strips = [gate for gate in answer.gates if _has_values(gate, new)][:MOST_STRIPS]
    failed = [
        (group, seed, run)
        for group, of in new.groups.items()
        for seed, run in of.runs.items()
        if run.status != "ok"
    ]
    page = made.get_template("suite.html.j2").render(
        answer=answer, suite=new.suite, description=description, against=against, command=command, cost=cost,
        runs=sum(len(of.runs) for of in new.groups.values()), groups=len(new.groups),
        gates=answer.gates[:MOST_GATES], more=max(0, len(answer.gates) - MOST_GATES),
        forest=forest(drawn) if drawn else None, strips=old_and_new(strips, old, new) if strips else None,
        failed=failed[:MOST_RUNS], more_failed=max(0, len(failed) - MOST_RUNS), coverage=coverage,
        columns=coverage.scenarios[:MOST_SCENARIOS] if coverage else (),
        most_dots=MOST_DOTS if any(len(new.groups[gate.group].runs) > MOST_DOTS for gate in strips) else 0,
        again=lambda gate: again(gate, new), number=number, interval=interval, colour=lambda o: LOOK[o][0],
        bench=new.bench, c=palette,
    )  # fmt: skip
    write_text(out / NAME, page)
    return out / NAME


def again(gate: Gate, side: Side) -> str:
    """The line that makes the worst run of a gate again."""
    of = side.groups.get(gate.worst_group or gate.group)
    if gate.worst is None or of is None:
        return ""
    run = of.runs.get(str(gate.worst))
    return "" if run is None else run.command


def _has_values(gate: Gate, side: Side) -> bool:
    of = side.groups.get(gate.group)
    return of is not None and any(run.values.get(gate.metric) is not None for run in of.runs.values())
