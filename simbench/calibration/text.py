"""A study in words: the table of pairs (the paper's Table I), that of the calibrated zone, plain data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import fmean
from typing import Any

from simbench.calibration.check import Part, Score
from simbench.calibration.study import PairStudy, Study

SCORES = ("residual_px", "on_board", "on_board_true", "tpr", "tpr_true")


def lines(study: Study) -> Iterator[str]:
    """What `simbench calibrate` prints."""
    s, v = study.settings, study.settings.volume
    yield (
        f"{s.rig}, seed {s.seed}: {s.poses} poses, clicks {s.click_noise_px:g} px, LiDAR corners "
        f"{1e3 * s.corner_noise_m:g} mm, boards {v.near_m:g} to {v.far_m:g} m away within image radius "
        f"{v.radius:g}"
    )
    yield ""
    width = max(len(pair.camera) for pair in study.pairs) + 2
    yield (
        f"{'pair':{width}s}{'found':>7s}{'reproj px':>11s}{'pairs px':>10s}{'focal %':>9s}{'deg':>8s}"
        f"{'mm':>7s}{'TPR %':>8s}{'(true)':>8s}{'on board %':>12s}{'(true)':>8s}"
    )
    for pair in study.pairs:
        here = mean_of(calibrated(pair))
        yield (
            f"{pair.camera:{width}s}{f'{len(pair.measured.used)}/{pair.held}':>7s}"
            f"{pair.measured.intrinsics.rms_px:11.3f}{pair.extrinsics.rms_px:10.2f}{100 * pair.focal:9.2f}"
            f"{pair.rotation_deg:8.3f}{1e3 * pair.translation_m:7.1f}"
            f"{_percent(here, 'tpr', 8)}{_percent(here, 'tpr_true', 8)}"
            f"{_percent(here, 'on_board', 12)}{_percent(here, 'on_board_true', 8)}"
        )
    every = [mean_of(calibrated(pair)) for pair in study.pairs]
    whole = {key: fmean(one[key] for one in every if one) for key in SCORES} if any(every) else {}
    yield (
        f"{'mean':{width}s}{'':52s}{_percent(whole, 'tpr', 8)}{_percent(whole, 'tpr_true', 8)}"
        f"{_percent(whole, 'on_board', 12)}{_percent(whole, 'on_board_true', 8)}"
    )
    yield ""
    yield (
        f"{'board at':14s}{'image radius':>14s}{'boards':>8s}{'residual px':>13s}"
        f"{'TPR %':>8s}{'(true)':>8s}{'on board %':>12s}{'(true)':>8s}"
    )
    for part, scores in zones(study.pairs):
        here = mean_of(scores)
        residual = f"{here['residual_px']:13.2f}" if here else f"{'-':>13s}"
        yield (
            f"{f'{part.near_m:g}-{part.far_m:g} m':14s}"
            f"{('up to ' if part.central else 'beyond ') + f'{v.radius:g}':>14s}{len(scores):8d}{residual}"
            f"{_percent(here, 'tpr', 8)}{_percent(here, 'tpr_true', 8)}"
            f"{_percent(here, 'on_board', 12)}{_percent(here, 'on_board_true', 8)}"
            f"{'  calibrated zone' if part.calibrated else ''}"
        )
    for pair in study.pairs:
        for number, why in pair.measured.left_out.items():
            yield f"{pair.camera}: pose {number} left out: {why}"


def calibrated(pair: PairStudy) -> tuple[Score, ...]:
    """The boards that were put up in the calibrated zone of a pair."""
    return next(part.boards for part in pair.parts if part.calibrated)


def zones(pairs: Sequence[PairStudy]) -> Iterator[tuple[Part, tuple[Score, ...]]]:
    """Every part of the volume with the boards of all pairs in it."""
    for parts in zip(*(pair.parts for pair in pairs), strict=True):
        yield parts[0], tuple(score for part in parts for score in part.boards)


def mean_of(scores: Sequence[Score]) -> dict[str, float]:
    """Means over boards; empty where there is none."""
    return {key: fmean(getattr(one, key) for one in scores) for key in SCORES} if scores else {}


def errors(study: Study) -> dict[str, Any]:
    """Settings and errors against the truth as plain data."""
    s = study.settings
    return {
        "settings": {
            "poses": s.poses, "seed": s.seed, "click_noise_px": s.click_noise_px,
            "corner_noise_m": s.corner_noise_m, "near_m": s.volume.near_m, "far_m": s.volume.far_m,
            "radius": s.volume.radius, "fit_distortion": s.fit_distortion,
        },
        "pairs": {
            pair.camera: {
                "views_used": len(pair.measured.used),
                "reprojection_px": pair.measured.intrinsics.rms_px,
                "pairs_px": pair.extrinsics.rms_px,
                "focal_error": pair.focal,
                "rotation_error_deg": pair.rotation_deg,
                "translation_error_m": pair.translation_m,
                "zones": [
                    {
                        "near_m": part.near_m, "far_m": part.far_m, "central": part.central,
                        "boards": len(part.boards), **mean_of(part.boards),
                    }
                    for part in pair.parts
                ],
            }
            for pair in study.pairs
        },
    }  # fmt: skip


def _percent(means: dict[str, float], key: str, width: int) -> str:
    return f"{100 * means[key]:{width}.1f}" if means else f"{'-':>{width}s}"
