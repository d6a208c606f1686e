"""`simbench init`: a folder to start from: a pipeline with a few lines to change, a suite, a CI file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from scenarios.errors import BadInput
from simbench.files import prepare_folder, write_bytes

STARTER = {
    "my_fusion.py.txt": "my_fusion.py",
    "suite.yaml": "suite.yaml",
    "simbench.yml": ".github/workflows/simbench.yml",
}
"""File of the package to its place in the folder."""


def init(folder: Path) -> tuple[Path, ...]:
    """Write the files; their paths. BadInput: one of them is there already; then none is written."""
    targets = {source: folder / place for source, place in STARTER.items()}
    for path in targets.values():
        if path.exists():
            raise BadInput(f"{path} is there already; give another folder, or move it away")
    for source, path in targets.items():
        prepare_folder(path.parent)
        write_bytes(path, files("simbench").joinpath("starter", source).read_bytes())
    return tuple(targets.values())
