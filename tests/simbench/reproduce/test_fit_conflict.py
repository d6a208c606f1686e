"""Prior-data conflict: uniform where there is none, small where there is; which cells no level reaches."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simbench.reproduce.fit.conflict import conflict, reach
from simbench.reproduce.fit.infer import Emulated, Observed

RUN = np.array([[0.04, 0.015], [0.015, 0.03]])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def cells(m: int = 1500, sd: float = 0.05) -> Emulated:
    """Two cells that move together over the prior."""
    level = rng(1).random(m)
    mean = np.column_stack([0.9 - 0.5 * level, 0.8 - 0.2 * level**2])
    return Emulated(mean=mean, sd=np.full(mean.shape, sd))


def test_draws_of_the_prior_predictive_itself_have_uniform_p() -> None:
    gen, some = rng(2), cells(600)
    joint, single = [], []
    for _ in range(200):
        at = gen.integers(0, 600)
        y = some.mean[at] + np.linalg.cholesky(RUN / 2 + 0.0125 * np.eye(2)) @ gen.standard_normal(2)
        found = conflict(some, Observed.of(y.tolist(), passes=2), RUN, 0.1, gen, replicates=99)
        joint.append(found.joint_p)
        single.append(found.cell_p)
    assert stats.kstest(joint, "uniform").pvalue > 0.01
    for column in np.array(single).T:
        assert stats.kstest(column, "uniform").pvalue > 0.01


def test_it_is_the_tail_of_a_normal_where_the_predictive_is_one() -> None:
    """All draws alike: y of 2 cells is normal, so that p is exp(-d²/2) and 2 (1 - Phi(|z|))."""
    some = Emulated(mean=np.full((400, 2), 0.5), sd=np.zeros((400, 2)))
    y = np.array([0.9, 0.3])
    found = conflict(some, Observed.of(y.tolist()), RUN, 0.0, rng(), replicates=20_000)
    distance2 = (y - 0.5) @ np.linalg.inv(RUN) @ (y - 0.5)
    assert found.joint_p == pytest.approx(np.exp(-0.5 * distance2), abs=0.003)
    assert found.cell_p == pytest.approx(2 * stats.norm.sf(np.abs(y - 0.5) / np.sqrt(np.diag(RUN))))


def test_a_prior_of_two_places_one_in_doubt_against_draws_of_another_program() -> None:
    """Draws are at (0, 0), well known, or at (1, 1), where the emulator is in doubt."""
    some = Emulated(
        mean=np.repeat([[0.0, 0.0], [1.0, 1.0]], 300, axis=0),
        sd=np.repeat([[0.0] * 2, [1.0] * 2], 300, axis=0),
    )
    parts = [
        stats.multivariate_normal([0.0, 0.0], RUN),
        stats.multivariate_normal([1.0, 1.0], RUN + np.eye(2)),
    ]
    y = np.vstack([part.rvs(20_000, random_state=rng(i)) for i, part in enumerate(parts)])
    level = 0.5 * (parts[0].pdf(y) + parts[1].pdf(y))
    for observed in ([0.4, 0.3], [1.6, 1.2], [-1.0, 1.5]):
        found = conflict(some, Observed.of(observed), RUN, 0.0, rng(7), replicates=6000)
        here = 0.5 * (parts[0].pdf(observed) + parts[1].pdf(observed))
        assert found.joint_p == pytest.approx(np.mean(level <= here), abs=0.03)


def test_values_each_likely_that_never_come_together_are_in_conflict_jointly_only() -> None:
    level = rng(3).random(2000)
    some = Emulated(mean=np.column_stack([level, level]), sd=np.full((2000, 2), 0.02))
    found = conflict(some, Observed.of([0.2, 0.8]), 1e-4 * np.eye(2), 0.0, rng())
    assert found.cell_p.min() > 0.3
    assert found.joint_p < 0.002
    assert all(one.reached for one in reach(some, Observed.of([0.2, 0.8]), 1e-4 * np.eye(2), 0.0))


def test_a_value_far_outside_has_the_least_p_and_a_wide_discrepancy_takes_it_back() -> None:
    far = Observed.of([-3.0, 0.7])
    found = conflict(cells(), far, RUN, 0.0, rng(), replicates=500)
    assert found.joint_p == pytest.approx(1 / 501) and found.cell_p[0] < 1e-6 < found.cell_p[1]
    assert conflict(cells(), far, RUN, 3.0, rng(), replicates=500).joint_p > 0.1


def test_reach_by_hand() -> None:
    some = Emulated(mean=np.array([[0.2, 0.5, 0.2], [0.4, 0.9, 0.4]]), sd=np.full((2, 3), [0.0, 0.0, 0.5]))
    observed = Observed.of([0.65, 0.95, 0.9], passes=4, frame_sd=[0.2, 0.0, 0.0], frames=[4, 1, 1])
    far, near, doubtful = reach(some, observed, 0.04 * np.eye(3), np.array([0.0, 0.0, 0.0]))
    assert (far.lowest, far.highest, far.nearest) == (0.2, 0.4, 1)
    # 0.04/4 + 0.2²/4 = 0.02: two SDs are 0.283
    assert far.slack == pytest.approx(2 * 0.02**0.5) and far.gap == pytest.approx(0.25) and far.reached
    assert near.slack == pytest.approx(0.2) and near.gap == pytest.approx(0.05) and near.reached
    assert not doubtful.reached and not doubtful.excluded
    none = reach(some, Observed.of([0.81, 0.7, 0.3]), 0.04 * np.eye(3), 0.0)[0]
    assert none.excluded and not none.reached and none.gap == pytest.approx(0.41)
    assert reach(some, Observed.of([0.81, 0.7, 0.3]), 0.04 * np.eye(3), 0.1)[0].reached


def test_a_seed_gives_the_same_and_one_draw_is_too_few() -> None:
    observed = Observed.of([0.5, 0.6])
    one, two = (conflict(cells(), observed, RUN, 0.1, rng(5), replicates=99).joint_p for _ in range(2))
    assert one == two
    with pytest.raises(ValueError, match="2 draws"):
        conflict(cells(1), observed, RUN, 0.1, rng())
