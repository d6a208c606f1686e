"""Numbers and names as the page writes them, and its one sentence."""

from __future__ import annotations

from collections.abc import Sequence

from scenarios.fault_set import FaultSet
from scenarios.faults import RoadShake
from scenarios.scenario import CameraSensor, ends
from simbench.case import Told
from simbench.report.choose import Group, mean_of_runs
from simbench.report.names import OURS
from simbench.score.statistics import MIN_RUNS

NONE = "–"
MOST_CLAUSES = 2


def pipeline_words(name: str, short: bool = False) -> str:
    """Plain words for our own pipelines; a user's keeps its name (cut for axes)."""
    known = OURS.get(name)
    if known is not None:
        return known.short if short else known.name
    if not short:
        return name
    last = name.rpartition(":")[2] or name
    return last if len(last) <= 14 else last[:13] + "…"


def percent(share: float | None, digits: int = 1) -> str:
    """A share in per cent, without the sign."""
    return NONE if share is None else f"{_unsigned_zero(100.0 * share, digits):.{digits}f}"


def points(difference: float) -> str:
    """A difference of shares in percentage points, with sign."""
    return f"{_unsigned_zero(100.0 * difference, 1):+.1f}".replace("-", "−")


def metres(value: float | None, digits: int = 2) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def signed_m(value: float) -> str:
    return f"{_unsigned_zero(value, 2):+.2f} m".replace("-", "−")


def signed_ms(value: float) -> str:
    return f"{_unsigned_zero(value, 2):+.2f} ms".replace("-", "−")


def _unsigned_zero(value: float, digits: int) -> float:
    return 0.0 if round(value, digits) == 0.0 else value


def counted(n: int, one: str, many: str | None = None) -> str:
    return f"{n} {one if n == 1 else many or one + 's'}"


def fault_words(faults: FaultSet) -> str:
    """Each fault with the number that sets it: '50 ms trigger offset and 1.1 deg vibration'."""
    said = []
    for spec in sorted(faults, key=lambda s: s.name, reverse=True):
        if isinstance(spec, RoadShake):
            said.append(_road_words(spec))
            continue
        kind = spec.name.rpartition(".")[2].removesuffix("_" + spec.unit.split()[0])
        for ending in ("_ms", "_deg", "_m", "_px"):
            kind = kind.removesuffix(ending)
        said.append(f"{getattr(spec, spec.strength):g} {spec.unit.split()[0]} {kind.replace('_', ' ')}")
    return joined(said)


def _road_words(spec: RoadShake) -> str:
    road = "a smooth road" if spec.roughness == "smooth" else f"a road of ISO class {spec.roughness}"
    return f"{road} with {counted(len(spec.events), 'event')}" if spec.events else road


def told_words(told: Told, recorded: bool) -> str:
    """Which calibration the pipelines know, as a sentence."""
    if recorded:
        return "Pipelines are told the calibration that the recording brings."
    if told == "true":
        return "Pipelines are told the true calibration (before any error of it)."
    return "Pipelines are told the calibration that was found on boards; scores are by the true one."


