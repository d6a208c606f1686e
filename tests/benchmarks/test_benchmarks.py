"""The benchmarks run, compare like with like, and say what they could not measure. Nothing here is timed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.sensors import rays
from tests.benchmarks import clock, ray_rows, rivals, workers
from tests.benchmarks.recording import peak_rss_mb
from tests.benchmarks.scene import Primitives, primitives
from tests.benchmarks.size import QUICK
from tests.benchmarks.table import KEYS, ROWS, Row, WrongAnswerError
from tests.benchmarks.triangles import slices, tessellate, world_mesh

ROOT = Path(__file__).resolve().parents[2]
WITH_A_RIVAL = {"rays_vs_mujoco_lidar", "rays_vs_embreex", "cameras_vs_gl"}  # not on every machine
ROUND = (rays.SPHERE, rays.ELLIPSOID, rays.CAPSULE, rays.CYLINDER)


# -- the script ---------------------------------------------------------------------------------------------


def test_json_is_one_object_with_all_keys_of_the_right_types() -> None:
    command = [sys.executable, "tests/benchmarks/sensors.py", "--quick", "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert list(result) == [*KEYS, "notes", "machine"]
    for key in KEYS:
        value = result[key]
        if value is None:
            assert key in WITH_A_RIVAL
            assert any(note.startswith(f"{key}:") for note in result["notes"]), "and a note says why"
        else:
            assert isinstance(value, float) and value > 0.0
    assert result["notes"] and all(isinstance(note, str) for note in result["notes"])
    assert set(result["machine"]) == {"cpu", "cores", "system", "python"}


def test_the_table_has_only_the_rows_asked_for() -> None:
    command = [
        sys.executable,
        str(ROOT / "tests/benchmarks/sensors.py"),
        "--quick",
        "--only",
        "geoms_600_vs_150",
    ]
    done = subprocess.run(command, cwd="/", capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    assert "overtake-approach" in done.stdout and "geoms_600_vs_150" in done.stdout
    assert not any(key in done.stdout for key in KEYS if key != "geoms_600_vs_150")


def test_an_unknown_key_is_a_usage_error() -> None:
    command = [sys.executable, "tests/benchmarks/sensors.py", "--only", "no_such_key"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize(
    ("key", "module"),
    [
        ("rays_vs_mujoco_lidar", "mujoco_lidar"),
        ("rays_vs_mujoco_lidar", "warp"),
        ("rays_vs_embreex", "embreex"),
    ],
)
def test_a_rival_that_is_not_installed_is_null_with_a_note(
    monkeypatch: pytest.MonkeyPatch, key: str, module: str
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    measured = ray_rows.against(key, QUICK)
    assert measured.value is None
    assert len(measured.notes) == 1 and measured.notes[0].startswith(f"{key}: ")


# -- what is compared ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [150, 600])
def test_the_scene_has_as_many_primitives_as_asked_for_and_is_the_same_every_time(count: int) -> None:
    first, second = primitives(count, 8), primitives(count, 8)
    assert len(first.kind) == count
    assert np.sum(first.kind == rays.PLANE) == 1
    assert first.direction.shape == (8, 64, 3)
    for name in ("kind", "size_m", "rotation", "position_m", "origin_m", "direction"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


def test_more_primitives_than_the_scene_has_are_refused() -> None:
    with pytest.raises(ValueError, match="not 100000"):
        primitives(100_000, 8)


def test_mujoco_sees_the_same_scene_as_the_ray_kernel() -> None:
    scene = primitives(600, 64)
    expected_m = rivals.ours(scene).ranges_m()
    assert 0.3 < np.mean(np.isfinite(expected_m)) < 0.9
    assert rivals.check(rivals.multi_ray(scene), expected_m, np.ones_like(expected_m), 0.0) == 0.0


def caster(range_m: list[float], tolerance_m: float) -> rivals.Caster:
    """A side that gives these ranges, with -1 for a miss."""
    return rivals.Caster(
        name="some rival", cast=lambda: np.array(range_m), miss=lambda r: r < 0.0, tolerance_m=tolerance_m
    )


@pytest.mark.parametrize(
    ("what", "range_m", "share"),
    [
        ("all right", [5.0, 9.0, -1.0, 7.0], 0.0),
        ("off by less than the tolerance", [5.0009, 9.0, -1.0, 7.0], 0.0),
        ("off by more", [5.002, 9.0, -1.0, 7.0], 0.25),
        ("off along a grazing ray only", [5.0, 9.0, -1.0, 7.009], 0.0),
        ("a hit where there is none", [5.0, 9.0, 50.0, 7.0], 0.25),
        ("a hit missed", [-1.0, 9.0, -1.0, 7.0], 0.25),
        ("not a number", [5.0, float("nan"), -1.0, 7.0], 0.25),
    ],
)
def test_the_share_of_wrong_ranges_is_counted(what: str, range_m: list[float], share: float) -> None:
    expected_m, cosine = np.array([5.0, 9.0, np.inf, 7.0]), np.array([1.0, 0.5, 0.0, 0.1])
    side = caster(range_m, 1e-3)
    assert rivals.check(side, expected_m, cosine, 0.5) == share, what
    if share > 0.0:
        with pytest.raises(WrongAnswerError, match="some rival: 25"):
            rivals.check(side, expected_m, cosine, 0.2)


def test_a_rival_with_wrong_ranges_is_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(scene: Primitives) -> rivals.Caster:
        return caster([1.0] * len(scene.flat_direction), 1e-3)

    monkeypatch.setattr(ray_rows, "RIVALS", {"wrong": (wrong, 0.01)})
    monkeypatch.setattr(ray_rows, "duel", lambda *_: pytest.fail("it was timed"))
    with pytest.raises(WrongAnswerError):
        ray_rows.against("wrong", QUICK)


# -- triangles ----------------------------------------------------------------------------------------------

sizes = st.floats(0.02, 1.5)


@settings(max_examples=40)
@given(st.sampled_from((*ROUND, rays.BOX)), sizes, sizes, sizes, st.sampled_from([0.005, 0.02]))
def test_a_mesh_is_closed_turned_outward_inscribed_and_no_farther_inside_than_the_tolerance(
    kind: int, x: float, y: float, z: float, tolerance_m: float
) -> None:
    vertices, faces = tessellate(kind, np.array([x, y, z]), tolerance_m)
    corners = vertices[faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = edges @ (len(vertices), 1), edges @ (1, len(vertices))
    assert len(np.unique(there)) == len(there)
    assert np.array_equal(np.sort(there), np.sort(back)), "closed: each edge once in either direction"
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert 0.0 < volume <= exact_volume(kind, x, y, z) * (1.0 + 1e-9), "outward, inscribed"
    for points in (vertices, corners.mean(axis=1), 0.5 * (corners[:, 0] + corners[:, 1])):
        depth_m = depth_inside(kind, np.array([x, y, z]), points)
        assert depth_m.min() > -1e-9
        assert depth_m.max() <= tolerance_m * (1.0 + 1e-6)
    assert depth_inside(kind, np.array([x, y, z]), vertices[:-2]).max() < 1e-9, "corners lie on the surface"


def exact_volume(kind: int, x: float, y: float, z: float) -> float:
    """Of a MuJoCo primitive."""
    if kind == rays.BOX:
        return 8.0 * x * y * z
    if kind == rays.CYLINDER:
        return 2.0 * np.pi * x * x * y
    if kind == rays.CAPSULE:
        return 2.0 * np.pi * x * x * y + 4.0 / 3.0 * np.pi * x**3
    return 4.0 / 3.0 * np.pi * x**3 if kind == rays.SPHERE else 4.0 / 3.0 * np.pi * x * y * z


def depth_inside(kind: int, size: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How deep points lie inside a primitive; of an ellipsoid, along the line to its centre (a bound)."""
    if kind == rays.BOX:
        return np.min(size - np.abs(points), axis=1)
    if kind == rays.CYLINDER:
        return np.minimum(size[0] - np.hypot(points[:, 0], points[:, 1]), size[1] - np.abs(points[:, 2]))
    if kind in (rays.SPHERE, rays.CAPSULE):
        half = 0.0 if kind == rays.SPHERE else size[1]
        nearest = np.clip(points[:, 2], -half, half)
        return size[0] - np.linalg.norm(points - np.column_stack([0 * nearest, 0 * nearest, nearest]), axis=1)
    scale = np.linalg.norm(points / size, axis=1)
    return (1.0 - scale) * np.min(size) / np.maximum(scale, 1e-9)


