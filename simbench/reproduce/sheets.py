"""All tables of the reproduction as text, in the order of the paper, then ours."""

from __future__ import annotations

from simbench.reproduce.answer import Answer
from simbench.reproduce.sheet import Sheet
from simbench.reproduce.sheets_fit import levels, predictions
from simbench.reproduce.sheets_ours import all_slopes, mended, other_scenes, steps
from simbench.reproduce.sheets_paper import (
    budget,
    mae,
    readings,
    table_i,
    table_ii,
    table_ii_test,
    table_iii,
    unmeasured,
)


def sheets(told: Answer) -> tuple[Sheet, ...]:
    """All tables, in the order of the paper, then ours."""
    found = [table_i(told.boards)]
    for table in told.conditions:
        found += [table_ii(table), table_ii_test(table), table_iii(table), unmeasured(table)]
    for table in told.conditions:
        found += [mae(table), budget(table), readings(table)]
    found += [steps(told)] if told.steps else []
    found += [other_scenes(told)] if told.elsewhere else []
    found += [mended(told)] if told.mended else []
    found += [all_slopes(told)] if told.slopes else []
    for fit in told.fits:
        found += [levels(fit), predictions(fit)]
    return tuple(found)
