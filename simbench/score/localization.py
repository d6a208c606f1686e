"""Localization: where the target was said to be, frame by frame (definitions: `metrics.py`).

Reference: the centre of the target's rest-pose box in the ego reference frame at the *output's own stamp*,
read on the bench's clock; or (`gnss`) the paper's 5 Hz GNSS position that holds at that stamp. Errors are
signed, position minus reference; longitudinal is x, lateral is y. A frame is eligible when one of its pairs
is.

* raw: the output's position for the frame; of several the most confident, then the nearest to its image
centre.
* smooth: the target's trajectory sample whose stamp lies in the frame's sweep [stamp, stamp + period); of
  several the nearest to the frame's instant (median true firing time of the target's points), then the
  earlier, then the lower track id. Between its stamps a trajectory says nothing: no interpolation by the
  bench.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import Trajectory
from simbench.recording import Recording
from simbench.score.frames import Frame
from simbench.score.identity import Identified, best
from simbench.score.mapping import is_hit
from simbench.score.metrics import (
    GROSS_M,
    LOCALIZATION,
    MIN_CLOSING_MPS,
    MIN_ERROR_FRAMES,
    TTC_HORIZON_S,
    Estimate,
    mean_of,
    null,
)
from simbench.score.pairs import EligiblePair, held_fix, held_position, planar_range_m
from simbench.truth import Truth

DERIVATIVE_NS = 5_000_000  # half the step of the central difference for true speeds
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A position for the target [m, ego frame] with the references at its stamp (GNSS: None before its first
    fix).
    """

    stamp_ns: int
    position_ego_m: Vector
    centre_ego_m: Vector
    gnss_ego_m: Vector | None

    def error_m(self, reference: str = "") -> Float64[np.ndarray, " 3"] | None:
        """Position minus centre, or minus the held GNSS for reference '.gnss'."""
        against = self.gnss_ego_m if reference == ".gnss" else self.centre_ego_m
        return None if against is None else np.subtract(self.position_ego_m, against)


@dataclass(frozen=True, kw_only=True)
class FrameScore:
    """One eligible frame. `camera`, `track_id`: of the raw position; `hit`: it rests on a point on the
    target. `target`: which of several targets, by its place among them.
    """

    frame: int
    scan_sensor: str
    scan_seq: int
    scan_stamp_ns: int
    instant_ns: int
    true_centre_ego_m: Vector  # at instant_ns
    raw: Fix | None
    camera: str | None
    track_id: int | None
    hit: bool
    smooth: Fix | None
    target: int = 0


def _vector(row: np.ndarray) -> Vector:
    return float(row[0]), float(row[1]), float(row[2])


def fixes(truth: Truth, stamps_ns: Sequence[int], positions_ego_m: Sequence[np.ndarray]) -> tuple[Fix, ...]:
    """Positions [n 3] at stamps [n] with their references."""
    if not len(stamps_ns):
        return ()
    t_ns = np.asarray(stamps_ns, dtype=np.int64)
    centre = truth.target_centre_ego_m(t_ns)
    held: list[Vector | None] = [None] * len(t_ns)
    if truth.reference is not None:
        rows = held_fix(truth.reference, t_ns)
        held = [
            None if row < 0 else _vector(held_position(truth, int(row), int(t))[0])
            for row, t in zip(rows, t_ns, strict=True)
        ]
    return tuple(
        Fix(
            stamp_ns=int(t_ns[i]),
            position_ego_m=_vector(positions_ego_m[i]),
            centre_ego_m=_vector(centre[i]),
            gnss_ego_m=held[i],
        )
        for i in range(len(t_ns))
    )


