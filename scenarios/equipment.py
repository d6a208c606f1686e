"""Rigs and sensors: reading their files and checking that they fit together."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from scenarios.errors import Where
from scenarios.library import NOWHERE, find, names, shown
from scenarios.validate import validate
from scenarios.yaml_source import read_yaml

if TYPE_CHECKING:
    from scenarios.scenario import Rig, Sensor

ALL_CAMERAS = "cameras"
"""The word that stands for every camera of a rig in a fault; no sensor may be called so."""


def list_rigs() -> tuple[str, ...]:
    """Names of the package's rigs."""
    return names("rig")


def list_sensors() -> tuple[str, ...]:
    """Names of the package's sensors."""
    return names("sensor")


def load_rig(name: str, beside: Path | None = None, where: Where = NOWHERE) -> Rig:
    """The checked rig of a name. `beside`: folder of the scenario file; `where`: what mentions the rig.

    BadInput: unknown, malformed, or its sensors do not fit together.
    """
    return _read_rig(find("rig", name, where, beside), beside)


def load_sensor(name: str, beside: Path | None = None, where: Where = NOWHERE) -> Sensor:
    """The sensor of a name; arguments and errors as for `load_rig`."""
    return _read_sensor(find("sensor", name, where, beside))


def rig_sensors(rig: Rig, beside: Path | None = None) -> dict[str, Sensor]:
    """The sensors of a rig by their name on it."""
    return {name: load_sensor(mount.sensor, beside) for name, mount in rig.sensors.items()}


def cameras_of(rig: Rig, beside: Path | None = None) -> tuple[str, ...]:
    """Names of the rig's cameras, in the file's order."""
    return tuple(name for name, sensor in rig_sensors(rig, beside).items() if sensor.kind == "camera")


@lru_cache(maxsize=64)
def _read_sensor(path: Path) -> Sensor:
    from scenarios.scenario import SENSOR_KINDS

    document = read_yaml(path, shown(path))
    data, where = document.data, document.where
    if not isinstance(data, dict) or "kind" not in data:
        raise where.error("a sensor file is a mapping with a 'kind'", allowed=", ".join(SENSOR_KINDS))
    if data["kind"] not in SENSOR_KINDS:
        raise where.unknown("kind of sensor", str(data["kind"]), SENSOR_KINDS, ("kind",))
    return validate(SENSOR_KINDS[data["kind"]], data, where)


@lru_cache(maxsize=64)
def _read_rig(path: Path, beside: Path | None) -> Rig:
    from scenarios.scenario import Rig

    document = read_yaml(path, shown(path))
    where = document.where
    rig = validate(Rig, document.data, where)
    if rig.name != path.stem:
        raise where.error(f"the rig's name is '{rig.name}', the file's is '{path.stem}'", ("name",))
    sensors = {
        name: load_sensor(mount.sensor, beside, where.at("sensors", name, "sensor"))
        for name, mount in rig.sensors.items()
    }
    _check_kinds(rig, sensors, where)
    _check_triggers(rig, sensors, where)
    return rig


def _check_kinds(rig: Rig, sensors: dict[str, Sensor], where: Where) -> None:
    if ALL_CAMERAS in sensors:
        raise where.error(f"no sensor may be called '{ALL_CAMERAS}'", ("sensors", ALL_CAMERAS))
    of_kind: dict[str, list[str]] = {kind: [] for kind in ("lidar", "camera", "gnss", "imu")}
    for name, sensor in sensors.items():
        of_kind[sensor.kind].append(name)
    for kind, found in of_kind.items():
        if kind != "camera" and len(found) > 1:
            raise where.error(f"a second {kind}; a rig has one", ("sensors", found[1]))
    if not of_kind["lidar"]:
        raise where.error("has no lidar; a rig has exactly one", ("sensors",))
    if not of_kind["camera"]:
        raise where.error("has no camera; a rig has at least one", ("sensors",))
    lidar = of_kind["lidar"][0]
    if rig.sensors[lidar].pose.xyz_m[:2] != (0.0, 0.0):
        raise where.error(
            "the lidar must stand at x 0, y 0: the ego frame's origin lies below it",
            ("sensors", lidar, "pose", "xyz_m"),
        )


def _check_triggers(rig: Rig, sensors: dict[str, Sensor], where: Where) -> None:
    lidar_rate_hz = next(sensor.rate_hz for sensor in sensors.values() if sensor.kind == "lidar")
    waiting = [name for name, s in sensors.items() if s.kind == "camera" and s.trigger == "lidar_angle"]
    if rig.pulse_deg is not None and all(rig.sensors[name].trigger_deg is not None for name in waiting):
        raise where.error("no camera of this rig waits for a pulse", ("pulse_deg",))
    for name, sensor in sensors.items():
        own_deg = rig.sensors[name].trigger_deg
        if sensor.kind != "camera" or sensor.trigger != "lidar_angle":
            if own_deg is not None:
                raise where.error("counts for triggered cameras only", ("sensors", name, "trigger_deg"))
            continue
        if sensor.rate_hz != lidar_rate_hz:
            raise where.error(
                f"runs at {sensor.rate_hz:g} Hz, the lidar that triggers it at {lidar_rate_hz:g} Hz",
                ("sensors", name, "sensor"),
            )
        if own_deg is None and rig.pulse_deg is None:
            raise where.error(
                "waits for a pulse that the rig never sends: give the rig a pulse_deg or it a trigger_deg",
                ("sensors", name),
            )
