"""Eligible pairs: which (frame, camera) pairs with the target count, whatever detector or pipeline did.

A pair is eligible when at least 5 of the target's true points project into the paired image and at least a
quarter of the target's outline is visible there.

"Project into the image" asks where the *surface spot* that a LiDAR point hit is when the image is taken. The
target moves between the firing and the capture, so a spot travels with it:

    x_box    = T_world_box(fire)^-1 . T_world_lidar(fire) . x_lidar      x_lidar: measured direction x true
    range x_camera = T_world_camera(capture)^-1 . T_world_box(capture) . x_box

then the true intrinsics. Only true poses enter: neither calibration errors nor clocks change eligibility.
Limbs that move against the body are carried with the body's box.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from fusion.camera import inside_box
from fusion.messages import BoxPx
from simbench.recording import Recording
from simbench.score.frames import Frame, frames_of
from simbench.truth import GnssReference, Truth

MIN_POINTS = 5
MIN_VISIBLE_FRACTION = 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class EligiblePair:
    """(frame, camera, target). `points` [k]: scan indices of the target's true points that project into the
    image.

    `true_xyz_lidar_m` [k 3]: the same points without range noise, LiDAR frame at their firing. Distances are
    planar from the LiDAR at `instant_ns` (median true firing time of the points): `surface` is the points'
    median planar range, `centre` the box centre's, `gnss` that of the held GNSS (None before the first fix or
    without GNSS).
    """

    frame: int
    camera: str
    points: Int64[np.ndarray, " k"]
    true_xyz_lidar_m: Float64[np.ndarray, "k 3"]
    true_uv_px: Float64[np.ndarray, "k 2"]  # where they are in the image
    box_px: BoxPx  # the target's whole outline in the image
    visible_fraction: float
    instant_ns: int
    surface_distance_m: float
    centre_distance_m: float
    gnss_distance_m: float | None


PoseOf = Callable[[Int64[np.ndarray, " n"]], tuple[np.ndarray, np.ndarray]]


def poses_at(source: PoseOf, t_ns: Int64[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
    """Rotations [n 3 3] and translations [n 3] at t_ns, asking the source once per different time."""
    times, inverse = np.unique(np.asarray(t_ns, dtype=np.int64), return_inverse=True)
    rotation, translation = source(times)
    return rotation[inverse], translation[inverse]


def to_parent(pose: tuple[np.ndarray, np.ndarray], xyz_m: Float64[np.ndarray, "n 3"]) -> np.ndarray:
    """Each point [n 3] through its own pose ([n 3 3], [n 3])."""
    rotation, translation = pose
    return np.asarray(np.einsum("nij,nj->ni", rotation, xyz_m) + translation)


def to_child(pose: tuple[np.ndarray, np.ndarray], xyz_m: Float64[np.ndarray, "n 3"]) -> np.ndarray:
    """Each point [n 3] through the inverse of its own pose ([n 3 3], [n 3])."""
    rotation, translation = pose
    return np.asarray(np.einsum("nji,nj->ni", rotation, xyz_m - translation))


def lidar_to_world(
    truth: Truth, lidar: str, fire_ns: Int64[np.ndarray, " n"], xyz_lidar_m: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Points in the LiDAR frame at their own firing times, in the world, through the LiDAR's true pose."""
    return to_parent(poses_at(lambda t: truth.poses.sensor(lidar, t), fire_ns), xyz_lidar_m)


