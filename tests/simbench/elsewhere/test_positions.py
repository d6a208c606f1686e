"""Results that are positions only: errors come out as they were put in, and nothing is made up."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from fusion.messages import LidarScan
from simbench.case import Job
from simbench.cli import main
from simbench.elsewhere.positions import Position, score_positions
from simbench.recording import Recording
from simbench.run import recording_of

JOB = Job(
    scenario="overtake-approach", system="car", seed=0, pipelines=(), changes=("systems.car.duration_s=1.5",)
)


@lru_cache(maxsize=1)
def recording() -> Recording:
    return recording_of(JOB)[2].recording


def said(
    error_m: tuple[float, float, float] = (0.0, 0.0, 0.0), track: Callable[[int], str | None] = lambda i: "a"
) -> list[Position]:
    """The target's true centre in the middle of every sweep, and an error."""
    truth = recording().truth
    stamps = [m.stamp_ns + truth.period_ns // 2 for m in recording().messages if isinstance(m, LidarScan)]
    centres = truth.target_centre_ego_m(np.array(stamps)) + np.array(error_m)
    return [
        Position(
            where=f"line {i + 2}", stamp_ns=t, position_ego_m=(float(x), float(y), float(z)), track=track(i),
            category="rider", confidence=1.0,
        )
        for i, (t, (x, y, z)) in enumerate(zip(stamps, centres, strict=True))
    ]  # fmt: skip


@pytest.mark.parametrize("stage", ["raw", "smooth"])
def test_an_error_put_in_comes_out(stage: str) -> None:
    scores = score_positions(recording(), said((0.25, -0.5, 3.0)), "x.csv")
    assert scores[f"mae_longitudinal_m.{stage}"].value == pytest.approx(0.25, abs=1e-9)
    assert scores[f"mae_lateral_m.{stage}"].value == pytest.approx(0.5, abs=1e-9)
    assert scores[f"planar_m.{stage}"].value == pytest.approx(np.hypot(0.25, 0.5), abs=1e-9)
    assert scores[f"coverage.{stage}"].value == 1.0


def test_what_needs_points_has_no_number_and_says_why() -> None:
    scores = score_positions(recording(), said(), "x.csv")
    for metric in ("tpr", "precision", "recall", "hit_rate", "tpr.pooled"):
        assert scores[metric].value is None and "no point was given" in str(scores[metric].why)


def test_positions_without_a_track_have_no_trajectory() -> None:
    scores = score_positions(recording(), said(track=lambda i: None), "x.csv")
    assert scores["coverage.raw"].value == 1.0 and scores["coverage.smooth"].value == 0.0


def test_positions_beyond_the_gate_are_false_objects() -> None:
    near, far = (score_positions(recording(), said((0.0, -d, 0.0)), "x.csv") for d in (1.9, 40.0))
    assert near["coverage.raw"].value == 1.0 and near["false_objects_per_frame"].value == 0.0
    assert far["coverage.raw"].value == 0.0 and far["false_objects_per_frame"].value == 1.0


def test_a_track_that_is_mostly_the_target_stays_the_target_where_it_errs_by_metres() -> None:
    found = said()
    moved = [
        Position(
            where=p.where, stamp_ns=p.stamp_ns, track=p.track, category="", confidence=1.0,
            position_ego_m=(p.position_ego_m[0] + (6.0 if i < 3 else 0.0), *p.position_ego_m[1:]),
        )
        for i, p in enumerate(found)
    ]  # fmt: skip
    scores = score_positions(recording(), moved, "x.csv")
    assert scores["mae_longitudinal_m.raw"].value == pytest.approx(6.0 * 3 / scores["mae_m.raw"].n)


def as_csv(positions: list[Position], path: Path) -> Path:
    rows = [
        f"{p.track},{p.stamp_ns},{','.join(map(repr, p.position_ego_m))},{p.confidence}" for p in positions
    ]
    path.write_text("track,stamp_ns,x_m,y_m,z_m,confidence\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def score(results: Path, out: Path) -> Result:
    words = ["score", JOB.scenario, "--set", JOB.changes[0], "--results", str(results), "--out", str(out)]
    return CliRunner().invoke(main, words)


def test_a_csv_file_gives_the_same_scores(tmp_path: Path) -> None:
    positions = said((0.1, 0.2, 0.0))
    done = score(as_csv(positions, tmp_path / "found.csv"), tmp_path / "out")
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["rows"]
    told = score_positions(recording(), positions, "x")
    assert {r["metric"]: r["value"] for r in rows} == {r.metric: r.value for r in told.rows}


HEAD = "stamp_ns,x_m,y_m,z_m,track,confidence\n"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "line 1: there is no column stamp_ns"),
        ("stamp_ns,x_m,y_m\n", "line 1: there is no column z_m"),
        ("stamp,x_m,y_m,z_m\n", "unknown column 'stamp'"),
        ("stamp_ns,stamp_ns,x_m,y_m,z_m\n", "a column stands twice"),
        (HEAD + "1,2,3\n", "line 2: 3 values under 6 columns"),
        (HEAD + "1.5,0,0,0,a,1\n", "line 2, stamp_ns: '1.5' is no whole number"),
        (HEAD + "5,nan,0,0,a,1\n", "line 2, x_m: 'nan' is no finite number"),
        (HEAD + "5,0,0,0,a,2\n", "line 2, confidence: is 2"),
        (HEAD + "500000000,0,0,0,a,1\n\n9000000000000,0,0,0,a,1\n", "line 4: its stamp 9000000000"),
        (HEAD + "500000000,0,0,0,a,1\n500000001,0,0,0,a,1\n", "line 3: track 'a' has two positions"),
        (HEAD + '5,0,0,0,"a,1\n', "it is no CSV"),
    ],
)  # fmt: skip
def test_a_bad_table_is_told_in_one_sentence(tmp_path: Path, content: str, says: str) -> None:
    (tmp_path / "bad.csv").write_text(content, encoding="utf-8")
    done = score(tmp_path / "bad.csv", tmp_path / "out")
    assert done.exit_code == 2 and says in done.output, done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out" / "result.json").exists()
