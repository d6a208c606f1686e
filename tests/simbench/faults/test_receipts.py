"""Receipts: silent on clean draws, loud for every mutant, honest about what they cannot see."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.faults import CalibrationRotation, EdgeError, FaultSpec, Flex, TriggerOffset, Vibration
from simbench.capture import Drawn
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt, judge, untouched
from simbench.stage import Stage
from tests.simbench.support import (
    ALL_FAULTS,
    boxed,
    drawn_for,
    faults,
    lie,
    posed,
    receipts_of,
    recorded,
    scaled,
    staged,
    without_faults,
)

FRONT, BACK = ("cam-front",), ("cam-back",)
SPECS: dict[str, FaultSpec] = {
    "timing": TriggerOffset(offset_ms=50.0),
    "timing with jitter": TriggerOffset(offset_ms=20.0, jitter_ms=5.0),
    "timing of one camera": TriggerOffset(offset_ms=50.0, sensors=FRONT),
    "vibration": Vibration(rms_deg=1.0),
    "flex": Flex(rms_deg=0.3),
    "flex of one camera": Flex(rms_deg=0.3, sensors=FRONT),
    "rotation": CalibrationRotation(angle_deg=1.0, axis="pitch"),
    "rotation about random axes": CalibrationRotation(angle_deg=1.0),
    "rotation of one camera": CalibrationRotation(angle_deg=1.0, axis="yaw", sensors=FRONT),
    "edges": EdgeError(sd_fraction=0.05),
    "edges with bias": EdgeError(sd_fraction=0.03, bias_fraction=0.05),
}


@cache
def scene(which: str, seed: int = 0) -> Stage:
    """Boxes need traffic and pictures large enough to detect in; poses do not."""
    edges = which.startswith("edges")
    return staged(
        specs=(SPECS[which],), seed=seed, background=edges, size_px=(320, 200) if edges else (96, 64),
        duration_s=1.5,
    )  # fmt: skip


def proof(at: Stage, seed: int = 0) -> tuple[Receipt, ...]:
    """Receipts of a recording that holds no more than they look at."""
    record = boxed if at.faults.get(EdgeError) else posed
    return receipts_of(record(at, seed), at)


def statuses(found: object) -> set[str]:
    return {receipt.status for receipt in found}  # type: ignore[attr-defined]


@pytest.mark.parametrize("which", SPECS)
def test_a_clean_draw_is_ok(which: str) -> None:
    found = proof(scene(which))
    assert found and statuses(found) == {OK}, found
    for receipt in found:
        assert receipt.fault == SPECS[which].name
        assert receipt.unit and receipt.note
        assert receipt.smallest == pytest.approx(5.0 * receipt.estimator_sd + receipt.systematic)


@pytest.mark.parametrize(("system", "seed"), [("car", 0), ("wearable", 1)])
def test_all_faults_together_are_ok(system: str, seed: int) -> None:
    at = staged(system, seed, specs=ALL_FAULTS, background=True, size_px=(320, 200), duration_s=3.0)
    found = receipts_of(recorded(at, seed), at)
    assert {receipt.fault for receipt in found} == {spec.name for spec in ALL_FAULTS}
    assert statuses(found) == {OK}, [r for r in found if r.status != OK]


@pytest.mark.parametrize("system", ["car", "wearable"])
@pytest.mark.parametrize("duration_s", [0.3, 0.6, 1.0])
def test_a_short_run_is_no_mismatch(system: str, duration_s: float) -> None:
    """A gyro cannot know the mean of the shake, which is large over a part of its period."""
    specs = (TriggerOffset(offset_ms=50.0), Vibration(rms_deg=1.1), CalibrationRotation(angle_deg=1.0))
    for seed in range(3):
        at = staged(system, seed, specs=specs, duration_s=duration_s)
        assert MISMATCH not in statuses(proof(at, seed))


@pytest.mark.parametrize("seed", [8, 18, 19])
def test_a_body_that_shakes_while_its_path_sways_is_no_mismatch(seed: int) -> None:
    """A heading that swings by 20 degrees turns roll into pitch and back, and so does a gyro's own error."""
    specs = (Vibration(rms_deg=2.0), Flex(rms_deg=0.3, sensors=("cam-left",)))
    at = staged("wearable", seed, specs=specs, scenario="overtake-wobble")
    assert statuses(proof(at, seed)) == {OK}


