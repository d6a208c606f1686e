"""`simbench timeline`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("target", metavar="RUN|SCENARIO")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option("--seed", type=click.IntRange(0), help="Which of the family (default: 0, or a run's first).")
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE",
    help="In place of or on top of those of the run or scenario; 'none' clears. May be repeated.",
)  # fmt: skip
@click.option("--at", "at_s", type=float, default=0.2, show_default=True, help="Seconds into the run.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/timeline"),
    show_default=True,
    help="Folder for the picture.",
)
def timeline(
    target: str, system: str | None, seed: int | None, faults: tuple[str, ...], at_s: float, out: Path
) -> None:
    """Draw when every sensor measures, what its stamps claim and when it delivers, over two sweeps.

    Of a scenario (name or .yaml file) or of the folder of a run. The table says how far the LiDAR's firing
    along each camera's axis is from the camera's exposure and from its stamp.

    Example: simbench timeline overtake-approach --system wearable
    """
    from rich.console import Console

    from simbench.files import prepare_folder, write_text
    from simbench.report.timeline import svg
    from simbench.report.timeline_text import text
    from simbench.timeline import timeline as read

    found = read(target, system, seed, faults, at_s)
    prepare_folder(out)
    console = Console()
    console.print(text(found, console.width))
    write_text(out / "timeline.svg", svg(found))
    click.echo(f"\npicture: {out / 'timeline.svg'}")
