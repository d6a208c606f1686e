"""Ours: clusters of the LiDAR first, boxes matched to them over time, centres from surfaces, a smooth path.

Per scan, one file each:

1 `odometry.py`, `deskew.py`   the sweep as a still world would show it at one instant, by measured motion
2 `local_ground.py`            the ground by sector, since a rolling sweep of a shaking sensor bends it
3 `footprint.py`               clusters of what stands on it (1 to 3 make a `scene.py`)
4 `candidates.py`              which clusters may be a box's object: place, size, range by the box's height
5 `pixel_shift.py`             the shift of the picture that all boxes agree on, if three or more do
6 `association.py`             the candidate whose motion over the last scans is the best supported
7 `surface_to_centre.py`       the centre behind the visible surface, by mean size and heading (`sighting.py`)
8 `kalman.py`                  the track (`object_track.py`): forward while driving, backward at the end

It knows calibration, measured ego motion and the mean sizes of the categories; nothing else.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from fusion.aoi import AoiConfig
from fusion.association import AssociationConfig, CandidateSet, associate, contested
from fusion.box_matching import MatchedBox, MatchingConfig, match_boxes, ranked_candidates
from fusion.confidence import ConfidenceConfig, confidence
from fusion.kalman import correct, predict
from fusion.messages import (
    Calibration,
    CategorySize,
    Detections,
    EgoMotion,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Measurement,
    Trajectory,
)
from fusion.object_track import ObjectTrack, Sighting, TrackConfig, trajectory
from fusion.odometry import from_odometry
from fusion.pipelines.base import ScanPipeline, areas
from fusion.pixel_shift import PixelShiftConfig, Vote, vote_shift
from fusion.scene import Scene, SceneConfig, build_scene
from fusion.sighting import look_where_expected, sight
from fusion.smooth import SmootherConfig
from fusion.surface_to_centre import is_figure
from fusion.timing import StepClock
from fusion.working_frame import WorkingFrame

_BOX = AoiConfig(widen=0.0)
_NO_SHIFT = np.zeros(2)


@dataclass(frozen=True, kw_only=True)
class RobustConfig:
    """Every parameter by step. Each ingredient can be switched off."""

    scene: SceneConfig = field(default_factory=SceneConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    shift: PixelShiftConfig | None = field(default_factory=PixelShiftConfig)  # None: pictures never shift
    association: AssociationConfig | None = field(default_factory=AssociationConfig)  # None: scan by scan
    track: TrackConfig = field(default_factory=TrackConfig)
    confidence: ConfidenceConfig = field(default_factory=ConfidenceConfig)
    use_motion: bool = True  # False: as if no ego motion were measured
    weight_scale: float = 0.35  # of log-scores, for the weights in the association
    look_back: int = 7  # scans that are kept to follow a new track back before its first box


@dataclass(frozen=True, kw_only=True, eq=False)
class _Choice:
    """A track's cluster (rows of the scene), its support by motion, its log-score; its boxes, each with
    its place among all."""

    points: Int64[np.ndarray, " k"]
    support: float
    score: float
    boxes: list[tuple[int, MatchedBox]]


class Robust(ScanPipeline):
    """All steps, scan by scan; `trajectories` smooths over the whole run."""

    steps = ("scene", "candidates", "shift", "associate", "localize")

    def __init__(self, config: RobustConfig | None = None) -> None:
        self.config = RobustConfig() if config is None else config
        super().__init__(SmootherConfig())

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        """Start a run: forget everything but the configuration."""
        super().reset(calibration, categories)
        self._frame: WorkingFrame | None = None
        self._motions: list[EgoMotion] = []
        self._objects: dict[int, ObjectTrack] = {}
        self._votes: dict[str, deque[tuple[Vote, ...]]] = {}
        self._scenes: deque[Scene] = deque(maxlen=max(self.config.look_back, 1))
        self._stamps_ns: list[int] = []

    def update(self, measurement: Measurement) -> FusionOutput | None:
        """As `ScanPipeline.update`; ego motion is integrated. ValueError: a category without size too."""
        if isinstance(measurement, EgoMotion) and self._calibration is not None and self.config.use_motion:
            if self._frame is None:
                self._motions.append(measurement)
            else:
                self._frame.odometry.add(measurement)
        return super().update(measurement)

    def trajectories(self) -> tuple[Trajectory, ...]:
        """One smooth path per track id, in the order of the ids."""
        if self._frame is None:
            return ()
        frame = self._frame
        with self._smooth_clock("smooth"):
            found = [
                trajectory(track, self._stamps_ns, frame.odometry, frame.T_ego_work, self.config.track)
                for _, track in sorted(self._objects.items())
            ]
        self._smooth_clock.close_scan()
        return tuple(path for path in found if path is not None)

    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        frame = self._frame_of(scan.sensor, calibration)
        with clock("scene"):
            scene = build_scene(scan, frame, self.config.scene)
            self._stamps_ns.append(scan.stamp_ns)
        with clock("candidates"):
            boxes = [
                box
                for detections in paired
                for box in match_boxes(
                    scene,
                    areas(detections, calibration.cameras[detections.sensor], _BOX),
                    detections.sensor,
                    calibration.cameras[detections.sensor],
                    detections.stamp_ns,
                    frame,
                    self._categories,
                    self._objects,
                    self.config.matching,
                    self.config.track,
                )
            ]
        with clock("shift"):
            shifts = self._shifts(boxes)
        with clock("associate"):
            by_track = _by_track(boxes)
            chosen = self._associate(scene, by_track, shifts)
        with clock("localize"):
            objects: dict[int, LocalizedObject] = {}
            for track_id, choice in chosen.items():
                track = self._objects[track_id]
                velocity = track.velocity_mps(self.config.track)
                sighting = sight(scene, track, choice.points, velocity, choice.support, self.config.track)
                track.take(sighting, self.config.track)
                track.detected_ns = sighting.stamp_ns
                objects |= self._objects_of(track, sighting, choice, scan, frame)
            for track_id, sighting in self._follow(scene, set(chosen)).items():
                if track_id in by_track:  # nothing fits its boxes, but it stands where it should be
                    choice = _Choice(
                        points=sighting.points,
                        support=0.0,
                        score=self.config.matching.least_score,
                        boxes=by_track[track_id],
                    )
                    objects |= self._objects_of(self._objects[track_id], sighting, choice, scan, frame)
            self._scenes.append(scene)
        return tuple(found for _, found in sorted(objects.items(), key=lambda item: item[0]))

    def _frame_of(self, lidar: str, calibration: Calibration) -> WorkingFrame:
        """The working frame, fixed by the first scan's LiDAR."""
        if self._frame is None:
            self._frame = WorkingFrame(calibration, lidar)
            for motion in self._motions:
                self._frame.odometry.add(motion)
            self._motions.clear()
        return self._frame

    def _shifts(self, boxes: list[MatchedBox]) -> dict[str, Float64[np.ndarray, "2"]]:
        """The shift of every camera's picture: this scan's vote, else that of the last scans, else none."""
        config = self.config.shift
        cameras = dict.fromkeys(box.camera for box in boxes)
        if config is None:
            return dict.fromkeys(cameras, _NO_SHIFT)
        shifts = {}
        for camera in cameras:
            votes = tuple(
                Vote(
                    track_id=box.detection.track_id,
                    offset_rad=box.fit.offset_rad,
                    weight=np.exp(box.fit.likeness),
                )
                for box in boxes
                if box.camera == camera
            )
            remembered = self._votes.setdefault(camera, deque(maxlen=config.frames))
            remembered.append(votes)
            shift = vote_shift(votes, config)
            if shift is None:
                shift = vote_shift([vote for past in remembered for vote in past], config)
            shifts[camera] = _NO_SHIFT if shift is None else shift
        return shifts

    def _associate(
        self,
        scene: Scene,
        by_track: Mapping[int, list[tuple[int, MatchedBox]]],
        shifts: Mapping[str, Float64[np.ndarray, "2"]],
    ) -> dict[int, _Choice]:
        """For every track the cluster that is its object."""
        config = self.config
        ranked = {}
        for track_id, members in by_track.items():
            numbers, score = ranked_candidates([box for _, box in members], shifts, config.matching)
            if len(numbers) and score[0] >= config.matching.least_score:
                ranked[track_id] = numbers, score
        for figure in (True, False):
            self._contest({i: by_track[i][0][1].size for i in ranked}, ranked, figure)
        chosen = {}
        places = {figure: scene.place_of(scene.clusters(figure)) for figure in (True, False)}
        for track_id, (numbers, score) in ranked.items():
            members = by_track[track_id]
            category, size = members[0][1].detection.category, members[0][1].size
            track = self._objects.get(track_id)
            if track is None:
                track = ObjectTrack(track_id=track_id, category=category, size=size)
                self._objects[track_id] = track
            figure = is_figure(size, config.track.surface)
            mean_m, after_ns = places[figure]
            at_ns = scene.stamp_ns + round(float(after_ns[numbers[0]]))
            weight = np.exp(config.weight_scale * (score - score[0]))
            newest = CandidateSet(stamp_ns=at_ns, xy_m=mean_m[numbers], weight=weight)
            memory_ns = config.track.memory_s * 1e9
            track.sets = [s for s in track.sets if 0 < at_ns - s.stamp_ns < memory_ns] + [newest]
            best, support = 0, 0.0
            if config.association is not None:
                expected_m = track.expected_mean_m(at_ns, config.track)
                best, support = associate(track.sets, expected_m, config.association)
            chosen[track_id] = _Choice(
                points=scene.clusters(figure).points(int(numbers[best])),
                support=support,
                score=float(score[best]),
                boxes=members,
            )
        return chosen

    def _contest(
        self,
        sizes: Mapping[int, CategorySize],
        ranked: dict[int, tuple[Int64[np.ndarray, " m"], Float64[np.ndarray, " m"]]],
        figure: bool,
    ) -> None:
        """Lower what another track of the same grid of clusters has a better claim to, and rank again."""
        config = self.config
        tracks = [i for i, size in sizes.items() if is_figure(size, config.track.surface) == figure]
        if config.association is None or len(tracks) < 2:
            return
        lost = contested(
            [ranked[i][0] for i in tracks], [ranked[i][1] for i in tracks], config.matching.least_score
        )
        for track_id, others in zip(tracks, lost, strict=True):
            numbers, score = ranked[track_id]
            lower = score - config.association.contested * others
            order = np.argsort(-lower, kind="stable")
            ranked[track_id] = numbers[order], lower[order]

    def _follow(self, scene: Scene, seen: set[int]) -> dict[int, Sighting]:
        """Look for tracks that no box showed where they should be, and for new ones in the scans before.
        The sightings of this scan, by track."""
        config = self.config.track
        followed = {}
        for track_id, track in self._objects.items():
            if track.belief is None or len(track.sightings) < config.heading_sightings:
                continue
            if not track.looked_back and self.config.look_back > 0:
                track.looked_back = True
                self._look_back(track)
            last = track.sightings[-1]
            at_ns = scene.expected_ns(last)
            if track_id in seen or not last.stamp_ns < at_ns < track.detected_ns + config.coast_s * 1e9:
                continue
            ahead = predict(track.belief, at_ns, config.kalman)
            found = look_where_expected(scene, track, ahead.position_m, ahead.velocity_mps, last, config)
            if found is not None and found.stamp_ns > last.stamp_ns:
                track.take(found, config)
                followed[track_id] = found
        return followed

    def _look_back(self, track: ObjectTrack) -> None:
        """Sightings before the first box, as long as the track is where it should have been."""
        config = self.config.track
        belief = track.backward(config)
        first = track.sightings[0]
        for scene in reversed(self._scenes):
            at_ns = scene.expected_ns(first)
            if scene.stamp_ns >= first.scan_stamp_ns or at_ns >= first.stamp_ns:
                continue
            ahead = predict(belief, at_ns, config.kalman)
            found = look_where_expected(scene, track, ahead.position_m, ahead.velocity_mps, first, config)
            if found is None or found.stamp_ns >= first.stamp_ns:
                return
            belief = correct(predict(belief, found.stamp_ns, config.kalman), found.centre_odom_m, found.sd_m)
            track.sightings.insert(0, found)
            first = found

    def _objects_of(
        self, track: ObjectTrack, sighting: Sighting, choice: _Choice, scan: LidarScan, frame: WorkingFrame
    ) -> dict[int, LocalizedObject]:
        """The output of a sighting: one object for every camera that shows it, by its box's place."""
        xy_m = sighting.centre_odom_m
        if self.config.track.filter and track.belief is not None and not track.surprises:
            xy_m = track.belief.position_m
        x, y = from_odometry(xy_m[None], frame.odometry.pose(np.array([sighting.stamp_ns])))[0]
        position_m = np.array([x, y, sighting.ground_m + 0.5 * track.size.mean_m[2]])
        position_ego_m = frame.T_ego_work.apply(position_m)
        T_work_lidar = frame.T_work_sensor[scan.sensor]
        from_lidar = T_work_lidar.rotation.T @ (position_m - T_work_lidar.translation_m)
        chance = confidence(
            choice.score, choice.support, len(sighting.points), len(track.sightings), self.config.confidence
        )
        by_camera = {box.camera: (place, box) for place, box in reversed(choice.boxes)}
        return {
            place: LocalizedObject(
                track_id=track.track_id,
                category=box.detection.category,
                sensor=box.camera,
                stamp_ns=sighting.stamp_ns,
                points=sighting.points,
                position_ego_m=position_ego_m,
                distance_m=math.hypot(from_lidar[0], from_lidar[1]),
                azimuth_rad=math.atan2(from_lidar[1], from_lidar[0]),
                confidence=chance,
            )
            for place, box in by_camera.values()
        }


def _by_track(boxes: Sequence[MatchedBox]) -> dict[int, list[tuple[int, MatchedBox]]]:
    """The boxes of every track, each with its place among all; the first one's category is the track's."""
    found: dict[int, list[tuple[int, MatchedBox]]] = {}
    for place, box in enumerate(boxes):
        members = found.setdefault(box.detection.track_id, [])
        if not members or members[0][1].size == box.size:
            members.append((place, box))
    return found
