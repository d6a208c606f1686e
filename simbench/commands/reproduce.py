"""`simbench reproduce`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from simbench.case import Images


@click.command()
@click.argument("paper", metavar="PAPER", type=click.Choice(["shen2023"]))
@click.option("--quick", is_flag=True, help="A few runs of some parts: minutes, and wide intervals.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@click.option(
    "--images", type=click.Choice(["raycast", "gl", "none"]), default="raycast", show_default=True,
    help="What draws the pictures under the points.",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/shen2023"), show_default=True)
def reproduce(paper: str, quick: bool, jobs: int | None, images: Images, out: Path) -> None:
    """Run the paper's experiment and print its tables and figures beside ours: where they agree, where they
    cannot, and which errors would bring the bench to its numbers.

    A ledger in the folder keeps every run as it is done: the same command again goes on where it stopped.

    Example: simbench reproduce shen2023 --quick
    """
    from simbench.reproduce.command import run_reproduce
    from simbench.reproduce.plan import FULL, QUICK

    raise SystemExit(run_reproduce(QUICK if quick else FULL, workers=jobs, images=images, out=out))
