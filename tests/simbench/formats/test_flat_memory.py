"""Checking a recording takes as much memory for a long one as for a short one."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusion.messages import CameraImage, Detections, Measurement
from simbench.case import Job
from simbench.formats.store import Source, check_recording, read_recording, write_recording
from simbench.recording import Recording
from simbench.run import recording_of

SOURCE = Source(scenario="overtake-approach", system="car", seed=0, images="raycast")
WIDTH, HEIGHT = 320, 240
SHORT_S, LONG_S = 0.4, 1.6


def pictured(recording: Recording) -> Recording:
    """A noisy picture beside the boxes of every image, of cameras that are small."""
    told, rng = recording.calibration, np.random.Generator(np.random.PCG64(1))
    small = {name: replace(c, width_px=WIDTH, height_px=HEIGHT) for name, c in told.cameras.items()}
    messages: list[Measurement] = []
    for message in recording.messages:
        messages.append(message)
        if isinstance(message, Detections):
            rgb = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            messages.append(CameraImage(
                sensor=message.sensor, seq=message.seq, stamp_ns=message.stamp_ns,
                arrival_ns=message.arrival_ns, rgb=rgb,
            ))  # fmt: skip
    return replace(recording, calibration=replace(told, cameras=small), messages=tuple(messages))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A short recording, and one of four times its length."""
    place = tmp_path_factory.mktemp("flat")
    for name, duration_s in (("short", SHORT_S), ("long", LONG_S)):
        job = Job(
            scenario="overtake-approach", system="car", seed=0, pipelines=(),
            changes=(f"systems.car.duration_s={duration_s}",),
        )  # fmt: skip
        write_recording(pictured(recording_of(job)[2].recording), place / name, SOURCE)
    check_recording(place / "short")  # what is imported and kept once is not counted below
    return place / "short", place / "long"


def peak_mb(work: Callable[[], object]) -> float:
    """The most memory of Python and NumPy while something is done."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def read_mb(folders: tuple[Path, Path]) -> tuple[float, float]:
    """What reading all of them takes: it grows, so the measure sees what is kept."""
    short, long = (peak_mb(lambda folder=folder: read_recording(folder)) for folder in folders)  # type: ignore[misc]
    assert long - short > 25.0
    return short, long


def test_checking_a_recording_of_four_times_the_length_takes_no_more(
    folders: tuple[Path, Path], read_mb: tuple[float, float]
) -> None:
    short, long = (peak_mb(lambda folder=folder: check_recording(folder)) for folder in folders)  # type: ignore[misc]
    assert long - short < 2.0
    assert long < 15.0


def test_a_recording_read_without_its_pictures_takes_as_much_less(
    folders: tuple[Path, Path], read_mb: tuple[float, float]
) -> None:
    pictures = sum(
        isinstance(m, Detections) for m in read_recording(folders[1], images=False).recording.messages
    )
    pixels_mb = pictures * WIDTH * HEIGHT * 3e-6
    without_mb = peak_mb(lambda: read_recording(folders[1], images=False))
    assert pixels_mb > 20.0 and read_mb[1] - without_mb == pytest.approx(pixels_mb, abs=3.0)
