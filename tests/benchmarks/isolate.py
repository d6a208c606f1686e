"""What isolation costs: a case in a process of its own against the same case in the bench's process.

    python3 dev.py run python tests/benchmarks/isolate.py [--pipeline NAME] [--repeats 5]

Of a recording of overtake-approach, car, seed 0, without and with images: seconds to start a host, to start
it and load the pipeline, of a whole case apart and in here (medians of cases that take turns), and their
ratio.
`per message` is what is left of the difference after the start, by message: packing, pipes and waking up.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from simbench.case import Job  # noqa: E402
from simbench.drive import drive  # noqa: E402
from simbench.isolate.drive import drive_isolated  # noqa: E402
from simbench.isolate.limits import DEFAULT  # noqa: E402
from simbench.isolate.reference import command_of  # noqa: E402
from simbench.isolate.session import Session  # noqa: E402
from simbench.plugins import load_pipeline  # noqa: E402
from simbench.run import recording_of  # noqa: E402


def seconds(work: Callable[[], object]) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def started(name: str) -> None:
    with Session(command_of(name), DEFAULT):
        pass


def main() -> None:
    parser = argparse.ArgumentParser(description="Measures what a process of its own costs a pipeline.")
    parser.add_argument("--pipeline", default="robust")
    parser.add_argument("--repeats", type=int, default=5)
    chosen = parser.parse_args()
    name, turns = chosen.pipeline, range(chosen.repeats)
    imported = [sys.executable, "-c", "import simbench.isolate.host"]
    bare_s = median(seconds(lambda: subprocess.run(imported, check=True, cwd=ROOT)) for _ in turns)
    start_s = median(seconds(lambda: started(name)) for _ in turns)
    print(f"host imported {bare_s:.2f} s; started with {name}, described and ended {start_s:.2f} s")
    for images in ("none", "raycast"):
        job = Job(scenario="overtake-approach", system="car", seed=0, pipelines=(), images=images)
        recording = recording_of(job)[2].recording
        told = (recording.calibration, recording.categories, recording.messages)
        here, apart = [], []
        for _ in turns:
            here.append(seconds(lambda: drive(load_pipeline(name)(), *told)))  # noqa: B023
            apart.append(seconds(lambda: drive_isolated(name, *told, DEFAULT)))  # noqa: B023
        here_s, apart_s = median(here), median(apart)
        each_ms = 1e3 * (apart_s - here_s - start_s) / len(recording.messages)
        print(
            f"images {images}: {len(recording.messages)} messages, here {here_s:.2f} s, "
            f"apart {apart_s:.2f} s, ratio {apart_s / here_s:.2f}, per message {each_ms:.2f} ms"
        )


if __name__ == "__main__":
    main()
