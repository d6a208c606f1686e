"""`simbench generate`: check everything before anything is made, record, say what there is."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePath
from shlex import join

import click

from scenarios.errors import BadInput
from scenarios.load import load_scenario
from simbench.campaign.executor import open_executor
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.lock import only_one
from simbench.campaign.run import campaign
from simbench.case import Images, Job
from simbench.files import prepare_folder, write_text
from simbench.generate.disk import check_room, estimate_bytes
from simbench.generate.work import Row, Task, key_of, row_of
from simbench.progress import Progress
from simbench.stage import stage

SCHEMA = "simbench-dataset/1"
NAME = "dataset.json"


def generate_recordings(
    targets: Sequence[str], *, system: str | None, seeds: Sequence[int], faults: tuple[str, ...],
    changes: tuple[str, ...], images: Images, workers: int | None, out: Path,
) -> int:  # fmt: skip
    """The exit code: 0 all are there, 3 the bench failed in some. Raises BadInput."""
    jobs = _jobs(targets, system, seeds, faults, changes, images)
    names = [f"{PurePath(job.scenario).stem}-{job.system}-{job.seed:04d}" for job in jobs]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise BadInput(f"two recordings would be called {twice[0]}; make them into two folders")
    for job in {(job.scenario, job.system): job for job in jobs}.values():
        stage(job)  # a bad combination costs one sentence and no time
    prepare_folder(out)
    about = {"faults": list(faults), "changes": list(changes), "images": images}
    with only_one(out), Ledger(out, about, kind="data set") as ledger:
        tasks = [Task(job=job, out=str(out), name=name) for job, name in zip(jobs, names, strict=True)]
        rows = _made(tasks, ledger, workers or os.cpu_count() or 1, out)
        _write(rows, tasks, out)
    good = [row for row in rows if row.status == "ok"]
    for row in rows:
        if row.status != "ok":
            click.echo(f"{row.name}: {row.status}: {row.why}")
    size = sum(row.size_bytes for row in good)
    click.echo(f"{len(good)} of {len(rows)} recordings, {size / 1e6:.1f} MB: {out}")
    return 0 if len(good) == len(rows) else 3


def _jobs(
    targets: Sequence[str], system: str | None, seeds: Sequence[int], faults: tuple[str, ...],
    changes: tuple[str, ...], images: Images,
) -> list[Job]:  # fmt: skip
    jobs = []
    for target in targets:
        known = load_scenario(target, changes).system_names
        for name in known if system is None else (system,):
            jobs += [
                Job(
                    scenario=target, system=name, seed=seed, pipelines=(), faults=faults, changes=changes,
                    images=images,
                )
                for seed in seeds
            ]  # fmt: skip
    return jobs


def _made(tasks: Sequence[Task], ledger: Ledger, workers: int, out: Path) -> list[Row]:
    """Make what is not there; all rows in the order of the tasks. A recording whose folder is gone is an
    error: the ledger is not to say that it is there."""
    missing = [task for task in tasks if key_of(task) not in ledger]
    if len(missing) < len(tasks):
        click.echo(f"{len(tasks) - len(missing)} of {len(tasks)} recordings are there already", err=True)
    if missing:
        needed = estimate_bytes([task.job for task in missing], out)
        click.echo(f"{len(missing)} recordings to make, about {needed / 1e6:.0f} MB", err=True)
        check_room(needed, out)
    progress = Progress(total=len(missing))
    names = {key_of(task): task.name for task in tasks}
    with open_executor(max(1, min(workers, len(missing))), None) as executor:
        found = [
            _row(names[done.key], done)
            for done in campaign(
                row_of, tasks, key_of, executor, ledger, lambda d: progress.say(_told(_row(names[d.key], d)))
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


def _write(rows: Sequence[Row], tasks: Sequence[Task], out: Path) -> None:
    """dataset.json: what there is. Same command, same bytes."""
    entries = [
        {
            "name": row.name, "status": row.status, "why": row.why, "scenario": task.job.scenario,
            "system": task.job.system, "seed": task.job.seed, "messages": row.messages,
            "size_bytes": row.size_bytes, "sha256": row.sha256,
        }
        for row, task in zip(rows, tasks, strict=True)
    ]  # fmt: skip
    content = {"schema": SCHEMA, "command": join(["simbench", *sys.argv[1:]]), "recordings": entries}
    write_text(out / NAME, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _told(row: Row) -> str:
    return (
        f"{row.name}: {row.status}, {row.size_bytes / 1e6:.1f} MB, {row.seconds[0]:.1f} s to make, "
        f"{row.seconds[1]:.1f} s to write"
    )
