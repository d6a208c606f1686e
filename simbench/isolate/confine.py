"""What a pipeline's process does to itself before any code of the user runs.

It ends with the bench (a worker that is killed leaves nothing behind), writes no core file, and cannot ask
for much more private memory than its limit: the bench looks at what is resident a few dozen times a second,
and this stops what grows faster. Programs of other languages are started through this file:
`python confine.py MEMORY_MB PARENT PROGRAM ARGS`. Standard library only.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys

_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of linux/prctl.h
SPARE_MB = 4096  # threads' stacks and the buffers of linear algebra are asked for, but hardly used


def confine(memory_mb: int, parent: int) -> None:
    """`parent`: the process that started this one; where it is gone already, this one ends."""
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = (memory_mb + SPARE_MB) * 2**20
    if hard == resource.RLIM_INFINITY or most < hard:
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


if __name__ == "__main__":
    confine(int(sys.argv[1]), int(sys.argv[2]))
    os.execv(sys.argv[3], sys.argv[3:])
