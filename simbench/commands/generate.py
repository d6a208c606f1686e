"""`simbench generate`, `simbench verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from simbench.commands.options import seeds_of

if TYPE_CHECKING:
    from simbench.case import Images


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="SCENARIO...")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: all).")
@click.option("--seeds", default="0-1", callback=seeds_of, show_default=True, help="Recordings: 0-99.")
@click.option("--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE", help="As for run.")
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="As for run.")
@click.option(
    "--images", type=click.Choice(["none", "raycast", "gl"]), default="none", show_default=True,
    help="Pictures by rays (all that the sensor file says), by OpenGL, or none.",
)  # fmt: skip
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/generate"), show_default=True)
def generate(
    targets: tuple[str, ...], system: str | None, seeds: tuple[int, ...], faults: tuple[str, ...],
    changes: tuple[str, ...], images: Images, jobs: int | None, out: Path,
) -> None:  # fmt: skip
    """Record drives: a folder each with messages and, apart from them, the truth; and OUT/dataset.json.

    Says first how much room they take, and refuses if there is not so much. The same command again makes
    what is missing.

    Example: simbench generate overtake-approach --system car --seeds 0-1 --out out/generate
    """
    from simbench.generate.command import generate_recordings

    code = generate_recordings(
        targets, system=system, seeds=seeds, faults=faults, changes=changes, images=images, workers=jobs,
        out=out,
    )  # fmt: skip
    raise SystemExit(code)


@click.command()
@click.argument(
    "recordings", nargs=-1, required=True, metavar="RECORDING...", type=click.Path(path_type=Path)
)
@click.option("--rerun", is_flag=True, help="Make it again, and name the first message that differs.")
def verify(recordings: tuple[Path, ...], rerun: bool) -> None:
    """Check every hash of recordings; say what is missing of one that was cut off.

    Example: simbench verify out/generate/overtake-approach-car-0000
    """
    from simbench.generate.verify import verified

    good = True
    for folder in recordings:
        sentence, whole = verified(folder, rerun=rerun)
        click.echo(sentence)
        good = good and whole
    raise SystemExit(0 if good else 1)
