"""How long each step of a pipeline takes, per scan."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager


class StepClock:
    """Adds up the time spent in named steps; `close_scan` files the sums as one entry per step.

    `with clock("ground"): ...` may be entered many times per scan (once per AOI, say).
    """

    def __init__(self, steps: Sequence[str]) -> None:
        self._running = dict.fromkeys(steps, 0)
        self._history: dict[str, list[int]] = {step: [] for step in steps}

    @contextmanager
    def __call__(self, step: str) -> Iterator[None]:
        start = time.perf_counter_ns()
        try:
            yield
        finally:
            self._running[step] += time.perf_counter_ns() - start

    def close_scan(self) -> None:
        """File what was spent since the last call, a zero for a step that was not entered."""
        for step, spent_ns in self._running.items():
            self._history[step].append(spent_ns)
            self._running[step] = 0

    def timings_ns(self) -> Mapping[str, Sequence[int]]:
        """Step name to the nanoseconds it took for each scan so far."""
        return {step: tuple(spent) for step, spent in self._history.items()}
