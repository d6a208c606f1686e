"""What is reused from run to run changes no byte, and is reused where it may be and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import pytest

from simbench import reuse
from simbench import stage as staging
from simbench.case import Job
from simbench.stage import record, stage
from simbench.stress.run import _drive
from tests.simbench.support import bytes_of

SHORT = ("systems.car.duration_s=0.4",)


def job(*faults: str, seed: int = 0, changes: tuple[str, ...] = SHORT, off: tuple[str, ...] = ()) -> Job:
    return Job(
        scenario="overtake-approach", system="car", seed=seed, pipelines=(), faults=faults, changes=changes,
        size_px=(160, 100), off=off,
    )  # fmt: skip


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    reuse.WORLDS.clear()
    staging.SWEEPS.clear()
    yield
    reuse.WORLDS.clear()
    staging.SWEEPS.clear()


def taken(wanted: Job) -> dict[str, str]:
    return bytes_of(record(wanted, stage(wanted)).recording)


SAME_SWEEPS = {
    "late cameras": job("timing.trigger_offset_ms=40"),
    "bent brackets": job("motion.flex_deg=0.5"),
    "points lost": job("lidar.dropout_percent=30"),
    "told wrongly": job("calibration.rotation_deg=1"),
    "another lens": job("calibration.undistorted_px=2"),
    "a knock": job("motion.knock_deg={angle_deg: 1, at_s: 0.1}"),
}
OTHER_SWEEPS = {
    "a shaking body": job("motion.vibration_deg=1"),
    "another shake": job("motion.vibration_deg=2"),
    "a rough road": job("motion.road=C", changes=("systems.car.duration_s=2.2",)),
    "a bent LiDAR": job("motion.flex_deg={rms_deg: 0.5, sensors: lidar}"),
    "a knocked LiDAR": job("motion.knock_deg={angle_deg: 1, at_s: 0.1, sensors: lidar}"),
    "a creeping LiDAR": job("calibration.drift_deg={shift_cm: 5, sensors: lidar}"),
    "another seed": job(seed=1),
    "another scenario": job(changes=(*SHORT, "background.0.count=1")),
    "longer": job(changes=("systems.car.duration_s=0.6",)),
    "no rolling scan": job(off=("bench.rolling_scan",)),
}


@pytest.mark.parametrize("which", [*SAME_SWEEPS, *OTHER_SWEEPS])
def test_a_run_after_another_is_the_run_alone(which: str) -> None:
    wanted = {**SAME_SWEEPS, **OTHER_SWEEPS}[which]
    alone = taken(wanted)
    reuse.WORLDS.clear()
    staging.SWEEPS.clear()
    taken(job())
    assert taken(wanted) == alone
    assert staging.SWEEPS.hits == (1 if which in SAME_SWEEPS else 0)


def test_two_shakes_share_the_world_and_not_the_sweeps() -> None:
    taken(OTHER_SWEEPS["a shaking body"])
    taken(OTHER_SWEEPS["another shake"])
    assert (reuse.WORLDS.hits, staging.SWEEPS.hits) == (1, 0)


def test_only_the_newest_are_kept() -> None:
    kept: reuse.Kept[int] = reuse.Kept(2)
    made = []

    def make(value: int) -> int:
        made.append(value)
        return value

    for value in (1, 2, 1, 3, 2):
        assert kept.of(value, lambda value=value: make(value)) == value  # type: ignore[misc]
    assert made == [1, 2, 3, 2] and kept.hits == 1


def test_jobs_of_one_shake_come_one_after_the_other() -> None:
    jobs = [
        job(f"timing.trigger_offset_ms={offset}", f"motion.vibration_deg={level}", seed=seed)
        for offset in (0, 50) for level in (1, 2) for seed in (0, 1)
    ]  # fmt: skip
    drives = [_drive(one) for one in sorted(jobs, key=_drive)]
    changes = sum(one != two for one, two in pairwise(drives))
    assert changes == 3