def score_frames(
    recording: Recording,
    frames: Sequence[Frame],
    pairs: Sequence[EligiblePair],
    identified: Sequence[Sequence[Identified]],
    target_tracks: Sequence[Trajectory],
) -> tuple[FrameScore, ...]:
    """One `FrameScore` per eligible frame; identified[i] are the output objects of frames[i]."""
    truth = recording.truth
    firing: dict[int, list[Int64[np.ndarray, " k"]]] = {}
    for pair in pairs:
        firing.setdefault(pair.frame, []).append(pair.points)
    eligible = sorted(firing)
    if not eligible:
        return ()
    instants = [
        int(np.median(frames[i].truth.fire_ns[np.unique(np.concatenate(firing[i]))])) for i in eligible
    ]
    raw = [best([k for k in identified[i] if k.object_id == truth.target_id], recording) for i in eligible]
    samples = _samples(target_tracks)
    smooth = [
        _sample_in(samples, frames[i].scan.stamp_ns, truth.period_ns, at)
        for i, at in zip(eligible, instants, strict=True)
    ]
    centre = truth.target_centre_ego_m(np.asarray(instants, dtype=np.int64))
    raw_fixes = iter(
        fixes(
            truth,
            [k.found.stamp_ns for k in raw if k is not None],
            [k.found.position_ego_m for k in raw if k is not None],
        )
    )
    smooth_fixes = iter(
        fixes(
            truth,
            [int(samples[0][s]) for s in smooth if s is not None],
            [samples[1][s] for s in smooth if s is not None],
        )
    )
    scores = []
    for row, i in enumerate(eligible):
        chosen = raw[row]
        scores.append(
            FrameScore(
                frame=i,
                scan_sensor=frames[i].scan.sensor,
                scan_seq=frames[i].scan.seq,
                scan_stamp_ns=frames[i].scan.stamp_ns,
                instant_ns=instants[row],
                true_centre_ego_m=_vector(centre[row]),
                raw=None if chosen is None else next(raw_fixes),
                camera=None if chosen is None else chosen.found.sensor,
                track_id=None if chosen is None else chosen.found.track_id,
                hit=chosen is not None and is_hit(recording, frames[i], chosen.found),
                smooth=None if smooth[row] is None else next(smooth_fixes),
            )
        )
    return tuple(scores)


def _samples(
    tracks: Sequence[Trajectory],
) -> tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "n 3"]]:
    """All samples of the tracks, by stamp and then track id."""
    ordered = sorted(tracks, key=lambda t: t.track_id)
    if not ordered:
        return np.empty(0, dtype=np.int64), np.empty((0, 3))
    stamps = np.concatenate([t.stamp_ns for t in ordered])
    order = np.argsort(stamps, kind="stable")
    return stamps[order], np.concatenate([t.position_ego_m for t in ordered])[order]


def _sample_in(
    samples: tuple[np.ndarray, np.ndarray], start_ns: int, period_ns: int, instant_ns: int
) -> int | None:
    first, last = np.searchsorted(samples[0], [start_ns, start_ns + period_ns], side="left")
    if first == last:
        return None
    return int(first + np.argmin(np.abs(samples[0][first:last] - instant_ns)))


def _errors(frames: Sequence[FrameScore], stage: str, reference: str) -> Float64[np.ndarray, "n 2"]:
    """Signed (x, y) errors of the frames that have a position and a reference."""
    found: list[np.ndarray] = []
    for frame in frames:
        fix = frame.raw if stage == "raw" else frame.smooth
        error = None if fix is None else fix.error_m(reference)
        if error is not None:
            found.append(error[:2])
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def localization_estimates(truth: Truth, frames: Sequence[FrameScore]) -> Mapping[str, Estimate]:
    """Every metric of `metrics.LOCALIZATION` by name."""
    if truth.target_id is None:
        return {metric.name: null("the scenario has no target") for metric in LOCALIZATION}
    return {
        **frame_estimates(frames),
        "lateral_clearance_error_m": _lateral_clearance(frames),
        "ttc_error_s": _ttc(truth, frames),
        "time_to_first_valid_s": _time_to_first_valid(frames),
    }


