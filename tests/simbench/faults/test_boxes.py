"""Faults of the delivered boxes: one list of them, and every law asked of each."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from pydantic import ValidationError

from scenarios.faults import FaultSpec
from scenarios.faults.detector import (
    BoxLag,
    ClassConfusion,
    FalseBoxes,
    HardMisses,
    IdentitySwitches,
    Merged,
    Misses,
    Split,
)
from scenarios.severity import severe
from simbench.faults.box_hard_misses import hardness
from simbench.faults.deliver import deliver
from simbench.faults.fault import Acted
from simbench.faults.receipt import OK, UNVERIFIABLE
from simbench.truth import TrueBox
from tests.simbench.faults.laws import (
    Case,
    act,
    clean,
    entry,
    mismatches,
    other,
    receipts,
    scaled,
    site,
)
from tests.simbench.support import digest, faults

FRONT, BACK = ("cam-front",), ("cam-back",)
CASES = [
    Case(Misses(percent=40.0), scaled(Misses(percent=40.0), 0.01, 0.5, 2.0)),
    Case(
        Misses(percent=40.0, burst_frames=5.0),
        (*scaled(Misses(percent=40.0, burst_frames=5.0), 0.01, 0.5, 2.0), Misses(percent=40.0)),
    ),
    Case(HardMisses(percent=60.0), scaled(HardMisses(percent=60.0), 0.01, 0.5, 1.6)),
    Case(
        HardMisses(percent=60.0, by="size"),
        (HardMisses(percent=60.0, by="visibility"), HardMisses(percent=60.0, half_height_px=200.0)),
    ),
    Case(FalseBoxes(boxes_per_image=1.0), scaled(FalseBoxes(boxes_per_image=1.0), 0.01, 0.5, 2.0)),
    Case(IdentitySwitches(per_s=4.0), scaled(IdentitySwitches(per_s=4.0), 1e-3, 0.5, 2.0)),
    Case(
        IdentitySwitches(per_s=4.0, mode="fresh"),
        scaled(IdentitySwitches(per_s=4.0, mode="fresh"), 1e-3, 0.5, 2.0),
    ),
    Case(ClassConfusion(percent=40.0), scaled(ClassConfusion(percent=40.0), 0.01, 0.5, 2.0)),
    Case(BoxLag(lag_frames=0.4), scaled(BoxLag(lag_frames=0.4), -1.0, 0.01, 0.5, 2.0, 100.0)),
    Case(Merged(percent=40.0), scaled(Merged(percent=40.0), 0.01, 0.5, 2.0)),
    Case(Split(percent=40.0), scaled(Split(percent=40.0), 0.01, 0.5, 2.0)),
]
NAMES = [f"{case.spec.name}-{k}" for k, case in enumerate(CASES)]
SPECS = pytest.mark.parametrize("case", CASES, ids=NAMES)
ALL = tuple({type(case.spec): case.spec for case in reversed(CASES)}.values())


@SPECS
def test_zero_strength_is_the_identity_and_never_enters_a_set(case: Case) -> None:
    (zero,) = scaled(case.spec, 0.0)
    before = clean()
    assert digest(act(zero, before, site()).delivery.shots) == digest(before.shots)
    assert zero.is_off and deliver(before, faults(), site()) == (before, ())


@SPECS
def test_inputs_stay_and_draws_repeat(case: Case) -> None:
    before = clean()
    was = digest(before.shots)
    once, again = act(case.spec, before, site()), act(case.spec, before, site())
    assert digest(before.shots) == was
    assert digest(once.delivery.shots) == digest(again.delivery.shots) != was
    if not isinstance(case.spec, BoxLag):  # which draws nothing
        assert digest(act(case.spec, before, site(1)).delivery.shots) != digest(once.delivery.shots)


@SPECS
@pytest.mark.parametrize("seed", range(5))
def test_a_clean_draw_is_ok(case: Case, seed: int) -> None:
    found = receipts(case.spec, clean(), act(case.spec, clean(), site(seed)), site(seed))
    assert {r.status for r in found} == {OK}, found
    assert found[0].measured == pytest.approx(found[0].realised)


@SPECS
def test_an_injector_that_acts_otherwise_is_caught(case: Case) -> None:
    before, place = clean(), site()
    honest = act(case.spec, before, place)
    for mutant in (*scaled(case.spec, 0.0), *case.mutants):
        acted = act(mutant, before, place)
        in_the_world = replace(honest, delivery=acted.delivery)
        assert mismatches(receipts(case.spec, before, in_the_world, place)), mutant
        assert mismatches(receipts(case.spec, before, acted, place)), mutant


@SPECS
def test_an_injector_that_acts_twice_is_caught(case: Case) -> None:
    before = clean()
    once = act(case.spec, before, site())
    twice = act(case.spec, once.delivery, site())
    if digest(twice.delivery.shots) != digest(once.delivery.shots):  # else the second time does nothing
        assert mismatches(receipts(case.spec, before, replace(once, delivery=twice.delivery), site()))
    anew = act(case.spec, once.delivery, site(1))
    assert mismatches(receipts(case.spec, before, replace(once, delivery=anew.delivery), site()))


@SPECS
def test_the_wrong_camera_is_caught(case: Case) -> None:
    before, place = clean(), site()
    front = other(case.spec, sensors=FRONT)
    honest, wrong = act(front, before, place), act(other(case.spec, sensors=BACK), before, place)
    assert not mismatches(receipts(front, before, honest, place))
    assert (
        len(
            mismatches(
                receipts(front, before, Acted(delivery=wrong.delivery, realised=honest.realised), place)
            )
        )
        >= 2
    )
    everywhere = replace(honest, delivery=act(case.spec, before, place).delivery)
    assert "changed images of the other cameras" in mismatches(receipts(front, before, everywhere, place))


@pytest.mark.parametrize("kind", [type(spec) for spec in ALL])
def test_more_of_a_fault_is_more_of_its_effect(kind: type[FaultSpec]) -> None:
    measured = []
    for level in range(1, 6):
        spec = severe(kind.name, level)
        found = receipts(spec, clean(), act(spec, clean(), site()), site())
        assert not mismatches(found)
        measured.append(found[0].measured)
    rises = np.diff(np.array(measured, dtype=float))
    assert (rises >= 0.0).all() and (rises[2:] > 0.0).all(), measured


def test_all_together_keep_their_receipts_and_their_draws() -> None:
    place = site()
    delivered, steps = deliver(clean(), faults(*ALL), place)
    assert len(steps) == len(ALL)
    for step in steps:
        found = entry(step.spec).receipts(step.spec, step, place)
        assert {r.status for r in found} == {OK}, found
    for shots in delivered.shots.values():
        for shot in shots:
            assert len(shot.detections.boxes) == len(shot.truth.detection_object_id)
            tracks = [box.track_id for box in shot.detections.boxes]
            assert len(set(tracks)) == len(tracks)


@pytest.mark.parametrize(
    ("by", "height_px", "visible", "hard"),
    [
        ("size", 40.0, 0.5, 0.5),  # as high as half_height_px
        ("size", 20.0, 1.0, 0.8),  # half as high: 1 / (1 + 1/4)
        ("size", 120.0, 1.0, 0.1),  # three times as high: 1 / (1 + 9)
        ("visibility", 20.0, 1.0, 0.0),  # nothing of it hidden
        ("visibility", 500.0, 0.25, 0.75),
        ("either", 40.0, 0.4, 0.8),  # found with 0.5 * 0.4
    ],
)
def test_how_hard_a_box_is_to_see_by_hand(
    by: Literal["either", "size", "visibility"], height_px: float, visible: float, hard: float
) -> None:
    box = TrueBox(
        object_id=0, amodal_px=(0.0, 0.0, 9.0, 9.0), visible_px=(5.0, 7.0, 9.0, 7.0 + height_px),
        visible_fraction=visible,
    )  # fmt: skip
    assert hardness(HardMisses(by=by, half_height_px=40.0), box) == pytest.approx(hard)


def test_as_many_misses_that_come_evenly_are_not_those_of_what_is_hard_to_see() -> None:
    spec, before = HardMisses(percent=70.0), clean()
    honest = act(spec, before, site())
    boxes = [
        sum(len(shot.detections.boxes) for shots in delivery.shots.values() for shot in shots)
        for delivery in (before, honest.delivery)
    ]
    even = act(Misses(percent=100.0 * (1.0 - boxes[1] / boxes[0])), before, site()).delivery
    found = mismatches(receipts(spec, before, replace(honest, delivery=even), site()))
    assert {"missed of the harder ones", "missed of the easier ones"} <= set(found)


def test_without_boxes_nothing_is_claimed() -> None:
    before = clean()
    empty = replace(
        before,
        shots={
            name: tuple(
                replace(
                    shot,
                    detections=replace(shot.detections, boxes=()),
                    truth=replace(shot.truth, detection_object_id=()),
                )
                for shot in shots
            )
            for name, shots in before.shots.items()
        },
    )
    for case in CASES:
        if not isinstance(case.spec, FalseBoxes):
            first = receipts(case.spec, empty, act(case.spec, empty, site()), site())[0]
            assert first.status == UNVERIFIABLE and first.note


def test_a_merged_box_is_the_larger_objects_and_a_split_box_stays_its_own() -> None:
    for spec in (Merged(percent=100.0), Split(percent=100.0)):
        after = act(spec, clean(), site()).delivery
        for was, now in zip(clean().shots["cam-front"], after.shots["cam-front"], strict=True):
            before = set(was.truth.detection_object_id)
            assert set(now.truth.detection_object_id) <= before
            if isinstance(spec, Split):
                assert len(now.detections.boxes) == 2 * len(was.detections.boxes)


@pytest.mark.parametrize(
    ("kind", "fields", "says"),
    [
        (Misses, {"percent": 101.0}, "less than or equal to 100"),
        (Misses, {"percent": -1.0}, "greater than or equal to 0"),
        (Misses, {"percent": 10.0, "burst_frames": 0.5}, "at least 1"),
        (Misses, {"percent": 90.0, "burst_frames": 2.0}, "too short for bursts"),
        (HardMisses, {"half_height_px": 0.0}, "greater than 0"),
        (HardMisses, {"by": "colour"}, "'either', 'size' or 'visibility'"),
        (FalseBoxes, {"boxes_per_image": float("inf")}, "finite"),
        (IdentitySwitches, {"per_s": 6.0}, "less than or equal to 5"),
        (IdentitySwitches, {"per_s": 1.0, "mode": "swop"}, "'swap' or 'fresh'"),
        (BoxLag, {"lag_frames": 1.5}, "less than or equal to 1"),
        (Merged, {"near_fraction": -1.0}, "greater than or equal to 0"),
        (Split, {"sensors": ()}, "names no camera"),
    ],
)
def test_bad_input_is_refused(kind: type[FaultSpec], fields: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        kind(**fields)
