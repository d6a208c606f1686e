"""Pipelines by name: ours and the user's are reached in the same ways, and a wrong name is one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusion.pipeline import Pipeline
from scenarios.errors import BadInput
from simbench.plugins import load_pipeline, pipeline_names

GOOD = """
class Mine:
    def reset(self, calibration, categories): ...
    def update(self, measurement): return None
    def trajectories(self): return ()

def make():
    return Mine()

class Half:
    def reset(self, calibration, categories): ...
    def update(self, measurement): ...

number = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "my_fusion.py").write_text(GOOD, encoding="utf-8")
    (tmp_path / "broken.py").write_text("import numpy\nraise RuntimeError('no licence')\n", encoding="utf-8")
    (tmp_path / "syntax.py").write_text("def f(:\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_ours_are_installed_by_name() -> None:
    assert {"static_projection", "static_projection_ground", "probabilistic"} <= set(pipeline_names())
    for name in pipeline_names():
        assert isinstance(load_pipeline(name)(), Pipeline)


@pytest.mark.parametrize("attribute", ["Mine", "make"])
def test_a_file_and_an_attribute_name_a_users_pipeline(folder: Path, attribute: str) -> None:
    assert isinstance(load_pipeline(f"my_fusion.py:{attribute}")(), Pipeline)
    assert isinstance(load_pipeline(f"{folder}/my_fusion.py:{attribute}")(), Pipeline)


def test_a_module_and_an_attribute_name_a_pipeline() -> None:
    assert isinstance(load_pipeline("fusion.pipelines.probabilistic:Probabilistic")(), Pipeline)


def test_two_files_of_one_name_do_not_get_mixed_up(tmp_path: Path) -> None:
    factories = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(GOOD + f"\nMine.where = {folder!r}\n", encoding="utf-8")
        factories.append(load_pipeline(f"{tmp_path}/{folder}/mine.py:Mine"))
    assert [factory.where for factory in factories] == ["one", "two"]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("probabilistc", "did you mean 'probabilistic'?"),
        ("", "unknown pipeline ''"),
        ("nowhere.py:Mine", "there is no file nowhere.py"),
        ("my_fusion.py:Mien", "did you mean 'Mine'?"),
        ("my_fusion.py:", "has no ''"),
        ("my_fusion.py:Half", "has no method trajectories"),
        ("my_fusion.py:number", "is not callable"),
        ("broken.py:Mine", "cannot be imported: RuntimeError: no licence"),
        ("syntax.py:Mine", "cannot be imported: SyntaxError"),
        ("no_such_module:Mine", "cannot be imported: ModuleNotFoundError"),
        (":Mine", "pipeline ':Mine'"),
    ],
)
def test_a_wrong_name_is_one_sentence(folder: Path, name: str, problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_pipeline(name)
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)