def frame_estimates(frames: Sequence[FrameScore]) -> dict[str, Estimate]:
    """The metrics that count frames alike, of whatever object: errors, coverage, gross errors."""
    estimates: dict[str, Estimate] = {}
    for stage in ("raw", "smooth"):
        for reference in ("", ".gnss"):
            error = _errors(frames, stage, reference)
            per_frame = {
                "mae_lateral_m": np.abs(error[:, 1]),
                "mae_longitudinal_m": np.abs(error[:, 0]),
                "mae_m": np.abs(error).mean(axis=1),
                "planar_m": planar_range_m(error),
            }
            of = f"eligible frames with a {stage} position" + (" and a GNSS fix" if reference else "")
            for name, values in per_frame.items():
                estimates[f"{name}.{stage}{reference}"] = mean_of(values, of=of, at_least=MIN_ERROR_FRAMES)
        got = [(f.raw if stage == "raw" else f.smooth) is not None for f in frames]
        estimates[f"coverage.{stage}"] = mean_of(got, of="eligible frames", spread=False)
    gross = []
    for frame in frames:
        error_m = None if frame.smooth is None else frame.smooth.error_m()
        gross.append(error_m is None or float(planar_range_m(error_m)) > GROSS_M)
    estimates["gross_rate.smooth"] = mean_of(gross, of="eligible frames", spread=False)
    return estimates


def _smooth_fixes(frames: Sequence[FrameScore]) -> list[Fix]:
    return [f.smooth for f in frames if f.smooth is not None]


def _too_few(n: int) -> Estimate:
    return null(f"{n} eligible frames with a smooth position, at least {MIN_ERROR_FRAMES} are needed", n)


def _lateral_clearance(frames: Sequence[FrameScore]) -> Estimate:
    if len(known := _smooth_fixes(frames)) < MIN_ERROR_FRAMES:
        return _too_few(len(known))
    closest = min(frames, key=lambda f: float(np.hypot(*f.true_centre_ego_m[:2])))
    error_m = None if closest.smooth is None else closest.smooth.error_m()
    if error_m is None:
        return null("no smooth position in the frame of closest approach")
    return Estimate(value=float(abs(error_m[1])), n=1)


def _ttc(truth: Truth, frames: Sequence[FrameScore]) -> Estimate:
    """Speeds: of the trajectory by central differences over its own samples, true ones over +-5 ms. A sweep
    that was delivered twice is one sample.
    """
    known = list({f.stamp_ns: f for f in _smooth_fixes(frames)}.values())
    if len(known) < MIN_ERROR_FRAMES:
        return _too_few(len(known))
    t_ns = np.array([f.stamp_ns for f in known], dtype=np.int64)
    t_s = (t_ns - t_ns[0]) * 1e-9
    gap_m = np.array([f.position_ego_m[0] for f in known])
    true_gap_m = np.array([f.centre_ego_m[0] for f in known])
    speed_mps = np.gradient(gap_m, t_s)
    before, after = (truth.target_centre_ego_m(t_ns + d)[:, 0] for d in (-DERIVATIVE_NS, DERIVATIVE_NS))
    true_speed_mps = (after - before) / (2e-9 * DERIVATIVE_NS)
    side = np.sign(true_gap_m)  # the side on which the target truly is: its gap there is positive
    true_ttc_s = _time_to_level(side * true_gap_m, -side * true_speed_mps)
    ttc_s = _time_to_level(side * gap_m, -side * speed_mps)
    closing = (-side * true_speed_mps >= MIN_CLOSING_MPS) & (true_ttc_s < TTC_HORIZON_S)
    return mean_of(np.abs(ttc_s - true_ttc_s)[closing], of="closing frames with a smooth position")


def _time_to_level(
    gap_m: Float64[np.ndarray, " n"], closing_mps: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """Gap over closing speed, limited to 0..horizon; the horizon where the gap does not close."""
    closes = closing_mps >= MIN_CLOSING_MPS
    time_s = np.where(closes, gap_m / np.where(closes, closing_mps, 1.0), TTC_HORIZON_S)
    return np.clip(time_s, 0.0, TTC_HORIZON_S)


def _time_to_first_valid(frames: Sequence[FrameScore]) -> Estimate:
    if not frames:
        return null("no eligible frames")
    first = next((f for f in frames if f.hit), None)
    if first is None:
        return null(f"no valid position in {len(frames)} eligible frames", len(frames))
    return Estimate(value=(first.instant_ns - frames[0].instant_ns) * 1e-9, n=1)
