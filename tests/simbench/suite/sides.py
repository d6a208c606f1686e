"""Sides made by hand: what a run or a baseline would hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from simbench.suite.side import Ran, Runs, Side

GROUP = "clean/overtake-approach/car/none/robust"


def ran(
    precision: float | None = 0.9, *, status: str = "ok", gross: bool | None = False,
    outputs: str | None = "a", scenario: str = "s", why: str | None = None,
) -> Ran:  # fmt: skip
    """One run with one value."""
    return Ran.model_validate(
        {
            "status": status, "scenario": scenario, "outputs": outputs, "gross": gross,
            "values": {"precision": precision}, "why": why, "command": "simbench run x --seeds 0",
        }
    )  # fmt: skip


def runs(values: Sequence[Ran | float | None], **asked: object) -> Runs:
    """A group: values by seed 0, 1, ... as runs whose outputs differ."""
    made = {
        str(seed): value if isinstance(value, Ran) else ran(value, outputs=f"{seed} {value}")
        for seed, value in enumerate(values)
    }
    return Runs.model_validate({"margins": {"precision": 0.05}, **asked, "runs": made})


def side(groups: Mapping[str, Runs] | Sequence[float | None], **more: object) -> Side:
    """A side; of a list, one group of that precision by seed."""
    if not isinstance(groups, Mapping):
        groups = {GROUP: runs(groups)}
    content = {
        "suite": "gate", "whole": True, "bench": {"simbench": "1", "numpy": "2.0"},
        "metrics": {"precision": "p"}, "groups": groups, **more,
    }  # fmt: skip
    return Side.model_validate(content)
