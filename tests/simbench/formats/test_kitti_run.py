"""From `simbench run kitti:FOLDER` to the files that it leaves: rows, objects, report, pictures."""

from __future__ import annotations

import csv
import io
import json
import shlex
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner, Result

from fusion.messages import FusionOutput
from scenarios.fault_set import FaultSet
from simbench.case import Case, Job, JobResult
from simbench.cli import main
from simbench.formats.kitti import open_kitti
from simbench.formats.recorded import Player
from simbench.report.objects import as_text, object_tables
from simbench.run import run_job
from simbench.score.metrics import METRICS
from simbench.score.objects import ONE_FRAME, score_objects, score_oracles
from simbench.score.score import score
from tests.simbench.formats import mini_kitti as mini

FRAMES = 7
PIPELINES = ("static_projection_ground", "probabilistic")
LOOKS = f"{Path(__file__).parent / 'looking.py'}:Looks"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitti")
    hidden = replace(mini.CAR, occluded=2, truncated=0.3)
    mini.write_object(root / "object", {3: mini.SCENE, 8: (hidden, mini.RIDER), 9: ()})
    mini.write_tracking(root / "tracking", mini.drive(FRAMES))
    mini.write_raw(root / "raw", mini.drive(FRAMES))
    return root


def job(root: Path, seed: int = 0, **options: object) -> Job:
    given = {"pipelines": PIPELINES, "faults": (), **options}
    return Job(scenario=f"kitti:{root}", system="car", seed=seed, **given)  # type: ignore[arg-type]


def case_of(result: JobResult, pipeline: str) -> Case:
    return next(c for c in result.cases if c.pipeline == pipeline)


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["run", *words], prog_name="simbench")


# -- scores -----------------------------------------------------------------------------------------------


def test_an_object_in_the_open_is_hit_in_every_layout(data: Path) -> None:
    for layout, number, pairs in (("object", 3, 1), ("tracking", 0, FRAMES), ("raw", 5, FRAMES)):
        result = run_job(job(data / layout, number))
        assert {case.status for case in result.cases} == {"ok"}, [case.why for case in result.cases]
        scores = case_of(result, "static_projection_ground").scores
        assert scores is not None
        rider = next(o for o in scores.objects if o.category == "rider")
        # A drive's images are stamped before its sweeps: no next image settles the last sweep's pairing.
        answered = pairs - (layout == "raw")
        assert (rider.pairs, rider.hits, rider.positions) == (pairs, answered, answered)
        assert rider.planar_m is not None and rider.planar_m < 1.0
        assert rider.distance_m == pytest.approx(np.hypot(9.0, 2.5), abs=0.02)
        oracle = case_of(result, "oracle").scores
        assert oracle is not None
        assert oracle["precision"].value == oracle["recall"].value == 1.0


def test_every_object_counts_and_the_recording_is_their_sum(data: Path) -> None:
    result = run_job(job(data / "tracking"))
    scores = case_of(result, "probabilistic").scores
    assert scores is not None
    assert [o.pairs for o in scores.objects] == [FRAMES - 1, FRAMES]
    assert scores["tpr"].n == len(scores.pairs) == 2 * FRAMES - 1
    assert scores["hit_rate"].value == pytest.approx(sum(o.hits for o in scores.objects) / (2 * FRAMES - 1))
    weighted = sum((o.tpr or 0.0) * o.pairs for o in scores.objects) / (2 * FRAMES - 1)
    assert scores["tpr"].value == pytest.approx(weighted)
    assert {p.target for p in scores.pairs} == {f.target for f in scores.frames} == {0, 1}


def test_a_recording_with_one_object_scores_as_one_with_one_target(tmp_path: Path) -> None:
    root = mini.write_tracking(tmp_path, [(mini.RIDER,)] * FRAMES)
    recording = Player(open_kitti(f"kitti:{root}").drive(0), FaultSet()).play().recording
    (alone,) = recording.by_target
    a, b = score_objects(recording, (), ()), score(alone, (), ())
    assert a.rows == b.rows
    assert a.pairs == b.pairs
    oracle = score_oracles(recording)
    assert oracle["hit_rate"].value == 1.0
    assert oracle["mae_m.smooth"].value is not None


def test_the_order_of_objects_changes_no_row(tmp_path: Path) -> None:
    rows = []
    for name, boxes in (("a", mini.SCENE), ("b", mini.SCENE[::-1])):
        root = mini.write_tracking(tmp_path / name, [boxes] * 5)
        result = run_job(job(root, pipelines=("static_projection_ground",)))
        rows.append({r.metric: (r.value, r.n) for r in result.cases[0].rows})
    for metric in rows[0]:
        (a, n), (b, m) = rows[0][metric], rows[1][metric]
        assert n == m and (a == pytest.approx(b) if a is not None else b is None), metric


