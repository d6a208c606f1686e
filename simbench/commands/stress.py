"""`simbench stress`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from simbench.commands.options import DEFAULT, cluster_option, seeds_of

if TYPE_CHECKING:
    from simbench.case import Boxes


@click.command()
@click.argument("scenario")
@click.option(
    "--vary", "axes", multiple=True, required=True, metavar="NAME=LOW:HIGH:COUNT|NAME=A,B",
    help="A fault's field or a value of the scenario file. May be repeated.",
)  # fmt: skip
@click.option("--design", type=click.Choice(["grid", "lhs", "sobol"]), default="grid", show_default=True)
@click.option(
    "--points", type=click.IntRange(2, 100000), default=30, show_default=True, help="Of lhs and sobol."
)
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME", help="May be repeated. Default: as run."
)
@click.option("--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE", help="At all points.")
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="At all points.")
@click.option("--boxes", type=click.Choice(["labels", "model"]), default=None, help="As for run.")
@click.option("--seeds", default="0-3", callback=seeds_of, show_default=True, help="Runs at every point.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@cluster_option
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/stress"), show_default=True)
def stress(
    scenario: str, axes: tuple[str, ...], design: str, points: int, system: str | None,
    pipelines: tuple[str, ...], faults: tuple[str, ...], changes: tuple[str, ...], boxes: Boxes | None,
    seeds: tuple[int, ...], jobs: int | None, cluster: str | None, out: Path,
) -> None:  # fmt: skip
    """Run a scenario over a grid of errors, or of anything in its file; write stress.html and stress.csv.

    A ledger in the folder keeps every recording as it is done: the same command again goes on where it
    stopped.

    Example: simbench stress overtake-approach --vary timing.trigger_offset_ms=0:150:4 --seeds 0-1
    """
    from simbench.stress.command import run_stress

    code = run_stress(
        scenario, axes, design=design, points=points, system=system,
        pipelines=tuple(dict.fromkeys(pipelines)) or DEFAULT, faults=faults, changes=changes, boxes=boxes,
        seeds=seeds, workers=jobs, cluster=cluster, out=out,
    )  # fmt: skip
    raise SystemExit(code)
