"""How far draws may stray, against SciPy's distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simbench.faults.chances import (
    RARE,
    SPREADS,
    count_allowed,
    mean_wait_allowed,
    share_allowed,
    spread_allowed,
)

ENDS = [RARE, 1.0 - RARE]
KNOWN = {
    "gaussian": stats.norm(),
    "uniform": stats.uniform(-np.sqrt(3.0), 2.0 * np.sqrt(3.0)),
    "heavy_tailed": stats.t(3, scale=1.0 / np.sqrt(3.0)),
}


@pytest.mark.parametrize("n", [1, 2, 10, 57, 1000, 40000])
@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.99, 1.0])
def test_a_share_may_stray_as_far_as_the_binomial_does(n: int, share: float) -> None:
    low, high = stats.binom.ppf(ENDS, n, share) / n if 0.0 < share < 1.0 else (share, share)
    assert share_allowed(share, n) == pytest.approx(max(share - low, high - share), abs=1e-12)


@pytest.mark.parametrize("mean", [0.01, 1.0, 7.3, 200.0])
def test_a_count_may_stray_as_far_as_the_poisson_does(mean: float) -> None:
    low, high = stats.poisson.ppf(ENDS, mean)
    assert count_allowed(mean) == pytest.approx(max(mean - low, high - mean), abs=1e-12)


def test_nothing_tried_or_expected_may_not_stray() -> None:
    assert share_allowed(0.3, 0) == count_allowed(0.0) == 0.0


@pytest.mark.parametrize("name", KNOWN)
def test_spreads_have_mean_0_and_sd_1(name: str) -> None:
    q = np.linspace(0.01, 0.99, 99)
    np.testing.assert_allclose(SPREADS[name](q), KNOWN[name].ppf(q), atol=1e-9)
    assert KNOWN[name].mean() == pytest.approx(0.0, abs=1e-12) and KNOWN[name].std() == pytest.approx(1.0)


@pytest.mark.parametrize("name", KNOWN)
def test_a_spread_may_stray_as_far_as_its_order_statistics_do(name: str) -> None:
    n, unit = 20, KNOWN[name]
    q = [stats.beta.ppf(RARE, 10, 11), stats.beta.ppf(1.0 - RARE, 11, 10)]
    least, most = unit.ppf(0.5 + 0.5 * np.array(q)) / unit.ppf(0.75)
    assert spread_allowed(2.0, n, name) == pytest.approx(2.0 * max(1.0 - least, most - 1.0))


def test_a_mean_wait_may_stray_as_far_as_the_gamma_does() -> None:
    low, high = stats.gamma.ppf(ENDS, 30) / 30
    assert mean_wait_allowed(5.0, 30) == pytest.approx(5.0 * (max(1.0 - low, high - 1.0) + 0.25))
