"""What was found, question by question; the sentences are of `sentences.py`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from simbench.reproduce import sentences as say
from simbench.reproduce.answer import Answer


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A question and what the runs say of it, a sentence a line."""

    question: str
    says: tuple[str, ...]


def findings(told: Answer) -> tuple[Finding, ...]:
    """All questions that this size of a reproduction answers."""
    tables = {table.condition: table for table in told.conditions}
    asked: tuple[tuple[str, Iterable[str]], ...] = (
        ("Is a good calibration good enough?", say.boards(told.boards)),
        ("Do the tables agree?", say.agreement(tables["reached"], told.varied)),
        ("Does the method help when nothing is wrong?", say.helping(tables["none"])),
        ("Does the method do what it was made for?", say.purpose(tables["reached"])),
        (
            "Which levels of error bring the baseline to the paper's values?",
            (line for fit in told.fits for line in say.fitted(fit)),
        ),
        ("What would have to be different?", say.different(told.elsewhere)),
        ("Does a sync offset alone matter?", say.alone(told.strips, "trigger offset")),
        (
            "What does a spinning LiDAR do to a rig with a hardware trigger?",
            say.alone(told.strips, "spin phase"),
        ),
        ("What does each cause cost amid the others?", say.amid(told.slopes)),
        ("What do causes cost alone and together?", say.together(told.attributions)),
        (
            "How much of the paper's 1.15 m and 1.07 m is the algorithm?",
            say.metres_of(tables["none"]),
        ),
        ("What to mend first?", say.mending(told.mended)),
        ("Which steps carry the method?", say.carrying(told.steps)),
    )
    found = ((question, tuple(lines)) for question, lines in asked)
    return tuple(Finding(question=question, says=says) for question, says in found if says)


def as_markdown(told: Answer, command: str) -> str:
    """`docs/findings.md`."""
    lines = [
        "# What the reproduction found",
        "",
        f"Made by `{command}` from {told.runs} runs; every number is of its `result.json`. "
        "Do not edit: a test compares this page with the stored result.",
        "",
        "Intervals in brackets are 95 % over runs. S1 is taken for overtake-approach and S2 for "
        "overtake-recede, which the paper does not say. Raw box: all points in the box; box without ground: "
        "after step 1.",
        "",
    ]
    for one in findings(told):
        lines += [f"## {one.question}", "", *(f"* {line}" for line in one.says), ""]
    if told.failures:
        lines += ["## Runs that failed", "", *(f"* {line}" for line in told.failures), ""]
    return "\n".join(lines).rstrip() + "\n"