def joined(words: Sequence[str]) -> str:
    """'a', 'a and b', 'a, b and c'."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def runs_words(groups: Sequence[Group]) -> str:
    """'n = 2 runs: illustration' below the number of runs that allows an interval, else 'n = 8 runs'."""
    counts = sorted({len(group.runs) for group in groups})
    n = "–".join(str(c) for c in dict.fromkeys((counts[0], counts[-1])))
    text = f"n = {n} run{'' if counts == [1] else 's'}"
    return f"{text}: illustration" if counts[0] < MIN_RUNS else text


def sentence(groups: Sequence[Group]) -> str:
    """What the errors cost the baseline, what the method made of it, and n. Means over runs."""
    return _sentence(groups).replace(" %", "\N{NO-BREAK SPACE}%").replace(" m)", "\N{NO-BREAK SPACE}m)")


def _sentence(groups: Sequence[Group]) -> str:
    shown, rest = list(groups[:MOST_CLAUSES]), groups[MOST_CLAUSES:]
    with_target = [g for g in shown if g.has_target()]
    more = f" {counted(len(rest), 'more group')} below." if rest else ""
    if not with_target:
        return _no_target(shown[0]) + more
    both = [g for g in with_target if len(g.sides) == 2]
    text = _compared(both) if both else _one_sided(with_target)
    return f"{text}; {runs_words(both or with_target)}.{more}"


def _on(group: Group, groups: Sequence[Group]) -> str:
    """Which group is meant, as far as that must be said."""
    scenario = f" in {group.scenario}" if len({g.scenario for g in groups}) > 1 else ""
    label = f" ({group.faults})" if len({g.faults for g in groups}) > 1 else ""
    return f"on the {group.system}{scenario}{label}"


def _compared(groups: Sequence[Group]) -> str:
    kinds = {fault_words(group.results("faulted")[0][1].faults) for group in groups}
    cause = kinds.pop() if len(kinds) == 1 else "the injected errors"
    cause = cause[0].upper() + cause[1:]
    costs: list[str] = []
    gains: list[str] = []
    said = ""
    for group in groups:
        a = mean_of_runs(group, "clean", group.baseline, "tpr")
        b = mean_of_runs(group, "faulted", group.baseline, "tpr")
        verb, amount = _effect(a, b)
        whom = "it" if costs else f"the {pipeline_words(group.baseline)}"
        scores = "no score" if a is None or b is None else f"{percent(a)} → {percent(b)} %"
        start = "" if verb == said else f"{verb} {whom} "
        costs.append(f"{start}{amount} {_on(group, groups)} ({scores})")
        said = verb
        if a is None or b is None:
            continue
        c = mean_of_runs(group, "faulted", group.method, "tpr")
        if c is None:
            continue
        without = mean_of_runs(group, "clean", group.method, "tpr")
        x = mean_of_runs(group, "faulted", group.baseline, "mae_m.raw")
        y = mean_of_runs(group, "faulted", group.method, "mae_m.raw")
        extra = "" if without is None else f"; {percent(without)} % without the errors"
        if y is not None:
            extra += f"; position error {metres(x)} → {metres(y)} m"
        elif not mean_of_runs(group, "faulted", group.method, "coverage.raw"):
            extra += "; no position"
        gains.append(f"{percent(c)} % {_on(group, groups)} ({points(c - b)}{extra})")
    text = f"{cause} {joined(costs)}"
    method = groups[0].method
    if gains and method is not None:
        text += f"; with the {pipeline_words(method)} the TPR is {joined(gains)}"
    return text


def _effect(without: float | None, with_errors: float | None) -> tuple[str, str]:
    """'cost' or 'gave', and how much: '1.3 points of TPR'."""
    if without is None or with_errors is None:
        return "cost", "an unknown amount"
    loss = _unsigned_zero(100.0 * (without - with_errors), 1)
    return "cost" if loss >= 0.0 else "gave", f"{abs(loss):.1f} points of TPR"


def stamp_words(cameras: Sequence[CameraSensor]) -> str:
    """What a reader must know of stamps that are late by themselves; empty where none are."""
    late = [ends(camera.stamp_delay_ms) for camera in cameras if camera.stamp == "arrival"]
    if not late:
        return ""
    low, high = min(low for low, _ in late), max(high for _, high in late)
    span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return (
        f"With and without errors, cameras stamp an image when the host has it, at least {span} ms after its "
        "exposure; a shutter that opens late makes up for part of that."
    )


def _one_sided(groups: Sequence[Group]) -> str:
    side = groups[0].main_side
    clauses = []
    for group in groups:
        values = [
            f"{percent(value)} % ({pipeline_words(name)})"
            for name in (group.baseline, group.method)
            if name is not None and (value := mean_of_runs(group, group.main_side, name, "tpr")) is not None
        ]
        clauses.append(f"{_on(group, groups)} {joined(values) if values else 'unknown (no score)'}")
    if side == "clean":
        return f"Without injected errors, the TPR is {joined(clauses)}"
    cause = fault_words(groups[0].results("faulted")[0][1].faults)
    return f"With {cause}, the TPR is {joined(clauses)}; no run without the errors stands beside it"


def _no_target(group: Group) -> str:
    names = [n for n in (group.baseline, group.method) if n is not None]
    said = [
        f"{pipeline_words(name)} {value:.2f}"
        for name in names
        if (value := mean_of_runs(group, group.main_side, name, "false_objects_per_frame")) is not None
    ]
    found = f"false objects per frame: {joined(said)}" if said else "nothing was scored"
    return f"{group.scenario} has no target, so nothing can be mapped to one; {found}; {runs_words([group])}."
