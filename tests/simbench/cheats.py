"""Pipelines that know what no pipeline can know, or break the contract. Loaded by name, like a user's.

`HANDED` is the recording that a cheat looks up the truth in; a test sets it before it runs one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusion.messages import (
    Calibration,
    CategorySize,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Measurement,
    Trajectory,
)
from simbench.recording import Recording
from simbench.score.frames import frames_of
from simbench.score.pairs import EligiblePair, eligible_pairs

HANDED: list[Recording] = []


class TruthHandedOver:
    """All of the target's points in every eligible pair, and its exact centre."""

    shift_ns = 0

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        recording = HANDED[-1]
        self.recording, self.truth = recording, recording.truth
        self.frames = {frame.key: frame for frame in frames_of(recording)}
        frames = tuple(self.frames.values())
        self.pairs: dict[tuple[str, int], list[EligiblePair]] = {key: [] for key in self.frames}
        for pair in eligible_pairs(recording, frames):
            self.pairs[frames[pair.frame].key].append(pair)
        self.answered: list[tuple[int, int, np.ndarray]] = []

    def points(self, scan: LidarScan, pair: EligiblePair) -> np.ndarray:
        return pair.points

    def stamp_ns(self, scan: LidarScan) -> int:
        return scan.stamp_ns + self.truth.period_ns // 2

    def frames_to_answer(self, scan: LidarScan) -> bool:
        return True

    def update(self, measurement: Measurement) -> FusionOutput | None:
        if not isinstance(measurement, LidarScan) or not self.frames_to_answer(measurement):
            return None
        key = (measurement.sensor, measurement.seq)
        objects = [self.object(measurement, pair) for pair in self.pairs[key]]
        return FusionOutput(scan_sensor=key[0], scan_seq=key[1], objects=tuple(o for o in objects if o))

    def object(self, scan: LidarScan, pair: EligiblePair) -> LocalizedObject | None:
        view = self.frames[(scan.sensor, scan.seq)].views[pair.camera]
        if view.detections is None:
            return None
        for box, object_id in zip(view.detections.boxes, view.truth.detection_object_id, strict=True):
            if object_id == self.truth.target_id:
                at_ns = self.stamp_ns(scan)
                centre = self.truth.target_centre_ego_m(np.array([at_ns + self.shift_ns]))[0]
                self.answered.append((box.track_id, at_ns, centre))
                return LocalizedObject(
                    track_id=box.track_id,
                    category=box.category,
                    sensor=pair.camera,
                    stamp_ns=at_ns,
                    points=self.points(scan, pair),
                    position_ego_m=centre,
                    distance_m=float(np.hypot(*centre[:2])),
                    azimuth_rad=float(np.arctan2(centre[1], centre[0])),
                    confidence=1.0,
                )
        return None

    def trajectories(self) -> tuple[Trajectory, ...]:
        rows = {at_ns: centre for _, at_ns, centre in self.answered}
        if not rows:
            return ()
        return (
            Trajectory(
                track_id=self.answered[0][0],
                stamp_ns=np.array(list(rows), dtype=np.int64),
                position_ego_m=np.array(list(rows.values())),
                inlier=np.ones(len(rows), dtype=bool),
            ),
        )


class TruthLate(TruthHandedOver):
    """The truth of 100 ms later."""

    shift_ns = 100_000_000


