"""Who may know whom. The contracts stand in pyproject.toml; here they are run, and proved to bite."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
CONFIG = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = ("fusion", "scenarios", "simbench")
DISTRIBUTION = {"cv2": "opencv-python-headless", "yaml": "pyyaml", "pydantic_core": "pydantic"}


def modules(package: str) -> list[str]:
    paths = sorted((ROOT / package).rglob("*.py"))
    return [".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for p in paths]


def loaded_after_importing(package: str, forbidden: tuple[str, ...]) -> list[str]:
    """Imports every module of the package in a fresh process; which forbidden packages got loaded."""
    code = (
        "import importlib, sys\n"
        f"for name in {modules(package)!r}: importlib.import_module(name)\n"
        f"print(*[name for name in {forbidden!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.split()


def lint(folder: Path) -> tuple[set[str], str]:
    """First words of the broken contracts, and all that was printed."""
    program = "import sys, importlinter.cli as cli; sys.exit(cli.lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True)
    assert "Contracts:" in done.stdout, done
    contracts = {c["name"] for c in CONFIG["tool"]["importlinter"]["contracts"]}
    lines = " ".join(done.stdout.split())
    broken = {name.split(" ")[0] for name in contracts if f"{name} BROKEN" in lines}
    assert bool(broken) == (done.returncode != 0), done
    return broken, done.stdout


def test_the_import_contracts_hold() -> None:
    broken, printed = lint(ROOT)
    assert not broken, printed


def test_each_contract_bites(tmp_path: Path) -> None:
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    for contract in CONFIG["tool"]["importlinter"]["contracts"]:
        names = [name for key in contract if key.endswith(("modules", "importers")) for name in contract[key]]
        for name in names:
            if name.split(".")[0] in PACKAGES and "." in name:
                folder = tmp_path / Path(*name.split("."))
                folder.mkdir(parents=True, exist_ok=True)
                (folder / "__init__.py").touch()
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    assert lint(tmp_path)[0] == set()
    for path, line, broken in (
        ("fusion/spy.py", "import simbench.truth", {"fusion", "the"}),
        ("fusion/spy.py", "import numba", {"fusion"}),
        ("scenarios/spy.py", "import mujoco", {"scenarios"}),
        ("simbench/spy.py", "import fusion.pipelines", {"pipelines"}),
        ("simbench/spy.py", "from simbench.truth import Truth", {"the"}),
        ("simbench/score/fine.py", "import simbench.truth", set[str]()),
    ):
        (tmp_path / path).write_text(line + "\n")
        assert lint(tmp_path)[0] == broken, line
        (tmp_path / path).unlink()


def test_what_drives_pipelines_may_not_import_the_truth() -> None:
    contracts = CONFIG["tool"]["importlinter"]["contracts"]
    (truth,) = (c for c in contracts if c.get("protected_modules") == ["simbench.truth"])
    assert not {"simbench", "simbench.drive", "simbench.plugins"} & set(truth["allowed_importers"])


def test_fusion_runs_without_mujoco_bench_or_scenarios() -> None:
    assert loaded_after_importing("fusion", ("mujoco", "simbench", "scenarios", "numba", "pydantic")) == []


def test_scenarios_are_read_without_mujoco_or_the_bench() -> None:
    assert loaded_after_importing("scenarios", ("mujoco", "simbench", "fusion")) == []


def test_every_imported_package_is_a_declared_dependency() -> None:
    declared = {re.split(r"[^A-Za-z0-9._-]", text)[0].lower() for text in CONFIG["project"]["dependencies"]}
    optional = {"glfw"}  # only where the user sets MUJOCO_GL=glfw
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom):
                    assert node.level == 0, f"{path}: relative import"
                    names = [node.module or ""]
                else:
                    continue
                for name in (full.split(".")[0] for full in names):
                    if (path.name, name) == ("pytest_plugin.py", "pytest"):
                        continue  # only pytest loads it
                    known = name in sys.stdlib_module_names or name in PACKAGES or name in optional
                    assert known or DISTRIBUTION.get(name, name).lower() in declared, f"{path}: {name}"


def test_global_randomness_is_refused_in_tests() -> None:
    for draw in (np.random.rand, np.random.normal, np.random.shuffle, np.random.default_rng):
        with pytest.raises(AssertionError):
            draw()
    assert np.random.default_rng(3).integers(1000) == np.random.default_rng(3).integers(1000)


def test_a_wrong_shape_is_refused_in_tests() -> None:
    from fusion.geometry import Transform

    with pytest.raises(TypeError):
        Transform(rotation=np.eye(3), translation_m=np.zeros(4))
