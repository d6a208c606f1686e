"""What several verbs share: which pipelines run where none is named, and lists of seeds."""

from __future__ import annotations

import click

OF_THE_PAPER = ("static_projection", "static_projection_ground", "probabilistic")  # what `demo` runs
DEFAULT = (*OF_THE_PAPER, "robust")  # what `run` runs

cluster_option = click.option(
    "--cluster", metavar="tcp://HOST:PORT|local", default=None,
    help="Run on a dask.distributed cluster: where its scheduler is, or 'local' for --jobs processes here.",
)  # fmt: skip


def seeds_of(_: click.Context, __: click.Parameter, text: str) -> tuple[int, ...]:
    """The seeds that a list like 0-3 or 0,2,5 names. BadParameter: anything else."""
    from scenarios.seeding import seed_list

    try:
        return seed_list(text)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None
