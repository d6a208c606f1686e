"""How messages travel: every fault of the room by the same laws, and what each of them does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from scenarios.faults import Dropped, Duplicated, FaultSpec, Frozen, Latency, Reordered, StaleFrames
from scenarios.seeding import stream
from simbench.faults.deliver import deliver
from simbench.faults.delivery import counted
from simbench.faults.flow import times
from simbench.faults.receipt import MISMATCH
from simbench.faults.transport import DELIVERED, lost
from tests.simbench.faults.timing_laws import (
    LEFT,
    acted,
    bad,
    check_identity,
    check_mutants,
    check_pure,
    check_receipts,
    check_wrong_draw,
    drive,
    entry,
    ladder,
    receipts,
    site,
    stepped,
)
from tests.simbench.support import digest, faults

ALL: tuple[FaultSpec, ...] = (
    StaleFrames(frames=2),
    Frozen(percent=40.0),
    Dropped(percent=40.0),
    Duplicated(percent=40.0),
    Latency(latency_ms=80.0, jitter_ms=10.0),
    Reordered(percent=30.0),
)
ONE = tuple(spec.model_copy(update={"sensors": (LEFT,)}) for spec in ALL)
LIDAR = tuple(spec.model_copy(update={"sensors": "lidar"}) for spec in ALL[2:])
MORE = (
    Dropped(percent=40.0, burst_frames=3.0),
    Dropped(percent=100.0),
    Latency(latency_ms=80.0),
    Latency(jitter_ms=30.0),
    Duplicated(percent=100.0, after_ms=150.0),
)
EVERY = (*ALL, *ONE, *LIDAR, *MORE)


def name_of(spec: FaultSpec) -> str:
    return f"{spec.name}-{spec.sensors if isinstance(spec.sensors, str) else spec.sensors[0]}"  # type: ignore[attr-defined]


def test_the_room_is_covered() -> None:
    assert {type(spec) for spec in ALL} == {fault.spec for fault in DELIVERED}


@pytest.mark.parametrize("spec", ALL, ids=name_of)
def test_zero_is_the_identity(spec: FaultSpec) -> None:
    check_identity(spec)


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_a_fault_leaves_its_input_and_repeats_itself(spec: FaultSpec) -> None:
    check_pure(spec)


@pytest.mark.parametrize("spec", [*ALL[1:], MORE[0]], ids=name_of)
def test_another_seed_draws_otherwise(spec: FaultSpec) -> None:
    assert digest(acted(spec).delivery) != digest(acted(spec, seed=1).delivery)


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_clean_draws_are_proved(spec: FaultSpec) -> None:
    check_receipts(spec)


WEAKER = [s for s in EVERY if getattr(s, s.strength) not in (0.0, 100.0)]


@pytest.mark.parametrize("spec", WEAKER, ids=name_of)
def test_a_wrong_injector_is_caught(spec: FaultSpec) -> None:
    check_mutants(spec)


@pytest.mark.parametrize("spec", [ALL[0], ALL[4], ONE[0], MORE[2]], ids=name_of)
def test_a_draw_that_was_not_asked_for_is_caught(spec: FaultSpec) -> None:
    check_wrong_draw(spec)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("timing.stale_frames", "delay"),
        ("timing.frozen_percent", "frozen"),
        ("timing.dropped_percent", "all sensors lost"),
        ("timing.duplicated_percent", "all sensors twice"),
        ("timing.latency_ms", "mean latency"),
        ("timing.reordered_percent", "all sensors overtaken"),
    ],
)
def test_a_higher_severity_is_more(name: str, quantity: str) -> None:
    found = ladder(name, quantity)
    assert all(weaker <= stronger for weaker, stronger in pairwise(found)) and found[0] < found[-1]


def test_every_fault_of_the_room_at_once_is_proved() -> None:
    delivered, steps = deliver(drive().measured, faults(*ALL), site())
    assert [step.spec.name for step in steps] == [fault.spec.name for fault in DELIVERED]
    for step in steps:
        assert not bad(entry(step.spec).receipts(step.spec, step, site()))
    for shots in delivered.shots.values():
        assert [shot.detections.seq for shot in shots] == list(range(len(shots)))
        assert [shot.truth.seq for shot in shots] == list(range(len(shots)))


def test_bursts_have_the_length_and_the_share_that_were_asked_for() -> None:
    gone = lost(Dropped(percent=20.0, burst_frames=4.0), 200_000, stream(0, "test")).astype(int)
    assert gone.mean() == pytest.approx(0.2, rel=0.03)
    assert gone.sum() / np.sum(np.diff(gone) == 1) == pytest.approx(4.0, rel=0.03)
    alone = lost(Dropped(percent=20.0), 200_000, stream(0, "test")).astype(int)
    assert alone.sum() / np.sum(np.diff(alone) == 1) == pytest.approx(1.25, rel=0.03)


def test_losses_one_by_one_instead_of_bursts_are_caught() -> None:
    spec = Dropped(percent=40.0, burst_frames=8.0)
    honest = stepped(spec)
    alone = acted(Dropped(percent=40.0)).delivery
    step = type(honest)(spec=spec, before=honest.before, after=alone, realised=honest.realised)
    assert any(r.quantity.endswith("burst") and r.status == MISMATCH for r in receipts(step))


def test_a_late_network_keeps_the_order() -> None:
    after = acted(Latency(latency_ms=50.0, jitter_ms=40.0)).delivery
    for name in after.shots:
        was, now = (times(d, site().rig, name) for d in (drive().measured, after))
        assert (np.diff(now.arrival_ns) > 0).all()
        assert (now.arrival_ns - was.arrival_ns >= 50_000_000).all()


def test_a_message_held_back_comes_just_after_its_successor() -> None:
    after = counted(acted(Reordered(percent=30.0)).delivery)
    for shots in after.shots.values():
        stamps = [shot.stamp_ns for shot in sorted(shots, key=lambda s: s.detections.seq)]
        back = [i for i, (a, b) in enumerate(pairwise(stamps)) if b < a]
        assert back and all(j - i > 1 for i, j in pairwise(back))
        arrivals = [shot.arrival_ns for shot in sorted(shots, key=lambda s: s.detections.seq)]
        assert all(arrivals[i + 1] - arrivals[i] == 1_000_000 for i in back)


def test_a_frozen_camera_shows_the_frame_before_with_its_truth() -> None:
    after = acted(Frozen(percent=40.0)).delivery
    for name, shots in after.shots.items():
        before = drive().measured.shots[name]
        assert shots[0].truth.capture_ns == before[0].truth.capture_ns
        for i, (shot, was) in enumerate(zip(shots, before, strict=True)):
            assert (shot.stamp_ns, shot.arrival_ns) == (was.stamp_ns, was.arrival_ns)
            fresh = shot.truth.capture_ns == was.truth.capture_ns
            source = was if fresh else shots[i - 1]
            assert shot.detections.boxes == source.detections.boxes
            assert shot.truth.detection_object_id == source.truth.detection_object_id


def test_boxes_that_do_not_freeze_with_their_truth_are_caught() -> None:
    """The message lies about what its truth shows."""
    from dataclasses import replace

    honest = stepped(Frozen(percent=40.0))
    mixed = {
        name: tuple(
            replace(shot, detections=was.detections)
            for shot, was in zip(shots, honest.before.shots[name], strict=True)
        )
        for name, shots in honest.after.shots.items()
    }
    assert bad(receipts(replace(honest, after=replace(honest.after, shots=mixed))))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"percent": 40.0, "burst_frames": 0.5}, "at least 1 frame"),
        ({"percent": 80.0, "burst_frames": 2.0}, "too short for a loss of 80 %"),
        ({"percent": 100.0, "burst_frames": 5.0}, "too short for a loss of 100 %"),
        ({"percent": 101.0}, "less than or equal to 100"),
        ({"sensors": "radar"}, "lidar"),
    ],
)
def test_what_cannot_be_lost_is_refused(fields: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        Dropped.model_validate(fields)