def true_points(frame: Frame, points: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k 3"]:
    """Points of a scan in the LiDAR frame without range noise: measured direction times true range."""
    xyz = frame.scan.xyz_m[points].astype(np.float64)
    norm = np.linalg.norm(xyz, axis=1)
    return np.asarray(xyz * (frame.truth.true_range_m[points] / np.where(norm > 0.0, norm, 1.0))[:, None])


def planar_range_m(xyz_m: np.ndarray) -> np.ndarray:
    """Horizontal distance [...] from the origin of points [... 3]."""
    return np.asarray(np.hypot(xyz_m[..., 0], xyz_m[..., 1]))


def median_point(xyz_m: np.ndarray) -> int:
    """Row of the actual point [n 3] at the middle rank of planar distance, n >= 1.

    Of two middle ones the nearer; equal distances in the order of x, y, z, so that point order decides
    nothing.
    """
    xyz = np.asarray(xyz_m, dtype=np.float64)
    order = np.lexsort((xyz[:, 2], xyz[:, 1], xyz[:, 0], planar_range_m(xyz)))
    return int(order[(len(order) - 1) // 2])


def held_fix(reference: GnssReference, t_ns: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """Row of the fix that holds at each t_ns (the last one available by then); -1 before the first."""
    order = np.argsort(reference.available_ns, kind="stable")
    at = np.searchsorted(reference.available_ns[order], t_ns, side="right") - 1
    return np.where(at >= 0, order[np.maximum(at, 0)], -1) if len(order) else np.full(len(t_ns), -1)


def held_position(
    truth: Truth, fix: int, t_ns: int
) -> tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, " 3"]]:
    """What the reference says at t_ns by the fix that holds then: the target's position [m, ego frame], and
    the true centre in it. The fix itself, or (`GnssReference.held` False) carried along by the true motion
    since."""
    reference = truth.reference
    assert reference is not None
    position, centre = reference.position_ego_m[fix], reference.centre_ego_m[fix]
    if reference.held:
        return position, centre
    now = truth.target_centre_ego_m(np.array([t_ns], dtype=np.int64))[0]
    return position + (now - centre), now


def eligible_pairs(recording: Recording, frames: Sequence[Frame]) -> tuple[EligiblePair, ...]:
    """All eligible pairs, by frame and then camera name; empty without a target."""
    truth = recording.truth
    target = truth.target_id
    if target is None:
        return ()
    found: list[EligiblePair] = []
    for frame in frames:
        points = np.flatnonzero(frame.truth.object_id == target)
        if len(points) < MIN_POINTS:
            continue
        xyz_lidar = true_points(frame, points)
        fire_ns = frame.truth.fire_ns[points]
        world = lidar_to_world(truth, frame.scan.sensor, fire_ns, xyz_lidar)
        box = to_child(poses_at(lambda t: truth.poses.object_centre(target, t), fire_ns), world)
        for camera, view in frame.views.items():
            shown = view.true_box(target)
            if shown is None or shown.visible_fraction < MIN_VISIBLE_FRACTION:
                continue
            capture = np.array([view.truth.capture_ns], dtype=np.int64)
            rotation, translation = truth.poses.object_centre(target, capture)
            at_capture = box @ rotation[0].T + translation[0]
            model = truth.calibration.cameras[camera]
            uv = model.project(view.truth.T_world_camera.inverse().apply(at_capture))
            inside = inside_box(uv, (0.0, 0.0, float(model.width_px), float(model.height_px)))
            if np.count_nonzero(inside) < MIN_POINTS:
                continue
            instant_ns = int(np.median(fire_ns[inside]))
            centre_m, gnss_m = _distances(truth, frame.scan.sensor, instant_ns)
            found.append(
                EligiblePair(
                    frame=frame.index,
                    camera=camera,
                    points=points[inside],
                    true_xyz_lidar_m=xyz_lidar[inside],
                    true_uv_px=uv[inside],
                    box_px=shown.amodal_px,
                    visible_fraction=shown.visible_fraction,
                    instant_ns=instant_ns,
                    surface_distance_m=float(np.median(planar_range_m(xyz_lidar[inside]))),
                    centre_distance_m=centre_m,
                    gnss_distance_m=gnss_m,
                )
            )
    return tuple(found)


def _distances(truth: Truth, lidar: str, t_ns: int) -> tuple[float, float | None]:
    """Planar distances [m] of the target's centre and of its held GNSS position from the LiDAR's rest
    position.
    """
    origin = truth.calibration.T_ego_sensor[lidar].translation_m
    at = np.array([t_ns], dtype=np.int64)
    centre_m = float(planar_range_m(truth.target_centre_ego_m(at)[0] - origin))
    if truth.reference is None:
        return centre_m, None
    fix = int(held_fix(truth.reference, at)[0])
    if fix < 0:
        return centre_m, None
    return centre_m, float(planar_range_m(held_position(truth, fix, t_ns)[0] - origin))


@lru_cache(maxsize=1)
def frames_and_pairs(recording: Recording) -> tuple[tuple[Frame, ...], tuple[EligiblePair, ...]]:
    """Frames and eligible pairs of a recording; every pipeline on it is scored against the same ones."""
    frames = frames_of(recording)
    return frames, eligible_pairs(recording, frames)
