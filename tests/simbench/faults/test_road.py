"""motion.road: what it draws, what its receipts say, and the mutants that they catch."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest

from scenarios.errors import BadInput
from scenarios.faults import RoadEvent, RoadShake, TriggerOffset
from scenarios.severity import severe
from simbench.capture import Captured
from simbench.dynamics.ride import Ride
from simbench.faults.draw import Drawn, shake_words
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt
from simbench.stage import Stage
from tests.simbench.support import Lie, bytes_of, digest, drawn_for, posed, receipts_of, recorded, staged

BUMP = RoadEvent(kind="bump", at_m=8.0, height_m=0.08, length_m=0.9)
SPECS = {
    "class C": RoadShake(roughness="C"),
    "bump": RoadShake(events=(BUMP,)),
    "class B and bump": RoadShake(roughness="B", events=(BUMP.model_copy(update={"track": "left"}),)),
}


@cache
def scene(which: str, system: str = "car") -> Stage:
    return staged(system, specs=(SPECS[which],), duration_s=1.5)


@cache
def honest(which: str, system: str = "car") -> Drawn:
    """What the scene's seed draws."""
    return drawn_for(scene(which, system))


@cache
def clean(which: str, system: str = "car") -> Captured:
    return recorded_with(honest(which, system), scene(which, system))


def recorded_with(drawn: Drawn, at: Stage) -> Captured:
    with mock.patch("simbench.capture.draw", lambda *_: drawn):
        return posed(at)


def told(which: str, mutate: Callable[[Drawn], Drawn], system: str = "car") -> Lie:
    """A recording of the scene with a mutated injector."""
    drawn = honest(which, system)
    return Lie(captured=recorded_with(mutate(drawn), scene(which, system)), honest=drawn)


def ride_of(drawn: Drawn) -> Ride:
    assert isinstance(drawn.body_shake, Ride)
    return drawn.body_shake


def scaled(drawn: Drawn, by: float) -> Drawn:
    ride = ride_of(drawn)
    return replace(drawn, body_shake=replace(ride, mount=by * ride.mount))


def bad(found: tuple[Receipt, ...]) -> set[str]:
    return {receipt.quantity for receipt in found if receipt.status == MISMATCH}


def test_a_smooth_road_without_events_changes_no_byte() -> None:
    """Past the fault set, which would leave it out: the injector itself runs."""
    at, still = staged(specs=(RoadShake(),), duration_s=0.5), staged(duration_s=0.5)
    assert bytes_of(recorded(at).recording) == bytes_of(recorded(still).recording)
    assert MISMATCH not in {receipt.status for receipt in receipts_of(recorded(at), at)}


def test_a_ride_moves_the_sensors_and_leaves_script_and_noise_alone() -> None:
    rough = staged(specs=(RoadShake(roughness="C"),))
    ridden, still = (bytes_of(recorded(at).recording) for at in (rough, staged()))
    assert {part for part in still if ridden[part] == still[part]} >= {"truth", "calibration", "categories"}
    assert {"scans", "boxes", "ego motion", "poses"} <= {p for p in still if ridden[p] != still[p]}


@pytest.mark.parametrize("system", ["car", "wearable"])
@pytest.mark.parametrize("which", SPECS)
def test_a_clean_ride_is_ok(which: str, system: str) -> None:
    found = receipts_of(clean(which, system), scene(which, system))
    assert {receipt.status for receipt in found} == {OK}, found
    assert {receipt.fault for receipt in found} == {"motion.road"}
    axes = {"pitch RMS", "heave RMS"} | ({"roll RMS"} if system == "car" and which != "bump" else set())
    road = set() if which == "bump" else {"roughness Gd(0.1 cycles/m)"}
    assert {receipt.quantity for receipt in found} == axes | road


