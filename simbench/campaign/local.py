"""Executors of this machine: this very process, or processes that outlive what goes wrong in one of them."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from simbench.campaign.died import TookTooLong, WorkerDied, in_words

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
LOOK_S = 0.05
"""How often running tasks are looked at: the grain of a time limit."""
ORPHAN_S = 1.0
"""How often a worker looks whether the process that started it is still there."""
LAST_S = 10.0
"""How long the end waits for processes that are being stopped."""


def one_thread_each() -> None:
    """Libraries in processes started from now on use one thread each."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")


class Here(Executor):
    """This process: a task is done when `submit` returns. What kills a task kills the campaign."""

    width = 1

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Do it now."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class LocalPool(Executor):
    """`width` processes, each a `pebble.ProcessPool` of one worker.

    One pool each, so that it is known whose worker died, and so that a worker that dies while it holds its
    pool's locks holds up no other. Workers are spawned, live until something goes wrong in them, and end by
    themselves when this process is gone. A future raises `WorkerDied` or `TookTooLong`, or what its task
    raised. timeout_s: of a task, from the moment in which a worker has it, by a clock that never goes back
    (pebble's own limit goes by the time of day).
    """

    def __init__(self, width: int, timeout_s: float | None = None) -> None:
        one_thread_each()
        self.width = width
        self._timeout_s = timeout_s
        self._slots = [_Slot() for _ in range(width)]
        self._waiting: deque[_Call] = deque()
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._burials: list[threading.Thread] = []
        self._watcher = threading.Thread(target=self._watch, name="simbench-watch", daemon=True)
        self._watcher.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Queue a call of a function of a module."""
        with self._lock:
            if self._closed.is_set():
                raise RuntimeError("cannot schedule new futures after shutdown")
            call = _Call(fn, args, kwargs)
            self._waiting.append(call)
            self._hand_out()
        return call.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop the workers: now where `cancel_futures`, else once all that was submitted is done."""
        if cancel_futures:
            with self._lock:
                for call in self._waiting:
                    call.future.cancel()
                self._waiting.clear()
        elif wait:
            while self._busy():
                time.sleep(LOOK_S)
        self._closed.set()
        with self._lock:
            for slot in self._slots:
                left, slot.call = slot.call, None
                self._bury(slot)
                if left is not None:
                    left.future.set_exception(WorkerDied("stopped"))
        until_s = time.monotonic() + LAST_S
        for burial in self._burials:
            burial.join(max(0.0, until_s - time.monotonic()))
        self._watcher.join()

    def _busy(self) -> bool:
        with self._lock:
            return bool(self._waiting) or any(slot.call is not None for slot in self._slots)

    def _hand_out(self) -> None:
        """Give waiting calls to idle workers. The lock is held."""
        for slot in self._slots:
            while slot.call is None and self._waiting:
                call = self._waiting.popleft()
                if not call.future.set_running_or_notify_cancel():
                    continue
                try:
                    slot.start(call)
                except (BrokenProcessPool, OSError) as error:  # no memory, too many processes
                    self._settle(slot, call, WorkerDied(f"it could not be started: {error}"))
                else:
                    call.inner.add_done_callback(partial(self._ended, slot, call))

    def _ended(self, slot: _Slot, call: _Call, inner: Future[Any]) -> None:
        """Pebble says that a call is over."""
        from pebble import ProcessExpired

        if inner.cancelled():
            return
        error = inner.exception()
        if isinstance(error, ProcessExpired):
            self._settle(slot, call, WorkerDied(in_words(error.exitcode)))
        elif isinstance(error, BrokenProcessPool):
            self._settle(slot, call, WorkerDied("it was lost before it began"))
        elif error is not None:
            self._settle(slot, call, error, healthy=True)
        else:
            self._settle(slot, call, None, inner.result(), healthy=True)

    def _settle(
        self, slot: _Slot, call: _Call, error: BaseException | None, result: Any = None, healthy: bool = False
    ) -> None:
        """A call's one end: the first to come counts. A worker that is not healthy is not used again."""
        with self._lock:
            if slot.call is not call:
                return
            slot.call = None
            if not healthy:
                self._bury(slot)
            if not self._closed.is_set():
                self._hand_out()
        if error is not None:
            call.future.set_exception(error)
        else:
            call.future.set_result(result)

    def _watch(self) -> None:
        """Look for what pebble does not tell: a task over its limit, a worker that ended with exit code 0."""
        while not self._closed.wait(LOOK_S):
            for slot in self._slots:
                with self._lock:
                    call = slot.call
                    if call is None or not call.inner.running():
                        continue
                    now_s = time.monotonic()
                    call.begun_s = now_s if call.begun_s is None else call.begun_s
                    if self._timeout_s is not None and now_s - call.begun_s > self._timeout_s:
                        self._settle(slot, call, TookTooLong(self._timeout_s))
                    elif slot.left_quietly():
                        call.seen_gone += 1
                        if call.seen_gone > 2:  # its answer may have been on the way
                            self._settle(slot, call, WorkerDied(in_words(0)))

    def _bury(self, slot: _Slot) -> None:
        """Stop a pool without waiting for it: SIGTERM, after 3 s SIGKILL."""
        pool, slot.pool = slot.pool, None
        if pool is not None:
            pool.stop()
            self._burials = [burial for burial in self._burials if burial.is_alive()]
            self._burials.append(threading.Thread(target=pool.join, name="simbench-bury", daemon=True))
            self._burials[-1].start()


class _Call:
    """A call that was submitted. inner: pebble's future, once a slot has it."""

    inner: Future[Any]

    def __init__(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        self.fn, self.args, self.kwargs = fn, args, kwargs
        self.future: Future[Any] = Future()
        self.begun_s: float | None = None
        self.seen_gone = 0


class _Slot:
    """The place of one worker, and the call that it has."""

    def __init__(self) -> None:
        self.pool: Any = None
        self.call: _Call | None = None
        self._context = _Remembers()

    def start(self, call: _Call) -> None:
        from pebble import ProcessPool

        self.call = call
        if self.pool is None or not self.pool.active:
            self._context = _Remembers()
            self.pool = ProcessPool(
                max_workers=1, context=self._context, initializer=end_with, initargs=(os.getpid(),)
            )
        call.inner = self.pool.schedule(call.fn, args=call.args, kwargs=call.kwargs)

    def left_quietly(self) -> bool:
        """Whether a worker of this pool ended with exit code 0, which no worker does whose pool is open."""
        return any(process.exitcode == 0 for process in self._context.spawned)


class _Remembers(SpawnContext):
    """Spawns processes, and remembers them: pebble replaces one that ended with exit code 0 without a word,
    and its task would be waited for without end."""

    def __init__(self) -> None:
        self.spawned: list[SpawnProcess] = []

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]
        self.spawned.append(SpawnProcess(*args, **kwargs))
        return self.spawned[-1]


def end_with(parent: int) -> None:
    """End this process soon after its parent: a driver that was killed leaves no worker behind."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(ORPHAN_S)
        os._exit(1)

    threading.Thread(target=watch, name="simbench-orphan", daemon=True).start()
