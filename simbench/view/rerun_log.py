"""A recording as a file of Rerun's (rerun.io), on the timeline `arrival`: all points, whole pictures.

ego/SENSOR            where the told calibration puts a sensor; below it its points, its picture and boxes
ego/truth/boxes       the true boxes, at the true time of the middle of the sweep that arrived
about                 what the recording is, and what of it is missing
"""

from __future__ import annotations

import importlib
import os
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan, Measurement
from scenarios.errors import BadInput
from simbench.formats.store import Stored
from simbench.recording import Recording
from simbench.view.caps import short
from simbench.view.placed import middle_ns, placed
from simbench.view.thumbs import jpeg

JPEG_QUALITY = 90
TIMELINE = "arrival"


def has_rerun() -> bool:
    """Whether Rerun is installed (there are other packages with a module of that name)."""
    try:
        version("rerun-sdk")
    except PackageNotFoundError:
        return False
    return True


def need_rerun() -> None:
    """BadInput: Rerun is not installed."""
    if not has_rerun():
        raise BadInput("rerun is not installed: pip install 'simbench[view]', or take --tool page")


def write_rerun(stored: Stored, path: Path) -> None:
    """Write the file, under a temporary name and then its own. No window is opened. BadInput: it cannot be
    written, or a time is beyond 64 bits."""
    rr: Any = importlib.import_module("rerun")
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    part = stored.manifest.messages
    log = rr.RecordingStream(
        "simbench", recording_id="unfinished" if part is None else part.sha256, default_enabled=True
    )
    log.set_log_time_enabled(False)
    log.set_log_tick_enabled(False)
    try:
        log.save(str(temporary))
        _log(rr, log, stored)
        log.flush()
        log.disconnect()
        temporary.replace(path)
    except OverflowError:
        raise BadInput("the recording has a time beyond 64 bits of nanoseconds") from None
    except OSError as error:
        raise BadInput(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _log(rr: Any, log: Any, stored: Stored) -> None:
    recording = stored.recording
    log.log("about", rr.TextDocument(_about(stored)), static=True)
    log.log("ego", rr.ViewCoordinates.FLU, static=True)
    for sensor, pose in recording.calibration.T_ego_sensor.items():
        entity = rr.Transform3D(translation=pose.translation_m, mat3x3=pose.rotation)
        log.log(["ego", sensor], entity, static=True)
    for name, camera in recording.calibration.cameras.items():
        pinhole = rr.Pinhole(
            image_from_camera=camera.matrix, resolution=[camera.width_px, camera.height_px],
            camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=0.5,
        )  # fmt: skip
        log.log(["ego", name, "picture"], pinhole, static=True)
    for message in recording.messages:
        log.set_time(TIMELINE, duration=np.timedelta64(int(message.arrival_ns), "ns"))
        _log_message(rr, log, message)
        if isinstance(message, LidarScan):
            _log_truth(rr, log, recording, message)


def _log_message(rr: Any, log: Any, message: Measurement) -> None:
    match message:
        case LidarScan():
            grey = np.rint(255.0 * np.clip(np.nan_to_num(message.intensity), 0.0, 1.0)).astype(np.uint8)
            points = rr.Points3D(message.xyz_m, colors=np.repeat(grey[:, None], 3, axis=1) // 2 + 100)
            log.log(["ego", message.sensor, "points"], points)
        case CameraImage():
            if message.rgb.size:
                image = rr.EncodedImage(contents=jpeg(message.rgb, JPEG_QUALITY), media_type="image/jpeg")
                log.log(["ego", message.sensor, "picture"], image)
        case Detections():
            boxes = rr.Boxes2D(
                array=np.array([box.box_px for box in message.boxes], dtype=np.float64).reshape(-1, 4),
                array_format=rr.Box2DFormat.XYXY,
                labels=[f"{short(box.category)} {box.track_id}" for box in message.boxes],
            )
            log.log(["ego", message.sensor, "picture", "boxes"], boxes)
        case EgoMotion():
            log.log(["motion", message.sensor, "velocity_mps"], rr.Scalars(message.velocity_mps))
            log.log(["motion", message.sensor, "rate_radps"], rr.Scalars(message.rate_radps))


def _log_truth(rr: Any, log: Any, recording: Recording, message: LidarScan) -> None:
    from scipy.spatial.transform import Rotation  # scipy.spatial takes a while to import

    truth = recording.truth
    scan = next((s for s in truth.scans if (s.sensor, s.seq) == (message.sensor, message.seq)), None)
    if scan is None:
        return
    ids = [info.object_id for info in truth.objects]
    at = placed(recording, ids, middle_ns(message, scan.fire_ns, truth.period_ns))
    if at is None or not len(ids):
        return
    known = np.isfinite(at.centre_m).all(axis=1) & np.isfinite(at.rotation).all(axis=(1, 2))
    boxes = rr.Boxes3D(
        centers=at.centre_m[known],
        quaternions=Rotation.from_matrix(at.rotation[known]).as_quat(),
        half_sizes=0.5 * np.array([info.size_m for info in truth.objects])[known],
        labels=[short(info.name) for info, there in zip(truth.objects, known, strict=True) if there],
    )
    log.log(["ego", "truth", "boxes"], boxes)


def _about(stored: Stored) -> str:
    source = stored.manifest.source
    lines = [
        *(f"INCOMPLETE: {why}" for why in stored.missing),
        f"scenario {source.scenario}, system {source.system}, seed {source.seed}",
        f"faults: {', '.join(source.faults) or 'none'}; changes: {', '.join(source.changes) or 'none'}",
        f"simbench {stored.manifest.simbench}; {len(stored.recording.messages)} messages",
    ]
    return "\n".join(lines)
