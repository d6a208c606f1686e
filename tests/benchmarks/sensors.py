"""Ours and the rivals, measured side by side in one run.

    python3 dev.py run python tests/benchmarks/sensors.py [--json] [--only KEY ...] [--quick]

`dev.py run` installs the rivals (requirements-bench.lock) for scripts of this folder; one that cannot be
installed gives null and a line in `notes`. Exit code 0: measured, whatever the numbers; 1: a side gave a
wrong answer; 2: usage.
"""

import os
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # read at the import of NumPy, here and in the workers
    from tests.benchmarks.cli import main

    sys.exit(main(sys.argv[1:]))
