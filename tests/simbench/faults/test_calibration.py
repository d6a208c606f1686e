"""Faults of what the fusion is told: one list, every law for each of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.faults import (
    CalibrationMixup,
    CalibrationRotation,
    CalibrationTranslation,
    ClickNoise,
    FaultSpec,
    FocalLength,
    PixelShift,
    Undistorted,
)
from scenarios.severity import SEVERITIES, severe
from simbench.calibration.file import told as on_found
from simbench.case import Job
from simbench.faults.draw import place_of
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt
from simbench.faults.tell import CALIBRATION_FAULTS, tell, told_receipts
from simbench.faults.telling import Place, Telling, Witness
from simbench.run import run_job
from tests.simbench.support import digest, faults, posed, receipts_of, staged

FRONT, BACK = "cam-front", "cam-back"
SPECS: dict[str, FaultSpec] = {
    "rotation": CalibrationRotation(angle_deg=1.0),
    "rotation about an axis": CalibrationRotation(angle_deg=1.0, axis="yaw", sensors=(FRONT,)),
    "rotation of the lidar": CalibrationRotation(angle_deg=1.0, axis="pitch", sensors="lidar"),
    "translation": CalibrationTranslation(shift_cm=5.0),
    "translation along an axis": CalibrationTranslation(shift_cm=5.0, axis="y", sensors=(FRONT,)),
    "translation of the lidar": CalibrationTranslation(shift_cm=5.0, axis="z", sensors="lidar"),
    "clicks": ClickNoise(noise_px=1.0),
    "clicks of one camera": ClickNoise(noise_px=1.0, sensors=(FRONT,)),
    "focal": FocalLength(percent=2.0),
    "focal of one camera": FocalLength(percent=-2.0, sensors=(FRONT,)),
    "shift": PixelShift(right_px=6.0, down_px=-3.0),
    "shift of one camera": PixelShift(right_px=6.0, sensors=(FRONT,)),
    "transposed": CalibrationMixup(what="transposed_rotation"),
    "degrees": CalibrationMixup(what="degrees_for_radians", sensors=(FRONT,)),
    "swapped": CalibrationMixup(what="cameras_swapped"),
    "inverse": CalibrationMixup(what="inverse", sensors=(FRONT,)),
}
RANDOM = ("rotation", "translation", "clicks", "clicks of one camera")
MIXED = ("transposed", "degrees", "swapped", "inverse")


@cache
def place(seed: int = 0) -> Place:
    return place_of(staged(size_px=(960, 600)).rig, seed)


def proof(
    told: Calibration, tellings: tuple[Telling, ...], *specs: FaultSpec, seed: int = 0
) -> tuple[Receipt, ...]:
    witness = Witness(place=place(seed), evidence=(), body=None)
    return told_receipts(faults(*specs), tellings, told, witness)


@cache
def made(*specs: FaultSpec, seed: int = 0) -> tuple[Calibration, tuple[Telling, ...]]:
    return tell(faults(*specs), place(seed))


def clean(*specs: FaultSpec, seed: int = 0) -> tuple[Receipt, ...]:
    return proof(*made(*specs, seed=seed), *specs, seed=seed)


def statuses(found: tuple[Receipt, ...]) -> set[str]:
    return {receipt.status for receipt in found}


# -- laws -------------------------------------------------------------------------------------------------


def test_every_fault_of_the_room_is_tried_here() -> None:
    """But what changes the lens as well, which has a file of its own."""
    assert {type(spec) for spec in SPECS.values()} | {Undistorted} == {f.spec for f in CALIBRATION_FAULTS}


@pytest.mark.parametrize("which", SPECS)
def test_zero_strength_is_the_identity_and_never_enters_the_set(which: str) -> None:
    spec = SPECS[which]
    if isinstance(spec, CalibrationMixup):
        zero: FaultSpec = CalibrationMixup(what="none")
    else:
        zero = type(spec).model_validate({**spec.model_dump(), **dict.fromkeys(spec.zero_when_off, 0.0)})
        assert len(FaultSet().override(parse_fault_arguments([f"{spec.name}=0"]))) == 0
    told, _ = tell(faults(zero), place())
    true = place().true
    if not isinstance(spec, ClickNoise):
        assert digest(told) == digest(true)
    for name, pose in true.T_ego_sensor.items():  # a solver comes back to the last digits
        np.testing.assert_allclose((told.T_ego_sensor[name] @ pose.inverse()).log(), 0.0, atol=1e-9)


@pytest.mark.parametrize("which", SPECS)
def test_inputs_stay_and_a_seed_repeats(which: str) -> None:
    spec, before = SPECS[which], digest(place().true)
    one, again = tell(faults(spec), place()), tell(faults(spec), place())
    assert digest(one) == digest(again) and digest(one[0]) != before == digest(place().true)
    assert (digest(tell(faults(spec), place(1))[0]) != digest(one[0])) == (which in RANDOM)


@pytest.mark.parametrize("which", SPECS)
@pytest.mark.parametrize("seed", range(5))
def test_a_clean_draw_is_ok_and_stays_a_rotation(which: str, seed: int) -> None:
    found = clean(SPECS[which], seed=seed)
    assert found and statuses(found) == {OK}, found
    for pose in made(SPECS[which], seed=seed)[0].T_ego_sensor.values():
        np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("which", SPECS)
def test_what_is_measured_is_what_was_asked_for(which: str) -> None:
    for receipt in clean(SPECS[which]):
        exact = not receipt.quantity.endswith("clicks")
        assert receipt.measured == pytest.approx(receipt.requested, rel=1e-3 if exact else 0.45, abs=1e-6)


NAMES = sorted({spec.name for spec in SPECS.values()} & {severity.fault for severity in SEVERITIES})


@pytest.mark.parametrize("name", NAMES)
def test_a_higher_severity_is_more_of_the_measured_effect(name: str) -> None:
    found = [clean(severe(name, level)) for level in range(1, 6)]
    assert all(statuses(receipts) == {OK} for receipts in found)
    for weaker, stronger in pairwise([[abs(r.measured or 0.0) for r in receipts] for receipts in found]):
        assert (np.array(stronger) > np.array(weaker)).all()


# -- mutants ----------------------------------------------------------------------------------------------


def scaled(told: Calibration, by: float) -> Calibration:
    """What was done to the calibration, so many times."""
    true = place().true
    poses = {
        name: Transform(
            rotation=(pose @ Transform.exp(by * _turn(pose, told.T_ego_sensor[name]))).rotation,
            translation_m=pose.translation_m
            + by * (told.T_ego_sensor[name].translation_m - pose.translation_m),
        )
        for name, pose in true.T_ego_sensor.items()
    }
    cameras = {
        name: replace(
            lens,
            **{
                key: getattr(lens, key) + by * (getattr(told.cameras[name], key) - getattr(lens, key))
                for key in ("fx_px", "fy_px", "cx_px", "cy_px")
            },
        )
        for name, lens in true.cameras.items()
    }
    return Calibration(T_ego_sensor=poses, cameras=cameras)


def _turn(before: Transform, after: Transform) -> np.ndarray:
    return np.concatenate([np.zeros(3), (before.inverse() @ after).log()[3:]])


FACTORS = {
    "off": 0.0, "half": 0.5, "twice": 2.0, "sign": -1.0, "deg for rad": 57.3, "rad for deg": 1 / 57.3,
    "percent for a fraction": 100.0, "a fraction for percent": 0.01, "m for cm": 1e-2,
}  # fmt: skip


@pytest.mark.parametrize("mutant", FACTORS)
@pytest.mark.parametrize("which", SPECS)
def test_what_is_told_otherwise_than_drawn_is_caught(which: str, mutant: str) -> None:
    spec = SPECS[which]
    told, tellings = made(spec)
    if isinstance(spec, FocalLength) and abs(FACTORS[mutant]) > 10.0:
        pytest.skip("no lens of negative focal length can be told")
    wrong = scaled(told, FACTORS[mutant])
    assert MISMATCH in statuses(proof(wrong, tellings, spec))


@pytest.mark.parametrize("by", [0.0, 0.5, 2.0, 1e-3])
@pytest.mark.parametrize("which", [which for which in SPECS if which not in MIXED])
def test_a_draw_of_another_size_is_caught(which: str, by: float) -> None:
    """The injector reads another strength than was asked for, and says truly what it drew."""
    spec = SPECS[which]
    other = spec.model_copy(update={field: by * getattr(spec, field) for field in spec.zero_when_off})
    assert MISMATCH in statuses(proof(*made(other), spec))


@pytest.mark.parametrize("which", SPECS)
def test_applied_twice_is_caught(which: str) -> None:
    spec, (entry,) = SPECS[which], [f for f in CALIBRATION_FAULTS if f.spec is type(SPECS[which])]
    once, tellings = made(spec)
    twice = entry.tell(spec, once, place()).calibration
    assert MISMATCH in statuses(proof(twice, tellings, spec))


@pytest.mark.parametrize("which", SPECS)
def test_an_injector_replaced_by_the_identity_is_caught(which: str) -> None:
    found = proof(place().true, (), SPECS[which])
    assert found and MISMATCH in statuses(found)


@pytest.mark.parametrize("which", [w for w, s in SPECS.items() if getattr(s, "sensors", "") == (FRONT,)])
def test_the_wrong_sensor_is_caught(which: str) -> None:
    spec = SPECS[which]
    _, tellings = made(spec)
    for sensors in ((BACK,), "cameras"):
        told, others = made(spec.model_copy(update={"sensors": sensors}))
        found = proof(told, tellings, spec)
        assert any(r.status == MISMATCH and "other" in r.quantity for r in found), found
    assert MISMATCH in statuses(proof(told, others, spec))


@pytest.mark.parametrize("which", ["rotation of the lidar", "translation of the lidar"])
def test_cameras_for_the_lidar_are_caught(which: str) -> None:
    spec = SPECS[which]
    told, tellings = made(spec.model_copy(update={"sensors": "cameras"}))
    assert len([r for r in proof(told, tellings, spec) if r.status == MISMATCH]) == 2


@pytest.mark.parametrize("what", MIXED)
def test_a_mixup_for_another_is_caught(what: str) -> None:
    spec = SPECS[what]
    for other in MIXED:
        if other != what:
            wrong = SPECS[other].model_copy(update={"sensors": getattr(spec, "sensors", "cameras")})
            told, tellings = made(wrong)
            assert MISMATCH in statuses(proof(told, tellings, spec)), other


# -- together ---------------------------------------------------------------------------------------------

TOGETHER = (
    SPECS["rotation"], SPECS["translation"], SPECS["clicks"], SPECS["focal"], SPECS["shift"],
    SPECS["swapped"],
)  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_all_of_them_compose_and_each_measures_its_own_step(seed: int) -> None:
    found = clean(*TOGETHER, seed=seed)
    assert {r.fault for r in found} == {spec.name for spec in TOGETHER} and statuses(found) == {OK}
    alone = {spec.name: clean(spec, seed=seed) for spec in TOGETHER}
    for receipt in found:
        (same,) = [r for r in alone[receipt.fault] if r.quantity == receipt.quantity]
        assert receipt.measured == pytest.approx(same.measured, abs=2e-4)
        assert receipt.realised == pytest.approx(same.realised, abs=1e-12)


@pytest.mark.parametrize("spec", TOGETHER, ids=lambda spec: spec.name)
def test_one_that_is_left_out_among_others_is_caught(spec: FaultSpec) -> None:
    rest = tuple(s for s in TOGETHER if s is not spec)
    found = proof(*made(*rest), *TOGETHER)
    assert spec.name in {r.fault for r in found if r.status == MISMATCH}


def test_a_whole_run_with_all_of_them_is_scored() -> None:
    at = staged(specs=(*TOGETHER,), duration_s=1.0, size_px=(320, 200))
    found = receipts_of(posed(at), at)
    assert {r.fault for r in found} == {spec.name for spec in TOGETHER} and statuses(found) == {OK}
    words = (
        "calibration.rotation_deg={angle_deg: 1, sensors: lidar}", "calibration.translation_cm=5",
        "calibration.click_noise_px=2", "calibration.focal_percent=1", "calibration.shift_px=3",
        "calibration.mixup=cameras_swapped",
    )  # fmt: skip
    result = run_job(
        Job(scenario="static-board", system="car", seed=0, pipelines=("static_projection",), faults=words)
    )
    assert {r.status for r in result.receipts} == {OK}, result.receipts


# -- edges ------------------------------------------------------------------------------------------------


def test_a_rig_of_one_camera_has_none_to_swap_with() -> None:
    spec, true = CalibrationMixup(what="cameras_swapped"), place().true
    one = Place(
        true=Calibration(T_ego_sensor=true.T_ego_sensor, cameras={FRONT: true.cameras[FRONT]}),
        lidar_name=place().lidar_name, seed=0,
    )  # fmt: skip
    told, tellings = tell(faults(spec), one)
    (found,) = told_receipts(faults(spec), tellings, told, Witness(place=one, evidence=(), body=None))
    assert (found.status, found.measured) == (UNVERIFIABLE, None) and "no second camera" in found.note


@pytest.mark.parametrize(
    "spec",
    [
        CalibrationTranslation(shift_cm=0.01),
        FocalLength(percent=1e-3),
        PixelShift(right_px=1e-3),
        ClickNoise(noise_px=1e-3),
    ],
    ids=lambda spec: spec.name,
)
def test_an_effect_too_small_to_detect_is_unverifiable(spec: FaultSpec) -> None:
    assert statuses(clean(spec)) == {UNVERIFIABLE}


@pytest.mark.parametrize(
    "spec",
    [
        CalibrationRotation(angle_deg=180.0, sensors="lidar"),
        CalibrationTranslation(shift_cm=-1000.0),
        FocalLength(percent=100.0),
        FocalLength(percent=-50.0),
        PixelShift(right_px=2000.0, down_px=-2000.0),
        ClickNoise(noise_px=50.0),
    ],
    ids=lambda spec: spec.name,
)
def test_the_strongest_is_no_mismatch(spec: FaultSpec) -> None:
    for seed in range(3):
        found = clean(spec, seed=seed)
        assert OK in statuses(found) and MISMATCH not in statuses(found), found


def test_more_clicks_find_a_better_pose() -> None:
    def error(boards: int) -> float:
        told, _ = made(ClickNoise(noise_px=2.0, boards=boards))
        true = place().true
        turns = [_turn(true.T_ego_sensor[name], told.T_ego_sensor[name]) for name in true.cameras]
        return float(np.mean([np.linalg.norm(turn) for turn in turns]))

    assert error(60) < error(5)


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("calibration.translation_cm=1001", "must be <= 1000"),
        ("calibration.translation_cm={axis: roll}", "allowed: random, x, y, z"),
        ("calibration.translation_cm={sensors: lidars}", "lidar"),
        ("calibration.rotation_deg={sensors: []}", "names no camera"),
        ("calibration.focal_percent=-51", "must be >= -50"),
        ("calibration.shift_px=nan", "not finite"),
        ("calibration.mixup=inverted", "inverse"),
        ("calibration.mixup=1", "allowed: none, transposed_rotation"),
        ("calibration.mixup={what: cameras_swapped, sensors: [a]}", "swaps two cameras"),
        ("calibration.click_noise_px=-1", "must not be negative"),
        ("calibration.click_noise_px={noise_px: 1, near_m: 6, far_m: 5}", "farther than near_m"),
        ("calibration.click_noise_px={noise_px: 1, boards: 2}", "must be >= 4"),
    ],
)
def test_a_bad_argument_is_refused_in_one_sentence(argument: str, says: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_fault_arguments([argument])
    assert says in str(caught.value) and str(caught.value).isprintable()


def test_a_found_calibration_keeps_what_a_fault_did_to_the_intrinsics() -> None:
    true = place().true
    found = Calibration(
        T_ego_sensor=true.T_ego_sensor,
        cameras={n: replace(c, fx_px=1.01 * c.fx_px, cx_px=c.cx_px + 2.0) for n, c in true.cameras.items()},
    )
    assert digest(on_found(true, true, found)) == digest(found)
    given, _ = made(SPECS["focal"], SPECS["shift"])
    lens = on_found(given, true, found).cameras[FRONT]
    assert lens.fx_px == pytest.approx(1.02 * 1.01 * true.cameras[FRONT].fx_px)
    assert lens.cx_px == pytest.approx(true.cameras[FRONT].cx_px + 8.0)
