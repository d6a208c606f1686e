"""A recording of the bench's own for the report: the sweeps and pictures that it holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from jaxtyping import UInt8

from fusion.camera import PinholeCamera
from fusion.messages import Calibration, CameraImage, CategorySize, LidarScan
from simbench.case import Images, Job
from simbench.exhibit import PairView
from simbench.formats.stored import play_stored
from simbench.recording import Recording
from simbench.report.recorded import enlarged


class StoredReplay:
    """What `pictures.Replay` is for a simulated job. BadInput: the recording is not there any more."""

    stamps = ""

    def __init__(self, job: Job) -> None:
        self._recording = play_stored(job, images=job.images != "none").recording
        self._scans = {m.seq: m for m in self._recording.messages if isinstance(m, LidarScan)}

    @property
    def pinholes(self) -> Mapping[str, PinholeCamera]:
        """The cameras as they are."""
        return self._recording.truth.calibration.cameras

    @property
    def told(self) -> Calibration:
        """What the fusion was told."""
        return self._recording.calibration

    @property
    def categories(self) -> Mapping[str, CategorySize]:
        """Mean sizes that the fusion was told."""
        return self._recording.categories

    @property
    def rate_hz(self) -> float:
        """Of the LiDAR."""
        return 1e9 / self._recording.truth.period_ns

    def category_of(self, view: PairView) -> str:
        """Of the object of a view."""
        truth = self._recording.by_target[view.target].truth
        return next(o.category for o in truth.objects if o.object_id == truth.target_id)

    def scan(self, seq: int) -> LidarScan:
        """Scan `seq` exactly as it was delivered."""
        return self._scans[seq]

    @contextmanager
    def camera(self, images: Images, sharper: int = 1) -> Iterator[StoredTaker]:
        """Gives the recorded pictures, enlarged `sharper` times for lines that are drawn on them."""
        yield StoredTaker(self._recording, sharper)


class StoredTaker:
    """The picture that was taken at a time."""

    def __init__(self, recording: Recording, sharper: int) -> None:
        pictures = {(m.sensor, m.seq): m.rgb for m in recording.messages if isinstance(m, CameraImage)}
        self._taken = {
            (truth.sensor, truth.capture_ns): pictures[truth.sensor, truth.seq]
            for truth in recording.truth.images
            if (truth.sensor, truth.seq) in pictures
        }
        self._sharper = sharper

    def take(self, camera: str, capture_ns: int) -> UInt8[np.ndarray, "h w 3"]:
        """KeyError: no picture was taken then."""
        return enlarged(self._taken[camera, capture_ns], self._sharper)
