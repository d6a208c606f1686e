"""Every relation holds for the plain baseline, and a pipeline that breaks it is caught by it."""

from __future__ import annotations

from functools import cache

import pytest

from fusion.pipelines.static_projection import StaticProjection
from simbench.checks import finer, mirror, offset, permute, retold, unseen
from simbench.checks.drives import recorded, told
from simbench.checks.finding import Finding, Story
from simbench.checks.finer import Precisions
from simbench.checks.offset import Shifts
from simbench.checks.relations import QUICK_SEEDS, RELATIONS, check
from simbench.plugins import Factory
from tests.fusion.make import lidar_scan
from tests.fusion.ours import OURS
from tests.fusion.street import CALIBRATION
from tests.simbench.checks import broken

BY_NAME = {relation.name: relation for relation in RELATIONS}
EXACT = tuple(name for name in BY_NAME if name not in ("conformance", "finer scan", "offset sign"))
BREAKS: tuple[tuple[str, Factory], ...] = (
    ("conformance", broken.FallsOver),
    ("mirror", broken.PrefersLeft),
    ("unseen actor", broken.Shares),
    ("unseen actor", broken.ReadsTheClock),
    ("blind camera", broken.CountsCameras),
    ("point order", broken.TrustsOrder),
    ("LiDAR frame", broken.TrustsAxes),
    ("time of day", broken.KnowsTheHour),
    ("finer scan", broken.LostInDetail),
    ("offset sign", broken.Compensates),
)
# What does not hold of ours, and why, so far as it is known.
KNOWN = {
    ("mirror", "probabilistic"),  # the learned shapes S* are not symmetric
    ("mirror", "probabilistic_paper"),
    (
        "mirror",
        "robust",
    ),  # of equally good headings the first counter-clockwise; ground from every other slice
    *(  # step 1 draws its planes by the index of a point
        ("point order", name) for name in OURS if name not in ("static_projection", "robust")
    ),
}


@cache
def found(relation: str, factory: Factory) -> Finding:
    return BY_NAME[relation].find(factory, QUICK_SEEDS)


@pytest.mark.parametrize(
    ("relation", "factory"), BREAKS, ids=lambda v: v if isinstance(v, str) else v.__name__
)
def test_who_breaks_a_relation_is_caught_by_it_and_the_baseline_is_not(
    relation: str, factory: Factory
) -> None:
    assert found(relation, StaticProjection).verdict == "holds", found(relation, StaticProjection)
    assert found(relation, factory).verdict == "does not hold", found(relation, factory)


def test_every_relation_has_a_pipeline_that_breaks_it() -> None:
    assert {relation for relation, _ in BREAKS} == set(BY_NAME)


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("relation", EXACT)
def test_what_holds_of_our_pipelines_and_what_does_not(relation: str, name: str) -> None:
    expected = "does not hold" if (relation, name) in KNOWN else "holds"
    assert found(relation, OURS[name]).verdict == expected, found(relation, OURS[name])


@pytest.mark.parametrize("relation", ["finer scan", "offset sign"])
def test_over_seeds_robust_loses_nothing_by_a_finer_scan_nor_by_the_sign_of_an_offset(relation: str) -> None:
    assert found(relation, OURS["robust"]).verdict == "holds", found(relation, OURS["robust"])


def test_of_who_says_nothing_nothing_can_be_said() -> None:
    verdicts = {relation.name: finding.verdict for relation, finding in check(broken.Silent, QUICK_SEEDS[:1])}
    assert verdicts.pop("conformance") == "holds"
    assert set(verdicts.values()) == {"cannot be said"}


def test_who_falls_over_holds_in_nothing_and_the_words_say_what_it_raised() -> None:
    findings = [finding for _, finding in check(broken.FallsOver, QUICK_SEEDS[:1])]
    assert len(findings) == len(RELATIONS)
    assert {finding.verdict for finding in findings} == {"does not hold"}
    assert all("ZeroDivisionError" in finding.why for finding in findings)


