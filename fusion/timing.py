"""How long each step of a pipeline takes, per scan."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence


class StepClock:
    """Adds up the time spent in named steps; `close_scan` files the sums as one entry per step.

    `with clock("ground"): ...` may be entered many times per scan (once per AOI, say).
    """

    def __init__(self, steps: Sequence[str]) -> None:
        self._running = dict.fromkeys(steps, 0)
        self._history: dict[str, list[int]] = {step: [] for step in steps}

    def __call__(self, step: str) -> _Step:
        return _Step(self._running, step)

    def close_scan(self) -> None:
        """File what was spent since the last call, a zero for a step that was not entered."""
        for step, spent_ns in self._running.items():
            self._history[step].append(spent_ns)
            self._running[step] = 0

    def timings_ns(self) -> Mapping[str, Sequence[int]]:
        """Step name to the nanoseconds it took for each scan so far."""
        return {step: tuple(spent) for step, spent in self._history.items()}


class _Step:
    """Adds the time between entering and leaving to `running[step]`; a class, for a generator costs more."""

    __slots__ = ("_running", "_start_ns", "_step")

    def __init__(self, running: dict[str, int], step: str) -> None:
        self._running, self._step = running, step

    def __enter__(self) -> None:
        self._start_ns = time.perf_counter_ns()

    def __exit__(self, *_: object) -> None:
        self._running[self._step] += time.perf_counter_ns() - self._start_ns
