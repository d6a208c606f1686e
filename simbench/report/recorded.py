"""Recorded data for the report: the same sweeps and images, read from the files again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import cv2
import numpy as np
from jaxtyping import UInt8

from fusion.camera import PinholeCamera
from fusion.messages import Calibration, CategorySize, LidarScan
from simbench.case import Images, Job
from simbench.exhibit import PairView
from simbench.formats.jobs import player_of
from simbench.formats.labels import SIZES
from simbench.formats.recorded import Player


class RecordedReplay:
    """What `pictures.Replay` is for a simulated job. BadInput where the files are not there any more."""

    stamps = ""

    def __init__(self, job: Job) -> None:
        self._player: Player = player_of(job)

    @property
    def pinholes(self) -> Mapping[str, PinholeCamera]:
        """The cameras as they are."""
        return self._player.true.cameras

    @property
    def told(self) -> Calibration:
        """What the fusion was told."""
        return self._player.drawn.told

    @property
    def categories(self) -> Mapping[str, CategorySize]:
        """Mean sizes that the fusion was told."""
        return SIZES

    @property
    def rate_hz(self) -> float:
        """Of the LiDAR."""
        return 1e9 / self._player.period_ns

    def category_of(self, view: PairView) -> str:
        """Of the object of a view."""
        return self._player.objects[view.target].category

    def scan(self, seq: int) -> LidarScan:
        """Scan `seq` exactly as it was delivered."""
        return self._player.scan(seq)

    @contextmanager
    def camera(self, images: Images, sharper: int = 1) -> Iterator[RecordedTaker]:
        """Gives the recorded images. `sharper`: enlarged so many times, for lines that are drawn on them."""
        yield RecordedTaker(self._player, sharper)


class RecordedTaker:
    """The image that was taken at a time."""

    def __init__(self, player: Player, sharper: int) -> None:
        self._player, self._sharper = player, sharper

    def take(self, camera: str, capture_ns: int) -> UInt8[np.ndarray, "h w 3"]:
        """KeyError: no image was taken then."""
        shown = {s.image_ns: s for s in self._player.drive.snapshots}[capture_ns]
        return enlarged(self._player.picture(shown), self._sharper)


def enlarged(rgb: UInt8[np.ndarray, "h w 3"], sharper: int) -> UInt8[np.ndarray, "h_out w_out 3"]:
    """A picture with so many times the pixels along each side."""
    size = (rgb.shape[1] * sharper, rgb.shape[0] * sharper)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
