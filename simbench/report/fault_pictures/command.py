"""`simbench describe fault NAME --picture FILE` and `simbench describe faults --pictures FOLDER`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from scenarios.errors import BadInput, Where
from scenarios.faults import FAULTS
from simbench.files import prepare_folder, write_bytes
from simbench.proving.prove import levels_of
from simbench.report.fault_pictures.picture import drawn, rendered
from simbench.report.fault_pictures.sketch import ENDINGS


def write_picture(fault: str, level: int, path: Path) -> None:
    """BadInput: no such fault or severity, a file of another kind, or a picture that would show nothing."""
    if fault not in FAULTS:
        raise Where(file=None).unknown("fault", fault, FAULTS)
    for ending in ENDINGS:
        if path.suffix == f".{ending}":
            prepare_folder(path.parent)
            write_bytes(path, rendered(drawn(fault, level), ending))
            return
    raise BadInput(
        f"{path.name} is no picture", field="--picture", allowed=", ".join(f".{e}" for e in ENDINGS)
    )


def write_pictures(folder: Path, level: int) -> Iterator[Path]:
    """Of every fault, in the kind of file that is smallest; one by one, as they are written. A fault with
    fewer severities is drawn at its last one."""
    prepare_folder(folder)
    for fault in FAULTS:
        picture = drawn(fault, min(level, len(levels_of(fault))))
        path = folder / f"{fault}.{picture.sketch.ending}"
        write_bytes(path, rendered(picture, picture.sketch.ending))
        yield path
