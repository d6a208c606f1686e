"""What several verbs share: which pipelines run where none is named, and lists of seeds."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

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


def isolation(command: Callable[..., None]) -> Callable[..., None]:
    """The options about processes of pipelines; the command gets `apart`: what a `Job` takes of them."""

    @click.option(
        "--isolate", type=click.Choice(["users", "all", "none"]), default="users", show_default=True,
        help="Pipelines that get a process of their own: all but simbench's, all, or none (to debug one).",
    )  # fmt: skip
    @click.option(
        "--message-timeout", "message_s", type=click.FloatRange(0.01, 86400.0), default=10.0,
        show_default=True, metavar="SECONDS", help="From a message to its answer, in such a process.",
    )  # fmt: skip
    @click.option(
        "--case-timeout", "case_s", type=click.FloatRange(0.1, 864000.0), default=600.0,
        show_default=True, metavar="SECONDS", help="A whole case in such a process.",
    )  # fmt: skip
    @click.option(
        "--memory", "memory_mb", type=click.IntRange(64, 2**24), default=4096, show_default=True,
        metavar="MB", help="Of such a process and its children.",
    )  # fmt: skip
    @wraps(command)
    def with_them(
        *args: Any, isolate: str, message_s: float, case_s: float, memory_mb: int, **more: Any
    ) -> None:
        from simbench.isolate.limits import Limits

        limits = Limits(message_s=message_s, case_s=case_s, memory_mb=memory_mb)
        command(*args, apart={"isolate": isolate, "limits": limits}, **more)

    return with_them
