"""Many jobs on a few processes, nothing kept. Results come in the order of the jobs."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from simbench.campaign.local import one_thread_each
from simbench.case import Job, JobResult
from simbench.run import run_job

Task = TypeVar("Task")
Result = TypeVar("Result")


def run_jobs(
    jobs: Sequence[Job], workers: int, done: Callable[[JobResult], None] = lambda _: None
) -> tuple[JobResult, ...]:
    """Run all jobs; `done` hears of each as it is collected. Raises what a job raises (bad input, no
    renderer).
    """
    if min(workers, len(jobs)) > 1:
        _find_renderer_once(jobs)
    results = []
    for result in each_of(run_job, jobs, workers):
        done(result)
        results.append(result)
    return tuple(results)


def each_of(work: Callable[[Task], Result], tasks: Sequence[Task], workers: int) -> Iterator[Result]:
    """What `work` makes of each task, in their order, by up to `workers` processes; `work` is a function of a
    module. Raises what it raises.
    """
    workers = min(workers, len(tasks))
    if workers <= 1:
        yield from map(work, tasks)
        return
    one_thread_each()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=workers, mp_context=context) as pool:
        try:
            yield from pool.map(work, tasks)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _find_renderer_once(jobs: Sequence[Job]) -> None:
    """Probe for OpenGL here, so that every worker inherits the finding."""
    if any(job.images == "gl" for job in jobs):
        from simbench.sensors import gl

        gl.provision()
