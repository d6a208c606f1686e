"""The values of a suite's runs, as gates read them: of a new run, or of a baseline. One file format for both.

`values.json` of a run's folder and a baseline are the same document: fingerprints first, then every run on a
line of its own, so that a review of a changed baseline reads line by line.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from scenarios.errors import BadInput, Where
from scenarios.scenario import Finite, Positive, Share, Spec
from scenarios.validate import validate
from simbench.files import write_text
from simbench.suite.fingerprint import fingerprints, metric_hashes, short
from simbench.suite.plan import Group

SCHEMA = "simbench-baseline/1"
NAME = "values.json"
GROSS = "gross_rate.smooth"
MAX_BYTES = 200_000_000
DIGITS = 10
Word = Annotated[str, Field(max_length=4000)]


class Ran(Spec):
    """One run. scenario, outputs: hashes of what happened and of what the pipeline gave. gross: whether any
    frame was off by more than 1 m or without a position; null where that cannot be said."""

    status: Literal["ok", "pipeline_error", "timeout", "bench_error", "receipt_mismatch"]
    scenario: Word
    outputs: Word | None
    gross: bool | None
    values: Mapping[Word, Finite | None]
    why: Word | None = None
    command: Word = ""


class Runs(Spec):
    """A group: its runs by seed (as text), and what is asked of it. margins: by metric, what may be lost.
    limits: by metric, as `>=0.9`. failed_runs: the share of runs that may have a gross failure."""

    margins: Mapping[Word, Positive] = Field(default_factory=dict)
    limits: Mapping[Word, Word] = Field(default_factory=dict)
    failed_runs: Share | None = None
    runs: Mapping[Word, Ran]


class Side(Spec):
    """All groups of a run. whole: the suite was run in full. bench, metrics: fingerprints of what the values
    depend on."""

    suite: Word
    whole: bool
    bench: Mapping[Word, Word]
    metrics: Mapping[Word, Word]
    groups: Mapping[Word, Runs]


def side_of(
    suite: str, groups: Iterable[Group], ran: Mapping[str, Mapping[int, Ran]], *, whole: bool
) -> Side:
    """The side of a run. groups: in the order of the suite. ran: by group and seed; a group of which nothing
    ran is left out."""
    some = [group for group in groups if group.name in ran]
    asked = {metric.name for group in some for metric, _ in group.metrics}
    return Side(
        suite=suite, whole=whole, bench=fingerprints(),
        metrics={name: digest for name, digest in metric_hashes().items() if name in asked},
        groups={
            group.name: Runs(
                margins={metric.name: margin for metric, margin in group.metrics},
                limits={limit.metric.name: limit.text_of_value for limit in group.limits},
                failed_runs=group.failed_runs,
                runs={str(seed): ran[group.name][seed] for seed in sorted(ran[group.name])},
            )
            for group in some
        },
    )  # fmt: skip


def ran_of(group: Group, case: Mapping[str, Any], values: Mapping[str, float | None]) -> Ran:
    """What gates read of one case: its entry in `result.json`, its values and latencies."""
    gross = values.get(GROSS)
    setting = json.dumps([group.job.images, case["boxes"], case["calibration"], case["off"]])
    return Ran(
        status=case["status"],
        scenario=short(f"{case['scenario_sha256']} {setting}".encode()),
        outputs=case["outputs_sha256"] and case["outputs_sha256"][:16],
        gross=None if gross is None else gross > 0.0,
        values={name: _rounded(values.get(name)) for name in group.values},
        why=case["why"],
        command=case["command"],
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def text_of(side: Side, *, commands: bool) -> str:
    """The document, one line for every run. commands: with the lines that reproduce; a baseline needs
    none."""
    return "\n".join(_lines(side, commands)) + "\n"


def _lines(side: Side, commands: bool) -> Iterator[str]:
    yield "{"
    yield f'  "schema": {json.dumps(SCHEMA)},'
    yield f'  "suite": {json.dumps(side.suite)},'
    yield f'  "whole": {json.dumps(side.whole)},'
    for name, table in (("bench", side.bench), ("metrics", side.metrics)):
        entries = [f"    {json.dumps(k)}: {json.dumps(v)}" for k, v in table.items()]
        yield f'  "{name}": {{\n' + ",\n".join(entries) + "\n  },"
    yield '  "groups": {'
    for i, (group, of) in enumerate(side.groups.items()):
        yield f"    {json.dumps(group)}: {{"
        for name, asked in (("margins", of.margins), ("limits", of.limits)):
            yield f'      "{name}": {json.dumps(dict(asked))},'
        yield f'      "failed_runs": {json.dumps(of.failed_runs)},'
        yield '      "runs": {'
        yield ",\n".join(
            f"        {json.dumps(seed)}: {_line(run, commands)}" for seed, run in of.runs.items()
        )
        yield "      }\n    }" + ("," if i + 1 < len(side.groups) else "")
    yield "  }\n}"


def _line(run: Ran, commands: bool) -> str:
    left_out = {name for name in ("why", "command") if not getattr(run, name)}
    data = run.model_dump(mode="json", exclude=left_out if commands else left_out | {"command"})
    return json.dumps(data, allow_nan=False)


def write_side(side: Side, path: Path, *, commands: bool) -> None:
    """Write the document. BadInput: the place cannot be written."""
    write_text(path, text_of(side, commands=commands))


def read_side(path: Path) -> Side:
    """The document of a file, or of a run's folder. BadInput: it is none, cut off, or of another version."""
    file = path / NAME if path.is_dir() else path
    name = str(file)
    try:
        if file.stat().st_size > MAX_BYTES:
            raise BadInput(f"is larger than {MAX_BYTES // 1_000_000} MB", file=name)
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        what = "holds no values.json: it is no folder of a suite's run" if path.is_dir() else "no such file"
        raise BadInput(what, file=str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"cannot be read: {error}", file=name) from None
    try:
        data = json.loads(text, parse_constant=_no_number)
    except json.JSONDecodeError as error:
        raise BadInput(f"is not JSON, or is cut off: {error.msg}", file=name, line=error.lineno) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"is not JSON: {error}", file=name) from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else None
        raise BadInput(f"is no baseline: its schema is {found!r}", file=name, allowed=SCHEMA)
    side = validate(Side, {k: v for k, v in data.items() if k != "schema"}, Where(file=name))
    for group, of in side.groups.items():
        for seed in of.runs:
            if not (seed.isascii() and seed.isdigit()):
                raise BadInput(f"'{seed}' is no seed", file=name, field=f"groups.{group}")
    return side


def _no_number(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")
