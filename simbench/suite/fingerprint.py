"""What numbers depend on besides scenario and pipeline: the bench's own code, its packages, its metrics.

A baseline keeps these; a changed one is told by name. The code of pipelines is under test and not part of it.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path

import scenarios
import simbench
from simbench.score.metrics import METRICS

PACKAGES = ("mujoco", "numpy", "scipy", "numba", "opencv-python-headless")
ROOMS = ("calibration", "dynamics", "faults", "formats", "score", "sensors")
"""Folders of simbench that decide numbers; its files at the top do too, but for those that only show."""
ONLY_SHOW = (
    "cli.py", "doctor.py", "environment.py", "exhibit.py", "init.py", "limits.py", "outcome.py",
    "pytest_plugin.py", "timeline.py",
)  # fmt: skip
SUFFIXES = (".py", ".yaml", ".xml", ".json")
SHORT = 12


@lru_cache(maxsize=1)
def fingerprints() -> Mapping[str, str]:
    """Part of the bench to a short hash of its files, or to its version."""
    bench, declared = Path(simbench.__file__).parent, Path(scenarios.__file__).parent
    top = [path for path in bench.glob("*.py") if path.name not in ONLY_SHOW]
    parts = {"simbench": _hash(top, bench)}
    parts |= {f"simbench/{room}": _hash((bench / room).rglob("*"), bench) for room in ROOMS}
    parts |= {"scenarios": _hash((p for p in declared.rglob("*") if "suites" not in p.parts), declared)}
    return parts | {name: importlib.metadata.version(name) for name in PACKAGES}


@lru_cache(maxsize=1)
def metric_hashes() -> Mapping[str, str]:
    """Metric to a short hash of its definition."""
    return {
        m.name: short("\n".join((m.name, m.unit, m.better, m.per, m.definition)).encode()) for m in METRICS
    }


def short(data: bytes) -> str:
    """The first digits of a SHA-256: enough to tell versions apart, few enough to read."""
    return hashlib.sha256(data).hexdigest()[:SHORT]


def _hash(files: Iterable[Path], root: Path) -> str:
    state = hashlib.sha256()
    for path in sorted(p for p in files if p.suffix in SUFFIXES and p.is_file()):
        data = path.read_bytes()
        state.update(f"{path.relative_to(root).as_posix()}\0{len(data)}\0".encode() + data)
    return state.hexdigest()[:SHORT]
