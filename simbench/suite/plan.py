"""From a suite file to what is run: jobs, and the groups of cases that its gates are about.

A case is one pipeline on one recording; its id is block/scenario/system/faults/pipeline/seed. A group is what
cases have in common but for the seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import PurePath

from scenarios.errors import BadInput, Where
from scenarios.fault_set import parse_fault_arguments
from scenarios.load import load_scenario
from scenarios.seeding import seed_list
from scenarios.suite import OWN, Block, Suite, SuiteFile
from simbench.case import Job
from simbench.limits import Limit, metric_named, parse_limit
from simbench.score.metrics import Metric


@dataclass(frozen=True, kw_only=True)
class Group:
    """Cases that differ by their seed only. job: of its first seed, with its one pipeline. metrics: those
    that a baseline is asked about, each with the margin by which it may be worse. failed_runs: the share of
    runs that may have a gross failure."""

    block: str
    faults: str
    job: Job
    seeds: tuple[int, ...]
    tags: tuple[str, ...]
    limits: tuple[Limit, ...]
    metrics: tuple[tuple[Metric, float], ...]
    failed_runs: float | None

    @property
    def scenario(self) -> str:
        """Its name, of a file the stem."""
        return PurePath(self.job.scenario).stem

    @property
    def pipeline(self) -> str:
        return self.job.pipelines[0]

    @property
    def name(self) -> str:
        """block/scenario/system/faults/pipeline"""
        path, _, attribute = self.pipeline.rpartition(":")
        # Of a file without its folder, which differs between users.
        pipeline = f"{PurePath(path).name}:{attribute}" if path.endswith(".py") else self.pipeline
        pipeline = pipeline.replace("/", "|")
        return "/".join((self.block, self.scenario, self.job.system, self.faults, pipeline))

    def case(self, seed: int) -> str:
        """The id of a case."""
        return f"{self.name}/{seed}"

    def at(self, seed: int) -> Job:
        """The job of one seed."""
        return replace(self.job, seed=seed)

    @property
    def values(self) -> tuple[str, ...]:
        """The metrics that its gates read, besides gross failures."""
        names = [metric.name for metric, _ in self.metrics] + [limit.metric.name for limit in self.limits]
        return tuple(dict.fromkeys(names))


@dataclass(frozen=True, kw_only=True)
class Recording:
    """One job of a block, whose errors the suite calls `faults`. groups: the name of the group that each of
    its pipelines' cases belongs to."""

    job: Job
    block: str
    faults: str
    groups: tuple[str, ...]


def groups_of(
    file: SuiteFile, *, pipelines: Sequence[str] = (), seeds: Sequence[int] | None = None
) -> tuple[Group, ...]:
    """All groups of a suite, in the order of the file. pipelines, seeds: in place of those of the suite.

    BadInput: unknown scenario, system, fault or metric, a malformed limit, two groups of one name.
    """
    suite, where = file.suite, file.where
    metrics = {
        metric_named(word, where.at("metrics", i)).name: metric_named(word, where.at("metrics", i))
        for i, word in enumerate(suite.metrics)
    }
    found: dict[str, Group] = {}
    for name, block in suite.blocks.items():
        place = where.at("blocks", name)
        limits = _limits(suite.limits, where.at("limits")) | _limits(block.limits, place.at("limits"))
        margins = _margins(suite.margins, where.at("margins"), metrics) | _margins(
            block.margins, place.at("margins"), metrics
        )
        own_seeds = seed_list(str(suite.seeds if block.seeds is None else block.seeds))
        runs = tuple(seeds) if seeds is not None else own_seeds
        for job, faults in _jobs(file, block, place):
            own = tuple(_pipeline(file, word) for word in block.pipelines or suite.pipelines)
            for pipeline in pipelines or own:
                group = Group(
                    block=name, faults=faults, seeds=runs, tags=block.tags, limits=tuple(limits.values()),
                    job=replace(job, seed=runs[0], pipelines=(pipeline,)),
                    metrics=tuple((m, margins.get(m.name, suite.margin)) for m in metrics.values()),
                    failed_runs=suite.failed_runs if block.failed_runs is None else block.failed_runs,
                )  # fmt: skip
                if group.name in found:
                    raise place.error(f"two groups are called {group.name}")
                found[group.name] = group
    return tuple(found.values())