@given(st.floats(0.01, 50.0), st.floats(1e-4, 0.05))
def test_chords_of_a_circle_are_as_near_as_asked(radius_m: float, tolerance_m: float) -> None:
    n = slices(radius_m, tolerance_m)
    assert radius_m * (1.0 - np.cos(np.pi / n)) <= tolerance_m * (1.0 + 1e-9)
    assert n == 12 or radius_m * (1.0 - np.cos(np.pi / (n - 1))) > tolerance_m * (1.0 - 1e-9)


def test_the_mesh_of_a_scene_stands_where_its_primitives_stand() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    vertices, faces = world_mesh(
        np.array([rays.BOX, rays.SPHERE], dtype=np.int32),
        np.array([[1.0, 2.0, 3.0], [0.5, 0.0, 0.0]]),
        np.stack([turn, np.eye(3)]),
        np.array([[10.0, 0.0, 0.0], [0.0, 20.0, 0.0]]),
    )
    box, sphere = vertices[:10], vertices[10:]
    assert np.allclose([box.min(axis=0), box.max(axis=0)], [[8, -1, -3], [12, 1, 3]])
    assert np.allclose(np.linalg.norm(sphere - (0.0, 20.0, 0.0), axis=1), 0.5)
    assert faces.max() == len(vertices) - 1


