"""`simbench score`: the words of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from simbench.case import Boxes, Images


@click.command()
@click.argument("target", metavar="TARGET")
@click.option(
    "--results", type=click.Path(path_type=Path), default=None, metavar="FILE",
    help="JSON lines (simbench-outputs/1), or positions: a .csv, or Detection3DArray messages in a .mcap or "
         "a bag's folder. Without it the messages are written.",
)  # fmt: skip
@click.option("--system", type=click.Choice(["car", "wearable"]), default="car", show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True)
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE|KEY@SEVERITY", help="As for run."
)
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="As for run.")
@click.option("--boxes", type=click.Choice(["labels", "model"]), default=None, help="As for run.")
@click.option(
    "--images", type=click.Choice(["none", "raycast"]), default="none", show_default=True,
    help="Whether the messages hold images; they change no score.",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/score"), show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
def score(
    target: str, results: Path | None, system: str, seed: int, faults: tuple[str, ...],
    changes: tuple[str, ...], boxes: Boxes | None, images: Images, out: Path, as_json: bool,
) -> None:  # fmt: skip
    """Score what was computed elsewhere; first, without --results, write the messages to compute on.

    TARGET (a scenario, a .yaml file, kitti:FOLDER or a recording's folder) with the same options and seed is
    the same recording each time. Writes OUT/messages.sbf (frames, see docs/pipeline.md) or OUT/result.json.

    Example: simbench score overtake-approach --system car --seed 0
    """
    import shlex
    import sys
    from dataclasses import replace

    from simbench.case import Job
    from simbench.elsewhere.command import print_rows, score_results, write_messages
    from simbench.formats.stored import plan_stored, stored_target
    from simbench.formats.targets import is_stored
    from simbench.result_file import print_result

    target = stored_target(target) or target
    job = Job(
        scenario=target, system=system, seed=seed, pipelines=(), faults=faults, changes=changes, boxes=boxes,
        images=images,
    )  # fmt: skip
    if is_stored(target):
        job = plan_stored(replace(job, system="both"), None)
    if results is None:
        click.echo(f"messages: {write_messages(job, out)}")
        return
    command = shlex.join(["simbench", *sys.argv[1:]])
    record, code = score_results(job, results, out, command)
    if as_json:
        print_result(out)
    else:
        print_rows(record)
    raise SystemExit(code)