# -- mutants ----------------------------------------------------------------------------------------------

SCALES = {"off": 0.0, "half": 0.5, "twice": 2.0, "sign": -1.0}
UNITS = {
    "timing": {"ms for us": 1e3, "us for ms": 1e-3},
    "vibration": {"deg for rad": 180.0 / np.pi, "rad for deg": np.pi / 180.0},
    "flex": {"deg for rad": 180.0 / np.pi, "rad for deg": np.pi / 180.0},
    "rotation": {"deg for rad": 180.0 / np.pi, "rad for deg": np.pi / 180.0},
    "edges": {"percent for fractions": 0.01, "fractions for percent": 100.0},
}
CASES = [
    (which, name, by)
    for which in SPECS
    for name, by in {**SCALES, **UNITS[which.split()[0]]}.items()
    if "one camera" not in which
]


@pytest.mark.parametrize(("which", "mutant", "by"), CASES, ids=[f"{w}-{m}" for w, m, _ in CASES])
def test_an_injector_that_acts_otherwise_than_drawn_is_caught(which: str, mutant: str, by: float) -> None:
    at = scene(which)
    told = lie(at, lambda drawn: scaled(drawn, at.rig.calibration, by))
    assert MISMATCH in statuses(receipts_of(told.in_the_world, at))
    symmetric = which in ("vibration", "flex", "rotation about random axes", "edges")
    if not (mutant == "sign" and symmetric):  # there the opposite is a draw like any other
        assert MISMATCH in statuses(receipts_of(told.in_the_draw, at))


def swapped(items: dict[str, object]) -> dict[str, object]:
    """Each camera gets what was drawn for the next; a single one moves to the camera at the back."""
    names = list(items)
    if not names:
        return {}
    if len(names) == 1:
        return {BACK[0]: items[names[0]]}
    return dict(zip(names, [items[name] for name in (*names[1:], names[0])], strict=True))


def on_wrong_cameras(drawn: Drawn, at: Stage) -> Drawn:
    true = at.rig.calibration
    told = dict(true.T_ego_sensor)
    for name in true.cameras:
        rest, turned = true.T_ego_sensor[name], drawn.told.T_ego_sensor[name]
        if not np.array_equal(rest.rotation, turned.rotation):
            back = true.T_ego_sensor[BACK[0]]
            told[BACK[0]] = replace(back, rotation=back.rotation @ rest.rotation.T @ turned.rotation)
    return replace(
        drawn,
        delays_ns=swapped(dict(drawn.delays_ns)),
        flex=swapped(dict(drawn.flex)),
        edge_errors=swapped(dict(drawn.edge_errors)),
        told=replace(drawn.told, T_ego_sensor=told),
    )


ONE = [which for which in SPECS if "one camera" in which]


@pytest.mark.parametrize("which", [*ONE, "flex", "timing with jitter", "edges", "edges with bias"])
def test_the_wrong_sensor_is_caught(which: str) -> None:
    at = scene(which)
    told = lie(at, lambda drawn: on_wrong_cameras(drawn, at))
    assert MISMATCH in statuses(receipts_of(told.in_the_world, at))
    if which in ONE:
        assert MISMATCH in statuses(receipts_of(told.in_the_draw, at))


@pytest.mark.parametrize("which", ONE)
def test_a_camera_that_is_struck_besides_the_named_one_is_caught(which: str) -> None:
    at = scene(which)
    everywhere = replace(at, faults=faults(SPECS[which].model_copy(update={"sensors": "cameras"})))
    told = lie(at, lambda _: drawn_for(everywhere))
    bad = [r for r in receipts_of(told.in_the_world, at) if r.status == MISMATCH]
    assert [r.quantity.endswith("of the other cameras") for r in bad] == [True]


