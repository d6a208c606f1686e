"""Many jobs on a few processes. Results come in the order of the jobs, whatever finishes first."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor

from simbench.case import Job, JobResult
from simbench.run import run_job

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def run_jobs(
    jobs: Sequence[Job], workers: int, done: Callable[[JobResult], None] = lambda _: None
) -> tuple[JobResult, ...]:
    """Run all jobs; `done` hears of each as it is collected. Raises what a job raises (bad input, no
    renderer).
    """
    results = []
    for result in _collect(jobs, min(workers, len(jobs))):
        done(result)
        results.append(result)
    return tuple(results)


def _collect(jobs: Sequence[Job], workers: int) -> Iterator[JobResult]:
    if workers <= 1:
        yield from map(run_job, jobs)
        return
    _find_renderer_once(jobs)
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=workers, mp_context=context) as pool:
        try:
            yield from pool.map(run_job, jobs)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _find_renderer_once(jobs: Sequence[Job]) -> None:
    """Probe for OpenGL here, so that every worker inherits the finding."""
    if any(job.images == "gl" for job in jobs):
        from simbench.sensors import gl

        gl.provision()
