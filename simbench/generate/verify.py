"""`simbench verify`: is a recording whole, and what was written; made again, is it the same?"""

from __future__ import annotations

from pathlib import Path

from scenarios.errors import BadInput
from scenarios.load import list_scenarios
from simbench.formats.store import check_recording, first_difference, read_recording
from simbench.generate.work import job_of
from simbench.run import recording_of


def _check_scenario(scenario: str, folder: Path) -> None:
    """BadInput: a recording, which may come from anybody, names a file that is no scenario."""
    if scenario not in list_scenarios() and Path(scenario).suffix not in (".yaml", ".yml"):
        raise BadInput(
            "cannot be made again: its scenario is neither of the catalogue nor a YAML file", file=str(folder)
        )


def verified(folder: Path, *, rerun: bool) -> tuple[str, bool]:
    """A sentence, and whether all is well. BadInput: no recording lies there, or it is damaged."""
    manifest, missing = check_recording(folder)
    if missing:
        return f"{folder}: INCOMPLETE: {'; '.join(missing)}", False
    count = 0 if manifest.messages is None else manifest.messages.count
    if not rerun:
        return f"{folder}: complete, {count} messages, all hashes right", True
    _check_scenario(manifest.source.scenario, folder)
    again = recording_of(job_of(manifest.source))[2].recording
    where = first_difference(read_recording(folder).recording, again)
    if where is not None:
        return f"{folder}: not the same when it is made again: {where}", False
    return f"{folder}: complete, {count} messages, the same bytes when made again", True
