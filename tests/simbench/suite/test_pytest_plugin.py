"""`pytest --simbench-suite`: a suite's groups are tests of the user's repo."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SUITE = """\
name: gate
description: A short drive.
seeds: 0
pipelines: [static_projection]
blocks:
  good:
    scenarios: [overtake-approach]
    change: [systems.car.duration_s=0.6]
    limits: {recall: ">= 0.1"}
  bad:
    scenarios: [overtake-approach]
    change: [systems.car.duration_s=0.6]
    limits: {recall: ">= 1.0", precision: ">= 1.0"}
    tags: [hard]
"""
OWN = "def test_mine() -> None:\n    assert True\n"


@pytest.fixture(scope="module")
def repo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("repo")
    (folder / "suite.yaml").write_text(SUITE, encoding="utf-8")
    (folder / "test_mine.py").write_text(OWN, encoding="utf-8")
    return folder


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-rA", *words]
    alone = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=alone, timeout=250)


def test_groups_and_canary_are_tests_beside_the_repos_own(repo: Path) -> None:
    done = run(repo, "--simbench-suite", "suite.yaml")
    assert "3 passed, 1 failed" in done.stdout or "1 failed, 3 passed" in done.stdout, done.stdout
    assert "PASSED suite.yaml::canary" in done.stdout
    assert "FAILED suite.yaml::bad/overtake-approach/car/none/static_projection" in done.stdout
    assert "FAIL     limit precision" in done.stdout
    assert "Traceback" not in done.stdout
    assert done.returncode == 1


def test_words_choose_among_them_and_bad_input_is_one_sentence(repo: Path) -> None:
    done = run(repo, "--simbench-suite", "suite.yaml", "-k", "good and not canary")
    assert "1 passed, 3 deselected" in done.stdout
    wrong = run(repo, "--simbench-suite", "suit.yaml")
    assert wrong.returncode == 4
    assert "ERROR: simbench: suit.yaml: no such file." in wrong.stderr


def test_the_plugin_loads_nothing_until_it_is_asked(repo: Path) -> None:
    heavy = "('numpy', 'mujoco', 'pydantic')"
    code = f"import simbench.pytest_plugin, sys; print(*[m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