def test_a_drive_with_nobody_in_sight_is_the_same_to_the_last_byte_but_not_the_truth() -> None:
    plain, other = recorded(0), recorded(0, unseen=True)
    assert len(other.truth.objects) == len(plain.truth.objects) + 1
    assert unseen.first_other(unseen.renumbered(plain.messages), unseen.renumbered(other.messages)) is None


def test_an_actor_that_is_seen_makes_nothing_said() -> None:
    a, b = told(recorded(0)), told(recorded(1))
    finding = unseen.find_actor(StaticProjection, a, b)
    assert finding.verdict == "cannot be said" and "the bench's own messages" in finding.why


def test_an_offset_moves_only_boxes_and_arrivals() -> None:
    plain, late = offset.bare(0, 0.0), offset.bare(0, 30.0)
    kinds = [(type(m).__name__, m.sensor, m.seq) for m in plain.messages]
    assert sorted(kinds) == sorted((type(m).__name__, m.sensor, m.seq) for m in late.messages)
    assert {m.stamp_ns for m in plain.messages} == {m.stamp_ns for m in late.messages}


# -- verdicts by hand -------------------------------------------------------------------------------------


def precisions(*gains: float) -> list[Precisions]:
    """Seeds whose one common pair gains so much; each resolution has another pair of its own."""
    return [
        Precisions(seed=i, coarse={(0, "a"): 0.5, (1, "a"): 0.9}, fine={(0, "a"): 0.5 + gain, (0, "b"): 0.0})
        for i, gain in enumerate(gains)
    ]


@pytest.mark.parametrize(
    ("gains", "verdict"),
    [
        ([0.0] * 6, "holds"),
        ([-0.01] * 6, "does not hold"),  # no spread: the mean is sure
        ([0.2] * 6, "holds"),
        # mean -0.02, SD 0.0219, n = 6: t(0.995, 5) = 4.032, half width 0.0361
        ([0.0, -0.04, 0.0, -0.04, 0.0, -0.04], "holds"),
        # mean -0.03, SD 0.011, half width 0.018
        ([-0.02, -0.04, -0.02, -0.04, -0.02, -0.04], "does not hold"),
        ([-0.5] * 5, "cannot be said"),
    ],
)
def test_a_loss_counts_that_seeds_can_tell_from_noise(gains: list[float], verdict: str) -> None:
    assert finer.judge(precisions(*gains)).verdict == verdict


@pytest.mark.parametrize(
    ("even_mm", "verdict"),
    [
        ([0.0] * 6, "holds"),
        ([0.3] * 6, "holds"),  # below rounding, 0.38 mm
        ([0.5] * 6, "does not hold"),
        ([-0.5] * 6, "does not hold"),
        ([5.0, -5.0] * 3, "holds"),
        ([5.0] * 5, "cannot be said"),
    ],
)
def test_only_what_both_signs_have_in_common_counts(even_mm: list[float], verdict: str) -> None:
    shifts = [
        Shifts(seed=i, late_m=0.1 + 1e-3 * even, early_m=-0.1 + 1e-3 * even) for i, even in enumerate(even_mm)
    ]
    assert offset.judge(shifts, len(shifts)).verdict == verdict


def test_points_that_all_have_an_instant_of_their_own_have_one_order_only() -> None:
    story = Story(calibration=CALIBRATION, messages=(lidar_scan([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),))
    assert permute.find(StaticProjection, story).verdict == "cannot be said"


def test_a_relation_is_asked_of_a_new_pipeline_each_time() -> None:
    made = []

    def factory() -> StaticProjection:
        made.append(StaticProjection())
        return made[-1]

    for find in (mirror.find, retold.find_turned, retold.find_later, permute.find, unseen.find_camera):
        made.clear()
        find(factory, told(recorded(0)))
        assert len(made) == 2
