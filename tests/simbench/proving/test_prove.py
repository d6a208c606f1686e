"""Faults of the catalogue are proved; and a proof fails where something is wrong."""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner

from scenarios.faults import FAULTS, ClockOffset, FaultSpec
from scenarios.severity import severe
from simbench.cli import main
from simbench.faults import transport
from simbench.faults.fault import Acted
from simbench.proving import places
from simbench.proving.mutants import by, mutants, signed
from simbench.proving.prove import Proof, levels_of, prove
from simbench.proving.same import same
from simbench.proving.table import failures, lines

KINDS = {"off", "half", "double", "sign", "sensor", "unit", "twice"}
CAMERAS = ("cam-front", "cam-back")


# Some of every family and every place where faults act. All of them: simbench doctor --faults --quick.
SOME = (
    "calibration.rotation_deg", "calibration.undistorted_px", "camera.exposure_ev", "detector.misses_percent",
    "lidar.ghosts_percent", "motion.knock_deg", "motion.trace", "reference.heading_deg",
    "timing.clock_offset_ms", "timing.reordered_percent", "timing.trigger_angle_deg",
)  # fmt: skip


@pytest.mark.parametrize("fault", SOME)
def test_a_fault_of_the_catalogue_is_proved(fault: str) -> None:
    proof = prove(fault, draws=3)
    assert proof.good, list(failures(proof))
    assert {tried.kind for tried in proof.tried} >= {"off"}
    said = "\n".join(lines((proof,)))
    assert "FAILED" not in said and "1 of 1 faults are proved" in said


def test_a_signed_fault_of_named_sensors_has_all_seven_mutants() -> None:
    found = list(mutants(severe("timing.clock_offset_ms", 4), CAMERAS))
    assert {mutant.kind for mutant in found} == KINDS
    assert {mutant.name for mutant in found if mutant.kind == "unit"} == {"s for ms", "us for ms"}


def test_a_mutant_differs_from_what_was_asked_for() -> None:
    for name in FAULTS:
        for mutant in mutants(levels_of(name)[-1], CAMERAS):
            assert mutant.specs != (mutant.honest,), (name, mutant)


def test_only_a_strength_below_0_has_a_sign() -> None:
    assert signed(ClockOffset()) and not signed(severe("timing.latency_ms", 1))
    assert by(ClockOffset(offset_ms=20.0), -1.0) == ClockOffset(offset_ms=-20.0)


# -- what a proof must notice -----------------------------------------------------------------------------


def proved_with(act: object, fault: str = "timing.clock_offset_ms") -> Proof:
    """The proof of a fault whose injector is another one."""
    entry = next(f for f in places.DELIVERY_FAULTS if f.spec is FAULTS[fault])
    others = tuple(f for f in places.DELIVERY_FAULTS if f is not entry)
    with mock.patch.object(places, "DELIVERY_FAULTS", (*others, replace(entry, act=act))):
        return prove(fault, draws=3)


def test_an_injector_that_does_nothing_is_not_proved() -> None:
    proof = proved_with(lambda spec, delivery, site: Acted(delivery=delivery, realised={}))
    assert (
        not proof.good and not proof.verified and proof.bad == proof.receipts - 3
    )  # spared sensors are right


def test_an_injector_of_half_the_strength_is_not_proved() -> None:
    entry = next(f for f in places.DELIVERY_FAULTS if f.spec is ClockOffset)
    proof = proved_with(lambda spec, delivery, site: entry.act(by(spec, 0.5), delivery, site))
    assert not proof.good and proof.bad


def test_a_receipt_that_sees_nothing_is_not_proved() -> None:
    """A blind receipt repeats what was asked for."""
    entry = next(f for f in places.DELIVERY_FAULTS if f.spec is ClockOffset)

    def blind(spec: FaultSpec, step: object, site: object) -> object:
        honest = entry.act(severe("timing.clock_offset_ms", 4), step.before, site)  # type: ignore[attr-defined]
        right = replace(step, after=honest.delivery, realised=honest.realised)  # type: ignore[type-var]
        return entry.receipts(spec, right, site)

    others = tuple(f for f in places.DELIVERY_FAULTS if f is not entry)
    with mock.patch.object(places, "DELIVERY_FAULTS", (*others, replace(entry, receipts=blind))):
        proof = prove("timing.clock_offset_ms", draws=2)
    assert not proof.good and "off: off" in proof.missed
    assert any("no receipt sees the mutant 'off: off'" in why for why in failures(proof))


def test_draws_of_another_strength_show_in_their_mean() -> None:
    """Each alone is a lucky draw; together they are not."""
    entry = next(f for f in transport.DELIVERED if f.spec.name == "timing.dropped_percent")
    proof = proved_with(
        lambda spec, delivery, site: entry.act(by(spec, 0.6), delivery, site), "timing.dropped_percent"
    )
    assert not proof.good and proof.off_draw


def test_same_compares_to_the_byte() -> None:
    one = {"a": (np.array([1.0, -0.0]), 3)}
    assert same(one, {"a": (np.array([1.0, -0.0]), 3)})
    assert not same(one, {"a": (np.array([1.0, 0.0]), 3)})
    assert not same(one, {"a": (np.array([1.0, -0.0], dtype=np.float32), 3)})
    assert not same(one, {"b": (np.array([1.0, -0.0]), 3)}) and not same((1,), (1, 2)) and not same(1, 1.0)


# -- the command ------------------------------------------------------------------------------------------


def test_doctor_prints_the_table_of_the_named_faults() -> None:
    done = CliRunner().invoke(main, ["doctor", "--faults", "--draws", "2", "--jobs", "1", "reference.lag_ms"])
    assert done.exit_code == 0
    assert "1 of 1 faults are proved" in done.stdout and "6 of 6" in done.stdout


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["doctor", "--faults", "timing.clock_ofset_ms"], "did you mean 'timing.clock_offset_ms'"),
        (["doctor", "--quick"], "go with --faults"),
    ],
)
def test_bad_words_cost_one_sentence(words: list[str], says: str) -> None:
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 2 and says.lower() in done.output.lower() + str(done.exception).lower()
