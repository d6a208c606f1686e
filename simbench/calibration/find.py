"""`--calibration`: which file holds the found calibration of a run, made there and then if need be."""

from __future__ import annotations

from pathlib import Path

from scenarios.equipment import rig_sensors
from scenarios.errors import BadInput
from scenarios.load import Family
from simbench.calibration.file import read_calibration, write_calibration
from simbench.calibration.study import Settings, calibrate_rig
from simbench.files import prepare_folder
from simbench.sensors.rig import assemble, resized


def found_for(
    text: str, folder: Path, family: Family, system: str, size_px: tuple[int, int] | None
) -> str | None:
    """The file for a system of a scenario: None for `true`. For `found` its rig is calibrated with the
    defaults of `Settings` (seed 0 whatever the run's), into `folder`; `found:FILE` is read, of a folder
    RIG.yaml.

    BadInput: another word, or a file that is not one of this rig and image size.
    """
    if text == "true":
        return None
    word, colon, place = text.partition(":")
    if word != "found" or (colon and not place):
        raise BadInput(f"'{text[:60]}' is unknown", field="--calibration", allowed="true, found, found:FILE")
    if system not in family.system_names:
        raise family.where.unknown("system", system, family.system_names, ("systems",))
    rig = family.system(system, seed=0).rig
    if not colon:
        path = folder / f"calibration-{rig}.yaml"
        prepare_folder(folder)
        settings = Settings(rig=rig, size_px=size_px, beside=family.beside)
        write_calibration(calibrate_rig(settings), path)
        return str(path)
    path = Path(place) / f"{rig}.yaml" if Path(place).is_dir() else Path(place)
    declared = family.rig(rig)
    assembled = assemble(declared, rig_sensors(declared, family.beside))
    read_calibration(path, assembled if size_px is None else resized(assembled, *size_px))
    return str(path)
