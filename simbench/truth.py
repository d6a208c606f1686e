"""What really happened. Imported by sensors, recording and score only (an import contract holds this).

Object ids index `Truth.objects`; -1 is the static ground or nothing. Times are true times on the bench's
clock, in nanoseconds. Nothing here is ever handed to a pipeline.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from fusion.geometry import Transform, readonly
from fusion.messages import BoxPx, Calibration


@dataclass(frozen=True, kw_only=True)
class ObjectInfo:
    """One thing of the scene. `size_m`: length, width, height of its rest-pose box (rider with scooter)."""

    object_id: int
    name: str
    category: str
    size_m: tuple[float, float, float]


@runtime_checkable
class PoseSource(Protocol):
    """Poses at any times t_ns [n], as rotations [n 3 3] and translations [n 3] in metres."""

    def ego(self, t_ns: Int64[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
        """T_world_ego: the reference frame of all outputs; travels with the script, does not shake."""

    def object_centre(self, object_id: int, t_ns: Int64[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
        """T_world_box: centre and axes of the object's rest-pose box."""

    def sensor(self, sensor: str, t_ns: Int64[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
        """T_world_sensor as it really was, shake and flex included."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanTruth:
    """Per point of one delivered scan, in the order of the scan's points."""

    sensor: str
    seq: int
    object_id: Int32[np.ndarray, " n"]
    part_id: Int32[np.ndarray, " n"]  # the geom that was hit
    true_range_m: Float64[np.ndarray, " n"]  # along the ray, before noise
    fire_ns: Int64[np.ndarray, " n"]
    incidence_rad: Float32[np.ndarray, " n"]

    def __post_init__(self) -> None:
        for name in ("object_id", "part_id", "true_range_m", "fire_ns", "incidence_rad"):
            object.__setattr__(self, name, readonly(getattr(self, name)))


@dataclass(frozen=True, kw_only=True)
class TrueBox:
    """One object in one image. `visible_px` is None where nothing of it is visible.

    `amodal_px`: the whole outline, clipped to the image. `visible_fraction`: visible share of the object's
    own outline area inside the image (0..1).
    """

    object_id: int
    amodal_px: BoxPx
    visible_px: BoxPx | None
    visible_fraction: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageTruth:
    """One delivered image (or its detections): when it was really taken, from where, and what is in it.

    `detection_object_id[i]` is the object behind box i of the `Detections` with this sensor and seq; -1 for a
    false box.
    """

    sensor: str
    seq: int
    capture_ns: int  # mid-exposure
    T_world_camera: Transform  # at capture_ns, shake and flex included
    boxes: tuple[TrueBox, ...]
    detection_object_id: tuple[int, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class GnssReference:
    """The paper's 5 Hz reference: the target relative to the ego, in the ego frame, by fix [m].

    A fix holds from its `available_ns` on. `position_ego_m` = `centre_ego_m` (exact, at `fix_ns`) +
    `lever_m` + `heading_m` + `noise_m`, each [m 3]: the parts of the error budget. held: False where a fix
    does not just hold, but goes along with the target's true motion since (`score.pairs.held_position`).
    """

    fix_ns: Int64[np.ndarray, " m"]
    available_ns: Int64[np.ndarray, " m"]
    position_ego_m: Float64[np.ndarray, "m 3"]
    centre_ego_m: Float64[np.ndarray, "m 3"]
    lever_m: Float64[np.ndarray, "m 3"]
    heading_m: Float64[np.ndarray, "m 3"]
    noise_m: Float64[np.ndarray, "m 3"]
    held: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """Everything that scores need. `target_id` is None in a scenario without a target.

    `targets`: where several objects are scored, each on its own, all of them (recorded data: every labelled
    object); empty: `target_id` only.
    """

    objects: tuple[ObjectInfo, ...]
    target_id: int | None
    scans: tuple[ScanTruth, ...]
    images: tuple[ImageTruth, ...]
    calibration: Calibration  # as it really is at rest
    poses: PoseSource
    reference: GnssReference | None
    period_ns: int  # of the LiDAR
    targets: tuple[int, ...] = ()

    def target_centre_ego_m(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
        """Centre of the target's box in the ego reference frame at t_ns."""
        if self.target_id is None:
            raise ValueError("this scenario has no target")
        return self.box_in_ego(self.target_id, t_ns)[1]

    def box_in_ego(
        self, object_id: int, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
        """T_ego_box at t_ns: axes and centre of an object's box in the ego reference frame."""
        r_ego, p_ego = self.poses.ego(t_ns)
        r_box, p_box = self.poses.object_centre(object_id, t_ns)
        return r_ego.transpose(0, 2, 1) @ r_box, np.einsum("nji,nj->ni", r_ego, p_box - p_ego)
