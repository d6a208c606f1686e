"""`simbench generate`: check everything before anything is made, record, say what there is."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from shlex import join

import click

from scenarios.errors import BadInput
from scenarios.load import load_scenario
from simbench.campaign.executor import open_executor
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.lock import only_one
from simbench.campaign.run import campaign
from simbench.cards.page import Made, write_card
from simbench.cards.recorded import recorded_sights
from simbench.cards.table import read_sights
from simbench.case import Images, Job
from simbench.files import prepare_folder, write_text
from simbench.generate.disk import check_room, estimate_bytes
from simbench.generate.require import Requirement
from simbench.generate.split import Shares, part_of
from simbench.generate.work import Format, Row, Task, key_of, row_of
from simbench.progress import Progress
from simbench.stage import stage

SCHEMA = "simbench-dataset/1"
NAME = "dataset.json"


@dataclass(frozen=True, kw_only=True)
class Request:
    """What `simbench generate` was asked. changes: of `--set` and `--vary`; beside: `kitti:FOLDER`."""

    targets: tuple[str, ...]
    out: Path
    system: str | None = None
    seeds: tuple[int, ...] = (0, 1)
    faults: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    required: tuple[Requirement, ...] = ()
    shares: Shares | None = None
    formats: tuple[Format, ...] = ()
    images: Images = "none"
    beside: str | None = None
    workers: int | None = None
    cluster: str | None = None


def generate_recordings(asked: Request) -> int:
    """The exit code: 0 all are there or were rejected, 3 the bench failed in some. Raises BadInput."""
    out = asked.out
    jobs = _jobs(asked)
    names = [f"{PurePath(job.scenario).stem}-{job.system}-{job.seed:04d}" for job in jobs]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise BadInput(f"two recordings would be called {twice[0]}; make them into two folders")
    for job in {(job.scenario, job.system): job for job in jobs}.values():
        stage(job)  # a bad combination costs one sentence and no time
    beside = None if asked.beside is None else recorded_sights(asked.beside)
    prepare_folder(out)
    about = {
        "faults": list(asked.faults), "changes": list(asked.changes), "images": asked.images,
        "required": [str(one) for one in asked.required], "formats": list(asked.formats),
    }  # fmt: skip
    with only_one(out), Ledger(out, about, kind="data set") as ledger:
        tasks = [
            Task(job=job, out=str(out.absolute()), name=name, required=asked.required, formats=asked.formats)
            for job, name in zip(jobs, names, strict=True)
        ]
        rows = _made(tasks, ledger, asked)
        made = _as_made(rows, tasks, asked.shares)
        command = join(["simbench", *sys.argv[1:]])
        _write(rows, made, command, out)
        title = ", ".join(dict.fromkeys(row.scenario for row in made))
        kept = [sight for row in rows if row.status == "ok" for sight in read_sights(out / row.name)]
        required = [str(one) for one in asked.required]
        page = write_card(made, kept, out, title=title, command=command, required=required, beside=beside)
    return _told(rows, out, page)


def _jobs(asked: Request) -> list[Job]:
    jobs = []
    for target in asked.targets:
        known = load_scenario(target, asked.changes).system_names
        for name in known if asked.system is None else (asked.system,):
            jobs += [
                Job(
                    scenario=target, system=name, seed=seed, pipelines=(), faults=asked.faults,
                    changes=asked.changes, images=asked.images,
                )
                for seed in asked.seeds
            ]  # fmt: skip
    return jobs


def _made(tasks: Sequence[Task], ledger: Ledger, asked: Request) -> list[Row]:
    """Make what is not there; all rows in the order of the tasks. A recording whose folder is gone is an
    error: the ledger is not to say that it is there."""
    out = asked.out
    missing = [task for task in tasks if key_of(task) not in ledger]
    if len(missing) < len(tasks):
        click.echo(f"{len(tasks) - len(missing)} of {len(tasks)} recordings are there already", err=True)
    if missing:
        needed = estimate_bytes(missing, out)
        click.echo(f"{len(missing)} recordings to make, about {needed / 1e6:.0f} MB", err=True)
        check_room(needed, out)
    progress = Progress(total=len(missing))
    names = {key_of(task): task.name for task in tasks}
    workers = max(1, min(asked.workers or os.cpu_count() or 1, len(missing)))
    with open_executor(workers, asked.cluster) as executor:
        found = [
            _row(names[done.key], done)
            for done in campaign(
                row_of, tasks, key_of, executor, ledger, lambda d: progress.say(_line(_row(names[d.key], d)))
            )
        ]
    for row in found:
        if row.status == "ok" and not (out / row.name).is_dir():
            raise BadInput(
                f"{row.name} was made and is gone; remove {ledger.path} to make all again", file=str(out)
            )
    return found


def _row(name: str, done: Done) -> Row:
    if done.value is None:
        return Row(name=name, status="bench_error", why=done.failure)
    content = json.loads(done.value)
    return Row(**{**content, "seconds": tuple(content["seconds"])})


def _as_made(rows: Sequence[Row], tasks: Sequence[Task], shares: Shares | None) -> list[Made]:
    return [
        Made(
            name=row.name, status=row.status, why=row.why, scenario=PurePath(task.job.scenario).stem,
            system=task.job.system, seed=task.job.seed, size_bytes=row.size_bytes,
            split=part_of(PurePath(task.job.scenario).stem, task.job.seed, shares),
        )
        for row, task in zip(rows, tasks, strict=True)
    ]  # fmt: skip


def _write(rows: Sequence[Row], made: Sequence[Made], command: str, out: Path) -> None:
    """dataset.json: what there is. Same command, same bytes."""
    entries = [
        {
            "name": row.name, "status": row.status, "why": row.why, "scenario": one.scenario,
            "system": one.system, "seed": one.seed, "split": one.split or None, "messages": row.messages,
            "size_bytes": row.size_bytes, "sha256": row.sha256,
        }
        for row, one in zip(rows, made, strict=True)
    ]  # fmt: skip
    content = {"schema": SCHEMA, "command": command, "recordings": entries}
    write_text(out / NAME, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _line(row: Row) -> str:
    if row.status != "ok":
        return f"{row.name}: {row.status}: {row.why}"
    return (
        f"{row.name}: ok, {row.size_bytes / 1e6:.1f} MB, {row.seconds[0]:.1f} s to make, "
        f"{row.seconds[1]:.1f} s to write"
    )


def _told(rows: Sequence[Row], out: Path, page: Path) -> int:
    good = [row for row in rows if row.status == "ok"]
    rejected = sum(row.status == "rejected" for row in rows)
    for row in rows:
        if row.status not in ("ok", "rejected"):
            click.echo(f"{row.name}: {row.status}: {row.why}")
    size = sum(row.size_bytes for row in good)
    driven_s = sum(row.driven_s for row in good)
    words = f"{len(good)} of {len(rows)} recordings, {size / 1e6:.1f} MB"
    words += f", {size / 1e6 / driven_s:.1f} MB per second of driving" if good else ""
    words += f", {rejected} rejected" if rejected else ""
    click.echo(f"{words}: {out}\ncard: {page}")
    return 0 if len(good) + rejected == len(rows) else 3
