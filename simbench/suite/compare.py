"""`simbench compare`, `simbench baseline save`, `simbench plan`: about runs that lie on the disk."""

from __future__ import annotations

import sys
from pathlib import Path
from shlex import join

import click

from scenarios.errors import BadInput, Where, nearest, show
from scenarios.suite import load_suite
from simbench.files import prepare_folder
from simbench.limits import LATENCY, metric_named
from simbench.suite.gate import as_lines
from simbench.suite.judge import Asked, answer
from simbench.suite.plan import groups_of
from simbench.suite.side import Runs, Side, read_side, write_side
from simbench.suite.write import Told, write_answer
from simbench.verdict.decide import ALPHA
from simbench.verdict.planning import POWER, plan


def save_baseline(run: Path, file: Path) -> int:
    """Keep the values of a whole run as a baseline. BadInput: it was run in part, or a run has no value."""
    side = read_side(run)
    if not side.whole:
        raise BadInput("was run in part (-k, -m or --lf); a baseline needs the whole suite", file=str(run))
    bad = [
        f"{name}/{seed} ({r.status})"
        for name, of in side.groups.items()
        for seed, r in of.runs.items()
        if r.status != "ok"
    ]
    if bad:
        raise BadInput(f"{len(bad)} runs did not end well, among them {bad[0]}: no baseline", file=str(run))
    prepare_folder(file.parent)
    write_side(_without_latencies(side), file, commands=False)
    click.echo(f"wrote {file}: {sum(len(of.runs) for of in side.groups.values())} runs of {side.suite}")
    return 0


def compare_runs(run: Path, baseline: Path, *, changed: bool, out: Path | None) -> int:
    """Judge a run against a baseline, or against another run; the exit code. out: a folder for junit.xml,
    summary.md and report.html."""
    new, old = read_side(run), read_side(baseline)
    found = answer(new, old, Asked(changed=changed))
    for line in (*as_lines(found.gates), *found.notes, *found.problems[1:], found.sentence):
        click.echo(line)
    if out is not None:
        prepare_folder(out)
        told = Told(
            description=f"{run} compared with {baseline}.", command=join(["simbench", *sys.argv[1:]]),
            cost="", against=baseline.name,
        )  # fmt: skip
        click.echo(f"report: {write_answer(found, new, old, out, told)}")
    return found.exit_code


def plan_runs(target: str, margin: str, losses: tuple[float, ...], pilot: Path, against: Path | None) -> int:
    """Print how many runs each group needs for a verdict on one metric."""
    file = load_suite(target)
    known = {group.name for group in groups_of(file)}
    word, _, number = margin.strip().rpartition(" ")
    where = Where(file="--margin")
    try:
        lost = float(number)
    except ValueError:
        lost = float("nan")
    if not word or not lost > 0.0:
        raise where.error(f"is 'METRIC NUMBER', with a number above 0; this is {show(margin)}")
    metric = metric_named(word.strip(), where)
    new = read_side(pilot)
    old = None if against is None else read_side(against)
    names = [name for name in new.groups if name in known]
    if not names:
        some = next(iter(new.groups), "none")
        raise BadInput(f"has no group of the suite '{file.suite.name}' (it has {some})", file=str(pilot),
                       hint=nearest(new.suite, [file.suite.name]))  # fmt: skip
    for loss in losses:
        aim = "PASS" if loss < lost else "REGRESSION"
        click.echo(f"to tell {aim} of {metric.name} at a margin of {lost:g}, if {loss:g} is truly lost, with "
                   f"{POWER:.0%} power at alpha {ALPHA:g}:")  # fmt: skip
        for name in names:
            click.echo(f"  {_needed(name, new.groups[name], old, metric.name, lost, loss)}")
    if old is None:
        click.echo(
            "SD of differences taken as that of single runs times √2: pairing by seed makes it smaller; give "
            "the run of another version with --against to measure it."
        )
    return 0


def _needed(name: str, of: Runs, old: Side | None, metric: str, margin: float, loss: float) -> str:
    values = {seed: run.values.get(metric) for seed, run in of.runs.items()}
    known = {seed: value for seed, value in values.items() if value is not None}
    if old is not None:
        before = old.groups[name].runs if name in old.groups else {}
        pairs = [(v, before[s].values.get(metric)) for s, v in known.items() if s in before]
        differences = [a - b for a, b in pairs if b is not None]
    else:
        differences = [2.0**0.5 * value for value in known.values()]
    if len(differences) < 2:
        return f"{name}: cannot be said from {len(differences)} runs"
    try:
        found = plan(differences, margin=margin, true_loss=loss)
    except ValueError as error:
        return f"{name}: {error}"
    return (
        f"{name}: {found.runs} runs (SD {found.sd:.3g} of {found.pilot_runs} pilot runs, upper 80 % limit "
        f"{found.sd_limit:.3g})"
    )


def _without_latencies(side: Side) -> Side:
    """Times differ from machine to machine: no baseline holds them."""
    groups = {
        name: of.model_copy(
            update={
                "runs": {
                    seed: run.model_copy(
                        update={"values": {m: v for m, v in run.values.items() if not LATENCY.fullmatch(m)}}
                    )
                    for seed, run in of.runs.items()
                }
            }
        )
        for name, of in side.groups.items()
    }
    return side.model_copy(update={"groups": groups})
