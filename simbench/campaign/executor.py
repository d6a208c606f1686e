"""Where tasks run, by one interface: `concurrent.futures.Executor`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from scenarios.errors import BadInput, show
from simbench.campaign.local import Here, LocalPool

LOCAL = "local"


@contextmanager
def open_executor(
    workers: int | None = None, cluster: str | None = None, timeout_s: float | None = None
) -> Iterator[Executor]:
    """An executor for the length of a block; its workers end with it.

    workers: processes on this machine (None: its cores); one works in this process, unless a task has a time
    limit. cluster: `tcp://HOST:PORT` of a dask scheduler, whatever workers it has, or `local`: dask with
    `workers` processes. timeout_s: of a task. Raises BadInput.
    """
    check_cluster(cluster)
    count = workers or os.cpu_count() or 1
    executor: Executor
    if cluster is not None:
        from simbench.campaign.cluster import Cluster

        executor = Cluster(cluster, count, timeout_s)
    elif count == 1 and timeout_s is None:
        executor = Here()
    else:
        executor = LocalPool(count, timeout_s)
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=True, cancel_futures=True)
        raise
    executor.shutdown(wait=True)


def check_cluster(cluster: str | None) -> None:
    """BadInput: not the word `local` nor an address."""
    if cluster is not None and cluster != LOCAL and "://" not in cluster:
        raise BadInput(f"{show(cluster)} is no cluster", field="--cluster", allowed="tcp://HOST:PORT, local")


def in_flight(executor: Executor) -> int:
    """How many tasks to hand to an executor at a time: so many that none of its workers waits."""
    if isinstance(executor, Here):
        return 1
    return 2 * int(getattr(executor, "width", os.cpu_count() or 1)) + 1
