"""`simbench list`, `simbench describe`: what there is."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("list")
@click.argument(
    "kind",
    default="scenarios",
    type=click.Choice(["scenarios", "suites", "rigs", "sensors", "faults", "pipelines", "metrics"]),
)
def list_(kind: str) -> None:
    """List what there is: scenarios, suites, rigs, sensors, faults, pipelines or metrics.

    Example: simbench list faults
    """
    if kind == "pipelines":
        from simbench.plugins import pipeline_names

        lines = [(name, "") for name in pipeline_names()]
    elif kind == "metrics":
        from simbench.score.metrics import METRICS

        lines = [(metric.name, metric.definition) for metric in METRICS]
    elif kind == "faults":
        from scenarios.fault_set import describe_faults

        lines = [(str(f["name"]), str(f["summary"])) for f in describe_faults()]
    elif kind == "scenarios":
        from scenarios.load import list_scenarios, load_scenario

        lines = [(name, load_scenario(name).description) for name in list_scenarios()]
    elif kind == "suites":
        from scenarios.suite import list_suites, load_suite

        lines = [(name, load_suite(name).suite.description) for name in list_suites()]
    elif kind == "rigs":
        from scenarios.load import list_rigs, load_rig

        lines = [(name, load_rig(name).description) for name in list_rigs()]
    else:
        from scenarios.load import list_sensors, load_sensor

        lines = [(name, load_sensor(name).kind) for name in list_sensors()]
    width = max([28, *(len(name) for name, _ in lines)])
    for name, text in lines:
        click.echo(f"{name:{width}s} {text}".rstrip())


@click.command()
@click.argument("words", nargs=-1, required=True, metavar="SCENARIO | fault NAME | suite NAME | faults")
@click.option("--seed", type=click.IntRange(0), default=0, help="Which of the scenario's family.")
@click.option(
    "--picture", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.svg|png|jpg",
    help="Of a fault: draw what it does instead, without it and with it.",
)  # fmt: skip
@click.option(
    "--pictures", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="With the word 'faults': draw all of them.",
)  # fmt: skip
@click.option("--level", type=click.IntRange(1, 5), default=4, show_default=True, help="Severity to draw.")
def describe(
    words: tuple[str, ...], seed: int, picture: Path | None, pictures: Path | None, level: int
) -> None:
    """Print the concrete scenario of a seed, every number fixed; or a fault: its formula, fields and
    severities; or what a suite runs, and what it does not exercise. Or draw what a fault does.

    Example: simbench describe overtake-approach --seed 3
    """
    if picture is not None or pictures is not None:
        _draw_faults(words, picture, pictures, level)
        return
    if words[0] == "fault" and len(words) == 2:
        from scenarios.describe_fault import describe_fault

        click.echo(describe_fault(words[1]))
        return
    if words[0] == "suite" and len(words) == 2:
        from simbench.suite.coverage import describe_suite

        for line in describe_suite(words[1]):
            click.echo(line)
        return
    if len(words) != 1:
        raise click.UsageError("one scenario, or the word 'fault' or 'suite' and the name of one")
    from scenarios.describe import describe as text
    from scenarios.load import load_scenario

    click.echo(text(load_scenario(words[0]).resolve(seed)), nl=False)


def _draw_faults(words: tuple[str, ...], picture: Path | None, pictures: Path | None, level: int) -> None:
    """One fault into a file, or all of them into a folder."""
    from simbench.report.fault_pictures.command import write_picture, write_pictures

    if picture is not None and pictures is None and words[0] == "fault" and len(words) == 2:
        write_picture(words[1], level, picture)
        click.echo(f"wrote {picture}")
    elif pictures is not None and picture is None and words == ("faults",):
        for path in write_pictures(pictures, level):
            click.echo(f"wrote {path}")
    else:
        raise click.UsageError("'fault NAME' goes with --picture FILE, 'faults' with --pictures FOLDER")
