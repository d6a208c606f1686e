"""The rows about whole drives: simulated seconds per second of wall time on two cores, and memory."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from simbench.case import Job
from simbench.stage import Stage, record, stage
from tests.benchmarks import frames, recording
from tests.benchmarks.scene import SCENARIO, SEED, SYSTEM
from tests.benchmarks.size import Size
from tests.benchmarks.table import Measured
from tests.benchmarks.workers import rates


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A drive that can be recorded again and again."""

    job: Job
    staged: Stage


def set_up_drive(effects: bool, drive_s: float | None) -> Drive:
    """The catalogue's drive, or its first `drive_s` seconds; the LiDAR with all effects or none."""
    job = Job(scenario=SCENARIO, system=SYSTEM, seed=SEED, pipelines=())
    staged = stage(job)
    if not effects:
        staged = replace(staged, rig=frames.plain_lidar(staged.rig))
    if drive_s is not None:
        staged = replace(staged, system=staged.system.model_copy(update={"duration_s": drive_s}))
    return Drive(job=job, staged=staged)


def record_drive(drive: Drive, seed: int) -> float:
    """One recording without images, its noise drawn from `seed`; the seconds that it covers."""
    captured = record(replace(drive.job, seed=seed), drive.staged)
    if not captured.recording.truth.images or not any(
        image.boxes for image in captured.recording.truth.images
    ):
        raise AssertionError("a drive without boxes measures nothing")
    return float(drive.staged.system.duration_s)


def lidar_boxes(size: Size, effects: bool) -> Measured:
    """`simbench.stage.record`: all that a case records but pictures; each worker its own drive."""
    windows = [(2 * i, 2 * i + 1) for i in range(size.windows + 1)]
    return measured(
        rates(set_up_drive, (effects, size.drive_s), record_drive, windows, size.spawn),
        "lidar and boxes: each worker records its own drive",
    )


FRAMES_PER_WINDOW = 10  # a second of the drive


def take_frames(session: frames.Session, numbers: tuple[int, ...]) -> float:
    """Take these frames of the drive and throw them away; the seconds that they cover."""
    for number in numbers:
        frames.take(session, number)
    return len(numbers) / session.rig.lidar.rate_hz


def full_rig(size: Size, effects: bool) -> Measured:
    """Rolling sweep and six pictures: the two workers take the even and the odd frames of the same drive."""
    whole = max(1, frames.frames_of(frames.set_up(effects, size.image_px)) // FRAMES_PER_WINDOW)
    windows = []
    for window in range(size.windows + 1):
        first = FRAMES_PER_WINDOW * (window % whole)
        last = first + (FRAMES_PER_WINDOW if size.image_px is None else 2)
        windows.append((tuple(range(first, last, 2)), tuple(range(first + 1, last, 2))))
    found = rates(frames.set_up, (effects, size.image_px), take_frames, windows, size.spawn)
    return measured(found, "full rig: the workers share one drive, frame by frame; nothing is written")


def peak_rss(size: Size) -> Measured:
    """One process that writes every message as soon as it has it."""
    written = recording.record(size.recording_s, size.image_px, size.spawn)
    return Measured(
        value=written.peak_rss_mb,
        ours=f"{written.peak_rss_mb:.0f} MB",
        rival=f"{written.files:,} files, {written.disk_mb:,.0f} MB",
    )


def measured(found: list[float], how: str) -> Measured:
    """The median of the windows, with their spread."""
    return Measured(
        value=float(np.median(found)),
        ours=f"{np.median(found):.2f} s/s",
        rival=f"{min(found):.2f} to {max(found):.2f} in {len(found)}",
        notes=(how,),
    )
