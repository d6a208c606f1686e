"""What several verbs share: which pipelines run where none is named, and options."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
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


def size_of(_: click.Context, __: click.Parameter, text: str | None) -> tuple[int, int] | None:
    """The size that a word like 960x600 names. BadParameter: anything else."""
    if text is None:
        return None
    width, cross, height = text.partition("x")
    if not cross or not (width + height).isascii() or not width.isdigit() or not height.isdigit():
        raise click.BadParameter(f"'{text}' is not an image size; allowed: 960x600")
    if not (64 <= int(width) <= 2048 and 64 <= int(height) <= 2048):
        raise click.BadParameter(f"'{text}' is out of range; allowed: 64x64 to 2048x2048")
    return int(width), int(height)


def common(folder: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The options that `demo` and `run` share; `folder`: where results go unless told."""
    options = (
        click.option("--seeds", default="0-1", callback=seeds_of, help="Runs to make: 0-3 or 0,2,5."),
        click.option(
            "--images",
            type=click.Choice(["none", "raycast", "gl"]),
            default="raycast",
            show_default=True,
            help="Take pictures by rays, by OpenGL, or not at all.",
        ),
        click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores)."),
        click.option(
            "--out",
            type=click.Path(path_type=Path),
            default=Path(folder),
            show_default=True,
            help="Folder for result.json, report.html and the video.",
        ),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout."),
        click.option("--size", callback=size_of, default=None, help="Image size in pixels, e.g. 960x600."),
    )

    def add(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return add


OF_SUITES = (
    "words", "tags", "last_failed", "resume", "against", "allow_changed", "until_decided", "cluster",
)  # fmt: skip


def of_suites(command: Callable[..., None]) -> Callable[..., None]:
    """The options of `run` that are for suites; the command gets `suite`: those that were given, by name."""
    path = click.Path(path_type=Path)
    options = (
        click.option("-k", "words", default=None, metavar="EXPR", help="Suites: only cases whose id has it."),
        click.option("-m", "tags", default=None, metavar="TAG", help="Suites: only blocks with this tag."),
        click.option("--lf", "last_failed", is_flag=True, help="Suites: only what did not pass last time."),
        click.option("--resume", is_flag=True, help="Suites: go on where a run in --out was stopped."),
        click.option("--against", type=path, default=None, metavar="FILE", help="Suites: a baseline."),
        click.option("--allow-changed", is_flag=True, help="Suites: compare though the bench changed."),
        click.option("--until-decided", is_flag=True, help="Suites: 20, 40 or 80 runs, as verdicts need."),
        cluster_option,
    )

    @wraps(command)
    def with_them(*args: Any, **more: Any) -> None:
        command(*args, suite={name: more.pop(name) for name in OF_SUITES}, **more)

    wrapped: Callable[..., None] = with_them
    for option in reversed(options):
        wrapped = option(wrapped)
    return wrapped
