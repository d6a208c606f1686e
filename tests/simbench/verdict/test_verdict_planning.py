"""Numbers of runs: rows worked out beforehand, the noncentral t by integration, chi2 by SciPy."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from scenarios.seeding import stream
from simbench.verdict.planning import noncentral_t, plan, power_of, runs_needed, sd_limit


@pytest.mark.parametrize(("sd", "runs"), [(0.02, 8), (0.04, 27), (0.066, 69), (0.08, 101)])
@pytest.mark.parametrize("true_loss", [0.0, 0.04], ids=["no loss: PASS", "twice the margin: REGRESSION"])
def test_80_percent_power_at_a_margin_of_2_percent(sd: float, runs: int, true_loss: float) -> None:
    assert runs_needed(sd, margin=0.02, true_loss=true_loss) == runs


@pytest.mark.parametrize(("n", "effect"), [(6, 1.0), (8, 1.0), (27, 0.5), (101, 0.25), (20, 3.0)])
def test_power_is_the_integral_over_the_unknown_sd(n: int, effect: float) -> None:
    """P(Z + effect sqrt(n) > t S) over the chi distribution of S: no noncentral t involved."""
    t, df = stats.t.ppf(0.95, n - 1), n - 1

    def part(s: float) -> float:
        return float(
            stats.norm.sf(t * s - effect * np.sqrt(n)) * stats.chi.pdf(s * np.sqrt(df), df) * np.sqrt(df)
        )

    expected, _ = integrate.quad(part, 0.0, 10.0, points=[1.0], epsabs=1e-10)
    assert power_of(n, sd=1.0, away=effect) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("n", [2, 6, 10, 40])
def test_the_pilots_limit_is_chi2s(n: int) -> None:
    assert sd_limit(0.03, n) == pytest.approx(0.03 * np.sqrt((n - 1) / stats.chi2.ppf(0.2, n - 1)))


def test_80_percent_of_pilots_have_a_limit_above_the_truth() -> None:
    pilots = stream(0, "pilots").normal(size=(20_000, 10)).std(axis=1, ddof=1)
    assert np.mean([sd_limit(sd, 10) >= 1.0 for sd in pilots]) == pytest.approx(0.8, abs=0.01)


@given(st.floats(0.001, 0.5), st.floats(1.0, 4.0), st.floats(0.01, 0.1))
def test_more_scatter_or_a_smaller_margin_never_need_fewer_runs(
    sd: float, more: float, margin: float
) -> None:
    here = runs_needed(sd, margin=margin)
    assert here >= 6
    assert runs_needed(sd * more, margin=margin) >= here
    assert runs_needed(sd, margin=margin / more) >= here
    assert here == 6 or power_of(here - 1, sd=sd, away=margin) < 0.8 <= power_of(here, sd=sd, away=margin)


@pytest.mark.parametrize(("df", "shift"), [(5, 0.5), (6, 3.0), (19, 2.0)])
def test_where_the_library_has_no_number_the_definition_is_integrated(df: int, shift: float) -> None:
    expected = stats.nct.cdf(2.0, df, shift)
    with mock.patch("simbench.verdict.planning.nctdtr", return_value=float("nan")):
        assert noncentral_t(2.0, df, shift) == pytest.approx(expected, abs=1e-4)


def test_a_margin_of_many_spreads_is_decided_by_the_fewest_runs() -> None:
    """SciPy's noncentral t is not a number at 7 runs here."""
    assert all(power_of(n, sd=0.001, away=0.0176) == pytest.approx(1.0) for n in range(6, 20))
    assert runs_needed(0.001, margin=0.0176) == 6


def test_a_plan_from_a_pilot() -> None:
    pilot = stream(4, "pilot").normal(0.0, 0.04, 10)
    made = plan(pilot, margin=0.02)
    assert (made.aim, made.pilot_runs, made.sd) == ("PASS", 10, pytest.approx(pilot.std(ddof=1)))
    assert made.runs == runs_needed(made.sd_limit, margin=0.02) > runs_needed(made.sd, margin=0.02)
    assert plan(pilot, margin=0.02, true_loss=0.04).aim == "REGRESSION"


def test_runs_that_never_differ_need_the_fewest() -> None:
    assert plan([0.0] * 8, margin=0.02).runs == 6


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"sd": 0.04, "true_loss": 0.02}, "equals the margin"),
        ({"sd": -1.0}, "finite SD"),
        ({"sd": np.nan}, "finite SD"),
        ({"sd": 0.04, "margin": 0.0}, "margin above 0"),
        ({"sd": 0.04, "power": 1.0}, "power"),
        ({"sd": 1e4}, "more than 1000000 runs"),
    ],
)
def test_what_cannot_be_planned_is_said(how: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        runs_needed(**{"margin": 0.02, **how})


@pytest.mark.parametrize("pilot", [[], [0.1], [0.1, np.nan]])
def test_a_pilot_needs_runs(pilot: list[float]) -> None:
    with pytest.raises(ValueError, match="pilot"):
        plan(pilot, margin=0.02)
