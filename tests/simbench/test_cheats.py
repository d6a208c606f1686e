"""Cheats and leaks at the level of a whole run (the list is in ../shared/scoring.md)."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from fusion.camera import project_points
from fusion.messages import Detections, LidarScan
from scenarios.faults import TriggerOffset
from scenarios.load import list_scenarios, load_scenario
from scenarios.scenario import Scenario
from simbench.capture import Captured
from simbench.case import Case, Job
from simbench.learn import FIRST_SEED, SCALES
from simbench.motion import Motion
from simbench.run import run_case
from simbench.score.frames import frames_of
from simbench.score.pairs import eligible_pairs
from simbench.stage import Stage, stage
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth, TrueBox, Truth
from simbench.world import World
from tests.simbench import cheats
from tests.simbench.support import faults, reachable, recorded, staged, write_scenario

OURS = ("static_projection", "static_projection_ground", "probabilistic")


def medium(system: str = "car", seed: int = 0, **changes: object) -> Stage:
    """The whole manoeuvre, a quarter of the columns, a third of the pixels."""
    kept = {"duration_s": None, "columns": 256, "size_px": (320, 200), "background": True}
    return staged(system, seed, **{**kept, **changes})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def captured() -> Captured:
    """With a detector that misses nothing: what is lost is lost by the pipeline."""
    with mock.patch("simbench.sensors.detector.recall", lambda *_: 1.0):
        return recorded(medium())


@pytest.fixture(scope="module")
def cases(captured: Captured) -> dict[str, Case]:
    cheats.handed(captured.recording)
    names = (
        "TruthHandedOver", "TruthLate", "OnePoint", "OneFrame", "LabelsPermuted", "StampsOutsideTheSweep",
        "Silent",
    )  # fmt: skip
    return {name: run_case(*cheats.named(name), captured, "none") for name in names}


def value(case: Case, metric: str) -> float:
    (row,) = (row for row in case.rows if row.metric == metric)
    assert row.value is not None, row.why
    return row.value


def test_truth_handed_over_is_perfect(cases: dict[str, Case]) -> None:
    case = cases["TruthHandedOver"]
    assert case.status == "ok"
    for metric in ("precision", "precision.pooled", "recall", "recall.pooled", "coverage.raw"):
        assert value(case, metric) == pytest.approx(1.0, abs=1e-12), metric
    for stage_name in ("raw", "smooth"):
        assert value(case, f"mae_m.{stage_name}") == pytest.approx(0.0, abs=1e-9)
    assert value(case, "gross_rate.smooth") <= 0.05  # the first frame's own half period is not smoothed


def test_nothing_returned_scores_nothing(cases: dict[str, Case]) -> None:
    case = cases["Silent"]
    assert case.status == "ok"
    for metric in ("tpr", "precision", "recall", "coverage.raw", "coverage.smooth"):
        assert value(case, metric) == 0.0
    assert value(case, "gross_rate.smooth") == 1.0
    for row in case.rows:
        assert (row.value is None) == bool(row.why), row


def test_one_point_per_object_has_a_high_tpr_and_no_recall(cases: dict[str, Case]) -> None:
    assert value(cases["OnePoint"], "tpr") > 0.95
    assert value(cases["OnePoint"], "recall") < 0.1
    assert value(cases["OnePoint"], "coverage@5points") < 0.2  # far off, where the target has five points


def test_one_frame_only_fails_in_coverage(cases: dict[str, Case]) -> None:
    case = cases["OneFrame"]
    assert value(case, "coverage.raw") < 0.05
    assert value(case, "gross_rate.smooth") > 0.95
    assert next(r for r in case.rows if r.metric == "mae_m.raw").value is None


def test_stamps_outside_the_sweep_are_a_contract_error(cases: dict[str, Case]) -> None:
    case = cases["StampsOutsideTheSweep"]
    assert case.status == "pipeline_error"
    assert case.why is not None and "outside its sweep" in case.why
    assert all(row.value is None and row.why for row in case.rows)


def test_permuted_labels_bring_precision_down_to_the_class_share(cases: dict[str, Case]) -> None:
    shares = cheats.LabelsPermuted.share
    assert 0.1 < np.mean(shares) < 0.9
    assert value(cases["LabelsPermuted"], "precision") == pytest.approx(np.mean(shares), abs=0.03)


def test_truth_of_100_ms_later_moves_only_the_longitudinal_error(cases: dict[str, Case]) -> None:
    for stage_name in ("raw", "smooth"):
        assert value(cases["TruthLate"], f"mae_longitudinal_m.{stage_name}") == pytest.approx(0.52, abs=0.05)
        assert value(cases["TruthLate"], f"mae_lateral_m.{stage_name}") < 0.05


def test_a_target_longer_than_its_category_raises_the_error() -> None:
    errors = []
    for scale in (1.0, 1.15):
        at = medium("wearable", scenario="overtake-recede", duration_s=3.0)
        actors = {
            name: actor.model_copy(update={"scale": scale}) if name == "car" else actor
            for name, actor in at.system.actors.items()
        }
        at = rebuilt(at, actors)
        captured = recorded(at)
        errors.append(value(run_case("probabilistic", captured), "mae_longitudinal_m.raw"))
    assert errors[1] > errors[0] + 0.1


def rebuilt(at: Stage, actors: object) -> Stage:
    from simbench.world import build_world

    system = at.system.model_copy(update={"actors": actors})
    return replace(at, system=system, world=build_world(at.scenario, system, 0))


# -- at rest ----------------------------------------------------------------------------------------------


def at_rest(name: str) -> Scenario:
    """A catalogue scenario in which nobody moves; the target stands 10 m away."""
    scenario = load_scenario(name).resolve(0)
    systems = {}
    for key, system in scenario.systems.items():
        actors = {}
        ((ego_x, _),) = system.actors[system.ego].path.waypoints_m
        for actor_name, actor in system.actors.items():
            ((x, y),) = actor.path.waypoints_m
            near = ego_x + 10.0 * np.sign(x - ego_x)
            path = actor.path.model_copy(update={"waypoints_m": ((float(near), y),), "speed_mps": 0.0})
            actors[actor_name] = actor.model_copy(update={"path": path})
        systems[key] = system.model_copy(update={"actors": actors, "duration_s": 1.0})
    background = tuple(s.model_copy(update={"speed_mps": 0.0}) for s in scenario.background)
    return scenario.model_copy(update={"name": "at-rest", "systems": systems, "background": background})


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_at_rest_an_offset_of_100_ms_changes_no_row(tmp_path: Path, system: str) -> None:
    path = write_scenario(tmp_path, at_rest("overtake-approach"))
    at = stage(Job(scenario=str(path), system=system, seed=0, pipelines=(), size_px=(320, 200)))
    at = replace(at, rig=replace(at.rig, lidar=at.rig.lidar.model_copy(update={"columns": 256})))
    rows = []
    for specs in ((), (TriggerOffset(offset_ms=100.0),)):
        captured = recorded(replace(at, faults=faults(*specs)))
        found = [run_case(name, captured) for name in OURS]
        assert {case.status for case in found} == {"ok"}
        assert value(found[0], "recall") > 0.5
        rows.append([case.rows for case in found])
    assert rows[0] == rows[1]


# -- leaks ------------------------------------------------------------------------------------------------


def test_no_array_of_a_message_reaches_a_larger_one(captured: Captured) -> None:
    recording = captured.recording
    arrays = [
        thing
        for message in (*recording.messages, recording.calibration)
        for thing in reachable(message)
        if isinstance(thing, np.ndarray)
    ]
    assert len(arrays) > 4 * len(recording.truth.scans)
    for array in arrays:
        assert array.base is None and array.flags.owndata and not array.flags.writeable


def test_nothing_that_a_pipeline_gets_reaches_the_truth(captured: Captured) -> None:
    recording = captured.recording
    given = (recording.messages, recording.calibration, dict(recording.categories))
    truth = (Truth, ScanTruth, ImageTruth, TrueBox, ObjectInfo, GnssReference, Motion, World, Captured)
    for thing in reachable(*given):
        assert not isinstance(thing, truth), type(thing)
    own = {id(array) for array in reachable(*given) if isinstance(array, np.ndarray)}
    true = [array for array in reachable(recording.truth.scans) if isinstance(array, np.ndarray)]
    assert len(true) == 5 * len(recording.truth.scans)
    assert not own & {id(array) for array in true}
    kinds = {type(thing).__module__.split(".")[0] for thing in reachable(*given)}
    assert kinds <= {"builtins", "numpy", "fusion"}


@cache
def ordinary(system: str) -> Captured:
    return recorded(medium(system, 1), 1)


def auc(score: list[float], positive: list[bool]) -> float:
    """Chance that a positive has the higher score, ties halved; which way round does not matter."""
    from scipy.stats import rankdata

    label = np.array(positive)
    rank = rankdata(np.array(score))
    n, m = int(label.sum()), int((~label).sum())
    area = float((rank[label].sum() - n * (n + 1) / 2.0) / (n * m))
    return max(area, 1.0 - area)


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_confidence_order_and_ids_of_boxes_do_not_tell_the_target(system: str) -> None:
    recording = ordinary(system).recording
    truth = {(i.sensor, i.seq): i.detection_object_id for i in recording.truth.images}
    columns: dict[str, list[float]] = {"confidence": [], "order": [], "parity of the id": []}
    label: list[bool] = []
    for message in recording.messages:
        if not isinstance(message, Detections) or len(message.boxes) < 2:
            continue
        behind = truth[(message.sensor, message.seq)]
        if recording.truth.target_id not in behind:
            continue
        for place, (box, object_id) in enumerate(zip(message.boxes, behind, strict=True)):
            columns["confidence"].append(box.confidence)
            columns["order"].append(place / (len(message.boxes) - 1))
            columns["parity of the id"].append(box.track_id % 2)
            label.append(object_id == recording.truth.target_id)
    assert sum(label) >= 20
    for name, column in columns.items():
        if name != "parity of the id":  # one draw per run: see the next test
            assert auc(column, label) < 0.7, name


def test_track_ids_are_drawn_anew_for_every_run() -> None:
    """The target's id is now higher, now lower than the others': its rank is uniform over seeds."""
    from simbench.sensors.detector import draw_track_ids

    objects = stage(Job(scenario="overtake-approach", system="car", seed=0, pipelines=())).world.objects
    target = next(o.object_id for o in objects if o.name == "rider")
    ranks = []
    for seed in range(60):
        ids = draw_track_ids(objects, seed)
        assert len(set(ids.values())) == len(objects)
        ranks.append(np.mean([ids[target] > other for key, other in ids.items() if key != target]))
    assert 0.35 < np.mean(ranks) < 0.65


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_the_order_of_points_in_the_box_does_not_tell_the_target(system: str) -> None:
    recording = ordinary(system).recording
    frames = frames_of(recording)
    order: list[float] = []
    label: list[bool] = []
    for pair in eligible_pairs(recording, frames):
        scan = frames[pair.frame].scan
        uv = project_points(
            scan.xyz_m,
            recording.calibration.T_camera_lidar(pair.camera, scan.sensor),
            recording.calibration.cameras[pair.camera],
        )
        x0, y0, x1, y1 = pair.box_px
        inside = np.flatnonzero((uv[:, 0] > x0) & (uv[:, 0] < x1) & (uv[:, 1] > y0) & (uv[:, 1] < y1))
        order += np.linspace(0.0, 1.0, len(inside)).tolist()
        label += np.isin(inside, pair.points).tolist()
    assert sum(label) > 200 and len(label) - sum(label) > 50
    assert auc(order, label) < 0.7


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_intensity_does_not_tell_the_target_from_other_objects_with_boxes(system: str) -> None:
    """Over several seeds. (Within its box the target is brighter than the asphalt: that is physics.)"""
    intensity: list[float] = []
    label: list[bool] = []
    for seed in range(4):
        truth, messages = _scans(staged(system, seed, duration_s=1.5, columns=128, background=True), seed)
        boxed = [o.object_id for o in truth.objects if o.category in ("car", "rider", "pedestrian")]
        for scan, points in zip(messages, truth.scans, strict=True):
            of_object = np.isin(points.object_id, boxed)
            intensity += scan.intensity[of_object].tolist()
            label += (points.object_id[of_object] == truth.target_id).tolist()
    assert auc(intensity, label) < 0.7


def _scans(at: Stage, seed: int) -> tuple[Truth, list[LidarScan]]:
    with mock.patch("simbench.capture._Sought.boxes_in", lambda *_: ()):
        recording = recorded(at, seed).recording
    return recording.truth, [m for m in recording.messages if isinstance(m, LidarScan)]


# -- what was learned on what ------------------------------------------------------------------------------


def test_shapes_were_learned_on_seeds_and_sizes_apart_from_evaluation() -> None:
    path = Path(cheats.__file__).parents[2] / "fusion" / "shapes.json"
    provenance = json.loads(path.read_text(encoding="utf-8"))["provenance"]
    first, _, last = provenance["command"].split("--seeds ")[1].partition("-")
    assert FIRST_SEED <= int(first) <= int(last)
    assert "more than 8 %" in provenance["sizes"] and provenance["faults"] == "none"
    assert set(provenance["objects"]) == {"car", "pedestrian", "rider"}
    assert min(provenance["objects"].values()) >= 100
    assert all(abs(scale - 1.0) > 0.08 for scale in SCALES)


def test_evaluation_draws_targets_within_8_percent() -> None:
    for name in list_scenarios():
        for seed in range(5):
            for system in load_scenario(name).resolve(seed).systems.values():
                if system.target is not None:
                    assert abs(system.actors[system.target].scale - 1.0) <= 0.08


def test_shapes_are_not_learned_on_seeds_of_evaluation() -> None:
    from simbench.learn import learn

    with pytest.raises(ValueError, match="from 100000 on"):
        learn([99_999])


def test_what_a_pipeline_is_told_of_sizes_is_not_the_targets() -> None:
    recording = ordinary("car").recording
    told = {size.mean_m for size in recording.categories.values()}
    assert not told & {info.size_m for info in recording.truth.objects}