def test_what_one_frame_cannot_tell_is_null_with_a_reason(data: Path) -> None:
    result = run_job(job(data / "object", 3))
    for case in result.cases:
        rows = {row.metric: row for row in case.rows}
        assert set(rows) == {m.name for m in METRICS}
        for row in rows.values():
            assert (row.value is None) == bool(row.why)
            if ".smooth" in row.metric:
                assert row.why == ONE_FRAME
        assert rows["time_to_first_valid_s"].why == ONE_FRAME
        assert "at least 5 are needed" in (rows["mae_m.raw"].why or "")
        assert "GNSS" in (rows["budget_lateral_m.total"].why or "")
        assert rows["tpr"].value is not None


def test_a_sequence_has_trajectories(data: Path) -> None:
    scores = case_of(run_job(job(data / "tracking")), "static_projection_ground").scores
    assert scores is not None
    for metric in ("mae_m.raw", "mae_m.smooth", "coverage.smooth", "time_to_first_valid_s"):
        assert scores[metric].value is not None, metric


def test_an_object_that_is_not_scored_says_why(data: Path) -> None:
    scores = run_job(job(data / "object", 8)).cases[0].scores
    assert scores is not None
    car, rider = scores.objects
    assert (car.pairs, car.tpr, car.planar_m) == (0, None, None)
    assert car.why == "21 % visible by its label, at least 25 % needed"
    assert car.points > 5
    assert rider.why is None


def test_a_frame_without_objects_has_nothing_to_map_to(data: Path) -> None:
    result = run_job(job(data / "object", 9))
    assert [case.pipeline for case in result.cases] == list(PIPELINES)  # no oracle
    for case in result.cases:
        rows = {row.metric: row for row in case.rows}
        assert rows["tpr"].value is None and rows["tpr"].why == "the scenario has no target"
        assert rows["false_objects_per_frame"].value == 0.0


def test_the_same_job_gives_the_same_rows(data: Path) -> None:
    faults = ("detector.edge_error=0.1", "lidar.beam_loss=30")
    a, b = (run_job(job(data / "tracking", faults=faults, boxes="model")) for _ in range(2))
    assert [case.rows for case in a.cases] == [case.rows for case in b.cases]


def test_a_turn_of_the_camera_costs_the_raw_box_its_points(data: Path) -> None:
    turned = ("calibration.rotation_deg={angle_deg: 5, axis: yaw}",)
    for layout, number in (("object", 3), ("tracking", 0)):
        recall = []
        for faults in ((), turned):
            scores = run_job(job(data / layout, number, faults=faults)).cases[0].scores
            assert scores is not None
            recall.append(scores["recall"].value or 0.0)
        assert recall[1] < 0.6 * recall[0]


def test_a_receipt_that_does_not_match_voids_the_recording(data: Path) -> None:
    from simbench.formats import recorded as made

    real = made.draw_on_recording

    def idle(faults: FaultSet, true: object, *rest: object, **more: object) -> object:
        drawn = real(faults, true, *rest, **more)  # type: ignore[arg-type]
        return replace(drawn, told=true)  # type: ignore[arg-type]

    with mock.patch.object(made, "draw_on_recording", idle):
        result = run_job(job(data / "object", 3, faults=("calibration.shift_px=9",)))
    assert {case.status for case in result.cases} == {"receipt_mismatch"}


# -- what a pipeline gets ---------------------------------------------------------------------------------


def test_images_are_handed_out_where_a_pipeline_looks_at_them(data: Path) -> None:
    for images, seen in (("raycast", FRAMES), ("none", 0)):
        result = run_job(job(data / "tracking", pipelines=(LOOKS,), images=images))
        assert result.cases[0].status == "ok", result.cases[0].why
        driven = result.cases[0].driven
        assert driven is not None
        assert len(driven.outputs) == seen


def test_truth_is_not_reachable_from_what_is_handed_out(data: Path) -> None:
    recording = Player(open_kitti(f"kitti:{data / 'tracking'}").drive(0), FaultSet()).play().recording
    for message in recording.messages:
        for value in vars(message).values():
            if isinstance(value, np.ndarray):
                assert value.base is None and not value.flags.writeable


