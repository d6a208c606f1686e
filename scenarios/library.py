"""The files behind the names: what the package ships, and what a user keeps beside a scenario file.

Scenarios, fault sets and parts are files of this package. Rigs and sensors are too, or files of the folders
`rigs` and `sensors` beside the user's scenario file (`beside`), never outside that file's folder.
"""

from __future__ import annotations

from pathlib import Path

from scenarios.errors import BadInput, Where

PACKAGE = Path(__file__).resolve().parent

FOLDERS = {
    "scenario": "catalogue",
    "fault set": "faultsets",
    "rig": "rigs",
    "sensor": "sensors",
    "part": "parts",
    "suite": "suites",
}
NOWHERE = Where(file=None)


def names(kind: str, beside: Path | None = None) -> tuple[str, ...]:
    """The known names of a kind ("scenario", "rig", ...), sorted."""
    return tuple(sorted(_files(kind, PACKAGE).keys() | (_files(kind, beside).keys() if beside else set())))


def find(kind: str, name: str, where: Where = NOWHERE, beside: Path | None = None) -> Path:
    """The file of a name. `where`: the place that mentions it.

    BadInput: unknown; known both here and beside the scenario file; or a link that leaves the file's folder.
    """
    ours = _files(kind, PACKAGE).get(name)
    theirs = _files(kind, beside).get(name) if beside else None
    if ours and theirs:
        raise where.error(f"the {kind} '{name}' is known twice, here and beside this file; rename yours")
    if theirs and beside and not theirs.resolve().is_relative_to(beside.resolve()):
        raise where.error(f"the {kind} '{name}' is a link that leaves the folder of this file")
    found = ours or theirs
    if found is None:
        raise where.unknown(kind, name, names(kind, beside))
    return found


def shown(path: Path) -> str:
    """How messages name a file: those of the package without the place where it is installed."""
    if path.is_relative_to(PACKAGE):
        return str(Path("scenarios") / path.relative_to(PACKAGE))
    return str(path)


def user_file(text: str, what: str) -> Path | None:
    """The path when `text` is one rather than a name: it has a slash or ends in .yaml or .yml.

    BadInput: `text` is empty.
    """
    if not text:
        raise BadInput(f"the name of a {what} is empty")
    return Path(text) if "/" in text or text.endswith((".yaml", ".yml")) else None


def _files(kind: str, folder: Path) -> dict[str, Path]:
    suffix = ".xml" if kind == "part" else ".yaml"
    return {path.stem: path for path in (folder / FOLDERS[kind]).glob(f"*{suffix}")}