def test_a_shake_about_the_wrong_axis_is_caught() -> None:
    at = scene("vibration")

    def turned(drawn: Drawn) -> Drawn:
        shake = drawn.body_shake
        assert shake is not None
        order = [1, 0, 2, 3]
        return replace(
            drawn,
            body_shake=replace(shake, amplitude=shake.amplitude[order], phase_rad=shake.phase_rad[order]),
        )

    told = lie(at, turned)
    for captured in (told.in_the_world, told.in_the_draw):
        bad = {r.quantity for r in receipts_of(captured, at) if r.status == MISMATCH}
        assert bad == {"roll RMS", "pitch RMS"}


def test_a_shake_of_the_cameras_instead_of_the_body_is_caught() -> None:
    at = scene("vibration")

    def bent(drawn: Drawn) -> Drawn:
        shake = drawn.body_shake
        assert shake is not None
        angles = replace(shake, amplitude=shake.amplitude[:3], phase_rad=shake.phase_rad[:3])
        return replace(drawn, body_shake=None, flex={name: angles for name in at.rig.cameras})

    told = lie(at, bent)
    for captured in (told.in_the_world, told.in_the_draw):
        assert statuses(receipts_of(captured, at)) == {MISMATCH}


@pytest.mark.parametrize("axis", range(4))
def test_each_axis_of_the_shake_has_its_own_receipt(axis: int) -> None:
    at = scene("vibration")

    def still(drawn: Drawn) -> Drawn:
        shake = drawn.body_shake
        assert shake is not None
        amplitude = shake.amplitude.copy()
        amplitude[axis] = 0.0
        return replace(drawn, body_shake=replace(shake, amplitude=amplitude))

    told = lie(at, still)
    names = ["roll RMS", "pitch RMS", "yaw RMS", "heave RMS"]
    for captured in (told.in_the_world, told.in_the_draw):
        bad = {r.quantity for r in receipts_of(captured, at) if r.status == MISMATCH}
        assert bad == {names[axis]}


def test_a_rotation_about_another_axis_is_caught() -> None:
    for which in ("rotation", "rotation about random axes"):
        at = scene(which)
        roll = staged(specs=(CalibrationRotation(angle_deg=1.0, axis="roll"),))
        told = lie(at, lambda _, roll=roll: drawn_for(roll))
        assert MISMATCH in statuses(receipts_of(told.in_the_world, at))


def test_edges_that_jitter_without_their_time_constant_are_caught() -> None:
    """White jitter of the right size alone flatters every smoother."""
    at = scene("edges")
    white = replace(at, faults=staged(specs=(EdgeError(sd_fraction=0.05, tau_s=0.0),)).faults)
    told = lie(at, lambda _: drawn_for(white))
    bad = {r.quantity for r in receipts_of(told.in_the_draw, at) if r.status == MISMATCH}
    assert "link to the next frame" in bad


@pytest.mark.parametrize("which", SPECS)
def test_an_injector_replaced_by_the_identity_is_caught(which: str) -> None:
    at = scene(which)
    with mock.patch("simbench.capture.draw", without_faults(at)):
        found = proof(at)
    assert found and MISMATCH in statuses(found)


# -- limits -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "spec",
    [
        TriggerOffset(offset_ms=0.05),
        Vibration(rms_deg=0.001),
        Flex(rms_deg=0.0005),
        CalibrationRotation(angle_deg=0.005),
        EdgeError(sd_fraction=0.0003, tau_s=0.0),
    ],
    ids=lambda spec: spec.name,
)
def test_an_effect_too_small_to_detect_is_unverifiable(spec: FaultSpec) -> None:
    edges = isinstance(spec, EdgeError)
    at = staged(specs=(spec,), background=edges, size_px=(320, 200) if edges else (96, 64))
    found = [r for r in proof(at) if "heave" not in r.quantity]
    assert statuses(found) == {UNVERIFIABLE}, found


def test_a_delay_of_a_standing_car_is_unverifiable_and_says_why() -> None:
    at = staged(scenario="static-board", specs=(TriggerOffset(offset_ms=50.0),), duration_s=1.0)
    found = proof(at)
    assert statuses(found) == {UNVERIFIABLE}
    assert all(r.measured is None and "too slow" in r.note for r in found)


