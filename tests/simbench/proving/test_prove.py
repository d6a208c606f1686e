"""Faults of the catalogue are proved; and a proof fails where something is wrong."""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import norm

from scenarios.faults import FAULTS, ClockOffset, FaultSpec
from scenarios.severity import severe
from simbench.cli import main
from simbench.faults import transport
from simbench.faults.fault import Acted
from simbench.faults.receipt import Receipt, judge
from simbench.proving import places
from simbench.proving.mutants import by, mutants, signed
from simbench.proving.prove import Proof, levels_of, prove, scatters
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


# -- what an estimator says of itself ---------------------------------------------------------------------


def receipts_of(errors: np.ndarray, sd: float, systematic: float = 0.0, quantity: str = "q") -> list[Receipt]:
    return [
        judge(
            fault="f", quantity=quantity, unit="u", requested=10.0, realised=10.0, measured=10.0 + float(e),
            estimator_sd=sd, systematic=systematic, allowed=0.1,
        )
        for e in errors
    ]  # fmt: skip


def scattered(z_sd: float, n: int, z_mean: float = 0.0) -> np.ndarray:
    """Errors of SD 1 as they fall, times z_sd."""
    return z_mean + z_sd * norm.ppf((np.arange(n) + 0.5) / n)


@pytest.mark.parametrize(
    ("z_sd", "z_mean", "n", "holds"),
    [
        (1.0, 0.0, 100, True),
        (0.3, 0.0, 100, False),  # better than it says
        (1.6, 0.0, 100, False),
        (1.25, 0.0, 100, True),  # within 5 / sqrt(200) = 0.35
        (1.25, 0.0, 5000, False),
        (0.75, 0.0, 5000, False),
        (1.15, 0.15, 5000, True),
        (1.0, 0.3, 5000, False),
        (1.0, 0.3, 100, True),  # within 5 / sqrt(100) = 0.5
        (1.0, 0.6, 100, False),
        (0.0, 0.0, 100, False),  # exact, and says otherwise
        (0.3, 0.0, 10, True),  # ten draws tell nothing
    ],
)
def test_z_has_mean_0_and_sd_1_or_the_estimator_is_not_what_it_says(
    z_sd: float, z_mean: float, n: int, holds: bool
) -> None:
    (found,), bounded = scatters(receipts_of(0.2 * scattered(z_sd, n, z_mean), sd=0.2))
    assert not bounded and found.n == n
    assert found.mean == pytest.approx(z_mean, abs=1e-9) and found.sd == pytest.approx(z_sd, rel=0.05)
    assert found.holds is holds


def test_two_quantities_that_are_wrong_in_opposite_ways_are_not_right_together() -> None:
    both = [
        *receipts_of(scattered(0.4, 200), 1.0, quantity="a"),
        *receipts_of(scattered(1.36, 200), 1.0, quantity="b"),
    ]
    proof = replace(A_PROOF, errs=scatters(both)[0])
    assert proof.z_sd == pytest.approx(1.0, abs=0.02) and not proof.z_holds and not proof.good
    said = list(failures(proof))
    assert len(said) == 2 and "the estimator of 'a' errs otherwise than it says" in said[0]


@pytest.mark.parametrize(
    ("sd", "systematic", "word"), [(0.0, 0.0, "exact"), (0.0, 0.3, "exact"), (0.1, 0.6, "bounded")]
)
def test_what_does_not_err_by_chance_has_no_z(sd: float, systematic: float, word: str) -> None:
    errs, bounded = scatters(receipts_of(np.zeros(50), sd, systematic))
    proof = replace(A_PROOF, errs=errs, bounded=bounded)
    assert not errs and proof.z_mean is None and proof.z_holds
    assert f"{word}  {word}" in " ".join(lines((proof,))).replace("   ", "  ")


def test_a_bound_of_less_than_five_sd_does_not_excuse_from_z() -> None:
    (found,), _ = scatters(receipts_of(scattered(0.3, 100), 1.0, systematic=4.0))
    assert not found.holds


def test_the_table_prints_the_mean_and_the_sd_of_z() -> None:
    errs, _ = scatters(receipts_of(scattered(1.1, 400, z_mean=0.12), 1.0))
    row = list(lines((replace(A_PROOF, errs=errs),)))[1]
    assert "+0.120  1.10" in row


A_PROOF = Proof(
    fault="f", tried=(), draws=100, receipts=100, verified=100, bad=0, off_draw=(), errs=(), bounded=0,
    effects=(), rises=None,
)  # fmt: skip


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
