"""What changed since a baseline besides the pipelines: then a difference says nothing about them."""

from __future__ import annotations

from collections.abc import Mapping

from simbench.suite.side import Runs, Side

WAY_OUT = "; save a new baseline, or compare all the same with --allow-changed"


def changes(old: Side, new: Side, *, allowed: bool) -> tuple[list[str], list[str]]:
    """Problems and notes about what changed since the baseline, besides the pipelines."""
    told = []
    parts = _differing(old.bench, new.bench)
    if parts:
        told.append(f"the bench changed since the baseline: {parts}")
    asked = {word for of in new.groups.values() for word in of.margins}
    before = {name: value for name, value in old.metrics.items() if name in asked}
    metrics = _differing(before, {name: new.metrics.get(name, "gone") for name in before})
    if metrics:
        told.append(f"metrics are defined otherwise than in the baseline: {metrics}")
    moved = {
        name: seeds
        for name, of in new.groups.items()
        if name in old.groups and (seeds := _other_scenario(old.groups[name], of))
    }
    if moved:
        name, seeds = next(iter(moved.items()))
        many = f" and {len(moved) - 1} more groups" if len(moved) > 1 else ""
        told.append(
            f"what happens in the runs changed since the baseline: {name} ({len(seeds)} runs, e.g. seed "
            f"{seeds[0]}){many}"
        )
    if allowed:
        return [], [f"Compared all the same: {text}." for text in told]
    return [text + WAY_OUT for text in told], []


def _differing(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    names = [name for name in {**old, **new} if old.get(name) != new.get(name)]
    return ", ".join(f"{name} {old.get(name, 'none')} → {new.get(name, 'none')}" for name in names)


def _other_scenario(old: Runs, new: Runs) -> list[str]:
    return [s for s, run in new.runs.items() if s in old.runs and old.runs[s].scenario != run.scenario]
