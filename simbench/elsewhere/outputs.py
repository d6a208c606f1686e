"""Results that were computed elsewhere: a file of JSON lines, `simbench-outputs/1`.

    {"schema": "simbench-outputs/1"}
    {"output": {"scan_sensor", "scan_seq", "scan_stamp_ns", "objects": [{"track_id", "category", "sensor",
                "stamp_ns", "points", "position_ego_m", "distance_m", "azimuth_rad", "confidence"}, ...]}}
    {"trajectory": {"track_id", "stamp_ns": [...], "position_ego_m": [[x, y, z], ...], "inlier": [...]}}

One output at most for each scan; lines may come in any order after the first. Whatever is not that, or is not
about this recording, is BadInput with file and line.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fusion.messages import FusionOutput, LidarScan, LocalizedObject, Trajectory
from scenarios.errors import BadInput, printable
from simbench.recording import Recording
from simbench.score.contract import ContractError, ScanKey, check_output, check_trajectories

SCHEMA = "simbench-outputs/1"
LARGEST_FILE = 2**30

Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Name = Annotated[str, Field(max_length=200)]
Point = tuple[float, float, float]
Told = TypeVar("Told", bound="_Line")


class _Line(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class _Object(_Line):
    track_id: Int64
    category: Name
    sensor: Name
    stamp_ns: Int64
    points: list[Int64]
    position_ego_m: Point
    distance_m: float
    azimuth_rad: float
    confidence: float


class _Output(_Line):
    scan_sensor: Name
    scan_seq: Int64
    scan_stamp_ns: Int64
    objects: list[_Object]


class _Trajectory(_Line):
    track_id: Int64
    stamp_ns: list[Int64]
    position_ego_m: list[Point]
    inlier: list[bool]


def read_outputs(path: Path, recording: Recording) -> tuple[tuple[FusionOutput, ...], tuple[Trajectory, ...]]:
    """Outputs and trajectories of a file. BadInput as above."""
    scans = {(m.sensor, m.seq): m for m in recording.messages if isinstance(m, LidarScan)}
    outputs: dict[ScanKey, FusionOutput] = {}
    tracks: list[Trajectory] = []
    for number, text in _lines(path):
        line = _object(path, number, text)
        kind = next(iter(line)) if len(line) == 1 else None
        try:
            if kind == "output":
                output = _output(_told(_Output, line["output"]), scans, recording.truth.period_ns, outputs)
                outputs[output.scan_sensor, output.scan_seq] = output
            elif kind == "trajectory":
                tracks.append(_trajectory(_told(_Trajectory, line["trajectory"]), scans, recording))
                check_trajectories(tracks)
            else:
                raise ContractError(f"a line must be one 'output' or one 'trajectory', not {text[:40]!r}.")
        except ContractError as error:
            raise BadInput(str(error).rstrip("."), file=str(path), line=number) from error
    return tuple(outputs.values()), tuple(tracks)


def _lines(path: Path) -> list[tuple[int, str]]:
    """The lines after the first, with their numbers."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise BadInput(f"it is larger than {LARGEST_FILE >> 20} MB", file=str(path))
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise BadInput("it is no UTF-8 text", file=str(path)) from error
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror or error}", file=str(path)) from error
    lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip()]
    if not lines or _object(path, *lines[0]) != {"schema": SCHEMA}:
        raise BadInput(
            "the first line is no schema", file=str(path), line=1, allowed=f'{{"schema": "{SCHEMA}"}}'
        )
    return lines[1:]


def _object(path: Path, number: int, text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        why = printable(" ".join(str(error).split())[:100])
        raise BadInput(f"it is no JSON: {why}", file=str(path), line=number) from error
    if not isinstance(found, dict):
        raise BadInput("it is no JSON object", file=str(path), line=number)
    return found


def _told(model: type[Told], content: object) -> Told:
    try:
        return model.model_validate_json(json.dumps(content))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        message = first["msg"][:1].lower() + first["msg"][1:]
        raise ContractError(f"{where}: {message}." if where else f"{message}.") from error


def _output(
    told: _Output,
    scans: Mapping[ScanKey, LidarScan],
    period_ns: int,
    answered: Mapping[ScanKey, FusionOutput],
) -> FusionOutput:
    key = (told.scan_sensor, told.scan_seq)
    if key not in scans:
        raise ContractError(
            f"there is no scan {told.scan_seq} of '{printable(told.scan_sensor)}' in the recording."
        )
    scan = scans[key]
    if told.scan_stamp_ns != scan.stamp_ns:
        raise ContractError(
            f"scan_stamp_ns is {told.scan_stamp_ns}, but scan {scan.seq} of '{scan.sensor}' in the recording "
            f"has {scan.stamp_ns}: these are results of another one."
        )
    output = FusionOutput(
        scan_sensor=told.scan_sensor,
        scan_seq=told.scan_seq,
        objects=tuple(
            LocalizedObject(
                track_id=one.track_id, category=one.category, sensor=one.sensor, stamp_ns=one.stamp_ns,
                points=np.array(one.points, dtype=np.int64), position_ego_m=np.array(one.position_ego_m),
                distance_m=one.distance_m, azimuth_rad=one.azimuth_rad, confidence=one.confidence,
            )
            for one in told.objects
        ),
    )  # fmt: skip
    check_output(scan, output, period_ns=period_ns, answered=answered)
    return output


def _trajectory(told: _Trajectory, scans: Mapping[ScanKey, LidarScan], recording: Recording) -> Trajectory:
    n = len(told.stamp_ns)
    if (len(told.position_ego_m), len(told.inlier)) != (n, n):
        raise ContractError("stamp_ns, position_ego_m and inlier of a trajectory have different lengths.")
    stamps = [scan.stamp_ns for scan in scans.values()]
    if told.stamp_ns:
        first, last = min(stamps, default=0), max(stamps, default=0) + recording.truth.period_ns
        if min(told.stamp_ns) < first or max(told.stamp_ns) > last:
            raise ContractError(
                f"a stamp of the trajectory lies outside the recording's sweeps, [{first}, {last}] ns."
            )
    return Trajectory(
        track_id=told.track_id,
        stamp_ns=np.array(told.stamp_ns, dtype=np.int64),
        position_ego_m=np.array(told.position_ego_m, dtype=np.float64).reshape(n, 3),
        inlier=np.array(told.inlier, dtype=bool),
    )