@pytest.mark.parametrize(
    "spec",
    [
        TriggerOffset(offset_ms=1000.0),
        TriggerOffset(offset_ms=-1000.0, jitter_ms=1000.0),
        Vibration(rms_deg=30.0),
        Flex(rms_deg=30.0),
        CalibrationRotation(angle_deg=180.0),
        CalibrationRotation(angle_deg=-180.0, axis="roll"),
        EdgeError(sd_fraction=1.0, bias_fraction=1.0),
    ],
    ids=lambda spec: spec.name,
)
def test_the_strongest_that_a_fault_allows_is_no_mismatch(spec: FaultSpec) -> None:
    edges = isinstance(spec, EdgeError)
    at = staged(specs=(spec,), background=edges, size_px=(320, 200) if edges else (96, 64), duration_s=1.5)
    found = proof(at)
    assert OK in statuses(found) and MISMATCH not in statuses(found), found


def test_a_standing_car_still_proves_rotation_flex_and_shake() -> None:
    specs = (Vibration(rms_deg=0.5), Flex(rms_deg=0.2), CalibrationRotation(angle_deg=5.0))
    at = staged(scenario="static-board", specs=specs, duration_s=None)
    assert statuses(proof(at)) == {OK}


def test_a_rig_without_a_gyro_says_that_it_cannot_see_the_shake() -> None:
    at = staged(specs=(Vibration(rms_deg=1.0), Flex(rms_deg=0.3)), duration_s=1.0)
    at = replace(at, rig=replace(at.rig, imu=None, imu_name=None))
    found = {r.quantity: r for r in proof(at) if r.fault == Vibration.name}
    assert [found[f"{axis} RMS"].status for axis in ("roll", "pitch", "yaw")] == [UNVERIFIABLE] * 3
    assert MISMATCH not in statuses(found.values())


def test_too_few_boxes_prove_nothing() -> None:
    at = staged(specs=(EdgeError(sd_fraction=0.05),), duration_s=0.3)
    (receipt,) = proof(at)
    assert (receipt.status, receipt.measured) == (UNVERIFIABLE, None)
    assert "boxes were delivered" in receipt.note


def test_a_verdict_needs_all_of_it() -> None:
    def verdict(requested: float, realised: float, measured: float | None) -> str:
        return judge(
            fault="f", quantity="q", unit="u", requested=requested, realised=realised, measured=measured,
            estimator_sd=0.1, allowed=0.2,
        ).status  # fmt: skip

    assert verdict(10.0, 10.1, 10.5) == OK
    assert verdict(10.0, 10.1, 10.7) == MISMATCH  # found something else than was drawn
    assert verdict(10.0, 10.3, 10.3) == MISMATCH  # drew something else than was asked for
    assert verdict(0.3, 0.3, 0.3) == UNVERIFIABLE  # below 5 SD of the estimator
    assert verdict(0.3, 0.3, 1.0) == MISMATCH
    assert verdict(10.0, 10.0, None) == UNVERIFIABLE
    assert verdict(10.0, 0.0, None) == MISMATCH
    nan = float("nan")
    assert verdict(10.0, 10.0, nan) == verdict(10.0, nan, 10.0) == verdict(10.0, nan, None) == MISMATCH


ERRORS = st.floats(0.0, 1e3)
NUMBERS = st.floats(-1e4, 1e4)


def judged(realised: float, measured: float, sd: float, systematic: float) -> Receipt:
    """What was asked for was drawn."""
    return judge(
        fault="f", quantity="q", unit="u", requested=realised, realised=realised, measured=measured,
        estimator_sd=sd, allowed=0.0, systematic=systematic,
    )  # fmt: skip


@given(realised=NUMBERS, measured=NUMBERS, sd=ERRORS, systematic=ERRORS)
def test_the_smallest_effect_is_five_sd_and_what_is_not_chance(
    realised: float, measured: float, sd: float, systematic: float
) -> None:
    receipt = judged(realised, measured, sd, systematic)
    assert receipt.smallest == 5.0 * sd + systematic
    assert (receipt.status == MISMATCH) == (abs(measured - realised) > receipt.smallest)
    if receipt.status == OK:
        assert abs(realised) > receipt.smallest


