"""When every sensor of a run measures, what its stamps claim and when it delivers.

A spinning LiDAR looks along each camera's axis at an instant of its own. How far that is from the image that
is paired with the sweep (by the claimed stamps, as scores and pipelines pair) is the camera's hidden offset.
Nothing is simulated for this: it is the clock of `sensors/clock.py` with the run's seed and timing faults.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.equipment import rig_sensors
from scenarios.errors import BadInput, Where
from scenarios.fault_set import FaultSet, parse_fault_arguments, parse_faults
from scenarios.faults import TriggerOffset
from scenarios.load import Family, load_scenario
from simbench.faults.refit import refit
from simbench.faults.struck import struck
from simbench.faults.timing import delays_ns
from simbench.score.frames import nearest
from simbench.sensors.clock import CameraTiming, ticks_ns
from simbench.sensors.lidar import beam_table, period_ns
from simbench.sensors.rig import SensorRig, assemble, axis_deg, fire_offset_ns

SWEEPS_SHOWN = 2
CROSSING_MPS = 5.0  # a target that crosses the camera's axis at this speed
CROSSING_M = 10.0  # at this distance


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweeps:
    """The LiDAR's sweeps [s]: first firing (which is the stamp), last firing, delivery."""

    name: str
    period_ns: int
    start_ns: Int64[np.ndarray, " s"]
    last_ns: Int64[np.ndarray, " s"]
    arrival_ns: Int64[np.ndarray, " s"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """One camera's images [f], faults included.

    A row is exposed for `exposure_ns`; rows follow each other from top to bottom over `readout_ns`. axis_deg:
    where the camera looks, in the LiDAR's frame. passed_ns [s]: when each sweep fires the columns that look
    there. paired [s]: which image is paired with each sweep, -1 for none.
    """

    name: str
    stamp: str
    focal_px: float
    axis_deg: float
    exposure_ns: int
    readout_ns: int
    mid_ns: Int64[np.ndarray, " f"]
    stamp_ns: Int64[np.ndarray, " f"]
    arrival_ns: Int64[np.ndarray, " f"]
    passed_ns: Int64[np.ndarray, " s"]
    paired: Int64[np.ndarray, " s"]

    @property
    def fires_after_mid_ms(self) -> Float64[np.ndarray, " p"]:
        """Per paired sweep: firing along the axis less true mid-exposure."""
        return self._after(self.mid_ns)

    @property
    def fires_after_stamp_ms(self) -> Float64[np.ndarray, " p"]:
        """Per paired sweep: firing along the axis less what the image's stamp claims."""
        return self._after(self.stamp_ns)

    @property
    def apart_m(self) -> float | None:
        """How far a target at CROSSING_MPS goes between image and points (mean of the run); None: no pair."""
        late_ms = self.fires_after_mid_ms
        return None if len(late_ms) == 0 else float(np.abs(late_ms).mean() * 1e-3 * CROSSING_MPS)

    @property
    def apart_px(self) -> float | None:
        """The same in pixels, for a target at CROSSING_M that crosses the axis."""
        return None if self.apart_m is None else self.focal_px * self.apart_m / CROSSING_M

    def _after(self, of_image_ns: Int64[np.ndarray, " f"]) -> Float64[np.ndarray, " p"]:
        has = self.paired >= 0
        late: np.ndarray = (self.passed_ns[has] - of_image_ns[self.paired[has]]) * 1e-6
        return late


@dataclass(frozen=True, kw_only=True, eq=False)
class Ticks:
    """A sensor with a steady rate: its instants (which are its stamps) and deliveries, [n]; `what` they are.
    delivered_ns: None for what is no message of its own."""

    name: str
    what: str
    taken_ns: Int64[np.ndarray, " n"]
    delivered_ns: Int64[np.ndarray, " n"] | None

    @property
    def words(self) -> str:
        """How often, and how late."""
        text = self.what
        if len(self.taken_ns) > 1:
            text += f" every {(self.taken_ns[1] - self.taken_ns[0]) * 1e-6:g} ms"
        if self.delivered_ns is not None and len(self.delivered_ns):
            text += f", known {(self.delivered_ns[0] - self.taken_ns[0]) * 1e-6:g} ms later"
        return text


@dataclass(frozen=True, kw_only=True, eq=False)
class Timeline:
    """All sensors of one run. from_ns, to_ns: the sweeps to be drawn."""

    title: str
    faults: str
    from_ns: int
    to_ns: int
    lidar: Sweeps
    cameras: tuple[Exposures, ...]
    ticks: tuple[Ticks, ...]


def timeline(
    target: str, system: str | None, seed: int | None, faults: Sequence[str], at_s: float
) -> Timeline:
    """Of a scenario (name or .yaml file) or of the folder of a run.

    system, seed: None takes the first, or seed 0 of a scenario. faults: as `--faults` gives them, in place of
    or on top of what the scenario or the run has. at_s: an instant of the first sweep to be drawn.
    BadInput: nothing there, or it has no such system, seed or instant.
    """
    if Path(target).is_dir():
        family, system, seed, own = _of_run(Path(target), system, seed)
    else:
        family, own = load_scenario(target), None
        system, seed = system or family.system_names[0], seed or 0
    scenario = family.resolve(seed)
    if system not in family.system_names:
        raise family.where.unknown("system", system, family.system_names, ("systems",))
    if own is None:
        own = family.fault_set(scenario)
    active = own.override(parse_fault_arguments(faults)) if faults else own
    played = scenario.system(system)
    declared = family.rig(played.rig)
    built = assemble(declared, rig_sensors(declared, family.beside))
    rig, _ = refit(built, active)
    active.check(tuple(rig.cameras), Where(file=None))
    title = f"{scenario.name}, {system}, seed {seed}"
    return plan(rig, played.duration_s, seed, active, at_s=at_s, title=title)


def plan(
    rig: SensorRig, duration_s: float, seed: int, faults: FaultSet, *, at_s: float = 0.0, title: str = ""
) -> Timeline:
    """The timeline of a rig's run. BadInput: `at_s` is not within it."""
    period, sweeps = period_ns(rig.lidar), rig.sweeps(duration_s)
    if not 0.0 <= at_s * 1e9 < sweeps * period:
        raise BadInput(f"{at_s:g} s is not within the run, whose sweeps end at {sweeps * period * 1e-9:g} s")
    first = max(min(int(at_s * 1e9) // period, sweeps - SWEEPS_SHOWN), 0)
    start_ns = period * np.arange(sweeps, dtype=np.int64)
    last_ns = start_ns + int(beam_table(rig.lidar).fire_offset_ns.max())
    timing = {name: rig.timing(name, duration_s, seed) for name in rig.cameras}
    return Timeline(
        title=title,
        faults=faults.label,
        from_ns=first * period,
        to_ns=min(first + SWEEPS_SHOWN, sweeps) * period,
        lidar=Sweeps(
            name=rig.lidar_name,
            period_ns=period,
            start_ns=start_ns,
            last_ns=last_ns,
            arrival_ns=last_ns + round(rig.lidar.latency_ms * 1e6),
        ),
        cameras=tuple(_exposures(name, rig, timing[name], seed, faults, start_ns) for name in rig.cameras),
        ticks=_ticks(rig, seed, rig.end_ns(duration_s, timing)),
    )


def _exposures(
    name: str,
    rig: SensorRig,
    timing: CameraTiming,
    seed: int,
    faults: FaultSet,
    scan_ns: Int64[np.ndarray, " s"],
) -> Exposures:
    sensor = rig.cameras[name]
    late_ns = np.zeros(len(timing.mid_ns), dtype=np.int64)
    offset = faults.get(TriggerOffset)
    if offset is not None and name in struck(offset, rig):
        late_ns = delays_ns(offset, name, len(late_ns), seed)
    looks_deg = axis_deg(rig, name)
    within_ns = period_ns(rig.lidar) / 2
    found = [nearest(timing.stamp_ns, int(t), within_ns) for t in scan_ns]
    return Exposures(
        name=name,
        stamp=sensor.stamp,
        focal_px=rig.pinholes[name].fx_px,
        axis_deg=looks_deg,
        exposure_ns=timing.exposure_ns,
        readout_ns=round(sensor.readout_ms * 1e6),
        mid_ns=timing.mid_ns + late_ns,
        stamp_ns=timing.stamp_ns,
        arrival_ns=timing.arrival_ns + late_ns,
        passed_ns=scan_ns + fire_offset_ns(rig, looks_deg),
        paired=np.array([-1 if i is None else i for i in found], dtype=np.int64),
    )


def _ticks(rig: SensorRig, seed: int, end_ns: int) -> tuple[Ticks, ...]:
    phases, lanes = rig.phases(seed), []
    if rig.gnss is not None and rig.gnss_name is not None:
        taken = ticks_ns(rig.gnss.rate_hz, phases.gnss_ns, end_ns)
        late = round(rig.gnss.latency_ms * 1e6)
        lanes.append(Ticks(name=rig.gnss_name, what="fixes", taken_ns=taken, delivered_ns=taken + late))
    if rig.imu is not None and rig.imu_name is not None:
        taken = ticks_ns(rig.imu.rate_hz, phases.imu_ns, end_ns)
        late = round(rig.imu.latency_ms * 1e6)
        lanes.append(Ticks(name=rig.imu_name, what="samples", taken_ns=taken, delivered_ns=taken + late))
        turns = ticks_ns(rig.imu.odometer_rate_hz, phases.odometer_ns, end_ns)
        lanes.append(Ticks(name="odometer", what="samples", taken_ns=turns, delivered_ns=None))
    return tuple(lanes)


def _of_run(folder: Path, system: str | None, seed: int | None) -> tuple[Family, str, int, FaultSet]:
    """The first case of a run with faults, or else the first, of that system and seed."""
    where = Where(file=str(folder / "result.json"))
    cases = cases_of_run(folder)
    fitting = [case for case in cases if system in (None, case["system"]) and seed in (None, case["seed"])]
    if not fitting:
        had = sorted({f"{case['system']} seed {case['seed']}" for case in cases})
        wanted = " ".join([system or "any system", "any seed" if seed is None else f"seed {seed}"])
        raise where.error(f"holds no case of {wanted}", allowed=", ".join(had) or "none")
    case = next((case for case in fitting if case["fault_specs"]), fitting[0])
    family = load_scenario(str(folder / f"scenario-{case['scenario']}-{case['seed']}.yaml"))
    faults = parse_faults(case["fault_specs"], where.at("cases"), label=case["faults"])
    return family, case["system"], case["seed"], faults


def cases_of_run(folder: Path) -> list[dict[str, Any]]:
    """The cases in a run's `result.json`. BadInput: the folder holds none."""
    where = Where(file=str(folder / "result.json"))
    kinds = {"scenario": str, "system": str, "seed": int, "faults": str, "fault_specs": dict}
    try:
        content = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(f"{folder} is no folder of a run: it has no result.json") from None
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise where.error(f"cannot be read: {error}") from error
    cases = content.get("cases") if isinstance(content, dict) else None
    if not isinstance(cases, list) or not all(
        isinstance(case, dict) and all(isinstance(case.get(key), kind) for key, kind in kinds.items())
        for case in cases
    ):
        raise where.error("is no result of a run")
    return cases
