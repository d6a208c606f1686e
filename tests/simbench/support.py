"""Recordings for the tests of whole runs: short, cheap, and compared by their bytes."""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from fusion.messages import Calibration, Detections, EgoMotion, LidarScan
from scenarios.describe import describe
from scenarios.fault_set import FaultSet
from scenarios.faults import CalibrationRotation, EdgeError, FaultSpec, Flex, TriggerOffset, Vibration
from scenarios.scenario import LidarSensor, Scenario
from simbench.capture import Captured, capture
from simbench.case import Job
from simbench.faults.draw import Drawn, draw
from simbench.faults.proof import receipts
from simbench.faults.receipt import Receipt
from simbench.faults.refit import refit
from simbench.recording import Recording
from simbench.sensors.rig import resized
from simbench.stage import CATEGORIES, Stage, stage
from simbench.truth import ScanTruth, TrueBox
from simbench.world import build_world

ALL_FAULTS: tuple[FaultSpec, ...] = (
    TriggerOffset(offset_ms=50.0),
    Vibration(rms_deg=1.0),
    Flex(rms_deg=0.3),
    CalibrationRotation(angle_deg=2.0),
    EdgeError(sd_fraction=0.03),
)


def faults(*specs: FaultSpec) -> FaultSet:
    """A set of exactly these specs, those of zero strength too."""
    return FaultSet(specs=specs, label="test")


def staged(
    system: str = "car",
    seed: int = 0,
    *,
    specs: tuple[FaultSpec, ...] = (),
    scenario: str = "overtake-approach",
    duration_s: float | None = 2.0,
    columns: int = 8,
    size_px: tuple[int, int] | None = (96, 64),
    background: bool = False,
) -> Stage:
    """A catalogue scenario with a coarse LiDAR and small pictures: enough where exactness is not at stake."""
    whole = _world(scenario, system, seed, background)
    rig = replace(whole.rig, lidar=whole.rig.lidar.model_copy(update={"columns": columns}))
    if size_px is not None:
        rig = resized(rig, *size_px)
    played = whole.system
    if duration_s is not None:
        played = played.model_copy(update={"duration_s": duration_s})
    rig, refits = refit(rig, faults(*specs))
    return replace(whole, rig=rig, system=played, faults=faults(*specs), refits=refits)


@lru_cache(maxsize=16)
def _world(scenario: str, system: str, seed: int, background: bool) -> Stage:
    whole = stage(Job(scenario=scenario, system=system, seed=seed, pipelines=()))
    if background:
        return whole
    bare = whole.scenario.model_copy(update={"background": ()})
    return replace(whole, scenario=bare, world=build_world(bare, whole.system, seed))


def recorded(at: Stage, seed: int = 0) -> Captured:
    """The recording of a stage."""
    return capture(at.system, at.rig, at.world, at.faults, CATEGORIES, seed)


def posed(at: Stage, seed: int = 0) -> Captured:
    """A recording without points and boxes: all that receipts of time, motion and calibration look at."""
    with (
        mock.patch("simbench.capture.lidar.sweep", _no_returns),
        mock.patch("simbench.capture._Sought.boxes_in", lambda *_: ()),
    ):
        return recorded(at, seed)


@lru_cache(maxsize=16)
def posed_under(*specs: FaultSpec) -> Captured:
    """Of the usual stage under some faults. Not to be changed: it is made once."""
    return posed(staged(specs=specs))


def with_scans_of(scans_of: Captured, at: Stage, seed: int = 0) -> Captured:
    """A recording with the scans of another one of the same world and body shake, not cast again."""
    delivered = (m for m in scans_of.recording.messages if isinstance(m, LidarScan))
    replay = zip(delivered, scans_of.recording.truth.scans, strict=True)
    with mock.patch("simbench.capture.lidar.sweep", lambda *_: next(replay)):
        return recorded(at, seed)


def boxed(at: Stage, seed: int = 0) -> Captured:
    """A recording without points whose true boxes are those of the first with this world and seed: for faults
    that move no camera."""
    key = (id(at.world), at.system.duration_s, seed)
    if key not in _BOXES:
        with mock.patch("simbench.capture.lidar.sweep", _no_returns):
            images = recorded(replace(at, faults=faults()), seed).recording.truth.images
        _BOXES[key] = (at.world, [image.boxes for image in images])
    replay = iter(_BOXES[key][1])
    with (
        mock.patch("simbench.capture.lidar.sweep", _no_returns),
        mock.patch("simbench.capture._Sought.boxes_in", lambda *_: next(replay)),
    ):
        return recorded(at, seed)


_BOXES: dict[tuple[int, float, int], tuple[object, list[tuple[TrueBox, ...]]]] = {}


def _no_returns(
    name: str, sensor: LidarSensor, motion: object, start_ns: int, seq: int, rng: object, course: object
) -> tuple[LidarScan, ScanTruth]:
    scan = LidarScan(
        sensor=name,
        seq=seq,
        stamp_ns=start_ns,
        arrival_ns=start_ns + 100_000_000,
        xyz_m=np.zeros((0, 3), dtype=np.float32),
        intensity=np.zeros(0, dtype=np.float32),
        offset_ns=np.zeros(0, dtype=np.int32),
        ring=np.zeros(0, dtype=np.int16),
    )
    truth = ScanTruth(
        sensor=name,
        seq=seq,
        object_id=np.zeros(0, dtype=np.int32),
        part_id=np.zeros(0, dtype=np.int32),
        true_range_m=np.zeros(0),
        fire_ns=np.zeros(0, dtype=np.int64),
        incidence_rad=np.zeros(0, dtype=np.float32),
    )
    return scan, truth


def receipts_of(captured: Captured, at: Stage) -> tuple[Receipt, ...]:
    return receipts(captured, at.rig, at.faults, at.system.duration_s, at.refits)


