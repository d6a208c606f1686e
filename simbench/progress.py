"""A line on stderr for everything that is done of many, with the time left."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import click


@dataclass(kw_only=True)
class Progress:
    """How many there are, and how many were told since `begun` (s)."""

    total: int
    count: int = 0
    begun: float = field(default_factory=time.perf_counter)

    def say(self, words: str) -> None:
        """One more is done."""
        self.count += 1
        left_s = (time.perf_counter() - self.begun) / self.count * (self.total - self.count)
        click.echo(f"[{self.count}/{self.total}] {words} ({left_s / 60:.1f} min left)", err=True)
