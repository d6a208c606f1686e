"""The page of a frontier: one strip per pipeline and limit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from simbench.files import write_text
from simbench.frontier.requirements import Requirement, goal_words
from simbench.report import palette
from simbench.report.frontier_figures import strip
from simbench.report.words import pipeline_words

NAME = "frontier.html"


def write_page(found: Sequence[Requirement], out: Path, *, title: str, command: str, cost: str) -> Path:
    """Write `out/frontier.html` and return its path."""
    made = Environment(
        loader=PackageLoader("simbench.report", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    axes = list(dict.fromkeys(item.axis for item in found))
    page = made.get_template("frontier.html.j2").render(
        title=title,
        holds_for=goal_words(found[0].goal),
        sections=[(axis, [(r, strip(r)) for r in found if r.axis == axis]) for axis in axes],
        words=pipeline_words,
        command=command,
        cost=cost,
        c=palette,
    )
    write_text(out / NAME, page)
    return out / NAME
