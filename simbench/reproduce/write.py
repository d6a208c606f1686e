"""Writes an answer: data, tables, findings and the page."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from shlex import join

from simbench.case import Images
from simbench.files import write_text
from simbench.report.reproduce_page import draw_paper, write_page
from simbench.reproduce.answer import Answer, as_json
from simbench.reproduce.cells import CELLS, PIPELINES
from simbench.reproduce.cost import Cost, cost_of
from simbench.reproduce.files import as_csv, as_latex
from simbench.reproduce.findings import as_markdown
from simbench.reproduce.plan import Size, condition_faults
from simbench.reproduce.sheets import sheets
from simbench.reproduce.variants import NAMES, reference_of
from simbench.run import recording_of

RESULT, COSTS, FINDINGS, TABLES = "result.json", "costs.json", "findings.md", "tables"


def write_answer(told: Answer, out: Path, images: Images) -> Path:
    """Write everything into a folder; the page's path."""
    command = join(["simbench", *sys.argv[1:]])
    write_text(out / RESULT, as_json(told))
    write_text(out / FINDINGS, as_markdown(told, command))
    found = sheets(told)
    (out / TABLES).mkdir(exist_ok=True)
    for sheet in found:
        write_text(out / TABLES / f"{sheet.name}.csv", as_csv(sheet))
        write_text(out / TABLES / f"{sheet.name}.tex", as_latex(sheet))
    costs = measured_costs(told.size)
    write_text(out / COSTS, json.dumps({name: asdict(cost) for name, cost in costs.items()}, indent=1) + "\n")
    return write_page(told, found, draw_paper(out, images), costs, out, command=command)


def measured_costs(size: Size) -> Mapping[str, Cost]:
    """Of every pipeline, on one drive; of every variant where all is run."""
    cell = CELLS[0]
    recording = recording_of(cell.job(0, condition_faults(cell, "reached"), ()))[2].recording
    variants = NAMES if size.name == "full" else ()
    names = (*PIPELINES, *(reference_of(name) for name in variants))
    return {name: cost_of(name, recording) for name in names}
