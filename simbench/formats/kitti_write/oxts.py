"""oxts: 30 numbers a frame. The GNSS/INS box is taken to sit at the ego frame's origin, in its axes.

Where it is and how it is turned is true, at the frame's instant; what it feels (speed, acceleration, rates)
is what the recording's own IMU and odometer measured nearest to the frame's stamp. The world's x is east and
its y north; latitude and longitude are by the development kit's Mercator formula,

    east = s r lon pi / 180,    north = s r ln tan((90 + lat) pi / 360),    s = cos(lat0 pi / 180)

about the first frame, which stands at 49 N, 8.4 E (nowhere near where anything was driven).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from fusion.geometry import rotation_rpy
from simbench.formats.kitti_write.drive import WrittenDrive, WrittenFrame
from simbench.formats.kitti_write.text import row

EARTH_M = 6378137.0
LAT_DEG, LON_DEG = 49.0, 8.4
ACCURACY = (0.0, 0.0)
MODES = "0 0 0 0 0"  # status, satellites, modes: nothing here has such


def oxts_text(drive: WrittenDrive) -> list[str] | None:
    """A line for every frame; None where the recording has no measured motion."""
    if any(frame.ego is None for frame in drive.frames):
        return None
    start_m = drive.frames[0].T_world_ego.translation_m
    return [f"{row(oxts_numbers(frame, start_m))} {MODES}" for frame in drive.frames]


def oxts_numbers(frame: WrittenFrame, start_m: Float64[np.ndarray, "3"]) -> list[float]:
    """The first 25 numbers of a frame."""
    ego, R, at_m = frame.ego, frame.T_world_ego.rotation, frame.T_world_ego.translation_m
    assert ego is not None
    lat_deg, lon_deg = lat_lon_deg(at_m - start_m)
    roll, pitch, yaw = roll_pitch_yaw(R)
    level = rotation_rpy(roll, pitch, 0.0)  # from the box's axes to forward, left, up along the ground
    v, a, w = ego.velocity_mps, ego.specific_force_mps2, ego.rate_radps
    return [
        lat_deg, lon_deg, at_m[2], roll, pitch, yaw, *velocity_north_east(R, v),
        *v, *a, *(level @ a), *w, *(level @ w), *ACCURACY,
    ]  # fmt: skip


def lat_lon_deg(east_north_m: Float64[np.ndarray, " n"]) -> tuple[float, float]:
    """Of a place so far from the first frame."""
    scale = float(np.cos(np.deg2rad(LAT_DEG))) * EARTH_M
    lon_deg = LON_DEG + np.rad2deg(east_north_m[0] / scale)
    start = np.log(np.tan((90.0 + LAT_DEG) * np.pi / 360.0))
    lat_deg = np.arctan(np.exp(start + east_north_m[1] / scale)) * 360.0 / np.pi - 90.0
    return float(lat_deg), float(lon_deg)


def velocity_north_east(
    R_world_ego: Float64[np.ndarray, "3 3"], velocity_mps: Float64[np.ndarray, "3"]
) -> tuple[float, float]:
    """Of a velocity in the box's axes."""
    east, north, _ = R_world_ego @ velocity_mps
    return float(north), float(east)


def roll_pitch_yaw(rotation: Float64[np.ndarray, "3 3"]) -> tuple[float, float, float]:
    """Angles [rad] of Rz(yaw) Ry(pitch) Rx(roll)."""
    return (
        float(np.arctan2(rotation[2, 1], rotation[2, 2])),
        float(-np.arcsin(np.clip(rotation[2, 0], -1.0, 1.0))),
        float(np.arctan2(rotation[1, 0], rotation[0, 0])),
    )
