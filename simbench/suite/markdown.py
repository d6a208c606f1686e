"""A suite's run as Markdown: what a pull request shows."""

from __future__ import annotations

from simbench.suite.gate import Answer, interval, number
from simbench.suite.side import Side

MOST = 30
HEAD = "| | gate | group | old | new | threshold | difference or interval | n | |"
MARK = {"PASS": "✅", "INCONCLUSIVE": "❔", "FAIL": "❌", "REGRESSION": "❌", "ERROR": "💥"}


def markdown(answer: Answer, side: Side, *, command: str, against: str | None) -> str:
    """The summary: the verdict, all gates that do not pass, worst first, and how to make the bad runs
    again."""
    runs = sum(len(of.runs) for of in side.groups.values())
    than = f", against `{_code(against)}`" if against else ""
    lines = [
        f"## {MARK[answer.outcome]} simbench {_text(side.suite)}: {_text(answer.sentence)}",
        "",
        f"{runs} runs in {len(side.groups)} groups{than}.",
    ]
    lines += ["", *(f"* {_text(problem)}" for problem in answer.problems)] if answer.problems else []
    lines += ["", *(f"* {_text(note)}" for note in answer.notes)] if answer.notes else []
    shown = [gate for gate in answer.gates if gate.outcome != "PASS"]
    if shown:
        lines += [
            "",
            "| | gate | group | old | new | threshold | difference or interval | n | |",
            "|" + "---|" * 9,
        ]
    for gate in shown[:MOST]:
        cells = (
            f"{MARK[gate.outcome]} {gate.outcome}", gate.name, gate.group, number(gate.old), number(gate.new),
            gate.threshold, interval(gate), str(gate.n), gate.note,
        )  # fmt: skip
        lines.append("| " + " | ".join(_text(cell) for cell in cells) + " |")
    if len(shown) > MOST:
        lines += ["", f"and {len(shown) - MOST} more."]
    passed = sum(gate.outcome == "PASS" for gate in answer.gates)
    lines += ["", f"{passed} gates pass."]
    bad = [run.command for of in side.groups.values() for run in of.runs.values() if run.status != "ok"]
    if bad:
        lines += ["", "Make a failed run again:", "", "```", *bad[:5], "```"]
    return "\n".join([*lines, "", f"`{_code(command)}`", ""])


def _text(text: str) -> str:
    """Text inside a table's cell, whatever a pipeline raised."""
    plain = " ".join(text.split())[:300]
    return "".join("\\" + c if c in "\\`*_|<>[]#" else c for c in plain)


def _code(text: str) -> str:
    return " ".join(text.split()).replace("`", "'")
