"""From the values of a run, and of a baseline, to the answers of all gates.

What may lead to PASS is said here once: every run ended well and has the value that is asked for, every limit
is kept, no metric is worse than its margin allows, nothing of what the numbers depend on has changed.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping
from dataclasses import dataclass

from scenarios.errors import BadInput, Where
from scenarios.seeding import stream
from simbench.limits import Limit, metric_named, parse_limit
from simbench.score.metrics import Metric
from simbench.score.statistics import summarize
from simbench.suite.changes import changes
from simbench.suite.gate import Answer, Gate, Kind, worst_first
from simbench.suite.pools import Pool, group_of, pools_of
from simbench.suite.side import Ran, Runs, Side
from simbench.verdict.decide import ALPHA, Judgement, judge
from simbench.verdict.overall import suite_verdict
from simbench.verdict.rare import judge_failures
from simbench.verdict.sequential import LEVELS, decide_at

Key = tuple[str, str]
"""Group and metric."""
OURS = ("bench_error", "receipt_mismatch")


@dataclass(frozen=True, kw_only=True)
class Asked:
    """How two sides are compared. changed: whether to compare although the bench, its packages or the
    scenarios changed. look: of a sequential test, None: one fixed look."""

    changed: bool = False
    look: int | None = None


def answer(
    new: Side, old: Side | None = None, asked: Asked = Asked(), *, canary: str | None = None,
    settled: Mapping[Key, Judgement] | None = None,
) -> Answer:  # fmt: skip
    """All gates of a run. old: the baseline. canary: what is wrong with it, None: it failed as it must.
    settled: the judgements of a sequential test. BadInput: the sides are of different suites."""
    if old is not None and old.suite != new.suite:
        raise BadInput(f"the baseline is of the suite '{old.suite}', the run of '{new.suite}'")
    gates = [_runs(name, of) for name, of in new.groups.items()]
    for name, of in new.groups.items():
        gates += [_limit(name, of, metric, text) for metric, text in of.limits.items()]
        if of.failed_runs is not None or old is not None:
            gates += _rare(name, of, old, asked)
    problems, notes = changes(old, new, allowed=asked.changed) if old is not None else ([], [])
    if old is not None:
        notes.append(_claim(new, old, asked.look))
        gates += _missing(old, new, notes)
        judgements = compared(new, old) if settled is None else settled
        gates += _baseline(new, old, judgements, asked.look)
    gates.append(
        Gate(
            group=new.suite, kind="canary", metric="", unit="", outcome="ERROR" if canary else "PASS",
            note=canary or "failed, as it must", ours=True,
        )
    )  # fmt: skip
    return Answer(gates=tuple(worst_first(gates)), problems=tuple(problems), notes=tuple(notes))


def compared(
    new: Side, old: Side, look: int | None = None, groups: Collection[str] | None = None
) -> dict[Key, Judgement]:
    """All metrics of the groups that both sides have (of these only: `groups`), adjusted to one another.
    look: of a sequential test, which takes every scenario by itself."""
    found: dict[Key, Judgement] = {}
    for pool in _pools(new, old, look, groups):
        identical = all(_identical(old.groups[name], new.groups[name]) for name in pool.groups)
        for word, margin in new.groups[pool.groups[0]].margins.items():
            if all(word not in run.values for name in pool.groups for run in old.groups[name].runs.values()):
                continue
            metric, rng = _metric(word), stream(0, "verdict", pool.name, word)
            sides = (pool.values(old, metric), pool.values(new, metric))
            if look is None:
                found[pool.name, word] = judge(
                    *sides, better=metric.better, margin=margin, rng=rng, identical=identical,
                    scenario_of=group_of if pool.is_sample else None,
                )  # fmt: skip
            else:
                found[pool.name, word] = decide_at(
                    look, *sides, better=metric.better, margin=margin, rng=rng, identical=identical
                )
    return dict(suite_verdict(found).judgements)


def _baseline(new: Side, old: Side, judgements: Mapping[Key, Judgement], look: int | None) -> list[Gate]:
    gates = []
    for pool in _pools(new, old, look):
        for word in new.groups[pool.groups[0]].margins:
            judgement = judgements.get((pool.name, word))
            if judgement is not None:
                gates.append(_compared(pool, _metric(word), judgement, new, old))
            else:
                why = "the baseline has no values of it"
                gates.append(_error(pool.name, "baseline", word, why, ours=True))
    return gates


def _claim(new: Side, old: Side, look: int | None) -> str:
    """What the verdicts are about."""
    if any(pool.is_sample for pool in _pools(new, old, look)):
        return (
            "Scenarios of a gate with 20 or more are a sample, and its verdict is about all that they stand "
            "for; every other verdict is about its own scenario."
        )
    return "Verdicts are about these scenarios, over their random draws; not about other scenarios."


def _pools(new: Side, old: Side, look: int | None, groups: Collection[str] | None = None) -> list[Pool]:
    """Of the groups that both sides have. A sequential test takes every scenario by itself."""
    some = [name for name in new.groups if name in old.groups and (groups is None or name in groups)]
    return pools_of(some) if look is None else [Pool(name=name, groups=(name,)) for name in some]


def _compared(pool: Pool, metric: Metric, j: Judgement, new: Side, old: Side) -> Gate:
    before, after = pool.values(old, metric), pool.values(new, metric)
    sign = 1.0 if metric.better == "higher" else -1.0
    lost = {
        run: sign * (a - b)
        for run, b in after.items()
        if b is not None and (a := before.get(run)) is not None
    }
    where, worst = pool.case(max(lost, key=lambda run: lost[run])) if lost else (None, None)
    notes = ["a sample of scenarios"] if pool.is_sample else []
    return Gate(
        group=pool.name, kind="baseline", metric=metric.name, unit=metric.unit, outcome=j.verdict,
        threshold=f"loss < {j.margin:g}", old=j.old, new=j.new, difference=j.difference, low=j.low,
        high=j.high, n=j.n, note="; ".join([*notes, j.note] if j.note else notes), beyond=j.beyond,
        margin=j.margin, worst=worst, worst_group=where if pool.is_sample else None,
    )  # fmt: skip


def _runs(name: str, of: Runs) -> Gate:
    bad = {seed: run for seed, run in of.runs.items() if run.status != "ok"}
    first = next(iter(bad.items()), None)
    note = "" if of.runs else "no runs"
    if first is not None:
        seed, run = first
        note = f"{len(bad)} of {len(of.runs)} runs did not end well; seed {seed}: {run.status}, {run.why}"
    return Gate(
        group=name, kind="runs", metric="", unit="", outcome="ERROR" if bad or not of.runs else "PASS",
        threshold="all end well", n=len(of.runs), worst=None if first is None else int(first[0]),
        note=note,
        ours=not of.runs or any(run.status in OURS for run in bad.values()),
        beyond=len(bad) / max(len(of.runs), 1),
    )  # fmt: skip


def _limit(name: str, of: Runs, word: str, text: str) -> Gate:
    limit = parse_limit(word + text, Where(file=None), timed=True)
    values = _values(of, limit.metric)
    known = {seed: limit.margin(value) for seed, value in values.items() if value is not None}
    missing = [seed for seed, value in values.items() if value is None]
    if missing or not known:
        seeds = ", ".join(map(str, missing[:5]))
        what = f"{len(missing)} of {len(values)} runs have no value (seeds {seeds})" if missing else "no runs"
        return _error(name, "limit", word, what, threshold=_words(limit), limit=limit.value,
                      worst=int(str(missing[0])) if missing else None)  # fmt: skip
    summary = summarize(values, stream(0, "limit", name, word))
    assert summary.mean is not None
    margin = limit.margin(summary.mean)
    low, high = summary.ci95 or (None, None)
    reaches = low is not None and high is not None and min(limit.margin(low), limit.margin(high)) < 0.0
    notes = [summary.note] if summary.note else []
    notes += ["the interval reaches over the limit"] if margin >= 0.0 and reaches else []
    return Gate(
        group=name, kind="limit", metric=limit.metric.name, unit=limit.metric.unit,
        outcome="PASS" if margin >= 0.0 else "FAIL", threshold=_words(limit), new=summary.mean, low=low,
        high=high, n=summary.n, note="; ".join(notes), beyond=-margin / max(abs(limit.value), 1e-9),
        worst=int(str(min(known, key=lambda seed: known[seed]))), limit=limit.value,
    )  # fmt: skip


def _words(limit: Limit) -> str:
    return f"{'≥' if limit.metric.better == 'higher' else '≤'} {limit.value:g}"


def _rare(name: str, of: Runs, old: Side | None, asked: Asked) -> list[Gate]:
    new: dict[Hashable, bool | None] = {int(seed): run.gross for seed, run in of.runs.items()}
    before = new
    if old is not None:
        if name not in old.groups:
            return []
        before = {int(seed): run.gross for seed, run in old.groups[name].runs.items()}
    if old is not None and of.failed_runs is None and _identical(old.groups[name], of):
        return []  # said by the other gates
    found = judge_failures(before, new, limit=of.failed_runs, alpha=_alpha(asked.look))
    if all(value is None for value in new.values()) and of.failed_runs is None:
        return []  # a scenario without a target: nothing can fail so
    failing = [*found.began, *(seed for seed, fails in new.items() if fails)]
    threshold = "no more than before" if of.failed_runs is None else f"≤ {of.failed_runs:g} of runs"
    return [
        Gate(
            group=name, kind="rare", metric="gross failures", unit="1", outcome=found.verdict,
            threshold=threshold, old=found.old.failed / found.old.n if found.old and old else None,
            new=found.new.failed / found.new.n if found.new else None,
            low=found.new.low if found.new else None, high=found.new.high if found.new else None,
            n=found.new.n if found.new else 0, note=found.note or "",
            worst=int(str(failing[0])) if failing else None,
        )
    ]  # fmt: skip


def _missing(old: Side, new: Side, notes: list[str]) -> list[Gate]:
    gates = []
    gone = [name for name in old.groups if name not in new.groups]
    if gone and not new.whole:
        notes.append(f"{len(gone)} groups of the baseline were not run.")
        gone = []
    for name in gone:
        gates.append(_error(name, "baseline", "", "the baseline has this group, the run has not", ours=True))
    for name in new.groups:
        if name not in old.groups:
            gates.append(_error(name, "baseline", "", "the baseline has no such group", ours=True))
    return gates


def _identical(old: Runs, new: Runs) -> bool:
    def outputs(runs: Mapping[str, Ran]) -> list[tuple[str, str | None]]:
        return sorted((seed, run.outputs) for seed, run in runs.items())

    return outputs(old.runs) == outputs(new.runs) and all(run.outputs for run in new.runs.values())


def _alpha(look: int | None) -> float:
    return ALPHA if look is None else LEVELS[look]


def _values(of: Runs, metric: Metric) -> dict[Hashable, float | None]:
    return {int(seed): run.values.get(metric.name) for seed, run in of.runs.items()}


def _metric(word: str) -> Metric:
    return metric_named(word, Where(file=None), timed=True)


def _error(
    group: str, kind: Kind, metric: str, note: str, *, ours: bool = False, threshold: str = "",
    limit: float | None = None, worst: int | None = None,
) -> Gate:  # fmt: skip
    return Gate(
        group=group, kind=kind, metric=metric, unit="", outcome="ERROR", note=note, ours=ours,
        threshold=threshold, limit=limit, worst=worst,
    )  # fmt: skip