# -- files ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("layout", "seeds"), [("object", ["3", "8", "9"]), ("tracking", ["0"]), ("raw", ["5"])]
)
def test_a_run_leaves_rows_objects_and_a_report(
    data: Path, tmp_path: Path, layout: str, seeds: list[str]
) -> None:
    faults = "calibration.rotation_deg={angle_deg: 2, axis: yaw}"
    pipelines = [word for name in PIPELINES for word in ("--pipeline", name)]
    done = run(
        f"kitti:{data / layout}", *pipelines, "--faults", faults, "--out", str(tmp_path), "--jobs", "1"
    )
    assert done.exit_code == 0, done.output
    made = {path.name for path in tmp_path.iterdir()}
    assert {"result.json", "pairs.csv", "frames.csv", "objects.csv", "report.html"} <= made
    assert {f"scenario-kitti-{layout}-{seed}.yaml" for seed in seeds} <= made
    assert any(name.endswith(".webm") for name in made) == (layout != "object")
    content = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert {row["scenario"] for row in content["rows"]} == {f"kitti-{layout}"}
    assert {str(row["seed"]) for row in content["rows"]} == set(seeds)
    assert {row["faults"] for row in content["rows"]} == {"none", faults}
    rows = list(csv.DictReader(io.StringIO((tmp_path / "objects.csv").read_text(encoding="utf-8"))))
    pairs = list(csv.DictReader(io.StringIO((tmp_path / "pairs.csv").read_text(encoding="utf-8"))))
    assert sum(int(row["pairs"]) for row in rows) == len(pairs)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for words in ("rider-", "no injected errors", "2 deg rotation", "Pictures are the recorded ones.",
                  "Truth is by hand", "data:image/jpeg"):  # fmt: skip
        assert words in page
    for words in ("rigid primitives", "smooth (0)"):
        assert words not in page
    assert "hit pairs" in done.stdout


def test_the_command_of_a_case_makes_the_same_job(data: Path, tmp_path: Path) -> None:
    words = [f"kitti:{data / 'tracking'}", "--pipeline", "static_projection", "--frames", "1-5"]
    words += ["--boxes", "model", "--faults", "lidar.beam_loss=25", "--alone", "--images", "none"]
    done = run(*words, "--out", str(tmp_path), "--jobs", "1")
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    planned: list[Job] = []
    for case in content["cases"]:
        program, *again = shlex.split(case["command"])
        assert program == "simbench"
        with mock.patch("simbench.commands.run.execute", lambda jobs, *_: planned.extend(jobs)):
            assert CliRunner().invoke(main, again).exit_code == 0
    assert len(set(planned)) == 1
    assert planned[0] == Job(
        scenario=f"kitti:{data / 'tracking'}", system="car", seed=0, pipelines=("static_projection",),
        faults=("lidar.beam_loss=25",), images="none", boxes="model", frames=(1, 5),
    )  # fmt: skip


def test_seeds_pick_frames_of_the_object_layout(data: Path) -> None:
    planned: list[Job] = []
    with mock.patch("simbench.commands.run.execute", lambda jobs, *_: planned.extend(jobs)):
        assert run(f"kitti:{data / 'object'}").exit_code == 0
        assert [j.seed for j in planned] == [3, 8, 9]
        planned.clear()
        assert run(f"kitti:{data / 'object'}", "--seeds", "8").exit_code == 0
        assert [j.seed for j in planned] == [8]


def test_the_object_table_by_hand(data: Path) -> None:
    results = [
        run_job(job(data / "object", seed, pipelines=("static_projection_ground",))) for seed in (3, 8)
    ]
    (table,) = object_tables(results)
    assert table.pipelines == ("static_projection_ground", "oracle")
    assert [line.name for line in table.lines] == [
        "000003-car-0", "000003-rider-1", "000008-car-0", "000008-rider-1",
    ]  # fmt: skip
    assert [cell.mark for cell in table.lines[1].cells] == ["hit", "hit"]
    assert [cell.mark for cell in table.lines[2].cells] == ["–", "–"]
    assert table.lines[2].why.startswith("21 % visible")
    assert table.totals[1] == "3 of 3"
    text = as_text(table).splitlines()
    assert len(text) == 2 + 4 + 1
    assert len({len(line) for line in text[1:]}) == 1  # columns stand under each other


def test_a_crash_of_a_pipeline_stays_its_own(data: Path) -> None:
    class Wrong:
        def reset(self, *_: object) -> None: ...

        def update(self, _: object) -> FusionOutput | None:
            raise KeyError("x")

        def trajectories(self) -> tuple[()]:
            return ()

    with mock.patch("simbench.run.load_pipeline", lambda name: Wrong):
        result = run_job(job(data / "object", 3, pipelines=("wrong",), isolate="none"))
    assert [case.status for case in result.cases] == ["pipeline_error", "ok"]
