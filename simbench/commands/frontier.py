"""`simbench frontier`: the words of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from simbench.commands.options import DEFAULT, seeds_of

if TYPE_CHECKING:
    from simbench.case import Boxes
    from simbench.frontier.curve import Functional


@click.command()
@click.argument("scenario")
@click.option(
    "--along", "axes", multiple=True, required=True, metavar="NAME=LOW:HIGH",
    help="A fault's field or a value of the scenario file. Repeated: each along its own axis alone.",
)  # fmt: skip
@click.option(
    "--limit", "limits", multiple=True, required=True, metavar="METRIC>=NUMBER|METRIC<=NUMBER",
    help="What must hold ('mae_m' stands for 'mae_m.smooth'). Repeated: a run must keep all of them.",
)  # fmt: skip
@click.option(
    "--functional", type=click.Choice(["share", "mean"]), default="share", show_default=True,
    help="Whether a share of the runs keeps the limit, or their mean does.",
)  # fmt: skip
@click.option(
    "--share", type=click.FloatRange(0.01, 0.999), default=0.9, show_default=True, metavar="Q",
    help="The share of runs that must keep the limit.",
)  # fmt: skip
@click.option("--assume-monotone", is_flag=True, help="Shares only fall: fit a logistic curve.")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME", help="May be repeated. Default: as run."
)
@click.option("--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE", help="At all levels.")
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="At all levels.")
@click.option("--boxes", type=click.Choice(["labels", "model"]), default=None, help="As for run.")
@click.option("--seeds", default="0-39", callback=seeds_of, show_default=True, help="Runs at every level.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/frontier"), show_default=True)
def frontier(
    scenario: str, axes: tuple[str, ...], limits: tuple[str, ...], functional: Functional, share: float,
    assume_monotone: bool, system: str | None, pipelines: tuple[str, ...], faults: tuple[str, ...],
    changes: tuple[str, ...], boxes: Boxes | None, seeds: tuple[int, ...], jobs: int | None, out: Path,
) -> None:  # fmt: skip
    """Say how far an error may go before a pipeline breaks its limits; write requirements.yaml and a page.

    Levels are chosen where they tell most; a ledger in the folder keeps every recording as it is done, and
    the same command again goes on where it stopped.

    Example: simbench frontier overtake-approach --along motion.flex_deg=0:2 --limit 'precision>=0.9'
    """
    from simbench.frontier.command import run_frontier
    from simbench.frontier.search import Goal

    if assume_monotone and functional == "mean":
        raise click.UsageError("--assume-monotone is for shares: a mean has no logistic curve")
    code = run_frontier(
        scenario, axes, limits, Goal(functional=functional, share=share, monotone=assume_monotone),
        system=system, pipelines=tuple(dict.fromkeys(pipelines)) or DEFAULT, faults=faults, changes=changes,
        boxes=boxes, seeds=seeds, workers=jobs, out=out,
    )  # fmt: skip
    raise SystemExit(code)
