"""One short recording on disk, and what was read of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from simbench.case import Job
from simbench.formats.store import Stored, read_recording, write_recording
from simbench.generate.work import source_of
from simbench.run import recording_of


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six sweeps of six cameras without pictures. Not to be changed: copy it."""
    job = Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=(),
        faults=("timing.trigger_offset_ms=50",), changes=("systems.car.duration_s=0.6",),
    )  # fmt: skip
    place = tmp_path_factory.mktemp("view") / "recorded"
    write_recording(recording_of(job)[2].recording, place, source_of(job))
    return place


@pytest.fixture(scope="session")
def stored(folder: Path) -> Stored:
    return read_recording(folder)