@given(realised=NUMBERS, measured=NUMBERS, sd=ERRORS, systematic=ERRORS, more=ERRORS)
def test_who_may_err_more_contradicts_less_and_verifies_less(
    realised: float, measured: float, sd: float, systematic: float, more: float
) -> None:
    tight = judged(realised, measured, sd, systematic)
    for loose in (
        judged(realised, measured, sd, systematic + more),
        judged(realised, measured, sd + more, systematic),
    ):
        assert loose.smallest >= tight.smallest
        assert tight.status == MISMATCH or loose.status != MISMATCH
        assert tight.status != UNVERIFIABLE or loose.status == UNVERIFIABLE


@pytest.mark.parametrize(
    ("measured", "sd", "systematic", "status"),
    [
        (10.5, 0.1, 0.0, OK),  # 5 SD
        (10.6, 0.1, 0.0, MISMATCH),  # 6 SD
        (10.6, 0.1, 0.2, OK),  # 5 SD and 0.1 of 0.2
        (10.8, 0.1, 0.2, MISMATCH),  # 0.7 is allowed
        (10.2, 0.0, 0.25, OK),
        (10.3, 0.0, 0.25, MISMATCH),
        (10.0, 0.0, 0.0, OK),
        (10.0, 0.0, 10.0, UNVERIFIABLE),  # off could not be told from on
        (10.0, 1.0, 5.0, UNVERIFIABLE),
    ],
)
def test_a_measurement_matches_within_five_sd_and_what_is_not_chance(
    measured: float, sd: float, systematic: float, status: str
) -> None:
    assert judged(10.0, measured, sd, systematic).status == status


# -- the published errors of the estimators ----------------------------------------------------------------


def test_measured_minus_realised_is_within_the_published_errors() -> None:
    """Over 30 draws the z-scores of every kind of receipt that errs by chance have a mean near 0 and an SD
    near 1; what errs otherwise stays within its bound."""
    specs = (
        TriggerOffset(offset_ms=50.0, jitter_ms=10.0),
        Vibration(rms_deg=1.0),
        Flex(rms_deg=0.3),
        CalibrationRotation(angle_deg=2.0),
    )
    z: dict[tuple[str, str], list[float]] = defaultdict(list)
    for seed in range(30):
        at = staged("car" if seed % 5 == 0 else "wearable", seed % 10, specs=specs)  # ten drives, 30 draws
        for receipt in proof(at, seed):
            assert receipt.measured is not None and receipt.status != MISMATCH, receipt
            kind = (
                receipt.quantity.split(" ", 1)[1] if receipt.quantity.startswith("cam-") else receipt.quantity
            )
            error = receipt.measured - receipt.realised
            if receipt.systematic > 5.0 * receipt.estimator_sd:
                assert abs(error) <= receipt.systematic + 5.0 * receipt.estimator_sd, receipt
                continue
            z[(receipt.fault, kind)].append(error / receipt.estimator_sd)
    assert {(Vibration.name, axis) for axis in ("roll RMS", "pitch RMS", "yaw RMS")} <= set(z)
    for kind, scores in z.items():
        assert len(scores) >= 30
        assert abs(np.mean(scores)) < 5.0 / np.sqrt(len(scores)), (kind, np.mean(scores))
        assert 0.5 < np.std(scores) < 1.5, (kind, np.std(scores))


@pytest.mark.parametrize(
    ("found", "measured", "status"),
    [
        ([(0.4, 0.1), (0.06, 0.01)], 0.06, MISMATCH),  # the smaller effect is the one beyond its own 5 SD
        ([(0.4, 0.1), (0.04, 0.01)], 0.4, OK),
        ([(0.4, 0.1), (float("nan"), 0.01)], None, MISMATCH),
    ],
)
def test_of_the_spared_cameras_the_one_farthest_beyond_its_own_uncertainty_decides(
    found: list[tuple[float, float]], measured: float | None, status: str
) -> None:
    (receipt,) = untouched(fault="f", quantity="q", unit="u", found=found, note="")
    assert receipt.status == status
    assert measured is None or receipt.measured == measured


def test_where_every_camera_is_struck_there_is_no_receipt_about_others() -> None:
    assert untouched(fault="f", quantity="q", unit="u", found=[], note="") == ()
