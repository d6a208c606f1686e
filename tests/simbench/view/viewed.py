"""A page read again: its blocks of data and its elements; and recordings with something changed."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np

from fusion.messages import CameraImage, Detections, LidarScan, Measurement
from simbench.formats.store import Stored


class Elements(HTMLParser):
    """Tags with their attributes, and the text of every script by its id."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: dict[str, str] = {}
        self._script: str | None = None
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self._script = dict(attrs).get("id") or ""
            self.scripts[self._script] = ""

    def handle_endtag(self, tag: str) -> None:
        self._script = None if tag == "script" else self._script

    def handle_data(self, data: str) -> None:
        if self._script is not None:
            self.scripts[self._script] += data


def block(page: str, name: str) -> dict[str, Any]:
    """One of the page's blocks of data."""
    return dict(json.loads(Elements(page).scripts[name]))


def numbers(text: str, dtype: str) -> np.ndarray:
    """What was packed."""
    return np.frombuffer(base64.b64decode(text), dtype=dtype)


def with_messages(stored: Stored, messages: tuple[Measurement, ...]) -> Stored:
    return replace(stored, recording=replace(stored.recording, messages=messages))


def with_pictures(stored: Stored) -> Stored:
    """A picture before every detections, of a grey that tells its camera and number."""
    cameras = sorted(stored.recording.calibration.cameras)
    messages: list[Measurement] = []
    for m in stored.recording.messages:
        if isinstance(m, Detections):
            grey = 30 + 25 * cameras.index(m.sensor) + 4 * m.seq
            rgb = np.full((60, 640, 3), grey, dtype=np.uint8)
            messages.append(
                CameraImage(sensor=m.sensor, seq=m.seq, stamp_ns=m.stamp_ns, arrival_ns=m.arrival_ns, rgb=rgb)
            )
        messages.append(m)
    return with_messages(stored, tuple(messages))


def scans(stored: Stored) -> list[LidarScan]:
    return [m for m in stored.recording.messages if isinstance(m, LidarScan)]


def renamed(stored: Stored, name: str) -> Stored:
    """The target under another name."""
    truth = stored.recording.truth
    objects = tuple(
        replace(info, name=name) if info.object_id == truth.target_id else info for info in truth.objects
    )
    return replace(stored, recording=replace(stored.recording, truth=replace(truth, objects=objects)))
