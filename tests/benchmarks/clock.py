"""Timing that is fair on a busy machine: two sides take turns, and medians of their CPU time are compared.

CPU time of the whole process, all threads together: others on the machine make no side slower, and no side
wins by taking a second core. Where nobody else is there it is the wall time.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Duel:
    """Median CPU seconds of both sides, and the median over turns of second / first."""

    first_s: float
    second_s: float
    ratio: float


def duel(first: Callable[[], object], second: Callable[[], object], turns: int) -> Duel:
    """first, second, first, second ...: `turns` times each, after one call each that is not timed."""
    first(), second()
    seconds = np.array([[_seconds(first), _seconds(second)] for _ in range(turns)])
    first_s, second_s = np.median(seconds, axis=0)
    ratio = np.median(seconds[:, 1] / seconds[:, 0])
    return Duel(first_s=float(first_s), second_s=float(second_s), ratio=float(ratio))


def _seconds(call: Callable[[], object]) -> float:
    started = process_time()
    call()
    return process_time() - started


@contextmanager
def one_core() -> Iterator[None]:
    """This process, and threads started within, stay on one core: no side can use more than one."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def milliseconds(seconds: float) -> str:
    """Three digits, such as "2.61 ms" or "143 ms"."""
    value = seconds * 1e3
    return f"{value:.{max(0, 2 - int(np.floor(np.log10(max(value, 1e-3)))))}f} ms"
