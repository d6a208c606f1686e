"""How much a data set takes: one second of each kind of drive is recorded, the rest is proportion."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenarios.errors import BadInput
from scenarios.load import Family, load_scenario
from simbench.formats.store import write_recording
from simbench.generate.work import Task, size_of, source_of, write_as
from simbench.run import recording_of

SPARE = 1.2  # of the estimate: drives of a family differ


def estimate_bytes(tasks: Sequence[Task], out: Path) -> int:
    """Of all recordings together, in all their formats. Raises BadInput."""
    drives: dict[tuple[str, tuple[str, ...], str, str], tuple[Family, float]] = {}
    total = 0.0
    for task in tasks:
        job = task.job
        drive = (job.scenario, job.changes, job.system, job.images)
        if drive not in drives:
            drives[drive] = load_scenario(job.scenario, job.changes), _second_bytes(task, out)
        family, second = drives[drive]
        total += family.resolve(job.seed).system(job.system).duration_s * second
    return int(total)


def check_room(needed_bytes: int, out: Path) -> None:
    """BadInput: the disk has no room for so much and a fifth more."""
    free = shutil.disk_usage(out).free
    if SPARE * needed_bytes > free:
        raise BadInput(
            f"the recordings take about {needed_bytes / 1e9:.2f} GB, and {free / 1e9:.2f} GB are free there",
            file=str(out),
        )


def _second_bytes(task: Task, out: Path) -> float:
    job = task.job
    short = replace(
        job, seed=0, faults=("none",), changes=(*job.changes, f"systems.{job.system}.duration_s=1")
    )
    _, _, made = recording_of(short)
    with tempfile.TemporaryDirectory(dir=out, prefix=".") as folder:
        write_recording(made.recording, Path(folder) / "pilot", source_of(short))
        pilot = replace(task, job=short, out=folder, name="pilot")
        others = sum(write_as(one, made.recording, pilot) for one in task.formats)
        return float(size_of(Path(folder) / "pilot") + others)
