"""The LiDAR's sweeps as a pipeline gets them, in order of arrival, thinned for the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int16, Int64, UInt8

from fusion.geometry import Transform
from fusion.messages import Calibration, LidarScan
from scenarios.errors import BadInput
from simbench.recording import Recording
from simbench.view.caps import MOST_POINTS, MOST_POINTS_TOGETHER, MOST_SWEEPS, every_kth
from simbench.view.packed import FARTHEST_M, centimetres

ALONG_RAD = np.radians(2.0)  # points so near to a camera's axis say when the LiDAR looked along it
FEWEST = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """One sweep. message: its place among the messages. xyz_cm: every `every`-th point in the ego frame,
    where the told calibration puts it. kept: their indices in the scan. passes_ms: when the LiDAR fires
    along each camera's axis, after the sweep's stamp; NaN where it sees nothing there."""

    message: int
    scan: LidarScan
    every: int
    kept: Int64[np.ndarray, " n"]
    xyz_cm: Int16[np.ndarray, "n 3"]
    intensity: UInt8[np.ndarray, " n"]
    passes_ms: Float64[np.ndarray, " cameras"]


def sweeps_of(recording: Recording, cameras: Sequence[str]) -> tuple[tuple[Sweep, ...], int]:
    """All sweeps or, of many, every k-th; and k. BadInput: there is none, or nobody says where a LiDAR is."""
    found = [(i, m) for i, m in enumerate(recording.messages) if isinstance(m, LidarScan)]
    if not found:
        raise BadInput("the recording holds no LiDAR sweep: there is nothing to show")
    every = every_kth(len(found), MOST_SWEEPS)
    shown = found[::every]
    most = max(1, min(MOST_POINTS, MOST_POINTS_TOGETHER // len(shown)))
    return tuple(_sweep(i, scan, recording.calibration, cameras, most) for i, scan in shown), every


def pose_of(calibration: Calibration, sensor: str) -> Transform:
    """T_ego_sensor as a pipeline is told. BadInput: it is not told."""
    if sensor not in calibration.T_ego_sensor:
        raise BadInput(f"the calibration does not say where the sensor {sensor[:60]!r} is")
    return calibration.T_ego_sensor[sensor]


def _sweep(
    message: int, scan: LidarScan, calibration: Calibration, cameras: Sequence[str], most: int
) -> Sweep:
    with np.errstate(invalid="ignore", over="ignore"):
        xyz_ego_m = pose_of(calibration, scan.sensor).apply(scan.xyz_m)
        near = np.flatnonzero((np.abs(xyz_ego_m) < FARTHEST_M).all(axis=1))  # False for NaN
        intensity = np.nan_to_num(np.clip(scan.intensity, 0.0, 1.0))
    every = every_kth(len(near), most) | 1  # odd: 64 beams in turn are not thinned to a few of them
    kept = near[::every]
    return Sweep(
        message=message, scan=scan, every=every, kept=kept, xyz_cm=centimetres(xyz_ego_m[kept]),
        intensity=np.rint(255.0 * intensity[kept]).astype(np.uint8),
        passes_ms=_passes_ms(scan, xyz_ego_m, calibration, cameras),
    )  # fmt: skip


def _passes_ms(
    scan: LidarScan, xyz_ego_m: Float64[np.ndarray, "n 3"], calibration: Calibration, cameras: Sequence[str]
) -> Float64[np.ndarray, " cameras"]:
    """The median firing time of the points whose azimuth from the LiDAR is a camera's."""
    seen = xyz_ego_m[:, :2] - calibration.T_ego_sensor[scan.sensor].translation_m[:2]
    azimuth_rad = np.arctan2(seen[:, 1], seen[:, 0])
    found = np.full(len(cameras), np.nan)
    for i, camera in enumerate(cameras):
        off = np.mod(azimuth_rad - azimuth_of(calibration, camera) + np.pi, 2.0 * np.pi) - np.pi
        along = np.abs(off) < ALONG_RAD
        if np.count_nonzero(along) >= FEWEST:
            found[i] = np.median(scan.offset_ns[along]) * 1e-6
    return found


def azimuth_of(calibration: Calibration, camera: str) -> float:
    """Where a camera looks in the ego frame [rad], from x forward to y left."""
    axis = calibration.T_ego_sensor[camera].rotation[:, 2]
    return float(np.arctan2(axis[1], axis[0]))
