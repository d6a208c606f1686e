"""`simbench run SUITE`: check everything before anything runs, run, judge, write."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import join

import click

from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet, fault_set, parse_fault_arguments
from scenarios.suite import Suite, SuiteFile, load_suite
from simbench.campaign.executor import check_cluster, open_executor
from simbench.campaign.job_key import job_key
from simbench.campaign.ledger import NAME as LEDGER
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.lock import only_one
from simbench.campaign.run import campaign
from simbench.canary import canary
from simbench.environment import environment
from simbench.files import prepare_folder
from simbench.isolate.ask import check_pipeline_name
from simbench.isolate.limits import DEFAULT, Isolate, Limits
from simbench.progress import Progress
from simbench.result_file import Record, print_result, write_result
from simbench.stage import stage
from simbench.suite.coverage import coverage
from simbench.suite.gate import as_lines
from simbench.suite.judge import Asked, answer
from simbench.suite.looks import until_decided
from simbench.suite.plan import Group, Recording, groups_of, recordings_of
from simbench.suite.run import failed_text, record_text, runs_of, seconds_of
from simbench.suite.select import chosen
from simbench.suite.side import Ran, Side, read_side, side_of
from simbench.suite.write import Told, failed_cases, verdict_of, write_answer, write_values

NOTHING = 5


@dataclass(frozen=True, kw_only=True)
class Request:
    """What `simbench run SUITE` was asked. pipelines, seeds: in place of the suite's. words, tags: -k, -m."""

    target: str
    out: Path
    pipelines: tuple[str, ...] = ()
    seeds: tuple[int, ...] | None = None
    words: str | None = None
    tags: str | None = None
    last_failed: bool = False
    resume: bool = False
    against: Path | None = None
    allow_changed: bool = False
    until_decided: bool = False
    workers: int | None = None
    cluster: str | None = None
    as_json: bool = False
    isolate: Isolate = "users"
    limits: Limits = DEFAULT


def run_suite(asked: Request) -> int:
    """The exit code: 0 pass, 1 regression, failed limit or failed pipeline, 3 the bench, 4 inconclusive, 5
    nothing selected. Raises BadInput before anything runs."""
    file = load_suite(asked.target)
    groups = tuple(
        replace(group, job=replace(group.job, isolate=asked.isolate, limits=asked.limits))
        for group in groups_of(file, pipelines=asked.pipelines, seeds=asked.seeds)
    )
    left_out = canary_of(file)
    for name in dict.fromkeys(group.pipeline for group in groups):
        check_pipeline_name(name)
    check_cluster(asked.cluster)
    old = None if asked.against is None else read_side(asked.against)
    if old is not None and old.suite != file.suite.name:
        raise BadInput(
            f"is a baseline of the suite '{old.suite}', not of '{file.suite.name}'", file=str(asked.against)
        )
    if asked.until_decided and old is None:
        raise BadInput("--until-decided needs a baseline to decide against: --against FILE")
    only = failed_cases(asked.out) if asked.last_failed else None
    cases = chosen(groups, words=asked.words, tags=asked.tags, only=only)
    if not cases:
        click.echo(
            f"simbench: nothing selected: no case of {file.suite.name} is meant{_why(asked)}", err=True
        )
        return NOTHING
    for group in {group.name: group for group, _ in cases}.values():
        stage(group.job)  # a bad combination costs one sentence and no time
    prepare_folder(asked.out)
    with only_one(asked.out):
        if not asked.resume:
            for suffix in ("", "-wal", "-shm"):
                (asked.out / (LEDGER + suffix)).unlink(missing_ok=True)
        with Ledger(asked.out, {"suite": file.suite.name}, kind="suite") as ledger:
            run = _Run(suite=file.suite, asked=asked, ledger=ledger, groups=groups)
            whole = len(cases) == sum(len(group.seeds) for group in groups)
            return run.finish(cases, old, whole, canary(left_out))


def canary_of(file: SuiteFile) -> FaultSet:
    """The error that the suite's canary asks for and does not get. BadInput: there is none."""
    change = parse_fault_arguments((file.suite.canary,))
    found = fault_set({spec.name: spec for spec in change.specs}, "canary")
    if not found.specs:
        raise file.where.error("is no error that could be left out", ("canary",))
    return found


