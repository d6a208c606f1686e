"""The oracle: what the same later steps give when the labels of the points are known.

In every eligible pair, whether a detector saw the target or not, the mapping is all of the target's true
points in the image; representative point, distance, position and smoother are the pipeline's own
(`fusion.localize`, `fusion.tracks`), with the calibration that a pipeline is told. It answers under one track
id that no detector used.
"""

from __future__ import annotations

from fusion.localize import LocalizeConfig, localize
from fusion.messages import Detection, Detections, FusionOutput, Trajectory
from fusion.smooth import SmootherConfig
from fusion.tracks import Tracks
from simbench.recording import Recording
from simbench.score.pairs import EligiblePair, frames_and_pairs
from simbench.score.score import Scores, score


def oracle_track(recording: Recording) -> int:
    """The track id under which the oracle answers: negative, and of no detection in the recording."""
    used = {b.track_id for m in recording.messages if isinstance(m, Detections) for b in m.boxes}
    return min(used | {0}) - 1


def oracle_labels(
    recording: Recording,
    *,
    localize_config: LocalizeConfig | None = None,
    smoother_config: SmootherConfig | None = None,
) -> tuple[tuple[FusionOutput, ...], tuple[Trajectory, ...]]:
    """One output per frame and the target's trajectory. Configs default to those of `fusion`."""
    truth = recording.truth
    frames, eligible = frames_and_pairs(recording)
    by_frame: dict[int, list[EligiblePair]] = {}
    for pair in eligible:
        by_frame.setdefault(pair.frame, []).append(pair)
    category = next((o.category for o in truth.objects if o.object_id == truth.target_id), "")
    track_id = oracle_track(recording)
    tracks = Tracks()
    outputs = []
    for frame in frames:
        objects = []
        for pair in by_frame.get(frame.index, []):
            objects.append(
                localize(
                    frame.scan,
                    pair.points,
                    detection=Detection(
                        track_id=track_id,
                        category=category,
                        box_px=pair.box_px,
                        confidence=1.0,
                    ),
                    camera=pair.camera,
                    T_ego_lidar=recording.calibration.T_ego_sensor[frame.scan.sensor],
                    confidence=1.0,
                    config=localize_config or LocalizeConfig(),
                )
            )
        tracks.add(frame.scan, objects)
        outputs.append(
            FusionOutput(scan_sensor=frame.scan.sensor, scan_seq=frame.scan.seq, objects=tuple(objects))
        )
    return tuple(outputs), tracks.trajectories(smoother_config or SmootherConfig())


def score_oracle(recording: Recording) -> Scores:
    """The oracle row of a recording, by the same functions as every pipeline."""
    outputs, trajectories = oracle_labels(recording)
    target = recording.truth.target_id
    known = {} if target is None else {oracle_track(recording): target}
    return score(recording, outputs, trajectories, known_tracks=known)
