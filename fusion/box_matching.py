"""All boxes of a scan, and the clusters that each may be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, Int64

from fusion.camera import PinholeCamera
from fusion.candidates import BoxFit, CandidateConfig, cut, fit_boxes, placed, view_clusters
from fusion.messages import BoxPx, CategorySize, Detection
from fusion.object_track import ObjectTrack, TrackConfig
from fusion.scene import Scene
from fusion.surface_to_centre import is_figure
from fusion.working_frame import WorkingFrame


@dataclass(frozen=True, kw_only=True)
class MatchingConfig:
    """How well a cluster must fit its box. SDs of place: of the calibration, and as a share of the side."""

    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    sd_rad: float = 0.006
    sd_share: float = 0.06
    place_cap: float = 6.0
    least_score: float = -16.0  # below it a box has no object
    keep: int = 3  # candidates per track
    late_s: float = 0.1  # how far an image's stamp may be off: what the ego turns in it is room to look
    largest: float = 2.5  # a cluster reaching over more than this times the category's diagonal is no object


@dataclass(frozen=True, kw_only=True, eq=False)
class MatchedBox:
    """A detection with what it may be, the spread (right, down) of where that lies, and whether the image's
    border cuts it."""

    camera: str
    detection: Detection
    size: CategorySize
    fit: BoxFit
    sd_rad: tuple[float, float]
    cut: bool


def match_boxes(
    scene: Scene,
    usable: tuple[tuple[Detection, BoxPx], ...],
    camera_name: str,
    camera: PinholeCamera,
    stamp_ns: int,
    frame: WorkingFrame,
    sizes: Mapping[str, CategorySize],
    tracks: Mapping[int, ObjectTrack],
    config: MatchingConfig,
    track_config: TrackConfig,
) -> list[MatchedBox]:
    """The boxes of one image, taken at `stamp_ns`, with their candidates among the scene's clusters.

    A box whose track has a velocity expects its object as far on as it goes between its hit by the sweep and
    the image. ValueError: a category without size.
    """
    T_camera_scene = frame.T_camera_scene(camera_name, stamp_ns, scene.pose) if usable else None
    room_rad = config.candidates.reach_rad + frame.turned_rad(stamp_ns, config.late_s)
    looking = replace(config.candidates, reach_rad=room_rad)
    sizes_of = [size_of(detection.category, sizes) for detection, _ in usable]
    groups: dict[bool, list[int]] = {}
    for place, size in enumerate(sizes_of):
        groups.setdefault(is_figure(size, track_config.surface), []).append(place)
    fits: dict[int, BoxFit] = {}
    for figure, places in groups.items():
        assert T_camera_scene is not None
        clusters = scene.clusters(figure)
        boxes_px = [usable[place][1] for place in places]
        expected = [sizes_of[place] for place in places]
        view = view_clusters(
            clusters,
            scene.xyz_m,
            T_camera_scene,
            camera,
            boxes_px,
            config.largest * max(math.hypot(*size.mean_m[:2]) for size in expected),
            looking,
        )
        moved_m = np.stack(
            [
                _moved_m(scene, tracks.get(usable[place][0].track_id), stamp_ns, track_config)
                for place in places
            ]
        )
        found = fit_boxes(
            view,
            clusters,
            boxes_px,
            expected,
            moved_m @ T_camera_scene.rotation.T,
            scene.beams_per_sr,
            looking,
        )
        fits |= dict(zip(places, found, strict=True))
    return [
        MatchedBox(
            camera=camera_name,
            detection=detection,
            size=sizes_of[place],
            fit=fits[place],
            sd_rad=(
                config.sd_rad + config.sd_share * (box_px[2] - box_px[0]) / camera.fx_px,
                config.sd_rad + config.sd_share * (box_px[3] - box_px[1]) / camera.fy_px,
            ),
            cut=bool(cut(np.array(box_px).reshape(1, 4, 1), camera, config.candidates)[0, 0]),
        )
        for place, (detection, box_px) in enumerate(usable)
    ]


def _moved_m(
    scene: Scene, track: ObjectTrack | None, stamp_ns: int, config: TrackConfig
) -> Float64[np.ndarray, "3"]:
    """How far an object goes from its hit by the sweep to `stamp_ns`, in the scene's axes."""
    if track is None or not track.sightings:
        return np.zeros(3)
    velocity = track.velocity_mps(config)
    dt_s = (stamp_ns - scene.expected_ns(track.sightings[-1])) * 1e-9
    c, s = math.cos(scene.pose[0, 2]), math.sin(scene.pose[0, 2])
    x, y = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
    return np.array([x * dt_s, y * dt_s, 0.0])


def size_of(category: str, sizes: Mapping[str, CategorySize]) -> CategorySize:
    """The category's size. ValueError: it has none."""
    if category not in sizes:
        known = ", ".join(sorted(sizes)) or "none"
        raise ValueError(f"category {category!r} has no size; known: {known}")
    return sizes[category]


def ranked_candidates(
    boxes: list[MatchedBox], shifts: Mapping[str, Float64[np.ndarray, "2"]], config: MatchingConfig
) -> tuple[Int64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """The candidates of one track's boxes in all cameras, best first, with the mean of their log-scores.

    A cluster that is no candidate in one of the cameras has the worst score there.
    """
    worst = config.least_score - 4.0
    total: dict[int, float] = {}
    for box in boxes:
        cap = config.candidates.weak_cap if box.cut else config.place_cap
        score = placed(box.fit, shifts[box.camera], box.sd_rad, cap)
        for number, value in zip(box.fit.cluster.tolist(), score.tolist(), strict=True):
            total[number] = total.get(number, 0.0) + max(value - worst, 0.0)
    ranked = sorted(total.items(), key=lambda item: (-item[1], item[0]))[: config.keep]
    numbers = np.array([number for number, _ in ranked], dtype=np.int64)
    return numbers, np.array([value / len(boxes) + worst for _, value in ranked], dtype=np.float64)