def _why(asked: Request) -> str:
    words = [f"-k {asked.words}" if asked.words else "", f"-m {asked.tags}" if asked.tags else ""]
    words += ["--lf: nothing failed last time" if asked.last_failed else ""]
    told = ", ".join(word for word in words if word)
    return f" by {told}" if told else ""


@dataclass(kw_only=True)
class _Run:
    """The state of a run: which recordings were made so far, by their keys in the ledger, and what gates read
    of them."""

    suite: Suite
    asked: Request
    ledger: Ledger
    groups: Sequence[Group]
    keys: dict[Recording, str] = field(default_factory=dict)
    ran: dict[str, dict[int, Ran]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    fresh: int = 0
    wall_s: float = 0.0

    def finish(
        self, cases: Sequence[tuple[Group, int]], old: Side | None, whole: bool, blind: str | None
    ) -> int:
        """Run, judge, write, print; the exit code."""
        asked, look, settled = self.asked, None, None
        if asked.until_decided and old is not None:
            names = {group.name for group, _ in cases}
            going = [group for group in self.groups if group.name in names]
            new, settled, look = until_decided(going, old, lambda more: self.measure(more, whole))
        else:
            new = self.measure(cases, whole)
        found = answer(
            new, old, Asked(changed=asked.allow_changed, look=look), canary=blind, settled=settled
        )  # fmt: skip
        told = Told(
            description=self.suite.description, command=join(["simbench", *sys.argv[1:]]), cost=self.cost(),
            against=None if asked.against is None else asked.against.name,
            coverage=coverage(self.groups), seconds=self.seconds,
        )  # fmt: skip
        write_values(new, asked.out)
        write_result(asked.out, self.records(), environment("none"), verdict=verdict_of(found))
        page = write_answer(found, new, old, asked.out, told)
        if asked.as_json:
            print_result(asked.out)
        else:
            for line in (*as_lines(found.gates), *found.notes, *found.problems[1:], found.sentence):
                click.echo(line)
            click.echo(f"report: {page}")
        return found.exit_code

    def measure(self, cases: Sequence[tuple[Group, int]], whole: bool) -> Side:
        """Run what was not run yet; the side of all so far."""
        recordings = [r for r in recordings_of(cases) if r not in self.keys]
        keys = {_key(recording): recording for recording in recordings}
        groups = {group.name: group for group in self.groups}
        missing = sum(key not in self.ledger for key in keys)
        if missing < len(keys):
            click.echo(f"{len(keys) - missing} of {len(keys)} recordings are there already", err=True)
        progress = Progress(total=missing)
        workers = max(1, min(self.asked.workers or os.cpu_count() or 1, missing))
        begun = time.perf_counter()
        with open_executor(workers, self.asked.cluster if missing else None) as executor:
            rows = campaign(
                record_text, recordings, _key, executor, self.ledger,
                lambda row: progress.say(_told(keys[row.key], row)),
            )  # fmt: skip
            for row in rows:
                recording, record = keys[row.key], _record(keys[row.key], row)
                self.keys[recording] = row.key
                for name, one in runs_of(recording, record, groups).items():
                    self.ran.setdefault(name, {})[recording.job.seed] = one
                    self.seconds[f"{name}/{recording.job.seed}"] = seconds_of(record)
        lost = [group.case(seed) for group, seed in cases if seed not in self.ran.get(group.name, {})]
        if lost:
            raise RuntimeError(f"{len(lost)} cases were meant and have no result, among them {lost[0]}")
        self.wall_s += time.perf_counter() - begun
        self.fresh += missing
        return side_of(self.suite.name, self.groups, self.ran, whole=whole)

    def records(self) -> Iterator[Record]:
        """What every recording adds to `result.json`, read again from the ledger: all of them may be more
        than memory holds."""
        for recording, key in self.keys.items():
            yield _record(recording, self.ledger.get(key))

    def cost(self) -> str:
        """What the run took, in words."""
        now = f"{self.fresh} of them now in {self.wall_s:.0f} s" if self.fresh else "none of them now"
        return f"{len(self.keys)} recordings, {now}."


def _record(recording: Recording, row: Done) -> Record:
    return dict(json.loads(failed_text(recording, row) if row.value is None else row.value))


def _key(recording: Recording) -> str:
    return job_key(recording.job, groups=list(recording.groups))


def _told(recording: Recording, row: Done) -> str:
    return f"{recording.groups[0].rpartition('/')[0]} seed {recording.job.seed}: {row.status}"
