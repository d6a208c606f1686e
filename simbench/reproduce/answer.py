"""The whole reproduction as data: all that the page, the tables and the findings are made of."""

from __future__ import annotations

import json
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any

from scenarios.errors import BadInput
from scenarios.seeding import stream
from simbench.explain.attribution import Attribution
from simbench.reproduce.boards import BoardTable, board_tables
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, GROUND
from simbench.reproduce.conditions import ConditionTable, condition_tables
from simbench.reproduce.effects import Mended, attributions, mended
from simbench.reproduce.elsewhere import Elsewhere, elsewhere
from simbench.reproduce.fit.study import Fit, fit_rig
from simbench.reproduce.grids import HeatMap, Strip, heat_maps, strips
from simbench.reproduce.levels import LEVELS
from simbench.reproduce.plan import Size, drives
from simbench.reproduce.protocol import Dependence
from simbench.reproduce.slopes import Slopes, slopes, varied
from simbench.reproduce.steps import Changed, changes

SCHEMA = "simbench-reproduction/1"


@dataclass(frozen=True, kw_only=True)
class Answer:
    """failures: what the bench could not run, which is in no number. varied: by cell, what the paper's frames
    are worth if its passes differ as levels within physics do."""

    size: Size
    runs: int
    failures: tuple[str, ...]
    boards: tuple[BoardTable, ...]
    conditions: tuple[ConditionTable, ...]
    steps: tuple[Changed, ...]
    elsewhere: tuple[Elsewhere, ...]
    attributions: dict[str, tuple[Attribution, ...]]
    mended: tuple[Mended, ...]
    maps: tuple[HeatMap, ...]
    strips: tuple[Strip, ...]
    slopes: tuple[Slopes, ...]
    varied: dict[str, Dependence]
    fits: tuple[Fit, ...]


def answer(found: Found, executor: Executor) -> Answer:
    """All of it. Random numbers (bootstrap, draws of frames) by name, so that the same runs give the same
    bytes. executor: for the fits, each a task of its own."""

    def rng(name: str) -> Any:
        return stream(0, "reproduce", "answer", name)

    of_fits = found.part("fit")
    fits = [
        executor.submit(fit_rig, of_fits, system, baseline)
        for system in LEVELS
        for baseline in (BASELINE, GROUND)
        if found.size.fit_points
    ]
    return Answer(
        size=found.size,
        runs=drives(found.runs) + len({(board.system, board.seed) for board in found.boards}),
        failures=found.failures,
        boards=board_tables(found.boards, rng("boards")),
        conditions=condition_tables(found, rng("conditions")),
        steps=changes(found, rng("steps")),
        elsewhere=elsewhere(found, rng("elsewhere")),
        attributions=attributions(found),
        mended=mended(found, rng("mended")),
        maps=heat_maps(found),
        strips=strips(found, rng("strips")),
        slopes=slopes(of_fits),
        varied=varied(of_fits),
        fits=tuple(fit.result() for fit in fits),
    )


def as_json(found: Answer) -> str:
    """The stored result, an entry of a list a line. ValueError: a number that is not finite."""
    fields = {"schema": SCHEMA, **asdict(found)}
    return (
        "{\n" + ",\n".join(f"{json.dumps(name)}: {_lines(value)}" for name, value in fields.items()) + "\n}\n"
    )


def _lines(value: Any) -> str:
    if not isinstance(value, list | tuple) or not value:
        return json.dumps(value, allow_nan=False)
    return "[\n" + ",\n".join(json.dumps(one, allow_nan=False) for one in value) + "\n]"


def read_answer(text: str, file: str) -> Answer:
    """A stored result. BadInput: it is none, or of another version."""
    from pydantic import TypeAdapter, ValidationError

    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadInput(f"is malformed: {error}", file=file) from None
    if not isinstance(data, dict) or data.pop("schema", None) != SCHEMA:
        raise BadInput("is no result of a reproduction", file=file, allowed=SCHEMA)
    try:
        return TypeAdapter(Answer).validate_python(data)
    except ValidationError as error:
        raise BadInput(f"is malformed: {' '.join(str(error).split())[:200]}", file=file) from None