def recordings_of(cases: Sequence[tuple[Group, int]]) -> tuple[Recording, ...]:
    """The jobs that make those cases: pipelines of a block on the same drive share its recording."""
    drives: dict[tuple[str, str, Job], dict[str, str]] = {}
    for group, seed in cases:
        drive = (group.block, group.faults, replace(group.at(seed), pipelines=()))
        drives.setdefault(drive, {})[group.pipeline] = group.name
    return tuple(
        Recording(
            job=replace(job, pipelines=tuple(groups)), block=block, faults=faults,
            groups=tuple(groups.values()),
        )
        for (block, faults, job), groups in drives.items()
    )  # fmt: skip


def _jobs(file: SuiteFile, block: Block, where: Where) -> list[tuple[Job, str]]:
    """Jobs of a block without seeds and pipelines, each with the name of its faults."""
    jobs = []
    for i, scenario in enumerate(block.scenarios):
        target = _beside(file, scenario)
        try:
            family = load_scenario(target, block.change)
        except BadInput as error:
            raise _placed(error, where.at("scenarios", i)) from None
        for system in block.systems:
            if system not in family.system_names:
                raise where.unknown("system", system, family.system_names, ("systems",))
        for system, (j, words) in product(block.systems, enumerate(block.faults)):
            arguments = () if words == OWN else (words,) if isinstance(words, str) else words
            try:
                parse_fault_arguments(arguments, "car" if system == "car" else "rider")
            except BadInput as error:
                raise _placed(error, where.at("faults", j)) from None
            job = Job(
                scenario=target, system=system, seed=0, pipelines=(), faults=arguments, images=block.images,
                boxes=block.boxes, changes=block.change,
            )  # fmt: skip
            jobs.append((job, "+".join(map(_label, arguments)) or OWN))
    return jobs


def _beside(file: SuiteFile, scenario: str) -> str:
    """A scenario file lies beside the suite file that names it; a name is one of the catalogue."""
    if "/" not in scenario and not scenario.endswith((".yaml", ".yml")):
        return scenario
    return str(file.path.parent / scenario)


def _label(words: str) -> str:
    """What a fault is called in a group's name: a file by its stem; without the slash that parts names."""
    if "=" in words:
        return words.replace("/", "|")
    path = PurePath(words)
    return path.stem if path.suffix in (".yaml", ".yml") else path.name


def _pipeline(file: SuiteFile, reference: str) -> str:
    """A pipeline's file lies beside the suite file too."""
    path, colon, attribute = reference.rpartition(":")
    return f"{file.path.parent / path}{colon}{attribute}" if path.endswith(".py") else reference


def _placed(error: BadInput, where: Where) -> BadInput:
    """The same complaint, told of the line of the suite that led to it. A file that lies elsewhere tells of
    its own line."""
    if error.file is not None and not error.file.startswith("--"):
        return error
    return where.error(error.problem, allowed=error.allowed, hint=error.hint)


def _limits(words: Mapping[str, str], where: Where) -> dict[str, Limit]:
    found = {}
    for word, text in words.items():
        limit = parse_limit(word + text, where.at(word), timed=True)
        found[limit.metric.name] = limit
    return found


def _margins(words: Mapping[str, float], where: Where, metrics: Mapping[str, Metric]) -> dict[str, float]:
    found = {}
    for word, margin in words.items():
        name = metric_named(word, where.at(word)).name
        if name not in metrics:
            raise where.error("is not among the suite's metrics", (word,), allowed=", ".join(metrics))
        found[name] = margin
    return found


def described(suite: Suite, groups: Sequence[Group]) -> str:
    """One sentence about the size of a suite."""
    cases = sum(len(group.seeds) for group in groups)
    drives = len(recordings_of([(group, seed) for group in groups for seed in group.seeds]))
    return f"{suite.name}: {len(groups)} groups, {cases} cases, {drives} recordings"
