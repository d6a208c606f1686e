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
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fusion.messages import FusionOutput, LidarScan, LocalizedObject, Trajectory
from scenarios.errors import BadInput
from simbench.files import open_plain
from simbench.recording import Recording
from simbench.score.contract import ContractError, ScanKey, check_output, check_trajectories

SCHEMA = "simbench-outputs/1"
LARGEST_FILE = 2**30
LONGEST_LINE = 2**24  # one sweep's objects with all their points, or one trajectory

Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Name = Annotated[str, Field(max_length=200)]
Coordinate = Annotated[float, Field(ge=-1e7, le=1e7)]
Point = tuple[Coordinate, Coordinate, Coordinate]
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
    distance_m: Coordinate
    azimuth_rad: Coordinate
    confidence: Annotated[float, Field(ge=0, le=1)]


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
    tracks: dict[int, Trajectory] = {}
    for number, text in _lines(path):
        line = _object(path, number, text)
        kind = next(iter(line)) if len(line) == 1 else None
        try:
            if kind == "output":
                output = _output(_told(_Output, line["output"]), scans, recording.truth.period_ns, outputs)
                outputs[output.scan_sensor, output.scan_seq] = output
            elif kind == "trajectory":
                track = _trajectory(_told(_Trajectory, line["trajectory"]), scans, recording)
                check_trajectories([track])
                if track.track_id in tracks:
                    raise ContractError(f"Trajectory {track.track_id}: a track may have only one trajectory.")
                tracks[track.track_id] = track
            else:
                raise ContractError(f"a line must be one 'output' or one 'trajectory', not {text[:40]!r}.")
        except ContractError as error:
            raise BadInput(str(error).rstrip("."), file=str(path), line=number) from error
    return tuple(outputs.values()), tuple(tracks.values())


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines after the first, with their numbers, one by one."""
    lines = ((number, line) for number, line in text_lines(path, LARGEST_FILE, LONGEST_LINE) if line.strip())
    first = next(lines, None)
    if first is None or _object(path, *first) != {"schema": SCHEMA}:
        raise BadInput(
            "the first line is no schema", file=str(path), line=1, allowed=f'{{"schema": "{SCHEMA}"}}'
        )
    yield from lines


def text_lines(path: Path, largest_file: int, longest_line: int) -> Iterator[tuple[int, str]]:
    """Every line of a text file and its number from 1. BadInput: it is too long, or no UTF-8."""
    name = str(path)
    with open_plain(path) as file:
        if os.fstat(file.fileno()).st_size > largest_file:
            raise BadInput(f"it is larger than {largest_file >> 20} MB", file=name)
        number = 0
        while raw := file.readline(longest_line + 1):
            number += 1
            if len(raw) > longest_line:
                raise BadInput(f"it is longer than {longest_line >> 10} kB", file=name, line=number)
            try:
                yield number, raw.decode("utf-8")
            except UnicodeDecodeError:
                raise BadInput("it is no UTF-8 text", file=name, line=number) from None


def _object(path: Path, number: int, text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        why = " ".join(str(error).split())[:100]
        raise BadInput(f"it is no JSON: {why}", file=str(path), line=number) from error
    if not isinstance(found, dict):
        raise BadInput("it is no JSON object", file=str(path), line=number)
    return found


def _told(model: type[Told], content: object) -> Told:
    try:
        return model.model_validate_json(json.dumps(content))
    except RecursionError as error:
        raise ContractError("it is nested too deeply.") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))[:200]
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
        raise ContractError(f"there is no scan {told.scan_seq} of '{told.scan_sensor}' in the recording.")
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
