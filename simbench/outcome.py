"""How a command that ran cases ends."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import click

from simbench.canary import canary

GOOD: Final = 0
FAILED: Final = 1
BENCH_ERROR: Final = 3


def exit_code(statuses: Iterable[str]) -> int:
    """0 all well, 1 a pipeline failed somewhere, 3 the bench did: a case says so, or the canary passed."""
    blind, ended = canary(), set(statuses)
    if blind:
        click.echo(f"simbench: {blind}", err=True)
    if blind or ended & {"bench_error", "receipt_mismatch"}:
        return BENCH_ERROR
    return FAILED if ended - {"ok"} else GOOD
