"""`simbench check`: ask a pipeline everything and print the table as it grows."""

from __future__ import annotations

from collections.abc import Sequence

import click

from simbench.checks.relations import RELATIONS, check
from simbench.checks.table import last_line, line
from simbench.plugins import load_pipeline

FAILED = 1


def check_by_name(name: str, seeds: Sequence[int]) -> int:
    """The exit code: 0 where every relation holds. BadInput: no such pipeline."""
    factory = load_pipeline(name)
    found = []
    for relation, finding in check(factory, seeds):
        found.append(finding)
        click.echo(line(relation, finding, RELATIONS))
    click.echo(last_line(name, found))
    return 0 if all(finding.verdict == "holds" for finding in found) else FAILED
