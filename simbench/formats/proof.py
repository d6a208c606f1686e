"""Receipts of the faults in recorded data: what the delivered data itself says, by its own means.

calibration.*             known points in the camera's view and PnP, as for a simulated drive
detector.edge_error       delivered against labelled boxes, as for a simulated drive
timing.stale_frames       how many frames before the labelled boxes fit the delivered ones best
lidar.beam_loss           layers of elevation in narrow sectors of the first sweep, delivered against file
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float32, Float64

from fusion.camera import project_points
from fusion.geometry import rotation_log
from fusion.messages import Detections, LidarScan
from scenarios.fault_set import FaultSet
from scenarios.faults import EdgeError, StaleFrames
from scenarios.faults.lidar import BeamLoss
from simbench.faults import detector as detector_fault
from simbench.faults.estimate import PNP, PoseEvidence, camera_pose
from simbench.faults.receipt import Receipt, judge
from simbench.faults.tell import asks_to_tell, told_receipts
from simbench.faults.telling import Place, Witness
from simbench.formats.calibration import CAMERA, LIDAR
from simbench.formats.inject import DrawnOnRecording
from simbench.formats.kitti import Drive
from simbench.recording import Recording
from simbench.sensors import fiducials
from simbench.truth import ImageTruth

SECTORS = 720
LAYER_DEG = 0.08
LAYERS_SD, LAYERS_OFF = 0.8, 3.5  # per cent: of 120 random losses on three full sweeps, SD 0.8 and bias -0.9
STALE_FRAMES = 0.25  # a whole number is found
CLEARLY = 0.5  # the best fit of boxes must be better than this share of the next best


def recorded_receipts(
    faults: FaultSet,
    drawn: DrawnOnRecording,
    recording: Recording,
    drive: Drive,
    ids: Mapping[int, int],
    first_sweep_m: Float32[np.ndarray, "n 3"] | None,
) -> tuple[Receipt, ...]:
    """Requested, realised and measured of every fault that is on. ids: object by track. first_sweep_m: as the
    file holds it, where beams are lost.
    """
    truth, result = recording.truth, list[Receipt]()
    evidence = (_evidence(recording),) if truth.images and asks_to_tell(faults) else ()
    # What was drawn needs no seed any more.
    place = Place(true=truth.calibration, lidar_name=LIDAR, seed=0)
    witness = Witness(place=place, evidence=evidence, body=None)
    result += told_receipts(faults, drawn.tellings, recording.calibration, witness)
    detections = [m for m in recording.messages if isinstance(m, Detections)]
    if (error := faults.get(EdgeError)) is not None:
        camera = truth.calibration.cameras[CAMERA]
        result += detector_fault.receipts(
            error,
            {CAMERA: drawn.edge_errors},
            detections,
            truth.images,
            {CAMERA: (camera.width_px, camera.height_px)},
            1e-9 * truth.period_ns,
        )
    if (stale := faults.get(StaleFrames)) is not None:
        result.append(_stale(stale, drawn, detections, truth.images, drive, ids))
    if (loss := faults.get(BeamLoss)) is not None and first_sweep_m is not None:
        result.append(_lost(loss, drawn, recording, first_sweep_m))
    return tuple(result)


def _evidence(recording: Recording) -> PoseEvidence:
    """The camera's attitude in every frame by PnP on known points, against the calibration."""
    truth = recording.truth
    camera, T_ego_camera = truth.calibration.cameras[CAMERA], truth.calibration.T_ego_sensor[CAMERA]
    turns = []
    for image in truth.images:
        known = fiducials.points_m(camera, image.T_world_camera)
        uv = project_points(known, image.T_world_camera.inverse(), camera)
        rotation, _ = camera_pose(known, uv, camera)
        turns.append(rotation_log(rotation @ T_ego_camera.rotation.T))
    n = len(truth.images)
    return PoseEvidence(
        sensor=CAMERA,
        by=PNP,
        taken_ns=np.array([image.capture_ns for image in truth.images], dtype=np.int64),
        turn_rad=np.array(turns),
        shift_m=np.zeros((n, 3)),
        position_ego_m=T_ego_camera.translation_m,
        pivot_ego_m=np.zeros(3),
        speed_mps=np.zeros(n),
    )


def _stale(
    spec: StaleFrames,
    drawn: DrawnOnRecording,
    detections: Sequence[Detections],
    images: Sequence[ImageTruth],
    drive: Drive,
    ids: Mapping[int, int],
) -> Receipt:
    behind = {image.seq: image.detection_object_id for image in images}
    labelled = [
        {ids[label.track]: np.array(label.box_px) for label in s.labels if label.box_px is not None}
        for s in drive.snapshots
    ]
    most = min(2 * spec.frames + 3, len(labelled) - 1)
    misfit = np.full(most + 1, np.nan)
    for lag in range(most + 1):
        off = [
            float(np.abs(np.array(box.box_px) - labelled[m.seq - lag][object_id]).mean())
            for m in detections
            if m.seq >= lag
            for box, object_id in zip(m.boxes, behind[m.seq], strict=True)
            if object_id in labelled[m.seq - lag]
        ]
        misfit[lag] = np.median(off) if off else np.nan
    measured: float | None = None
    note = "labelled boxes of the frames before that fit the delivered ones best"
    if np.isfinite(misfit).sum() > 1:
        ranked = np.argsort(np.where(np.isfinite(misfit), misfit, np.inf))
        if misfit[ranked[0]] < CLEARLY * misfit[ranked[1]]:
            measured = float(ranked[0])
    if measured is None:
        note = "boxes move too little from frame to frame to tell"
    return judge(
        fault=spec.name, quantity=f"{CAMERA} delay", unit="frames", requested=float(spec.frames),
        realised=float(drawn.stale_frames), measured=measured, systematic=STALE_FRAMES, allowed=0.0,
        note=note,
    )  # fmt: skip


def _lost(
    spec: BeamLoss,
    drawn: DrawnOnRecording,
    recording: Recording,
    first_sweep_m: Float32[np.ndarray, "n 3"],
) -> Receipt:
    scan = next(m for m in recording.messages if isinstance(m, LidarScan) and m.seq == 0)
    before, after = layers(first_sweep_m), layers(scan.xyz_m)
    return judge(
        fault=spec.name, quantity="rings", unit="%", requested=spec.percent, realised=drawn.lost_percent,
        measured=100.0 * (1.0 - after / before), estimator_sd=LAYERS_SD, systematic=LAYERS_OFF,
        allowed=100.0 / max(drawn.rings, 1), note="layers of elevation in narrow sectors, first sweep",
    )  # fmt: skip


def layers(xyz_m: Float32[np.ndarray, "n 3"]) -> float:
    """Mean number of layers of elevation over narrow sectors of azimuth, empty ones included: about the
    number of beams that return something there.
    """
    x, y, z = xyz_m.astype(np.float64).T
    sector = np.floor((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * SECTORS).astype(np.int64)
    elevation_deg: Float64[np.ndarray, " n"] = np.rad2deg(np.arctan2(z, np.hypot(x, y)))
    order = np.lexsort((elevation_deg, sector))
    sector, elevation_deg = sector[order], elevation_deg[order]
    starts = (np.diff(sector) != 0) | (np.diff(elevation_deg) > LAYER_DEG)
    return (int(starts.sum()) + min(len(sector), 1)) / SECTORS
