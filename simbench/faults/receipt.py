"""A receipt: what was asked for, what this seed drew, and what an independent estimator finds in the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Final, Literal

Status = Literal["ok", "mismatch", "unverifiable"]
OK: Final = "ok"
MISMATCH: Final = "mismatch"
UNVERIFIABLE: Final = "unverifiable"


@dataclass(frozen=True, kw_only=True)
class Receipt:
    """requested, realised, measured in `unit`. The measurement errs about the realised value in two ways: by
    chance, with `estimator_sd` as 1 SD; and by at most `systematic` in what is not chance (rounding, terms
    that a model leaves out).

    status is `mismatch` unless |measured - realised| <= smallest and |realised - requested| <= allowed; else
    `unverifiable` when the effect is below `smallest`, 5 SD + systematic (what the estimator can detect), or
    the data allow no estimate (`measured` is None); else `ok`.
    """

    fault: str
    quantity: str
    unit: str
    requested: float
    realised: float
    measured: float | None
    estimator_sd: float
    allowed: float
    smallest: float
    note: str
    status: Status
    systematic: float = 0.0


def judge(
    *,
    fault: str,
    quantity: str,
    unit: str,
    requested: float,
    realised: float,
    measured: float | None,
    estimator_sd: float = 0.0,
    allowed: float,
    note: str = "",
    systematic: float = 0.0,
) -> Receipt:
    """Fill in the verdict. The smallest detectable effect is 5 SD of the estimator and its systematic error:
    below it, a fault that was switched off could not be told from one that acts. Numbers that are not finite
    are a mismatch.
    """
    smallest = 5.0 * float(estimator_sd) + float(systematic)
    drawn_as_asked = abs(realised - requested) <= allowed
    status: Status
    if not drawn_as_asked or (measured is not None and not abs(measured - realised) <= smallest):
        status = MISMATCH
    elif measured is None or abs(realised) <= smallest:
        status = UNVERIFIABLE
    else:
        status = OK
    return Receipt(
        fault=fault,
        quantity=quantity,
        unit=unit,
        requested=requested,
        realised=realised,
        measured=None if measured is None else float(measured),
        estimator_sd=float(estimator_sd),
        allowed=float(allowed),
        smallest=smallest,
        note=note,
        status=status,
        systematic=float(systematic),
    )


def untouched(
    *, fault: str, quantity: str, unit: str, found: Sequence[tuple[float, float]], note: str
) -> tuple[Receipt, ...]:
    """What a fault must leave alone: `found` holds (effect, most SD of the estimator) of every sensor that it
    spares. One receipt about the one that stands out most against its own SD, `ok` within 5 SD of nothing;
    none where there is no such sensor.
    """
    if not found:
        return ()
    worst, sd = max(found, key=lambda pair: abs(pair[0]) / pair[1] if isfinite(pair[0]) else inf)
    smallest = 5.0 * sd
    return (
        Receipt(
            fault=fault,
            quantity=quantity,
            unit=unit,
            requested=0.0,
            realised=0.0,
            measured=worst,
            estimator_sd=sd,
            allowed=0.0,
            smallest=smallest,
            note=note,
            status=OK if abs(worst) <= smallest else MISMATCH,
        ),
    )
