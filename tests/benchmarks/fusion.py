"""What our pipelines cost per sweep on one core: six cameras, five objects of interest, OS1-64.

    python3 dev.py run python tests/benchmarks/fusion.py [--json] [--only PIPELINE ...] [--sweeps N]

Every pipeline gets the same recording of `five-objects`, message by message. A sweep costs what all calls of
`update` together cost from one answer to the next: pairing, mapping, localization. The first three sweeps
warm up and are left out. BLAS and OpenCV have one thread. Peak memory is what the pipeline allocates above
the recording, over its first third. Ratios are to the raw box. Exit code 0: measured, whatever the numbers;
2: usage.

JSON keys: `machine`; by pipeline `_p50_ms`, `_p99_ms`, `_vs_static_projection` (null without it), `_peak_mb`,
`_steps_ms`.
"""

import os
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # read at the import of NumPy
    from tests.benchmarks.fusion_rows import main

    sys.exit(main(sys.argv[1:]))
