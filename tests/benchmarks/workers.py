"""Two worker processes that live for a whole row: each sets up once, then works window after window."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

WORKERS = 2
_ready: Any = None  # in a worker: what `set_up` made


def _start(set_up: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    global _ready
    _ready = set_up(*arguments)


def _work(task: Callable[[Any, Any], float], argument: Any) -> float:
    return task(_ready, argument)


def rates(
    set_up: Callable[..., Any],
    arguments: tuple[Any, ...],
    task: Callable[[Any, Any], float],
    windows: Sequence[tuple[Any, Any]],
    spawn: bool = True,
) -> list[float]:
    """Simulated seconds per second of wall time, for each window but the first, which warms up.

    Each worker calls `set_up(*arguments)` once. In a window each gets one item of the pair; `task(ready,
    item)` returns the seconds that it simulated, and the window ends with the slower one. Both are
    module-level functions: the workers are spawned. Without `spawn` this process does both parts, in turn.
    """
    found = []
    with _pool(set_up, arguments) if spawn else _here(set_up, arguments) as work:
        for pair in windows:
            started = time.perf_counter()
            simulated_s = sum(work(_work, [task] * WORKERS, pair))
            found.append(simulated_s / (time.perf_counter() - started))
    return found[1:]


@contextmanager
def _pool(set_up: Callable[..., Any], arguments: tuple[Any, ...]) -> Iterator[Callable[..., Iterable[float]]]:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, context, initializer=_start, initargs=(set_up, arguments)) as pool:
        yield pool.map


@contextmanager
def _here(set_up: Callable[..., Any], arguments: tuple[Any, ...]) -> Iterator[Callable[..., Iterable[float]]]:
    _start(set_up, arguments)
    yield map
