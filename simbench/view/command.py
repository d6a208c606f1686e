"""`simbench view`: a recording as a page, or as a file of Rerun's."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from simbench.files import prepare_folder, write_text
from simbench.formats.store import read_recording

Tool = Literal["page", "rerun"]
PAGE, RERUN = "recording.html", "recording.rrd"


def view_recording(folder: Path, *, out: Path, tool: Tool | None) -> Path:
    """Write what shows the recording, and return its path. tool: None for Rerun where it is installed, else
    the page. BadInput: no recording lies there, or it cannot be shown."""
    from simbench.view.rerun_log import has_rerun, need_rerun

    if tool == "rerun":
        need_rerun()
    chosen = tool or ("rerun" if has_rerun() else "page")
    stored = read_recording(folder)
    if stored.missing:
        click.echo(f"{folder}: INCOMPLETE: {'; '.join(stored.missing)}", err=True)
    if chosen == "page":
        from simbench.view.page import page_of

        page = page_of(stored)
        prepare_folder(out)
        write_text(out / PAGE, page)
        click.echo(f"{out / PAGE}: {(out / PAGE).stat().st_size / 1e6:.1f} MB; open it in a browser")
        return out / PAGE
    from simbench.view.rerun_log import write_rerun

    prepare_folder(out)
    write_rerun(stored, out / RERUN)
    size = (out / RERUN).stat().st_size
    click.echo(f"{out / RERUN}: {size / 1e6:.1f} MB; open it with: rerun {out / RERUN}")
    return out / RERUN
