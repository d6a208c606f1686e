"""The executor of a dask.distributed cluster: one that runs somewhere, or processes of this machine."""

from __future__ import annotations

import importlib
import logging
import math
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import ExitStack
from typing import Any

from scenarios.errors import BadInput
from simbench.campaign.died import TookTooLong, WorkerDied

LOCAL = "local"
ANSWER_S = 15.0
"""How long a scheduler may take to answer, and how long a lost one is looked for."""
ASK_S = 2.0
"""How old the number of workers may be."""
EMPTY_S = 120.0
"""How long a cluster may be without any worker."""
LEAVE_S = 0.5
"""How long a worker with a task that is stuck lives on, so that its answer leaves it."""


class Cluster(Executor):
    """`dask.distributed.Client.get_executor()`, with the ends of `LocalPool`.

    address: `tcp://HOST:PORT` of a scheduler, or `local`: `workers` processes on loopback. Raises BadInput
    where dask is not installed or nobody answers. A cluster that is lost ends its futures with BadInput.
    """

    def __init__(self, address: str, workers: int, timeout_s: float | None = None) -> None:
        try:
            dask: Any = importlib.import_module("dask")
            distributed: Any = importlib.import_module("distributed")
        except ImportError as error:
            raise BadInput(
                "a cluster needs dask.distributed, which is not installed: pip install 'simbench[cluster]'",
                field="--cluster",
            ) from error
        _hush()
        self._timeout_s, self._address = timeout_s, address
        self._killed = distributed.scheduler.KilledWorker
        self._seen_s, self._width, self._asked_s = time.monotonic(), 1, -math.inf
        with ExitStack() as stack:
            settings = {
                "distributed.comm.timeouts.connect": f"{ANSWER_S}s",
                "distributed.scheduler.allowed-failures": 0,  # who died how often is counted in `run.py`
                "distributed.admin.low-level-log-length": 1000,  # memory that does not grow with the tasks
            }
            stack.enter_context(dask.config.set(settings))
            if address == LOCAL:
                cluster = distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1",
                    dashboard_address=None, memory_limit=0, silence_logs=logging.CRITICAL,
                )  # fmt: skip
                self._address = stack.enter_context(cluster).scheduler_address
            try:
                self._client = stack.enter_context(
                    distributed.Client(self._address, timeout=ANSWER_S, set_as_default=False)
                )
            except (OSError, TimeoutError, ValueError) as error:
                raise BadInput(
                    f"no cluster answers at {self._address}", field="--cluster",
                    allowed="tcp://HOST:PORT of a running 'dask scheduler', or local",
                ) from error  # fmt: skip
            self._inner = self._client.get_executor(pure=False)
            self._open = stack.pop_all()

    @property
    def width(self) -> int:
        """How many tasks the workers that there are can do at a time, at least 1. BadInput: it is lost, or
        has workers of many threads, which would share what `simbench/reuse.py` keeps."""
        if time.monotonic() - self._asked_s > ASK_S:
            try:
                threads = self._client.nthreads().values()
            except (OSError, TimeoutError, RuntimeError, ValueError) as error:
                raise self.lost() from error
            if max(threads, default=1) > 1:
                raise BadInput(
                    f"a worker of {self._address} has {max(threads)} threads", allowed="--nthreads 1"
                )
            self._width, self._asked_s = max(1, len(threads)), time.monotonic()
        return self._width

    def check(self) -> None:
        """Called now and then while nothing comes back. BadInput: it will not."""
        if self._client.status not in ("running", "connecting"):
            raise self.lost()
        if self._client.status == "running" and self._client.nthreads():
            self._seen_s = time.monotonic()
        if time.monotonic() - self._seen_s > EMPTY_S:
            raise BadInput(f"the cluster at {self._address} has had no worker for {EMPTY_S:g} s; {KEPT}")

    def lost(self) -> BadInput:
        """The sentence about a scheduler that is gone."""
        return BadInput(f"the cluster at {self._address} is lost; {KEPT}")

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Send a call of a function that the workers can import."""
        outer: Future[Any] = Future()
        try:
            inner = self._inner.submit(_timed, self._timeout_s, fn, args, kwargs)
        except Exception as error:  # a closed client raises many things
            raise self.lost() from error
        outer.set_running_or_notify_cancel()
        inner.add_done_callback(lambda ended: self._settle(outer, ended))
        return outer

    def _settle(self, outer: Future[Any], inner: Future[Any]) -> None:
        if inner.cancelled():  # by nobody here: dask does so with all it had on a scheduler that is gone
            outer.set_exception(self.lost())
        elif isinstance(inner.exception(), self._killed):
            outer.set_exception(WorkerDied("it was lost"))
        elif (error := inner.exception()) is not None:
            outer.set_exception(error)
        else:
            outer.set_result(inner.result())

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster; end it where it is ours."""
        if self._client.status == "running":
            self._inner.shutdown(wait=wait and not cancel_futures)
        self._open.close()


KEPT = "what was measured is kept, and the same command goes on from there"


def _hush() -> None:
    """What goes wrong in dask is told by us, once."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _timed(
    timeout_s: float | None, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Any:
    """In a worker of the cluster: a call with a time limit. A call that is stuck cannot be ended alone, so
    that its worker goes with it and its nanny starts another."""
    if timeout_s is None:
        return fn(*args, **kwargs)
    future: Future[Any] = Future()

    def call() -> None:
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:  # handed to who waits
            future.set_exception(error)

    threading.Thread(target=call, daemon=True).start()
    try:
        return future.result(timeout_s)
    except TimeoutError:
        if future.done():  # a TimeoutError of the task's own
            raise
        if importlib.import_module("distributed").get_worker().nanny is not None:
            threading.Timer(LEAVE_S, os._exit, (1,)).start()
        raise TookTooLong(timeout_s) from None
