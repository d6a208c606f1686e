"""`simbench init`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False), default=Path("."))
def init(folder: Path) -> None:
    """Write a folder to start from: a pipeline with a few lines to change, a suite that gates it, a CI file.

    Example: simbench init my-gate
    """
    from simbench.init import init as write

    for path in write(folder):
        click.echo(f"wrote {path}")
    where = "" if folder == Path(".") else f"cd {folder} && "
    click.echo(f"next: {where}simbench run suite.yaml")
