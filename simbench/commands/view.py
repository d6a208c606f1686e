"""`simbench view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from simbench.view.command import Tool


@click.command()
@click.argument("recording", metavar="RECORDING", type=click.Path(path_type=Path))
@click.option(
    "--tool", type=click.Choice(["page", "rerun"]), default=None,
    help="One HTML page, or a file for Rerun (default: Rerun where it is installed, else the page).",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/view"), show_default=True)
def view(recording: Path, tool: Tool | None, out: Path) -> None:
    """Show a recording: sweeps from above, true boxes, what the cameras saw, and every stamp.

    Example: simbench view out/generate/overtake-approach-car-0000 --tool page
    """
    from simbench.view.command import view_recording

    view_recording(recording, out=out, tool=tool)
