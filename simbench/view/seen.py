"""What a pipeline may see of a recording: the first block of data of its page, as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int64

from fusion.messages import Calibration, CameraImage, Detections, Measurement
from simbench.recording import Recording
from simbench.view.caps import MOST_BOXES, MOST_CAMERAS, MOST_IMAGES, short
from simbench.view.latest import NONE, Stream, latest_of, streams_of
from simbench.view.packed import packed
from simbench.view.sweeps import Sweep, azimuth_of, sweeps_of
from simbench.view.thumbs import thumbnail


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """What of a recording the page shows. images, boxes: per camera the places [sweeps] among all messages of
    the image and of the detections that are shown with each sweep. every_picture: the page holds images of
    every so many sweeps."""

    sweeps: tuple[Sweep, ...]
    every_sweep: int
    cameras: tuple[str, ...]
    streams: tuple[Stream, ...]
    images: tuple[Int64[np.ndarray, " sweeps"], ...]
    boxes: tuple[Int64[np.ndarray, " sweeps"], ...]
    every_picture: int


def shown_of(recording: Recording) -> Shown:
    """What the page shows. BadInput: there is no sweep, or nobody says where a LiDAR is."""
    cameras = in_rows(recording.calibration)[:MOST_CAMERAS]
    sweeps, every = sweeps_of(recording, cameras)
    streams = streams_of(recording, np.array([sweep.message for sweep in sweeps], dtype=np.int64))
    images = tuple(latest_of(streams, "image", camera, len(sweeps)) for camera in cameras)
    boxes = tuple(latest_of(streams, "boxes", camera, len(sweeps)) for camera in cameras)
    return Shown(
        sweeps=sweeps, every_sweep=every, cameras=cameras, streams=streams, images=images, boxes=boxes,
        every_picture=_every_picture(images),
    )  # fmt: skip


def _every_picture(images: Sequence[Int64[np.ndarray, " sweeps"]]) -> int:
    """The smallest k with which the images of every k-th sweep are at most MOST_IMAGES."""
    every = 1
    while len(_pictured(images, every)) > MOST_IMAGES:
        every += 1
    return every


def _pictured(images: Sequence[Int64[np.ndarray, " sweeps"]], every: int) -> set[int]:
    return {place for of in images for place in of[::every].tolist()} - {NONE}


def in_rows(calibration: Calibration) -> tuple[str, ...]:
    """Cameras as one sees what they see: those that look ahead from left to right, then those that look back,
    left ones first."""

    def place(camera: str) -> tuple[bool, float, str]:
        azimuth_rad = azimuth_of(calibration, camera)
        back = abs(azimuth_rad) > 0.5 * np.pi + 1e-6
        return back, azimuth_rad % (2.0 * np.pi) if back else -azimuth_rad, camera

    return tuple(sorted(calibration.cameras, key=place))


def seen_block(recording: Recording, shown: Shown) -> dict[str, Any]:
    """The block: times in nanoseconds, lengths in centimetres, boxes in pixels of their camera."""
    messages, calibration = recording.messages, recording.calibration
    return {
        "every_sweep": shown.every_sweep,
        "every_picture": shown.every_picture,
        "sweeps": [_about_sweep(sweep) for sweep in shown.sweeps],
        "xyz_cm": packed(np.concatenate([sweep.xyz_cm for sweep in shown.sweeps])),
        "intensity": packed(np.concatenate([sweep.intensity for sweep in shown.sweeps])),
        "cameras": [_about_camera(calibration, camera) for camera in shown.cameras],
        "streams": [_about_stream(messages, stream) for stream in shown.streams],
        "images": [_places(of) for of in shown.images],
        "boxes": [_places(of) for of in shown.boxes],
        "messages": _about_messages(messages, shown),
    }


def _about_sweep(sweep: Sweep) -> dict[str, Any]:
    scan = sweep.scan
    return {
        **_stamps(scan), "sensor": short(scan.sensor), "points": len(scan.xyz_m), "kept": len(sweep.kept),
        "every": sweep.every, "last_ns": int(scan.offset_ns.max(initial=0)),
        "passes_ms": [None if np.isnan(t) else round(float(t), 3) for t in sweep.passes_ms],
    }  # fmt: skip


def _about_camera(calibration: Calibration, camera: str) -> dict[str, Any]:
    pinhole = calibration.cameras[camera]
    return {
        "name": short(camera), "width_px": max(1, pinhole.width_px), "height_px": max(1, pinhole.height_px),
        "azimuth_deg": round(float(np.degrees(azimuth_of(calibration, camera))), 2),
    }  # fmt: skip


def _about_stream(messages: Sequence[Measurement], stream: Stream) -> dict[str, Any]:
    """Per sweep its latest message: [seq, stamp, arrival], or nothing."""
    rows: list[list[int] | None] = []
    for place in stream.latest.tolist():
        one = None if place == NONE else messages[place]
        rows.append(None if one is None else [int(one.seq), int(one.stamp_ns), int(one.arrival_ns)])
    return {"sensor": short(stream.sensor), "kind": stream.kind, "rows": rows}


def _about_messages(messages: Sequence[Measurement], shown: Shown) -> dict[str, dict[str, Any]]:
    """Images and detections that are shown with any sweep, by their place."""
    pictured = _pictured(shown.images, shown.every_picture)
    places = {int(place) for of in (*shown.images, *shown.boxes) for place in of} - {NONE}
    found: dict[str, dict[str, Any]] = {}
    for place in sorted(places):
        match messages[place]:
            case CameraImage() as image:
                found[str(place)] = {
                    **_stamps(image), "jpeg": thumbnail(image.rgb) if place in pictured else None,
                }  # fmt: skip
            case Detections() as detections:
                found[str(place)] = {**_stamps(detections), **_boxes(detections)}
            case _:
                raise AssertionError("a camera's streams are images and detections")
    return found


def _boxes(detections: Detections) -> dict[str, Any]:
    boxes = [
        [int(box.track_id), short(box.category), *(round(float(v), 1) for v in box.box_px)]
        for box in detections.boxes
        if np.isfinite(box.box_px).all()
    ]
    return {"boxes": boxes[:MOST_BOXES], "more": len(detections.boxes) - len(boxes[:MOST_BOXES])}


def _stamps(message: Measurement) -> dict[str, int]:
    return {
        "seq": int(message.seq), "stamp_ns": int(message.stamp_ns), "arrival_ns": int(message.arrival_ns),
    }  # fmt: skip


def _places(of: Int64[np.ndarray, " sweeps"]) -> list[int]:
    return [int(place) for place in of]
