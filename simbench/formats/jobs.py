"""Jobs on recorded data: which ones a target of the command line stands for, and how one is played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scenarios.errors import BadInput, Where, show
from scenarios.fault_set import OPTION
from scenarios.recorded import parse_recorded_faults
from simbench.case import Images, Job, boxes_of
from simbench.formats.calibration import CAMERA
from simbench.formats.inject import check_faults
from simbench.formats.kitti import WORDS, listed, open_kitti
from simbench.formats.recorded import Player, Recorded, words
from simbench.formats.scene import SYSTEM
from simbench.formats.stored import plan_stored, play_stored
from simbench.formats.targets import is_stored
from simbench.isolate.ask import reads_images

MOST_JOBS = 100_000


def plan(job: Job, numbers: Sequence[int] | None, *, alone: bool) -> list[Job]:
    """The jobs of a `kitti:PATH` target: one per recording (all, or those of `numbers`), before it the same
    without faults where there are some, unless `alone`. Every text file is read and every sweep's size
    checked, so that bad input shows before anything runs. BadInput.
    """
    if job.size_px is not None:
        raise BadInput("--size: recorded images have the size that they have")
    if job.system not in (SYSTEM, "both"):
        raise BadInput(f"unknown system {show(job.system)}", file=job.scenario, allowed=SYSTEM)
    folder = open_kitti(job.scenario)
    faults = parse_recorded_faults(job.faults)
    faults.check((CAMERA,), Where(file=OPTION))
    chosen = tuple(folder.names) if numbers is None else tuple(numbers)
    for number in chosen:
        if number not in folder.names:
            raise BadInput(
                f"there is no {WORDS[folder.layout]} {number}",
                file=job.scenario,
                allowed=listed(tuple(folder.names)),
            )
    # Recorded images need nobody to draw them.
    images: Images = "none" if job.images == "none" else "raycast"
    planned = []
    for number in chosen:
        drive = folder.drive(number, job.frames)
        check_faults(faults, len(drive.snapshots), words(drive))
        one = replace(job, system=SYSTEM, seed=number, images=images)
        if len(faults) and not alone:
            planned.append(replace(one, faults=("none",), images="none"))
        planned.append(one)
    return planned


def plan_recorded(
    targets: Sequence[str], template: Job, numbers: Sequence[int] | None, *, alone: bool
) -> list[Job]:
    """The jobs of all recorded targets: see `plan` and `plan_stored`. BadInput, and for more than one folder
    of KITTI, whose recordings would share their names and numbers in every table."""
    kitti = [target for target in targets if not is_stored(target)]
    if len(kitti) > 1:
        raise BadInput(f"one kitti: folder at a time, not {len(kitti)}")
    planned = [
        plan_stored(replace(template, scenario=target), numbers) for target in targets if is_stored(target)
    ]
    for target in kitti:
        planned += plan(replace(template, scenario=target), numbers, alone=alone)
    return planned


def player_of(job: Job) -> Player:
    """The recording of a job, opened. BadInput: it cannot be, or a fault cannot act on it."""
    drive = open_kitti(job.scenario).drive(job.seed, job.frames)
    return Player(drive, parse_recorded_faults(job.faults), boxes=boxes_of(job, recorded=True))


def play_job(job: Job, *, images: bool | None = None) -> Recorded:
    """The recording of a job, read. images: its images too; None: where a pipeline wants them. BadInput as
    above, and as `play_stored`."""
    if images is None:
        images = job.images != "none" and any(reads_images(name) for name in job.pipelines)
    if is_stored(job.scenario):
        return play_stored(job, images=images)
    return player_of(job).play(images=images)
