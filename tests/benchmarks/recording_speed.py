"""What it costs to write recordings, beside making them, and beside writing the same arrays otherwise.

    python3 dev.py run python tests/benchmarks/recording_speed.py [RUNS]

For each drive (overtake-approach, car, 5.2 s, no images): seconds to make it, to write it (also those of
processors: writing uses two, and others on the machine disturb them less), to write its arrays by NumPy
(`savez`, and `savez_compressed`), without names or hashes, and sizes. Prints medians and ratios. The rival
has less to do; what it saves is the price of hashes, checksums and frames.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from simbench.cards.statistics import sights
from simbench.case import Job
from simbench.formats.store import _messages, _truth, write_recording
from simbench.generate.work import size_of, source_of
from simbench.recording import Recording
from simbench.run import recording_of

JOB = Job(scenario="overtake-approach", system="car", seed=0, pipelines=(), images="none")
DRIVEN_S = 5.2


def timed(work: Callable[[], object]) -> float:
    return both_timed(work)[0]


def both_timed(work: Callable[[], object]) -> tuple[float, float]:
    """Seconds that passed, and those of all processors of this process."""
    begun, processors = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - begun, time.process_time() - processors


def arrays(recording: Recording) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for frames in (_messages(recording), _truth(recording)):
        for number, (topic, _, _, frame) in enumerate(frames):
            found |= {f"{topic}/{number}/{name}": array for name, array in frame.arrays.items()}
    return found


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    recording_of(JOB)  # compiles, once
    rows = []
    for seed in range(1, runs + 1):
        job = replace(JOB, seed=seed)
        made: list[Recording] = []
        making = both_timed(lambda job=job, made=made: made.append(recording_of(job)[2].recording))  # type: ignore[misc]
        recording = made[0]
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            writing = both_timed(lambda: write_recording(recording, out / "ours", source_of(job)))  # noqa: B023
            counting = timed(lambda: sights(recording))  # noqa: B023
            plain = arrays(recording)
            saving = timed(lambda: np.savez(out / "plain.npz", **plain))  # type: ignore[arg-type]  # noqa: B023
            packing = timed(lambda: np.savez_compressed(out / "packed.npz", **plain))  # type: ignore[arg-type]  # noqa: B023
            sizes = [size_of(out / "ours"), *((out / f"{n}.npz").stat().st_size for n in ("plain", "packed"))]
        rows.append((*making, *writing, counting, saving, packing, *sizes))
    making, making_cpu, writing, writing_cpu, counting, saving, packing, ours, theirs, packed = (
        statistics.median(column) for column in zip(*rows, strict=True)
    )
    ratio, ratio_cpu = (statistics.median(row[i + 2] / row[i] for row in rows) for i in (0, 1))
    print(f"{runs} drives of {DRIVEN_S} s, medians")
    print(f"making {making:.2f} s, writing {writing:.2f} s: adds {100 * ratio:.0f} %")
    print(f"of processors: {making_cpu:.2f} s, {writing_cpu:.2f} s: adds {100 * ratio_cpu:.0f} %")
    print(f"statistics for the card {counting:.2f} s: adds {100 * counting / making:.0f} %")
    print(f"size {ours / 1e6:.1f} MB, {ours / 1e6 / DRIVEN_S:.1f} MB per second of driving")
    print(
        f"numpy savez: {saving:.2f} s, {theirs / 1e6:.1f} MB; ours takes {writing / saving:.2f} of its time"
    )
    print(f"numpy savez_compressed: {packing:.2f} s, {packed / 1e6:.1f} MB; {writing / packing:.2f}")


if __name__ == "__main__":
    main()
