"""A found calibration as a file: YAML, what a fusion is told of each camera, and how it was found.

`T_ego_camera` is R (row by row) and t of x_ego = R x_camera + t, metres; `intrinsics` in pixels. Under
`study` stand the settings and the errors against the truth, for the reader; nothing of it is read back.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.scenario import Finite, Name, Positive, Spec
from scenarios.validate import validate
from scenarios.yaml_source import read_yaml
from simbench.calibration.study import Study
from simbench.calibration.text import errors
from simbench.files import write_text
from simbench.sensors.rig import SensorRig

Row = tuple[Finite, Finite, Finite]


class Lens(Spec):
    """As `fusion.camera.PinholeCamera`."""

    fx_px: Positive
    fy_px: Positive
    cx_px: Finite
    cy_px: Finite
    width_px: Annotated[int, Field(ge=16, le=8192)]
    height_px: Annotated[int, Field(ge=16, le=8192)]
    distortion: tuple[Finite, Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 0.0, 0.0)


class FoundPose(Spec):
    """T_ego_camera."""

    rotation: tuple[Row, Row, Row]
    translation_m: Row


class FoundCamera(Spec):
    """One camera."""

    intrinsics: Lens
    T_ego_camera: FoundPose


class FoundFile(Spec):
    """The file."""

    format: Literal["simbench-calibration/1"]
    rig: Name
    cameras: dict[Name, FoundCamera] = Field(min_length=1)
    study: dict[str, object] = Field(default_factory=dict)


def write_calibration(study: Study, path: Path) -> None:
    """Write what was found. BadInput: the place cannot be written."""
    import yaml

    found = study.calibration
    cameras = {}
    for pair in study.pairs:
        lens, pose = found.cameras[pair.camera], found.T_ego_sensor[pair.camera]
        cameras[pair.camera] = {
            "intrinsics": {
                **{key: getattr(lens, key) for key in ("fx_px", "fy_px", "cx_px", "cy_px")},
                **{key: getattr(lens, key) for key in ("width_px", "height_px")},
                "distortion": list(lens.distortion),
            },
            "T_ego_camera": {
                "rotation": pose.rotation.tolist(), "translation_m": pose.translation_m.tolist()
            },
        }  # fmt: skip
    data = {
        "format": "simbench-calibration/1", "rig": study.settings.rig, "cameras": cameras,
        "study": errors(study),
    }  # fmt: skip
    write_text(path, yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110))


def read_calibration(path: Path, rig: SensorRig) -> Calibration:
    """The calibration of a rig with the cameras of a file as they were found; others as they are.

    BadInput: the file is missing or malformed, is of another rig, names a camera that the rig has not, or was
    found for pictures of another size.
    """
    document = read_yaml(path, str(path))
    where = document.where
    found = validate(FoundFile, document.data, where)
    if found.rig != rig.rig.name:
        raise where.error(f"was found for rig '{found.rig}', this run's is '{rig.rig.name}'", ("rig",))
    true = rig.calibration
    poses, cameras = dict(true.T_ego_sensor), dict(true.cameras)
    for name, camera in found.cameras.items():
        if name not in rig.cameras:
            raise where.unknown("camera", name, rig.cameras, ("cameras", name))
        lens = camera.intrinsics
        if (lens.width_px, lens.height_px) != (cameras[name].width_px, cameras[name].height_px):
            raise where.error(
                f"was found for pictures of {lens.width_px}x{lens.height_px}, this run's are "
                f"{cameras[name].width_px}x{cameras[name].height_px}",
                ("cameras", name, "intrinsics"),
            )
        cameras[name] = PinholeCamera(**lens.model_dump())
        try:
            poses[name] = Transform(
                rotation=np.array(camera.T_ego_camera.rotation),
                translation_m=np.array(camera.T_ego_camera.translation_m),
            )
        except ValueError as error:
            raise where.error(str(error), ("cameras", name, "T_ego_camera", "rotation")) from error
    return Calibration(T_ego_sensor=poses, cameras=cameras)


def told(given: Calibration, true: Calibration, found: Calibration) -> Calibration:
    """What a fusion is told that goes by the found calibration: on it, whatever a fault did to the true one
    (`given`)."""
    poses = {
        name: found.T_ego_sensor[name] @ (true.T_ego_sensor[name].inverse() @ pose)
        for name, pose in given.T_ego_sensor.items()
    }
    cameras = {
        name: _retold(lens, true.cameras[name], given.cameras[name]) for name, lens in found.cameras.items()
    }
    return Calibration(T_ego_sensor=poses, cameras=cameras)


def _retold(found: PinholeCamera, true: PinholeCamera, given: PinholeCamera) -> PinholeCamera:
    """The found intrinsics with what a fault did to the true ones; as they are where it did nothing."""
    if given == true:
        return found
    return replace(
        found,
        fx_px=found.fx_px * given.fx_px / true.fx_px,
        fy_px=found.fy_px * given.fy_px / true.fy_px,
        cx_px=found.cx_px + given.cx_px - true.cx_px,
        cy_px=found.cy_px + given.cy_px - true.cy_px,
        distortion=found.distortion if given.distortion == true.distortion else given.distortion,
    )
