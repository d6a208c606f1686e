"""`simbench generate`, `simbench verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from simbench.commands.options import cluster_option, seeds_of

if TYPE_CHECKING:
    from simbench.case import Images
    from simbench.generate.work import Format


FORMATS = ("simbench", "mcap", "kitti", "pcd")


def _formats(_: click.Context, __: click.Parameter, text: str) -> tuple[str, ...]:
    words = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    for word in words:
        if word not in FORMATS:
            raise click.BadParameter(f"'{word}' is none of {', '.join(FORMATS)}")
    return tuple(word for word in words if word != "simbench")


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="SCENARIO...")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: all).")
@click.option("--seeds", default="0-1", callback=seeds_of, show_default=True, help="Recordings: 0-99.")
@click.option("--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE", help="As for run.")
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="As for run.")
@click.option(
    "--vary", multiple=True, metavar="PATH=LOW..HIGH|A|B",
    help="Let every seed draw a value of the scenario file: even in between, one of several, or a "
    "distribution as in a file.",
)  # fmt: skip
@click.option(
    "--require",
    "required",
    multiple=True,
    metavar="NAME>=VALUE",
    help="Keep only drives that hold this: visible_frames, points, nearest_m, farthest_m, with >= or <=.",
)
@click.option("--split", metavar="80,10,10", help="Percent of drives in train, val, test.")
@click.option(
    "--format", "formats", default="simbench", callback=_formats, show_default=True, metavar="NAME,...",
    help="Write these too: mcap (ROS 2), kitti (raw layout), pcd.",
)  # fmt: skip
@click.option(
    "--images", type=click.Choice(["none", "raycast", "gl"]), default="none", show_default=True,
    help="Pictures by rays (all that the sensor file says), by OpenGL, or none.",
)  # fmt: skip
@click.option("--beside", metavar="kitti:FOLDER", help="Compare with recorded data, on the card.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@cluster_option
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/generate"), show_default=True)
def generate(
    targets: tuple[str, ...], system: str | None, seeds: tuple[int, ...], faults: tuple[str, ...],
    changes: tuple[str, ...], vary: tuple[str, ...], required: tuple[str, ...], split: str | None,
    formats: tuple[Format, ...], images: Images, beside: str | None, jobs: int | None, cluster: str | None,
    out: Path,
) -> None:  # fmt: skip
    """Record drives: a folder each with messages and, apart from them, the truth; dataset.json and card.html.

    Says first how much room they take, and refuses if there is not so much. The same command again makes
    what is missing. All recordings of one scenario and seed are in the same part of a split.

    Example: simbench generate overtake-approach --system car --seeds 0-1 --out out/generate
    """
    from scenarios.changes import varied
    from simbench.generate.command import Request, generate_recordings
    from simbench.generate.require import parse_requirement
    from simbench.generate.split import parse_shares

    asked = Request(
        targets=targets, out=out, system=system, seeds=seeds, faults=faults,
        changes=(*changes, *map(varied, vary)), required=tuple(map(parse_requirement, required)),
        shares=None if split is None else parse_shares(split), formats=formats, images=images, beside=beside,
        workers=jobs, cluster=cluster,
    )  # fmt: skip
    raise SystemExit(generate_recordings(asked))


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
