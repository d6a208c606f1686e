"""Where the time goes: a sweep, the pictures of one frame, a whole case; and what its arithmetic alone takes.

    python3 dev.py run python tests/benchmarks/breakdown.py

Times are CPU times of one core, medians, but where a table says wall. Prints tables in Markdown, as
docs/performance.md shows them.
"""

import os
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    from tests.benchmarks.parts import main

    main()
