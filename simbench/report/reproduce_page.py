"""The page of the reproduction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from simbench.case import Images, Job, JobResult
from simbench.files import write_text
from simbench.report import palette
from simbench.report import reproduce_figures as figures
from simbench.report.choose import groups_of
from simbench.report.explain_figure import bars, width
from simbench.report.page import Section, section_of
from simbench.report.reproduce_fit_figures import alone_curves, posterior
from simbench.reproduce.answer import Answer
from simbench.reproduce.cells import BASELINE, CELLS, METHOD, OURS
from simbench.reproduce.cost import Cost
from simbench.reproduce.findings import findings
from simbench.reproduce.plan import condition_faults
from simbench.reproduce.sheet import Sheet
from simbench.reproduce.variants import reference_of, variant_of
from simbench.reproduce.words import COLUMNS, NONE, share
from simbench.run import run_job

NAME = "shen2023.html"
SEED = 0


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """The paper's figures: a cell without and with errors, and five objects seen by several cameras."""

    overtaking: Section
    five: Section


def draw_paper(out: Path, images: Images) -> Drawn:
    """Run what the paper's figures show. images: what draws the pictures under the points."""
    cell = CELLS[0]
    faults = (condition_faults(cell, "none"), condition_faults(cell, "reached"))
    overtaking = [run_job(cell.job(SEED, of, (BASELINE, METHOD))) for of in faults]
    five = run_job(
        Job(scenario="five-objects", system="car", seed=SEED, pipelines=(METHOD, OURS), faults=("none",))
    )
    return Drawn(overtaking=_section(overtaking, out, images), five=_section([five], out, images))


def _section(results: Sequence[JobResult], out: Path, images: Images) -> Section:
    return section_of(groups_of(results)[0], 1, images=images, out=out)


def write_page(
    told: Answer, sheets: Sequence[Sheet], drawn: Drawn, costs: Mapping[str, Cost], out: Path, *, command: str
) -> Path:
    """Write `out/shen2023.html` and return its path."""
    by_name = {sheet.name: sheet for sheet in sheets}
    made = Environment(
        loader=PackageLoader("simbench.report", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    page = made.get_template("reproduce.html.j2").render(
        told=told,
        findings=findings(told),
        by_name=by_name,
        bars=[
            (table.words, table.condition, figures.tpr_bars(table), figures.budget_bars(table))
            for table in told.conditions
        ],
        drawn=drawn,
        heat=figures.heat(told.maps) if told.maps else None,
        strips=[
            (cell, figures.strip_maps(told.strips, cell))
            for cell in dict.fromkeys(one.cell for one in told.strips)
        ],
        mended=figures.mended_bars(told.mended) if told.mended else None,
        steps=figures.step_dots(told.steps) if told.steps else None,
        slopes=figures.slope_dots(told.slopes) if told.slopes else None,
        elsewhere=figures.scene_dots(told.elsewhere) if told.elsewhere else None,
        attributions=_attributions(told),
        fits=[
            (
                fit, posterior(fit), alone_curves(fit),
                by_name[f"levels-{fit.system}-{fit.baseline}"],
                by_name[f"predictions-{fit.system}-{fit.baseline}"],
            )
            for fit in told.fits
        ],
        costs=[(_cost_name(name), cost, _gains(told, name)) for name, cost in costs.items()],
        cells=[cell.name for cell in CELLS],
        columns=COLUMNS,
        command=command,
        c=palette,
    )  # fmt: skip
    write_text(out / NAME, page)
    return out / NAME


def _attributions(told: Answer) -> list[tuple[str, str, Markup, int]]:
    """Cell, metric, figure, width: of the baseline, the method and ours."""
    shown = []
    for cell, found in told.attributions.items():
        for metric in dict.fromkeys(one.metric for one in found):
            mine = [one for one in found if one.metric == metric and one.pipeline in (BASELINE, METHOD, OURS)]
            shown.append((cell, metric, bars(mine, COLUMNS.__getitem__), width(mine)))
    return shown


def _gains(told: Answer, name: str) -> list[str]:
    """By cell: what a variant changes in TPR (points), as the table of steps has it."""
    gains = {
        one.cell: share(one.differences["tpr"].difference, signed=True)
        for one in told.steps
        if reference_of(one.name) == name and "tpr" in one.differences
    }
    return [gains.get(cell.name, NONE) for cell in CELLS]


def _cost_name(name: str) -> str:
    if ":" not in name:
        return COLUMNS[name]
    variant = variant_of(name)
    return f"step {variant.step or '–'}, {variant.title}: {variant.what}"
