"""`simbench explain`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from simbench.commands.options import DEFAULT, seeds_of

if TYPE_CHECKING:
    from simbench.case import Boxes


def _seeds(context: click.Context, option: click.Parameter, text: str | None) -> tuple[int, ...] | None:
    return None if text is None else seeds_of(context, option, text)


@click.command()
@click.argument("target", metavar="SCENARIO|RUN")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME",
    help="May be repeated. Default: as run, or those of the run.",
)  # fmt: skip
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE|KEY@SEVERITY",
    help="Replaces the scenario's same fault, adds the others; 'none' clears. May be repeated.",
)  # fmt: skip
@click.option(
    "--cause", "chosen", multiple=True, metavar="NAME",
    help="A cause to switch: a fault that is on, bench.rolling_scan, bench.spin_phase, bench.reference_rate. "
    "May be repeated; all else stays on. Default: all.",
)  # fmt: skip
@click.option(
    "--set", "changes", multiple=True, metavar="PATH=VALUE",
    help="Replaces a value of the scenario file, as systems.car.duration_s=3. May be repeated.",
)  # fmt: skip
@click.option("--boxes", type=click.Choice(["labels", "model"]), default=None, help="As for run.")
@click.option(
    "--seeds", default=None, callback=_seeds, help="Runs to make. Default: 0-9, or those of the run."
)
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/explain"), show_default=True)
def explain(
    target: str, system: str | None, pipelines: tuple[str, ...], faults: tuple[str, ...],
    chosen: tuple[str, ...], changes: tuple[str, ...], boxes: Boxes | None, seeds: tuple[int, ...] | None,
    jobs: int | None, out: Path,
) -> None:  # fmt: skip
    """Say which causes cost how much precision and how many metres, alone and together; and the error budget.

    Of a scenario (name or .yaml file) or of the folder of a run. Every set of up to six causes is run with
    the same seeds; above six, singles, pairs and random orders. A ledger in the folder keeps every recording
    as it is done.

    Example: simbench explain overtake-approach --faults demo --cause timing.trigger_offset_ms --seeds 0-5
    """
    from simbench.explain.command import run_explain

    code = run_explain(
        target, system=system, pipelines=tuple(dict.fromkeys(pipelines)), faults=faults, changes=changes,
        boxes=boxes, seeds=seeds, chosen=chosen, workers=jobs, out=out, default_pipelines=DEFAULT,
    )  # fmt: skip
    raise SystemExit(code)
