"""One recording of a data set: made, proved by its receipts, written beside its place and put there whole."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from scenarios.scenario import Scenario
from simbench.campaign.job_key import job_key
from simbench.cards.statistics import sights
from simbench.cards.table import write_sights
from simbench.case import Job
from simbench.formats.kitti_write import write_kitti
from simbench.formats.pcd import write_pcd_folder
from simbench.formats.png import Pictures
from simbench.formats.ros2.bag import write_bag
from simbench.formats.scene import RecordedScene
from simbench.formats.store import Injected, Source, write_recording
from simbench.generate.require import Requirement, missed
from simbench.recording import Recording
from simbench.run import mismatch, recording_of

Format = Literal["mcap", "kitti", "pcd"]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A job, and the folder of the data set in which its recording gets a folder of this name if it holds
    what is required; formats: it is written in too, beside the bench's own."""

    job: Job
    out: str
    name: str
    required: tuple[Requirement, ...] = ()
    formats: tuple[Format, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Row:
    """What became of a recording: `ok`, `rejected` (it does not hold what is required), or what went wrong.
    why: None where it is there. size_bytes: of its folders. driven_s: how long the drive is. seconds: that it
    took to make, and to write."""

    name: str
    status: str
    why: str | None = None
    size_bytes: int = 0
    messages: int = 0
    sha256: str = ""
    driven_s: float = 0.0
    seconds: tuple[float, float] = (0.0, 0.0)


def key_of(task: Task) -> str:
    """The key of a recording, wherever its data set lies."""
    return job_key(
        task.job, name=task.name, required=[str(one) for one in task.required], formats=list(task.formats)
    )


def row_of(task: Task) -> str:
    """Make a recording and write it; its row as JSON text."""
    begun = time.perf_counter()
    with Pictures() as pictures:
        scenario, faults, made = recording_of(task.job, pictures.beside)
        if why := mismatch(made.receipts):
            return json.dumps(asdict(Row(name=task.name, status="receipt_mismatch", why=why)))
        if why := missed(task.required, made.recording):
            return json.dumps(asdict(Row(name=task.name, status="rejected", why=why)))
        written = time.perf_counter()
        injected = Injected(
            label=faults.label, specs=faults.as_data(), shake=made.shake, receipts=made.receipts
        )
        place = Path(task.out) / task.name
        with placed(place) as beside:
            part = write_recording(
                made.recording, beside, source_of(task.job), injected, pictures.png
            ).messages
            write_sights(sights(made.recording), beside)
    assert part is not None  # it is complete
    size = size_of(place) + sum(write_as(one, made.recording, task) for one in task.formats)
    done = time.perf_counter()
    row = Row(
        name=task.name, status="ok", size_bytes=size, messages=part.count, sha256=part.sha256,
        driven_s=_driven_s(scenario, task.job.system), seconds=(written - begun, done - written),
    )  # fmt: skip
    return json.dumps(asdict(row))


def _driven_s(scenario: Scenario | RecordedScene, system: str) -> float:
    if isinstance(scenario, RecordedScene):
        return scenario.duration_s
    return scenario.system(system).duration_s


def write_as(one: Format, recording: Recording, task: Task) -> int:
    """Write a recording in another format, into OUT/FORMAT/NAME; its bytes."""
    place = Path(task.out) / one / task.name
    with placed(place) as beside:
        if one == "mcap":
            write_bag(recording, beside)
        elif one == "kitti":
            write_kitti(recording, beside)
        else:
            write_pcd_folder(recording, beside)
    return size_of(place)


@contextmanager
def placed(place: Path) -> Iterator[Path]:
    """An empty folder of a place's name beside it, put there when all is written; what was there is
    replaced."""
    aside = place.parent / f".{place.name}"
    shutil.rmtree(aside, ignore_errors=True)  # what a killed worker left
    beside = aside / place.name
    beside.mkdir(parents=True)
    yield beside
    shutil.rmtree(place, ignore_errors=True)  # made by other code, or the ledger would hold it
    beside.rename(place)
    aside.rmdir()


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
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
