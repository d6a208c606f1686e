"""`simbench baseline save`, `simbench compare`, `simbench plan`."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path)


@click.group()
def baseline() -> None:
    """Keep the values of a suite's run, to judge later runs against.

    Example: simbench baseline save out/run baseline.json
    """


@baseline.command()
@click.argument("run", type=FILE)
@click.argument("file", type=FILE)
def save(run: Path, file: Path) -> None:
    """Write the values of RUN (the folder of a suite's run) to FILE: JSON, one run a line, made to be
    reviewed and committed.

    Example: simbench baseline save out/run baseline.json
    """
    from simbench.suite.compare import save_baseline

    raise SystemExit(save_baseline(run, file))


@click.command()
@click.argument("run", type=FILE)
@click.argument("against", metavar="BASELINE", type=FILE)
@click.option("--allow-changed", is_flag=True, help="Compare although the bench or the scenarios changed.")
@click.option("--out", type=FILE, help="Folder for junit.xml, summary.md and report.html.")
def compare(run: Path, against: Path, allow_changed: bool, out: Path | None) -> None:
    """Judge a suite's run against a baseline file, or against another run's folder.

    Exit code 0 PASS, 1 REGRESSION or a failed limit, 3 not comparable, 4 INCONCLUSIVE.

    Example: simbench compare out/run baseline.json
    """
    from simbench.suite.compare import compare_runs

    raise SystemExit(compare_runs(run, against, changed=allow_changed, out=out))


@click.command()
@click.argument("suite")
@click.option("--margin", required=True, metavar="'METRIC NUMBER'", help="What may be lost.")
@click.option(
    "--true-loss", "losses", multiple=True, type=float, default=(0.0,), show_default=True,
    help="What is truly lost. May be repeated.",
)  # fmt: skip
@click.option("--pilot", required=True, type=FILE, metavar="RUN", help="The folder of a run of the suite.")
@click.option("--against", type=FILE, metavar="RUN", help="A run of another version, to pair by seed.")
def plan(suite: str, margin: str, losses: tuple[float, ...], pilot: Path, against: Path | None) -> None:
    """Say how many runs a verdict needs, from the spread of a pilot run.

    Example: simbench plan smoke --margin 'precision 0.02' --true-loss 0 --pilot out/run
    """
    from simbench.suite.compare import plan_runs

    raise SystemExit(plan_runs(suite, margin, losses, pilot, against))
