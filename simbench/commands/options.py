"""What several verbs share: which pipelines run where none is named, and lists of seeds."""

from __future__ import annotations

import click

OF_THE_PAPER = ("static_projection", "static_projection_ground", "probabilistic")  # what `demo` runs
DEFAULT = (*OF_THE_PAPER, "robust")  # what `run` runs


def seeds_of(_: click.Context, __: click.Parameter, text: str) -> tuple[int, ...]:
    """The seeds that a list like 0-3 or 0,2,5 names. BadParameter: anything else."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        numbers = (first, last) if dash else (first,)
        if not all(word.isascii() and word.isdigit() and len(word) < 19 for word in numbers):
            raise click.BadParameter(f"'{text}' is not a list of seeds; allowed: 0-3 or 0,2,5")
        low, high = int(first), int(last) if dash else int(first)
        if high < low or high - low >= 100_000:
            raise click.BadParameter(f"'{part}' is not a range of seeds from low to high")
        found += [seed for seed in range(low, high + 1) if seed not in found]
    return tuple(found)
