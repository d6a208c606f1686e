"""`simbench reproduce`: run what is missing, work out the answer, write it."""

from __future__ import annotations

import os
import time
from pathlib import Path

import click

from simbench.campaign.executor import open_executor
from simbench.campaign.ledger import Done
from simbench.campaign.lock import only_one
from simbench.case import Images
from simbench.files import prepare_folder
from simbench.progress import Progress
from simbench.reproduce.answer import answer
from simbench.reproduce.campaign import collect, missing, named, open_ledger
from simbench.reproduce.plan import Ask, BoardAsk, Size
from simbench.reproduce.write import write_answer


def run_reproduce(size: Size, *, workers: int | None, images: Images, out: Path) -> int:
    """The exit code: 0 all well, 3 the bench could not make some run. Raises BadInput."""
    prepare_folder(out)
    count = workers or os.cpu_count() or 1
    begun = time.perf_counter()
    with only_one(out), open_ledger(out) as ledger:
        fresh = len(missing(size, ledger))
        progress = Progress(total=fresh)
        click.echo(f"{fresh} runs to make, {size.name}", err=True)

        def done(ask: Ask | BoardAsk, row: Done) -> None:
            progress.say(named(ask) + (f": {row.failure}" if row.failure else ""))

        found = collect(size, ledger, count, done)
    with open_executor(min(count, 4)) as executor:
        told = answer(found, executor)
    page = write_answer(told, out, images)
    for failure in told.failures:
        click.echo(f"failed: {failure}", err=True)
    click.echo(f"{told.runs} runs, {fresh} of them now, in {time.perf_counter() - begun:.0f} s")
    click.echo(f"report: {page}")
    return 3 if told.failures else 0
