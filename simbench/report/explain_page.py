"""The page of an attribution."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from simbench.explain.answer import Answer, BudgetRow
from simbench.explain.causes import Question
from simbench.explain.table import interval, number, percent, verdict, words
from simbench.files import write_text
from simbench.report import palette
from simbench.report.explain_figure import bars, width
from simbench.report.figures import BUDGET_WORDS
from simbench.report.stress_page import cost
from simbench.report.words import pipeline_words
from simbench.score.metrics import BUDGET_PARTS
from simbench.score.metrics import METRICS as DEFINED
from simbench.score.statistics import MIN_RUNS
from simbench.stress.ledger import Outcome

NAME = "explain.html"
SCALE = 1.35  # pixels of the page to a unit of a figure


def write_page(
    question: Question,
    answer: Answer,
    outcomes: Sequence[Outcome],
    out: Path,
    *,
    command: str,
    wall_s: float,
    fresh: int,
) -> Path:
    """Write `out/explain.html` and return its path. wall_s: that `fresh` recordings took now."""
    made = Environment(
        loader=PackageLoader("simbench.report", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    defined = {metric.name: metric.definition for metric in DEFINED}
    by_metric = {
        a.metric: [b for b in answer.attributions if b.metric == a.metric] for a in answer.attributions
    }
    page = made.get_template("explain.html.j2").render(
        title=question.title,
        sentence=sentence(question, answer),
        failed=[o for o in outcomes if o.status != "ok"],
        count=len(outcomes),
        on=lambda point: ", ".join(map(str, point)) or "none",
        metrics=[
            (metric, defined[metric], found, bars(found), round(SCALE * width(found)))
            for metric, found in by_metric.items()
        ],
        valueless=answer.valueless,
        sampled=answer.pairs is not None,
        budget=answer.budget,
        first_part=next(iter(BUDGET_PARTS)),
        part_words=BUDGET_WORDS,
        difference=_difference,
        pipeline_words=pipeline_words,
        words=words,
        number=number,
        interval=interval,
        percent=percent,
        verdict=verdict,
        command=command,
        cost=cost(outcomes, wall_s, fresh),
        c=palette,
    )
    write_text(out / NAME, page)
    return out / NAME


def sentence(question: Question, answer: Answer) -> str:
    """What was asked and how it was measured."""
    causes, seeds = question.causes, len(question.seeds)
    how = f"All {1 << len(causes)} sets of them were run"
    if answer.pairs is not None:
        how = f"All sets of up to two were run, and {answer.pairs} random orders with their reverses"
    few = f" (fewer than {MIN_RUNS}: numbers only, no interval and no verdict)" if seeds < MIN_RUNS else ""
    return f"{len(causes)} causes: {', '.join(causes)}. {how}, with the same {seeds} seeds each{few}."


def _difference(row: BudgetRow) -> str:
    if row.clean.mean is None or row.whole.mean is None:
        return number(None)
    return number(row.whole.mean - row.clean.mean)
