"""Sightings of recorded data, to lay beside a data set."""

from __future__ import annotations

from scenarios.errors import BadInput
from simbench.cards.page import Beside
from simbench.cards.statistics import Sight, sights
from simbench.case import Job
from simbench.formats.jobs import play_job
from simbench.formats.kitti import WORDS, open_kitti
from simbench.formats.targets import KITTI

MOST = 500  # frames, sequences or drives


def recorded_sights(target: str) -> Beside:
    """All sightings of `kitti:FOLDER` by its labels. BadInput: it is not there or not readable."""
    if not target.startswith(KITTI):
        raise BadInput(f"--beside: '{target}' is no recorded data", allowed="kitti:FOLDER")
    folder = open_kitti(target)
    numbers = list(folder.names)[:MOST]
    found: list[Sight] = []
    for number in numbers:
        job = Job(scenario=target, system="car", seed=number, pipelines=())
        found += sights(play_job(job, images=False).recording)
    what = WORDS[folder.layout] + ("s" if len(numbers) != 1 else "")
    return Beside(path=target, words=f"{len(numbers)} {what}, {len(found)} sightings", sights=tuple(found))