# -- the clock ----------------------------------------------------------------------------------------------


def test_the_two_sides_take_turns_and_medians_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    now, calls = [0.0], list[str]()
    cost = {"first": iter([99.0, 1.0, 2.0, 30.0]), "second": iter([99.0, 4.0, 6.0, 60.0])}

    def side(name: str) -> None:
        calls.append(name)
        now[0] += next(cost[name])

    monkeypatch.setattr(clock, "process_time", lambda: now[0])
    found = clock.duel(lambda: side("first"), lambda: side("second"), 3)
    assert calls == ["first", "second"] * 4
    assert (found.first_s, found.second_s) == (2.0, 6.0)
    assert found.ratio == 3.0, "median of 4, 3 and 2"


def test_one_core_is_one_core_and_is_given_back() -> None:
    before = os.sched_getaffinity(0)
    with clock.one_core():
        assert len(os.sched_getaffinity(0)) == 1
    assert os.sched_getaffinity(0) == before


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.00261, "2.61 ms"), (0.1432, "143 ms"), (0.0119, "11.9 ms"), (2.5, "2500 ms")]
)
def test_times_have_three_digits(seconds: float, words: str) -> None:
    assert clock.milliseconds(seconds) == words


def set_up_factor(factor: float) -> tuple[float, int]:
    """In a worker, or here: what its tasks are given."""
    return factor, os.getpid()


def cover(ready: tuple[float, int], seconds: float) -> float:
    """A task that takes a moment; it fails where its worker was not set up for it."""
    factor, owner = ready
    if owner != os.getpid():
        raise AssertionError("set up in another process")
    time.sleep(0.01)
    return factor * seconds


@pytest.mark.parametrize("spawn", [True, False])
def test_every_window_but_the_first_gives_a_rate(spawn: bool) -> None:
    found = workers.rates(set_up_factor, (2.0,), cover, [(1.0, 1.0), (0.5, 0.5), (0.0, 0.0)], spawn)
    assert len(found) == 2
    assert 0.0 < found[0] < 2.0 / 0.01, "2 s in all, in at least 10 ms"
    assert found[1] == 0.0


def test_the_peak_of_memory_counts_what_was_freed_again() -> None:
    before = peak_rss_mb()
    np.ones(int(before * 1e6 / 8) + 10_000_000).sum()
    assert peak_rss_mb() >= before + 80.0


# -- the table ----------------------------------------------------------------------------------------------


@given(st.sampled_from(ROWS), st.floats(0.01, 2000.0))
def test_a_goal_that_is_reached_keeps_the_limit(row: Row, value: float) -> None:
    assert row.holds(row.goal) is not False
    if row.must is None:
        assert row.holds(value) is None
    elif row.sign > 0:
        assert row.holds(value) == (value >= row.must)
    else:
        assert row.holds(value) == (value <= row.must)
    assert row.holds(None) is None
