"""Keys: equal for what is equal, other for whatever could change a row."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from simbench.campaign import job_key as job_keys
from simbench.campaign.job_key import job_key, pipeline_digest
from simbench.campaign.key import code_digest, files_of, sha256_of, task_key
from simbench.case import Job
from simbench.isolate.limits import Limits

JOB = Job(scenario="overtake-approach", system="car", seed=0, pipelines=("robust",))
OTHER: dict[str, Any] = {
    "scenario": "overtake-recede", "system": "wearable", "seed": 1, "pipelines": ("probabilistic",),
    "faults": ("none",), "images": "raycast", "size_px": (96, 64), "boxes": "labels", "frames": (0, 3),
    "changes": ("systems.car.duration_s=3",), "calibration": "found", "off": ("bench.spin_phase",),
    "found_in": "nowhere.yaml", "isolate": "all", "limits": Limits(message_s=1.0),
}  # fmt: skip


def fresh(job: Job) -> str:
    """The key as a new process would make it."""
    pipeline_digest.cache_clear()
    job_keys._recorded.cache_clear()
    return job_key(job)


def test_every_word_of_a_job_is_in_its_key() -> None:
    assert OTHER.keys() == {field.name for field in fields(Job)}
    keys = {job_key(replace(JOB, **{name: value})) for name, value in OTHER.items()}
    keys |= {job_key(JOB), job_key(JOB, point=(1.0,)), job_key(JOB, point=(2.0,))}
    assert len(keys) == len(OTHER) + 3


def test_a_key_is_the_same_whenever_and_however_it_is_made() -> None:
    first = fresh(JOB)
    with mock.patch("time.time", lambda: 0.0), mock.patch.object(time, "monotonic", lambda: 0.0):
        assert fresh(replace(JOB)) == first
    assert len(first) == 64
    assert task_key(case={"a": 1, "b": 2}, config={}) == task_key(case={"b": 2, "a": 1}, config={})
    assert task_key(case={"a": 1}, config={"b": 2}) != task_key(case={"a": 1, "b": 2}, config={})


def test_other_code_gives_other_keys() -> None:
    assert task_key(case={}, config={}) == task_key(case={}, config={}, code=code_digest())
    assert task_key(case={}, config={}, code="x") != task_key(case={}, config={})


@pytest.mark.parametrize("name", ["a.py", "b/c.yaml", "b/d.xml"])
def test_the_digest_of_code_is_of_every_source_file_by_name_and_content(name: str, tmp_path: Path) -> None:
    def digest() -> str:
        return sha256_of(files_of(tmp_path, (".py", ".yaml", ".xml")))

    for path in ("a.py", "b/c.yaml", "b/d.xml"):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(path)
    before = digest()
    (tmp_path / "notes.txt").write_text("not code")
    assert digest() == before
    (tmp_path / name).write_text("other")
    changed = digest()
    (tmp_path / name).rename((tmp_path / name).with_stem("moved"))
    assert len({before, changed, digest()}) == 3


def test_parts_are_told_apart_by_their_lengths() -> None:
    assert sha256_of([b"ab", b"c"]) != sha256_of([b"a", b"bc"]) != sha256_of([b"abc"])


def _fusion(folder: Path) -> tuple[Job, Path]:
    path = folder / "mine.py"
    path.write_text("class Mine: ...\n", encoding="utf-8")
    return replace(JOB, pipelines=(f"{path}:Mine",)), path


def _scenario(folder: Path) -> tuple[Job, Path]:
    path = folder / "mine.yaml"
    path.write_text("name: mine\n", encoding="utf-8")
    return replace(JOB, scenario=str(path)), path


def _rig(folder: Path) -> tuple[Job, Path]:
    job, _ = _scenario(folder)
    (folder / "rigs").mkdir()
    path = folder / "rigs" / "mine.yaml"
    path.write_text("name: mine\n", encoding="utf-8")
    return job, path


def _trace(folder: Path) -> tuple[Job, Path]:
    path = folder / "gyro.csv"
    path.write_text("0,0,0,0\n", encoding="utf-8")
    return replace(JOB, faults=(f"motion.trace={path}",)), path


def _trace_in_a_set(folder: Path) -> tuple[Job, Path]:
    job, path = _trace(folder)
    faults = folder / "faults.yaml"
    faults.write_text(f"motion.trace: {{file: {path}}}\n", encoding="utf-8")
    return replace(job, faults=(str(faults),)), path


def _calibration(folder: Path) -> tuple[Job, Path]:
    path = folder / "found.yaml"
    path.write_text("cameras: {}\n", encoding="utf-8")
    return replace(JOB, found_in=str(path)), path


def _recorded(folder: Path) -> tuple[Job, Path]:
    path = folder / "calib" / "000000.txt"
    path.parent.mkdir()
    path.write_text("P0: 1\n", encoding="utf-8")
    return replace(JOB, scenario=f"kitti:{folder}"), path


@pytest.mark.parametrize(
    "made",
    [_fusion, _scenario, _rig, _trace, _trace_in_a_set, _calibration, _recorded],
    ids=lambda f: f.__name__,
)
def test_the_content_of_a_users_file_is_in_the_key(
    made: Callable[[Path], tuple[Job, Path]], tmp_path: Path
) -> None:
    job, path = made(tmp_path)
    before = fresh(job)
    assert fresh(job) == before
    path.write_text(path.read_text(encoding="utf-8") + "# other\n", encoding="utf-8")
    assert fresh(job) != before


def test_the_files_of_a_users_package_are_in_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "my_fusion_package"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "helper.py").write_text("A = 1\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    job = replace(JOB, pipelines=("my_fusion_package.main:Mine",))
    before = fresh(job)
    (package / "helper.py").write_text("A = 2\n", encoding="utf-8")
    assert fresh(job) != before