@pytest.mark.parametrize(
    ("mutant", "by"),
    [
        ("off", 0.0), ("half", 0.5), ("twice", 2.0), ("sign", -1.0),
        ("deg for rad", 180.0 / np.pi), ("rad for deg", np.pi / 180.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("which", ["class C", "bump"])
def test_a_ride_that_acts_otherwise_than_integrated_is_caught(which: str, mutant: str, by: float) -> None:
    at, wrong = scene(which), told(which, lambda drawn: scaled(drawn, by))
    assert bad(receipts_of(wrong.in_the_world, at)) >= {"pitch RMS", "heave RMS"}
    if mutant != "sign" or which != "bump":  # the opposite of a bump has the size of one
        assert bad(receipts_of(wrong.in_the_draw, at))


@pytest.mark.parametrize("system", ["car", "wearable"])
@pytest.mark.parametrize("which", SPECS)
def test_a_road_that_is_not_applied_is_caught(which: str, system: str) -> None:
    at, wrong = scene(which, system), told(which, lambda drawn: replace(drawn, body_shake=None), system)
    assert "pitch RMS" in bad(receipts_of(wrong.in_the_world, at))
    (receipt,) = receipts_of(wrong.in_the_draw, at)
    assert receipt.status == MISMATCH and receipt.realised == 0.0


@pytest.mark.parametrize("other", ["B", "D"])
def test_a_road_of_another_class_than_asked_for_is_caught(other: str) -> None:
    at = scene("class C")
    spec = RoadShake.model_validate({"roughness": other})
    drawn = drawn_for(staged(specs=(spec,), duration_s=1.5))
    wrong = told("class C", lambda _: drawn)
    for captured in (wrong.in_the_draw, wrong.in_the_world):
        assert "roughness Gd(0.1 cycles/m)" in bad(receipts_of(captured, at))


def test_another_seeds_road_is_caught() -> None:
    at = scene("class C")
    other = drawn_for(at, 5)
    wrong = told("class C", lambda _: other)
    assert "pitch RMS" in bad(receipts_of(wrong.in_the_world, at))


def test_rolling_instead_of_pitching_is_caught() -> None:
    at = scene("class C")

    def turned(drawn: Drawn) -> Drawn:
        ride = ride_of(drawn)
        return replace(drawn, body_shake=replace(ride, mount=ride.mount[:, [1, 0, 2, 3]]))

    wrong = told("class C", turned)
    assert bad(receipts_of(wrong.in_the_world, at)) >= {"roll RMS", "pitch RMS"}
    assert "roughness Gd(0.1 cycles/m)" in bad(receipts_of(wrong.in_the_draw, at))


@pytest.mark.parametrize("system", ["car", "wearable"])
@pytest.mark.parametrize("duration_s", [0.3, 0.6, 1.0])
def test_a_short_ride_is_no_mismatch(system: str, duration_s: float) -> None:
    for roughness in ("A", "E"):
        spec = RoadShake.model_validate({"roughness": roughness})
        at = staged(system, 1, specs=(spec,), duration_s=duration_s)
        assert not bad(receipts_of(posed(at, 1), at))


def test_a_car_that_stands_on_a_rough_road_proves_nothing() -> None:
    at = staged(scenario="static-board", specs=(RoadShake(roughness="E"),), duration_s=1.0)
    found = receipts_of(posed(at), at)
    assert {receipt.status for receipt in found} == {UNVERIFIABLE}, found


def test_measured_less_realised_is_within_the_published_errors() -> None:
    z: dict[str, list[float]] = defaultdict(list)
    for seed in range(6):
        system = "car" if seed % 2 == 0 else "wearable"
        at = staged(system, seed, specs=(RoadShake(roughness="B"),), duration_s=2.0)
        for receipt in receipts_of(posed(at, seed), at):
            assert receipt.measured is not None and receipt.status != MISMATCH, receipt
            error = receipt.measured - receipt.realised
            if receipt.systematic > 5.0 * receipt.estimator_sd:
                assert abs(error) <= receipt.systematic, receipt
                continue
            z[receipt.quantity].append(error / receipt.estimator_sd)
    assert set(z) == {"roll RMS", "pitch RMS"}  # by the gyro, whose noise is known
    for quantity, scores in z.items():
        assert 0.4 < np.sqrt(np.mean(np.square(scores))) < 1.8, (quantity, scores)


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_each_severity_shakes_more_than_the_one_before(system: str) -> None:
    measured = []
    for level in range(1, 6):
        at = staged(system, specs=(severe("motion.road", level),), duration_s=1.0)
        found = receipts_of(posed(at), at)
        assert not bad(found)
        measured.append([receipt.measured for receipt in found])
    for weaker, stronger in pairwise(np.array(measured, dtype=float)):
        assert (stronger > weaker).all()


def test_the_ride_reaches_as_far_as_late_and_early_cameras_look() -> None:
    for offset_ms in (-1000.0, 1000.0):
        at = staged(specs=(RoadShake(roughness="A"), TriggerOffset(offset_ms=offset_ms)), duration_s=1.0)
        assert not bad(receipts_of(posed(at), at))


def test_a_draw_repeats_and_differs_from_seed_to_seed_and_stays_whatever_else_is_on() -> None:
    at = scene("class C")
    assert digest(honest("class C")) == digest(drawn_for(at, 0)) != digest(drawn_for(at, 1))
    also = staged(specs=(SPECS["class C"], TriggerOffset(offset_ms=50.0)), duration_s=1.5)
    one, two = ride_of(honest("class C")), ride_of(drawn_for(also))
    n = min(len(one.mount), len(two.mount)) - 2  # late cameras need a longer ride
    np.testing.assert_allclose(one.mount[:n], two.mount[:n], atol=1e-12)


def test_a_fall_is_bad_input_in_one_sentence() -> None:
    kerb = RoadEvent(kind="kerb", at_m=6.0, height_m=0.3, length_m=3.0)
    with pytest.raises(BadInput, match=r"^motion.road: the e-scooter does not stay upright.*lower events\.$"):
        drawn_for(staged("wearable", specs=(RoadShake(events=(kerb,)),)))


@pytest.mark.parametrize(
    ("which", "says"),
    [
        ("class C", "a car on ISO 8608 road class C, integrated"),
        ("bump", "a car on a smooth road and 1 event, integrated"),
    ],
)
def test_a_ride_is_told_in_words(which: str, says: str) -> None:
    words = shake_words(honest(which), scene(which).faults, 1.5)
    assert words.endswith(says)
    for part in ("pitch 0.", "deg RMS (", "deg/s)", "roll ", "heave ", " mm, ", " Hz: "):
        assert part in words
