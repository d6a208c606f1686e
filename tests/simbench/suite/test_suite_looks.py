"""--until-decided: 20, 40 or 80 runs, as few as the verdicts need, and no other number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from scenarios.errors import BadInput
from scenarios.suite import load_suite
from simbench.suite.judge import Asked, answer
from simbench.suite.looks import until_decided
from simbench.suite.plan import Group, groups_of
from simbench.suite.side import Ran, Side
from tests.simbench.suite.sides import ran, runs, side

GROUPS = groups_of(load_suite("smoke"))[:2]
CLEAR, CLOSE = GROUPS
NOISE = np.random.Generator(np.random.PCG64(3)).normal(0.0, 0.02, 80).tolist()


@dataclass
class Measured:
    """Stands for running: values by group and seed; what was asked for, look by look."""

    loss: dict[str, float]
    looks: list[dict[str, int]] = field(default_factory=list)
    have: dict[str, dict[int, Ran]] = field(default_factory=dict)

    def __call__(self, cases: Sequence[tuple[Group, int]]) -> Side:
        asked: dict[str, int] = {}
        for group, seed in cases:
            asked[group.name] = asked.get(group.name, 0) + 1
            value = 0.9 - self.loss[group.name] + NOISE[-1 - seed]
            self.have.setdefault(group.name, {})[seed] = ran(value, outputs=f"new {seed}")
        self.looks.append(asked)
        return side({name: runs([got[s] for s in sorted(got)]) for name, got in self.have.items()})


def baseline(count: int = 80) -> Side:
    values = [ran(0.9 + NOISE[seed], outputs=f"old {seed}") for seed in range(count)]
    return side({group.name: runs(values) for group in GROUPS})


def test_a_clear_group_stops_at_twenty_and_a_close_one_goes_on_to_the_end() -> None:
    measured = Measured({CLEAR.name: 0.0, CLOSE.name: 0.05})  # the second loses exactly its margin
    new, settled, last = until_decided(GROUPS, baseline(), measured)
    assert measured.looks == [
        {CLEAR.name: 20, CLOSE.name: 20}, {CLOSE.name: 40}, {CLOSE.name: 80},
    ]  # fmt: skip
    assert last == 80
    assert settled[CLEAR.name, "precision"].verdict == "PASS"
    assert settled[CLEAR.name, "precision"].n == 20
    close = settled[CLOSE.name, "precision"]
    assert (close.verdict, close.n) == ("INCONCLUSIVE", 80)
    assert "budget of 80 runs spent" in (close.note or "")
    found = answer(new, baseline(), Asked(look=last), settled=settled)
    assert (found.outcome, found.exit_code) == ("INCONCLUSIVE", 4)


def test_a_clear_regression_stops_at_the_first_look() -> None:
    measured = Measured({CLEAR.name: 0.2, CLOSE.name: 0.0})
    new, settled, last = until_decided(GROUPS, baseline(), measured)
    assert (len(measured.looks), last) == (1, 20)
    assert settled[CLEAR.name, "precision"].verdict == "REGRESSION"
    assert answer(new, baseline(), Asked(look=last), settled=settled).exit_code == 1


def test_no_look_is_taken_between_those_that_are_planned() -> None:
    measured = Measured({CLEAR.name: 0.05, CLOSE.name: 0.05})
    _, settled, last = until_decided(GROUPS, baseline(50), measured)  # 50 runs allow looks at 20 and 40
    assert [look[CLOSE.name] for look in measured.looks] == [20, 40]
    assert (last, settled[CLOSE.name, "precision"].n) == (40, 40)


def test_fewer_runs_than_a_look_are_bad_input() -> None:
    with pytest.raises(BadInput, match=r"looks at 20, 40, 80 runs, and the baseline has 19 of"):
        until_decided(GROUPS, baseline(19), Measured({}))