class OnePoint(TruthHandedOver):
    """One point of the target in each pair: the one of median distance."""

    def points(self, scan: LidarScan, pair: EligiblePair) -> np.ndarray:
        distance = np.hypot(*scan.xyz_m[pair.points, :2].T)
        return pair.points[np.argsort(distance)[len(distance) // 2 :][:1]]


class OneFrame(TruthHandedOver):
    """One answer in the whole run."""

    def frames_to_answer(self, scan: LidarScan) -> bool:
        return bool(self.pairs[(scan.sensor, scan.seq)]) and not self.answered


class LabelsPermuted(TruthHandedOver):
    """As many points as the target has in the picture, but drawn from all that lie in the box."""

    share: list[float] = []

    def points(self, scan: LidarScan, pair: EligiblePair) -> np.ndarray:
        near = np.flatnonzero(np.linalg.norm(scan.xyz_m - scan.xyz_m[pair.points].mean(axis=0), axis=1) < 4.0)
        pool = np.union1d(near, pair.points)
        self.share.append(len(pair.points) / len(pool))
        rng = np.random.default_rng(scan.seq)
        return np.sort(rng.permutation(pool)[: len(pair.points)])


class StampsOutsideTheSweep(TruthHandedOver):
    """Describes an instant after the sweep has ended."""

    def stamp_ns(self, scan: LidarScan) -> int:
        return scan.stamp_ns + self.truth.period_ns + 1


class Silent:
    """Answers nothing."""

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.calibration, self.categories = calibration, categories

    def update(self, measurement: Measurement) -> FusionOutput | None:
        return self.answer(measurement) if isinstance(measurement, LidarScan) else None

    def answer(self, scan: LidarScan) -> FusionOutput | None:
        return None

    def trajectories(self) -> tuple[Trajectory, ...]:
        return ()


def _an_object(scan: LidarScan, **changes: object) -> LocalizedObject:
    values: dict[str, object] = {
        "track_id": 1,
        "category": "rider",
        "sensor": "cam-front",
        "stamp_ns": scan.stamp_ns,
        "points": np.array([0], dtype=np.int64),
        "position_ego_m": np.array([10.0, 0.0, 1.0]),
        "distance_m": 10.0,
        "azimuth_rad": 0.0,
        "confidence": 1.0,
    }
    return LocalizedObject(**{**values, **changes})  # type: ignore[arg-type]


def _output(scan: LidarScan, *objects: LocalizedObject) -> FusionOutput:
    return FusionOutput(scan_sensor=scan.sensor, scan_seq=scan.seq, objects=objects)


class Raises(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        raise ZeroDivisionError("the pipeline's own bug")


class RaisesAtReset(Silent):
    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        raise KeyError("cam-7")


class RaisesAtTheEnd(Silent):
    def trajectories(self) -> tuple[Trajectory, ...]:
        raise IndexError("no track")


class ReturnsNaN(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        return _output(scan, _an_object(scan, position_ego_m=np.array([np.nan, 0.0, 0.0])))


class AnswersTwice(Silent):
    """A second output for a scan, when the next one comes."""

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.first: FusionOutput | None = None

    def answer(self, scan: LidarScan) -> FusionOutput | None:
        self.first = self.first or _output(scan)
        return self.first


class NamesNoPoint(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        return _output(scan, _an_object(scan, points=np.array([len(scan.xyz_m)], dtype=np.int64)))


class AnswersAnotherScan(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        return FusionOutput(scan_sensor=scan.sensor, scan_seq=scan.seq + 1_000_000, objects=())


class ReturnsText(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        return "a car, 10 m ahead"  # type: ignore[return-value]


class MovesPoints(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        scan.xyz_m[:, 2] += 1.0
        return None


class ChangesTheCalibration(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        self.calibration.T_ego_sensor["cam-front"].translation_m[0] = 99.0
        return None


class ForgetsACamera(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        del self.calibration.cameras["cam-front"]  # type: ignore[attr-defined]
        return None


class ChangesTheCategories(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        self.categories["rider"] = CategorySize(mean_m=(9.0, 9.0, 9.0), spread=0.0)  # type: ignore[index]
        return None


class RestampsAMessage(Silent):
    def answer(self, scan: LidarScan) -> FusionOutput | None:
        scan.stamp_ns = 0  # type: ignore[misc]
        return None


BREACHES: Mapping[str, str] = {
    "Raises": "ZeroDivisionError: the pipeline's own bug",
    "RaisesAtReset": "KeyError",
    "RaisesAtTheEnd": "IndexError: no track",
    "ReturnsNaN": "not finite",
    "AnswersTwice": "second output",
    "NamesNoPoint": "points must be indices",
    "AnswersAnotherScan": "never delivered",
    "ReturnsText": "must return a FusionOutput or None, not str",
    "MovesPoints": "read-only",
    "ChangesTheCalibration": "read-only",
    "ForgetsACamera": "mappingproxy",
    "ChangesTheCategories": "mappingproxy",
    "RestampsAMessage": "cannot assign to field",
}
"""Pipelines that break the contract, and what the reason of their case must say."""


def named(*names: str) -> tuple[str, ...]:
    """How the bench is asked for pipelines of this file."""
    return tuple(f"{__name__}:{name}" for name in names)


def handed(recording: Recording) -> None:
    """Show a recording to the cheats."""
    HANDED[:] = [recording]
