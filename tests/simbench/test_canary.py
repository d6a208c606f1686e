"""The canary fails in a bench that sees, and is heard where the bench is blind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from click.testing import CliRunner

from scenarios.faults import ClockOffset, Dropped
from simbench.canary import canary
from simbench.cli import main
from simbench.faults.receipt import MISMATCH
from tests.simbench.support import faults, receipts_of, recorded, staged


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    canary.cache_clear()
    yield
    canary.cache_clear()


def test_the_canary_case_fails_as_it_must() -> None:
    assert canary() is None


def test_a_bench_that_takes_receipts_for_granted_is_told_so() -> None:
    with mock.patch("simbench.canary.receipts", lambda *_: ()):
        assert "static_projection (ok)" in (canary() or "")


def test_a_bench_that_scores_in_spite_of_a_mismatch_is_told_so() -> None:
    with mock.patch("simbench.run.spoiled", lambda case, _: case):
        assert "nobody noticed" in (canary() or "")


@pytest.mark.parametrize(
    "words",
    [
        ("run", "empty-road", "--system", "car", "--pipeline", "static_projection"),
        (
            "stress",
            "empty-road",
            "--vary",
            "systems.car.duration_s=0.3,0.4",
            "--pipeline",
            "static_projection",
        ),
    ],
)
def test_a_run_with_a_silent_canary_is_an_error(words: tuple[str, ...], tmp_path: Path) -> None:
    some = ("--seeds", "0", "--jobs", "1", "--set", "systems.car.duration_s=0.4", "--out", str(tmp_path))
    arguments = [*words, *(some if words[0] == "run" else (*some[:4], *some[6:]))]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    with mock.patch("simbench.outcome.canary", lambda: "the canary passed"):
        done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 3 and "the canary passed" in done.output


@pytest.mark.parametrize("spec", [ClockOffset(offset_ms=50.0), Dropped(percent=20.0)])
def test_a_fault_that_never_acted_is_a_mismatch(spec: ClockOffset | Dropped) -> None:
    """Not in its injector: in the flow, which left it out."""
    clean = recorded(staged(duration_s=0.5))
    found = receipts_of(clean, replace(staged(duration_s=0.5), faults=faults(spec)))
    assert [(r.fault, r.status) for r in found] == [(spec.name, MISMATCH)]
