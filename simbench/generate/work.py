"""One recording of a data set: made, proved by its receipts, written beside its place and put there whole."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from simbench.campaign.job_key import job_key
from simbench.case import Job
from simbench.formats.png import Pictures
from simbench.formats.store import Injected, Source, write_recording
from simbench.run import mismatch, recording_of


@dataclass(frozen=True, kw_only=True)
class Task:
    """A job, and the folder of the data set in which its recording gets a folder of this name."""

    job: Job
    out: str
    name: str


@dataclass(frozen=True, kw_only=True)
class Row:
    """What became of a recording. why: None where it is there. size_bytes: of its folder. seconds: that it
    took to make, and to write."""

    name: str
    status: str
    why: str | None = None
    size_bytes: int = 0
    messages: int = 0
    sha256: str = ""
    seconds: tuple[float, float] = (0.0, 0.0)


def key_of(task: Task) -> str:
    """The key of a recording, wherever its data set lies."""
    return job_key(task.job, name=task.name)


def row_of(task: Task) -> str:
    """Make a recording and write it; its row as JSON text."""
    begun = time.perf_counter()
    with Pictures() as pictures:
        _, faults, made = recording_of(task.job, pictures.beside)
        if why := mismatch(made.receipts):
            return json.dumps(asdict(Row(name=task.name, status="receipt_mismatch", why=why)))
        written = time.perf_counter()
        place, beside = Path(task.out) / task.name, Path(task.out) / f".{task.name}"
        shutil.rmtree(beside, ignore_errors=True)  # what a killed worker left
        injected = Injected(
            label=faults.label, specs=faults.as_data(), shake=made.shake, receipts=made.receipts
        )
        source = source_of(task.job)
        messages = write_recording(made.recording, beside, source, injected, pictures.png).messages
    assert messages is not None  # it is complete
    shutil.rmtree(place, ignore_errors=True)  # made by other code, or the ledger would hold it
    beside.rename(place)
    done = time.perf_counter()
    row = Row(
        name=task.name, status="ok", size_bytes=size_of(place), messages=messages.count,
        sha256=messages.sha256, seconds=(written - begun, done - written),
    )  # fmt: skip
    return json.dumps(asdict(row))


def source_of(job: Job) -> Source:
    """A job in the words of a recording's manifest."""
    return Source(
        scenario=job.scenario, system=job.system, seed=job.seed, faults=job.faults, changes=job.changes,
        images=job.images,
    )  # fmt: skip


def job_of(source: Source) -> Job:
    """The job that makes a recording again."""
    return Job(
        scenario=source.scenario, system=source.system, seed=source.seed, pipelines=(), faults=source.faults,
        changes=source.changes, images=source.images,
    )  # fmt: skip


def size_of(folder: Path) -> int:
    """Bytes of the files of a folder."""
    return sum(path.stat().st_size for path in folder.iterdir())
