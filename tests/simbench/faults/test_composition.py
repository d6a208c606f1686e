"""Faults compose: any six at once do not crash, each is proved, and all at zero strength are nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.faults import (
    FAULTS,
    CalibrationMixup,
    Drift,
    FaultSpec,
    Flex,
    Knock,
    Trace,
    TriggerAngle,
)
from scenarios.faults.motion import SHAKERS
from scenarios.severity import SEVERITIES, severe
from simbench.faults.receipt import MISMATCH
from simbench.faults.refit import refit
from simbench.run import HasRecording, run_case
from simbench.stage import Stage
from tests.simbench.support import bytes_of, receipts_of, recorded, staged

GRADED = tuple(sorted({severity.fault for severity in SEVERITIES}))
MIXUPS = tuple(CalibrationMixup(what=what) for what in CalibrationMixup.strength_words()[1:])  # type: ignore[arg-type]


@cache
def ground(system: str) -> Stage:
    """A second and a half with people beside the lanes."""
    return staged(system, duration_s=1.5, columns=48, size_px=(320, 200), background=True)


def struck(specs: tuple[FaultSpec, ...], system: str) -> Stage:
    at = ground(system)
    rig, refits = refit(at.rig, FaultSet(specs=specs))
    return replace(at, rig=rig, refits=refits, faults=FaultSet(specs=specs, label="several"))


@st.composite
def sets(draw: st.DrawFn) -> tuple[FaultSpec, ...]:
    """Up to six faults at any severity, brackets of cameras or of the LiDAR; of those that shake the body one
    at most."""
    names = draw(
        st.lists(st.sampled_from([*GRADED, "calibration.mixup"]), min_size=1, max_size=6, unique=True)
    )
    specs: list[FaultSpec] = []
    for name in sorted(names):
        if issubclass(FAULTS[name], SHAKERS) and any(isinstance(spec, SHAKERS) for spec in specs):
            continue
        mixup = name == "calibration.mixup"
        specs.append(draw(st.sampled_from(MIXUPS)) if mixup else severe(name, draw(st.integers(1, 5))))
        if isinstance(specs[-1], Drift | Flex | Knock) and draw(st.booleans()):
            specs[-1] = specs[-1].model_copy(update={"sensors": "lidar"})
    return tuple(specs)


@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(specs=sets(), system=st.sampled_from(["car", "wearable"]))
def test_any_six_faults_at_once_are_each_proved(specs: tuple[FaultSpec, ...], system: str) -> None:
    if system == "wearable":  # its cameras run freely: no beam triggers them
        specs = tuple(spec for spec in specs if not isinstance(spec, TriggerAngle))
    at = struck(specs, system)
    captured = recorded(at)
    found = receipts_of(captured, at)
    assert {receipt.fault for receipt in found} == {spec.name for spec in specs}
    assert not [receipt for receipt in found if receipt.status == MISMATCH]
    held: HasRecording = captured
    case = run_case("static_projection", held)
    assert case.status == "ok", case.why


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_all_faults_at_zero_strength_change_no_byte(system: str) -> None:
    """Past the fault set, which would leave them out: the injectors themselves run."""
    off = tuple(
        FAULTS[name].model_validate(dict.fromkeys(FAULTS[name].zero_when_off, 0))
        for name in FAULTS
        if FAULTS[name].zero_when_off and FAULTS[name] is not Trace and not issubclass(FAULTS[name], SHAKERS)
        if name != "calibration.click_noise_px"  # a solver comes back to the last digits
    )
    assert len(off) > 40 and all(spec.is_off for spec in off)
    assert bytes_of(recorded(struck(off, system)).recording) == bytes_of(recorded(ground(system)).recording)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_that_is_off_never_enters_a_set(name: str) -> None:
    (spec,) = parse_fault_arguments([f"{name}={FAULTS[name].off_words()}"]).specs
    assert spec.is_off
    assert not len(FaultSet().override(parse_fault_arguments([f"{name}={FAULTS[name].off_words()}"])))
