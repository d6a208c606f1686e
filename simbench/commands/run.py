"""`simbench demo`, `simbench run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.core import ParameterSource

from simbench.commands.options import DEFAULT, OF_THE_PAPER, common, isolation, of_suites
from simbench.execute import execute

if TYPE_CHECKING:
    from simbench.case import Boxes, Images


def _span(_: click.Context, __: click.Parameter, text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    first, dash, last = text.partition("-")
    numbers = (first, last if dash else first)
    if not all(word.isascii() and word.isdigit() and len(word) < 10 for word in numbers):
        raise click.BadParameter(f"'{text}' is not a range of frames; allowed: 0-99")
    low, high = int(numbers[0]), int(numbers[1])
    if high < low:
        raise click.BadParameter(f"'{text}' is not a range of frames from low to high")
    return low, high


@click.command()
@common("out/demo")
def demo(
    seeds: tuple[int, ...],
    images: Images,
    jobs: int | None,
    out: Path,
    as_json: bool,
    size: tuple[int, int] | None,
) -> None:
    """A car overtakes an e-scooter; cameras are 50 ms late, the body shakes; both rigs, one page.

    Example: simbench demo --out out/demo
    """
    from simbench.case import Job

    planned = [
        Job(
            scenario="overtake-approach", system=system, seed=seed, pipelines=OF_THE_PAPER, faults=(faults,),
            images=images if faults == "demo" else "none", size_px=size,
        )
        for system in ("car", "wearable")
        for seed in seeds
        for faults in ("none", "demo")
    ]  # fmt: skip
    execute(planned, out, images, jobs, as_json)


@click.command()
@click.argument("targets", nargs=-1, metavar="TARGET...")
@click.option("--system", type=click.Choice(["car", "wearable", "both"]), default="both", help="Which rig.")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME",
    help="May be repeated. Default: the raw box (with and without ground), the paper's method and 'robust'.",
)  # fmt: skip
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE|KEY@SEVERITY",
    help="Replaces the scenario's same fault, adds the others; 'none' clears. May be repeated.",
)  # fmt: skip
@click.option(
    "--set", "changes", multiple=True, metavar="PATH=VALUE",
    help="Replaces a value of the scenario file, as systems.car.duration_s=3. May be repeated.",
)  # fmt: skip
@click.option(
    "--off", "off", multiple=True, metavar="NAME",
    help="Leave a part of the bench out: bench.rolling_scan, bench.spin_phase, bench.reference_rate.",
)  # fmt: skip
@click.option("--alone", is_flag=True, help="Leave out the same drives with errors off.")
@click.option(
    "--boxes", type=click.Choice(["labels", "model"]), default=None,
    help="Detections: the exact boxes of all objects (default for recorded data), or what the detector model "
    "makes of them (default for simulated drives).",
)  # fmt: skip
@click.option(
    "--frames", "span", callback=_span, default=None, metavar="FIRST-LAST",
    help="Recorded sequences: only these frames.",
)  # fmt: skip
@click.option(
    "--calibration", default="true", show_default=True, metavar="true|found[:FILE]",
    help="What the pipelines are told: the truth, or what 'simbench calibrate' finds (or wrote to FILE).",
)  # fmt: skip
@click.option(
    "--topics", type=click.Path(path_type=Path), default=None, metavar="FILE",
    help="Of mcap:PATH: which topic is which sensor (docs/formats.md). Not needed for bags of simbench's.",
)  # fmt: skip
@of_suites
@isolation
@common("out/run")
def run(
    targets: tuple[str, ...], system: str, pipelines: tuple[str, ...], faults: tuple[str, ...],
    changes: tuple[str, ...], off: tuple[str, ...], alone: bool,
    boxes: Boxes | None, span: tuple[int, int] | None, calibration: str, topics: Path | None,
    seeds: tuple[int, ...], images: Images, jobs: int | None, out: Path, as_json: bool,
    size: tuple[int, int] | None, apart: dict[str, Any], suite: dict[str, Any],
) -> None:  # fmt: skip
    """Run a suite, or scenarios (names or .yaml files), through pipelines; write result.json and report.html.

    A suite gives a verdict: exit code 0 PASS, 1 a limit missed, a REGRESSION or a pipeline that failed, 3 the
    bench, 4 INCONCLUSIVE, 5 nothing selected. Without a target the suite 'regression' runs.

    Of scenarios: where errors are injected, the same drives are also run with errors off. A target
    kitti:FOLDER is recorded data: every frame (object layout), sequence or drive is a run, called by its
    number; --seeds picks some. A FOLDER that 'simbench generate' wrote (or rec:FOLDER) is played as it was
    made. mcap:PATH is a ROS 2 bag (--topics says which topic is which sensor): nobody knows its truth, so
    answers are only held against each other.

    Example: simbench run overtake-approach --system car --faults timing.trigger_offset_ms=50 --seeds 0-1
    """
    from dataclasses import replace

    from scenarios.fault_set import parse_fault_arguments
    from scenarios.load import load_scenario
    from simbench.calibration.find import found_for
    from simbench.case import Job
    from simbench.formats.jobs import plan_recorded
    from simbench.formats.stored import stored_target
    from simbench.formats.targets import MCAP, is_recorded
    from simbench.isolate.ask import check_pipeline_name
    from simbench.stage import faults_of

    targets = tuple(stored_target(target) or target for target in targets)
    if any(target.startswith(MCAP) for target in targets):
        if len(targets) > 1:
            raise click.UsageError("one ROS 2 bag at a time, and nothing beside it")
        _run_imported(targets[0], topics, pipelines, out, as_json, apart, suite)
    if topics is not None:
        raise click.UsageError("--topics is for a ROS 2 bag (mcap:PATH)")
    if _is_suite(targets, suite):
        _run_suite(targets, pipelines, seeds, jobs, out, as_json, apart, suite)
    chosen = tuple(dict.fromkeys(pipelines)) or DEFAULT
    for name in chosen:
        check_pipeline_name(name)
    recorded = [target for target in dict.fromkeys(targets) if is_recorded(target)]
    planned = []
    if recorded and changes:
        raise click.UsageError("--set is for simulated drives: what was recorded has happened")
    if recorded and off:
        raise click.UsageError("--off is for simulated drives: what was recorded has happened")
    if recorded and calibration != "true":
        raise click.UsageError("--calibration is for simulated drives: recorded data bring their own")
    if recorded:
        given = click.get_current_context().get_parameter_source("seeds") != ParameterSource.DEFAULT
        template = Job(
            scenario="", system=system, seed=0, pipelines=chosen, faults=faults, images=images, size_px=size,
            boxes=boxes, frames=span, **apart,
        )  # fmt: skip
        planned += plan_recorded(recorded, template, seeds if given else None, alone=alone)
    if len(recorded) < len(dict.fromkeys(targets)):
        parse_fault_arguments(faults)
        if span is not None:
            raise click.UsageError("--frames is for recorded data (kitti:FOLDER)")
    for target in dict.fromkeys(targets):
        if target in recorded:
            continue
        family = load_scenario(target, changes)
        for name in family.system_names if system == "both" else (system,):
            if calibration == "found":
                click.echo(f"calibrating the rig of {name}: this takes about a minute", err=True)
            found_in = found_for(calibration, out, family, name, size)
            for seed in seeds:
                job = Job(
                    scenario=target, system=name, seed=seed, pipelines=chosen, faults=faults,
                    images=images, size_px=size, boxes=boxes, changes=changes, calibration=calibration,
                    found_in=found_in, off=tuple(dict.fromkeys(off)), **apart,
                )  # fmt: skip
                # The same drive with errors off: what every loss is measured against.
                if not alone and len(faults_of(job, family, family.resolve(seed))) > 0:
                    planned.append(replace(job, faults=("none",), images="none"))
                planned.append(job)
    pictures = images if any(job.images != "none" for job in planned) else "none"
    execute(planned, out, pictures, jobs, as_json)


def _run_imported(
    target: str, topics: Path | None, pipelines: tuple[str, ...], out: Path, as_json: bool,
    apart: dict[str, Any], suite: dict[str, Any],
) -> NoReturn:  # fmt: skip
    """UsageError: an option that is for drives whose truth is known."""
    import shlex
    import sys

    from simbench.imported.command import Asked, run_imported
    from simbench.isolate.ask import check_pipeline_name

    source = click.get_current_context().get_parameter_source
    for name in (*FOR_SCENARIOS, "seeds", *suite):
        if source(name) not in (ParameterSource.DEFAULT, None):
            raise click.UsageError(f"{_option(name)} is not for a ROS 2 bag")
    chosen = tuple(dict.fromkeys(pipelines)) or DEFAULT
    for name in chosen:
        check_pipeline_name(name)
    asked = Asked(
        target=target, topics=topics, pipelines=chosen, out=out, as_json=as_json,
        command=shlex.join(["simbench", *sys.argv[1:]]), **apart,
    )  # fmt: skip
    raise SystemExit(run_imported(asked))


FOR_SCENARIOS = (
    "system", "faults", "changes", "off", "alone", "boxes", "span", "calibration", "size", "images",
)  # fmt: skip


def _is_suite(targets: tuple[str, ...], suite: dict[str, Any]) -> bool:
    """Whether a suite is meant. UsageError: a mixture."""
    from scenarios.errors import Where
    from scenarios.load import list_scenarios
    from scenarios.suite import is_suite, list_suites

    known = (*list_scenarios(), *list_suites())
    for target in targets:
        if target and not set(target) & set("/.:") and target not in known:
            raise Where(file=None).unknown("scenario or suite", target, known)
    suites = [target for target in targets if is_suite(target)]
    if suites and len(targets) > 1:
        raise click.UsageError("one suite at a time, and nothing beside it")
    given = [name for name, value in suite.items() if value]
    if targets and not suites and given:
        raise click.UsageError(
            f"{_option(given[0])} is for suites; {targets[0]} is none (see 'simbench list suites')"
        )
    return bool(suites) or not targets


def _run_suite(
    targets: tuple[str, ...], pipelines: tuple[str, ...], seeds: tuple[int, ...], jobs: int | None, out: Path,
    as_json: bool, apart: dict[str, Any], suite: dict[str, Any],
) -> NoReturn:  # fmt: skip
    """UsageError: an option that the suite's file decides."""
    from simbench.suite.command import Request, run_suite

    source = click.get_current_context().get_parameter_source
    for name in FOR_SCENARIOS:
        if source(name) != ParameterSource.DEFAULT:
            raise click.UsageError(f"{_option(name)} is for scenarios: of a suite its file says it")
    if not targets:
        click.echo("no target: the suite 'regression'", err=True)
    request = Request(
        target=targets[0] if targets else "regression", out=out, pipelines=tuple(dict.fromkeys(pipelines)),
        seeds=seeds if source("seeds") != ParameterSource.DEFAULT else None, workers=jobs, as_json=as_json,
        **apart, **suite,
    )  # fmt: skip
    raise SystemExit(run_suite(request))


def _option(name: str) -> str:
    """How an option is written, by its parameter's name."""
    parameters = click.get_current_context().command.params
    return next(parameter.opts[0] for parameter in parameters if parameter.name == name)
