"""`simbench check PIPELINE`."""

from __future__ import annotations

import click


@click.command()
@click.argument("pipeline")
@click.option("--quick", is_flag=True, help="6 seeds instead of 12 where one drive is not enough.")
def check(pipeline: str, quick: bool) -> None:
    """Ask a pipeline what needs no threshold: does it keep the contract, and are its answers the same where
    only the question is put otherwise?

    PIPELINE is a name, module:attribute or file.py:attribute. Prints a line for each relation: holds, does
    not hold (the worst deviation and where), cannot be said (why). Exit code 0 only if all hold.

    Example: simbench check static_projection --quick
    """
    from simbench.checks.command import check_by_name
    from simbench.checks.relations import QUICK_SEEDS, SEEDS

    raise SystemExit(check_by_name(pipeline, QUICK_SEEDS if quick else SEEDS))
