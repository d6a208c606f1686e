"""The command line: what to measure, and the table or the JSON object that comes of it."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.benchmarks.size import FULL, QUICK, Size
from tests.benchmarks.table import KEYS, ROWS, Measured, WrongAnswerError

SCENE = (
    "Scene: overtake-approach, car, seed 0, 2.6 s into the drive; 65,536 rays of the OS1-64 on its roof. The "
    "ray rows take its nearest 150 primitives, or 600 of a fuller lot, at rest; all sides see the same. "
    "Where two sides are compared, the times are CPU times on one core, medians of calls that take turns."
)
BUSY = 0.7  # processes that want to run, averaged over the last minute


def machine() -> dict[str, str | int]:
    """What it was measured on."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "cpu": named[0] if named else platform.machine(),  # some processors name no model
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.system(),
        "python": platform.python_version(),
    }


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """What libraries print goes to stderr: stdout is for the result."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def measure(keys: Sequence[str], size: Size) -> dict[str, Measured]:
    """Every key in the table's order; those not in `keys` are null. Raises WrongAnswerError."""
    from tests.benchmarks.measures import MEASURES  # slow: a usage error comes before it

    found = {}
    for key in KEYS:
        if key not in keys:
            found[key] = Measured(value=None, notes=(f"{key}: not asked for",))
            continue
        print(f"measuring {key} ...", file=sys.stderr, flush=True)
        found[key] = MEASURES[key](size)
    return found


def notes_of(found: dict[str, Measured], load: float) -> list[str]:
    """All notes once, in the table's order; before them a word about a machine that was busy at the start."""
    notes = [note for measured in found.values() for note in measured.notes]
    if load > BUSY:
        notes.insert(0, f"the machine was busy (load {load:.1f}): the real-time rows are too low")
    return list(dict.fromkeys(notes))


def print_table(found: dict[str, Measured], notes: Sequence[str]) -> None:
    """The head, the rows and the notes, for people."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 140)
    on = machine()
    console.print(f"{on['cpu']}, {on['cores']} cores, Python {on['python']}", highlight=False)
    console.print(SCENE, highlight=False)
    table = Table()
    for name in ("key", "ours", "rival", "value", "must", "goal", "ok"):
        table.add_column(name, justify="left" if name == "key" else "right", no_wrap=name != "rival")
    for row in ROWS:
        measured = found[row.key]
        if measured.value is None and f"{row.key}: not asked for" in measured.notes:
            continue
        sign = "≥" if row.sign > 0 else "≤"
        verdict = {True: "yes", False: "NO", None: "–"}[row.holds(measured.value)]
        table.add_row(
            row.key,
            measured.ours,
            measured.rival,
            "–" if measured.value is None else f"{measured.value:.3g} {row.unit}",
            "–" if row.must is None else f"{sign} {row.must:g}",
            f"{sign} {row.goal:g}",
            verdict,
        )
    console.print(table)
    for note in notes:
        if not note.endswith(": not asked for"):
            console.print("* " + note, highlight=False, markup=False)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Measures the bench's sensors against their rivals.")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--only", nargs="+", choices=KEYS, metavar="KEY", help="measure only these keys")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: only shows that everything runs")
    chosen = parser.parse_args(arguments)
    load = os.getloadavg()[0]
    try:
        with quiet_stdout():
            found = measure(chosen.only or KEYS, QUICK if chosen.quick else FULL)
    except WrongAnswerError as error:
        print(f"sensors.py: {error}", file=sys.stderr)
        return 1
    notes = notes_of(found, load)
    if chosen.json:
        values = {key: found[key].value for key in KEYS}
        print(json.dumps({**values, "notes": notes, "machine": machine()}, indent=1))
    else:
        print_table(found, notes)
    return 0