def drawn_for(at: Stage, seed: int = 0) -> Drawn:
    """What a seed draws, without recording anything."""
    duration_s = at.system.duration_s
    timing = {name: at.rig.timing(name, duration_s, seed) for name in at.rig.cameras}
    return draw(at.rig, at.world, at.faults, timing, at.system, seed)


def write_scenario(folder: Path, scenario: Scenario) -> Path:
    """A scenario as a user's file."""
    path = folder / f"{scenario.name}.yaml"
    path.write_text(describe(scenario), encoding="utf-8")
    return path


# -- bytes ------------------------------------------------------------------------------------------------


def digest(*things: object) -> str:
    """SHA-256 of plain data: dataclasses, mappings, sequences, arrays (type, shape, bytes), scalars."""
    hasher = hashlib.sha256()
    for word in _words(things):
        hasher.update(word + b"\0")
    return hasher.hexdigest()


def _words(thing: object) -> Iterator[bytes]:
    if isinstance(thing, np.ndarray):
        yield f"{thing.dtype}{thing.shape}".encode()
        yield thing.tobytes()
    elif is_dataclass(thing) and not isinstance(thing, type):
        yield type(thing).__name__.encode()
        for field in fields(thing):
            yield from _words(getattr(thing, field.name))
    elif isinstance(thing, Mapping):
        for key in thing:
            yield repr(key).encode()
            yield from _words(thing[key])
    elif isinstance(thing, tuple | list):
        yield str(len(thing)).encode()
        for item in thing:
            yield from _words(item)
    elif thing is None or isinstance(thing, bool | int | float | str | np.generic):
        yield repr(thing).encode()
    else:
        raise TypeError(f"no plain data: {type(thing).__name__}")


def bytes_of(recording: Recording) -> dict[str, str]:
    """Digests of all that a recording holds, the poses of everything at 50 instants among it."""
    truth = recording.truth
    t_ns = np.linspace(0, 3_000_000_000, 50).astype(np.int64)
    poses = truth.poses
    sensors = truth.calibration.T_ego_sensor
    return {
        "calibration": digest(recording.calibration),
        "categories": digest(recording.categories),
        "messages": digest(recording.messages),
        "scans": digest([m for m in recording.messages if isinstance(m, LidarScan)]),
        "boxes": digest([m for m in recording.messages if isinstance(m, Detections)]),
        "ego motion": digest([m for m in recording.messages if isinstance(m, EgoMotion)]),
        "true scans": digest(truth.scans),
        "true images": digest(truth.images),
        "reference": digest(truth.reference),
        "truth": digest(truth.objects, truth.target_id, truth.calibration, truth.period_ns),
        "poses": digest(
            poses.ego(t_ns),
            [poses.sensor(name, t_ns) for name in sensors],
            [poses.object_centre(info.object_id, t_ns) for info in truth.objects],
        ),
    }


def reachable(*roots: object) -> Iterator[object]:
    """Everything that the roots hold, near or far; types, modules and code are not followed."""
    seen: set[int] = set()
    heap: list[object] = list(roots)
    while heap:
        thing = heap.pop()
        if (
            id(thing) in seen
            or isinstance(thing, type)
            or callable(thing)
            or type(thing).__name__ == "module"
        ):
            continue
        seen.add(id(thing))
        yield thing
        heap += gc.get_referents(thing)


# -- mutants of injectors ---------------------------------------------------------------------------------


def scaled(drawn: Drawn, true: Calibration, by: float) -> Drawn:
    """What an injector does that is off (0), half or twice as strong, turned round or in a wrong unit."""
    from fusion.geometry import Transform, rotation_exp, rotation_log

    def shake(item: Any) -> Any:
        return None if item is None else replace(item, amplitude=by * item.amplitude)

    told = {}
    for name, rest in true.T_ego_sensor.items():
        turn = rotation_log(rest.rotation.T @ drawn.told.T_ego_sensor[name].rotation)
        told[name] = Transform(
            rotation=rest.rotation @ rotation_exp(by * turn), translation_m=rest.translation_m
        )
    return replace(
        drawn,
        body_shake=shake(drawn.body_shake),
        flex={name: shake(item) for name, item in drawn.flex.items()},
        delays_ns={name: np.round(by * ns).astype(np.int64) for name, ns in drawn.delays_ns.items()},
        edge_errors={
            camera: {i: by * errors for i, errors in by_object.items()}
            for camera, by_object in drawn.edge_errors.items()
        },
        told=Calibration(T_ego_sensor=told, cameras=true.cameras),
    )


def without_faults(at: Stage) -> Callable[..., Drawn]:
    """Every injector replaced by the identity: a `draw` that draws nothing whatever it is asked for."""

    def nothing(*args: Any) -> Drawn:
        rig, world, _, timing, system, seed = args
        return draw(rig, world, FaultSet(), timing, system, seed)

    return nothing


@dataclass(frozen=True, kw_only=True)
class Lie:
    """A recording whose world got `acted`, with what the bench says it drew in `honest`."""

    captured: Captured
    honest: Drawn

    @property
    def in_the_world(self) -> Captured:
        """The draw was right, what acted was not."""
        return replace(self.captured, drawn=self.honest)

    @property
    def in_the_draw(self) -> Captured:
        """The draw itself was wrong, and acted as drawn."""
        return self.captured


def lie(at: Stage, mutate: Callable[[Drawn], Drawn], seed: int = 0) -> Lie:
    """Record a stage with a mutated injector."""
    honest = drawn_for(at, seed)
    record = boxed if at.faults.get(EdgeError) else posed
    with mock.patch("simbench.capture.draw", lambda *_: mutate(honest)):
        return Lie(captured=record(at, seed), honest=honest)
