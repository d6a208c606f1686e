"""`simbench reproduce`: run what is missing, work out the answer, write it."""

from __future__ import annotations

import os
import time
from pathlib import Path

import click

from simbench.campaign.ledger import Done
from simbench.campaign.lock import only_one
from simbench.files import prepare_folder, write_text
from simbench.progress import Progress
from simbench.reproduce.answer import answer, as_json
from simbench.reproduce.campaign import collect, missing, named, open_ledger
from simbench.reproduce.plan import Ask, BoardAsk, Size
from simbench.reproduce.write import write_answer

RESULT = "result.json"


def run_reproduce(size: Size, *, workers: int | None, out: Path) -> int:
    """The exit code: 0 all well, 3 the bench could not make some run. Raises BadInput."""
    prepare_folder(out)
    begun = time.perf_counter()
    with only_one(out), open_ledger(out) as ledger:
        fresh = len(missing(size, ledger))
        progress = Progress(total=fresh)
        click.echo(f"{fresh} runs to make, {size.name}", err=True)

        def done(ask: Ask | BoardAsk, row: Done) -> None:
            progress.say(named(ask) + (f": {row.failure}" if row.failure else ""))

        found = collect(size, ledger, workers or os.cpu_count() or 1, done)
    told = answer(found)
    write_text(out / RESULT, as_json(told))
    page = write_answer(told, found, out)
    for failure in told.failures:
        click.echo(f"failed: {failure}", err=True)
    click.echo(f"{len(found.runs)} runs, {fresh} of them now, in {time.perf_counter() - begun:.0f} s")
    click.echo(f"report: {page}")
    return 3 if told.failures else 0
