"""What numbers depend on besides scenario and pipeline: the bench's own code, its packages, its metrics.

A baseline keeps these; a changed one is told by name. The code of pipelines is under test and not part of it.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import scenarios
import simbench
from simbench.campaign.key import LIBRARIES, SOURCE, files_of, sha256_of
from simbench.score.metrics import METRICS

ROOMS = ("calibration", "dynamics", "faults", "formats", "score", "sensors")
"""Folders of simbench that decide numbers; its files at the top do too, but for those that only show."""
ONLY_SHOW = (
    "__main__.py", "cli.py", "doctor.py", "environment.py", "exhibit.py", "init.py", "limits.py",
    "outcome.py", "pytest_plugin.py", "result_file.py", "timeline.py",
)  # fmt: skip
SHORT = 12


@lru_cache(maxsize=1)
def fingerprints() -> Mapping[str, str]:
    """Part of the bench to a short hash of its files, or to its version."""
    bench, declared = Path(simbench.__file__).parent, Path(scenarios.__file__).parent
    top = [path for path in sorted(bench.glob("*.py")) if path.name not in ONLY_SHOW]
    parts = {"simbench": [part for path in top for part in (path.name.encode(), path.read_bytes())]}
    parts |= {f"simbench/{room}": list(files_of(bench / room, SOURCE)) for room in ROOMS}
    parts |= {"scenarios": list(files_of(declared, SOURCE, besides="suites"))}
    hashes = {name: sha256_of(content)[:SHORT] for name, content in parts.items()}
    return hashes | {name: importlib.metadata.version(name) for name in LIBRARIES}


@lru_cache(maxsize=1)
def metric_hashes() -> Mapping[str, str]:
    """Metric to a short hash of its definition."""
    return {
        m.name: short("\n".join((m.name, m.unit, m.better, m.per, m.definition)).encode()) for m in METRICS
    }


def short(data: bytes) -> str:
    """The first digits of a SHA-256: enough to tell versions apart, few enough to read."""
    return sha256_of([data])[:SHORT]
