"""Receipts of how messages travel: messages counted, and arrivals of the same messages, after against before.

A message is known by the true instant of what it shows and by its stamp. Shares are given per sensor, against
this seed's draw, and over all struck sensors together, against what was asked for with more to count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from scenarios.faults import Dropped, Duplicated, FaultSpec, Latency, Reordered
from simbench.faults.chances import least_wait_allowed, mean_wait_allowed, share_allowed
from simbench.faults.fault import Site, Step
from simbench.faults.flow import COUNT_SD, Times, elsewhere, times
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck

ARRIVAL_SD_MS = 2e-6  # arrivals are whole nanoseconds
IDENTITY = ("true_ns", "stamp_ns")
NOTE = "messages counted, after against before"


def _pairs(spec: FaultSpec, step: Step, site: Site) -> list[tuple[str, Times, Times]]:
    """Every struck sensor that delivers anything, before and after."""
    named = struck(spec, site.rig)
    found = [(s, times(step.before, site.rig, s), times(step.after, site.rig, s)) for s in named]
    return [(sensor, before, after) for sensor, before, after in found if len(before)]


def _judged(
    spec: FaultSpec, step: Step, quantity: str, unit: str, requested: float, measured: float | None,
    sd: float, allowed: float, note: str = NOTE, realised: float | None = None,
) -> Receipt:  # fmt: skip
    drawn = step.realised.get(quantity, 0.0) if realised is None else realised
    return judge(
        fault=spec.name, quantity=quantity, unit=unit, requested=requested, realised=drawn,
        measured=measured, systematic=5.0 * sd, allowed=allowed, note=note,
    )  # fmt: skip


def _shares(
    spec: Any, step: Step, word: str, counts: Sequence[tuple[str, float, int]], free: float = 1.0
) -> list[Receipt]:
    """counts: sensor, messages that it happened to, of how many. free: free trials in one message."""
    p = 0.01 * spec.percent
    result = []
    for sensor, many, n in counts:
        allowed = 100.0 * (share_allowed(p, n * free) + 1.0 / n)
        share = 100.0 * many / n
        result.append(_judged(spec, step, f"{sensor} {word}", "%", spec.percent, share, COUNT_SD, allowed))
    total = sum(n for _, _, n in counts)
    if len(counts) > 1:
        drawn = sum(step.realised.get(f"{sensor} {word}", 0.0) * n for sensor, _, n in counts) / total
        allowed = 100.0 * (share_allowed(p, total * free) + len(counts) / total)
        share = 100.0 * sum(many for _, many, _ in counts) / total
        result.append(
            _judged(
                spec, step, f"all sensors {word}", "%", spec.percent, share, COUNT_SD, allowed, realised=drawn
            )
        )
    if not counts:
        result.append(
            _judged(spec, step, word, "%", spec.percent, None, 0.0, 0.0, "no message to count", spec.percent)
        )
    return result


def dropped(spec: Dropped, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How many are missing; in bursts also how many in a row, on average."""
    pairs = _pairs(spec, step, site)
    counts = [(sensor, float(len(b) - len(a)), len(b)) for sensor, b, a in pairs]
    free = 1.0
    if spec.burst_frames > 0.0:
        link = 1.0 - 1.0 / (spec.burst_frames * (1.0 - 0.01 * spec.percent))
        free = (1.0 - link) / (1.0 + link) if link > 0.0 else 1.0
    result = _shares(spec, step, "lost", counts, free)
    if spec.burst_frames > 0.0:
        for sensor, before, after in pairs:
            here = set(after.rows(*IDENTITY))
            by_arrival = sorted(before.rows("arrival_ns", *IDENTITY))
            gone = np.array([row[1:] not in here for row in by_arrival])
            starts = int(np.sum(np.diff(np.concatenate([[0], gone.astype(np.int64)])) == 1))
            if starts == 0:
                continue
            b = spec.burst_frames
            # A burst may be cut by either end of the run, so half of one is allowed besides.
            allowed = 5.0 * float(np.sqrt(b * (b - 1.0) / starts)) + 0.5 * b
            result.append(
                _judged(
                    spec, step, f"{sensor} burst", "frames", b, float(gone.sum()) / starts, COUNT_SD, allowed
                )
            )
    return (*result, *elsewhere(spec, step, site.rig, ("true_ns", "stamp_ns", "arrival_ns")))


def duplicated(spec: Duplicated, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How many are there more than once, and how much later the copy comes."""
    pairs = _pairs(spec, step, site)
    counts = [(sensor, float(len(a) - len(b)), len(b)) for sensor, b, a in pairs]
    result = _shares(spec, step, "twice", counts)
    for sensor, _, after in pairs:
        rows = np.array(after.rows("true_ns", "stamp_ns", "arrival_ns"), dtype=np.int64)
        again = (np.diff(rows[:, :2], axis=0) == 0).all(axis=1)
        if again.any():
            gap_ms = float(np.diff(rows[:, 2])[again].mean()) * 1e-6
            result.append(
                _judged(
                    spec, step, f"{sensor} copy after", "ms", spec.after_ms, gap_ms, ARRIVAL_SD_MS, 1e-6,
                    "arrivals of the same message",
                )
            )  # fmt: skip
    return (*result, *elsewhere(spec, step, site.rig, IDENTITY))


def latency(spec: Latency, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How much later the same messages arrive: the mean, and the least of all."""
    result = []
    for sensor, before, after in _pairs(spec, step, site):
        n, wait = len(before), spec.jitter_ms
        same = before.rows(*IDENTITY) == after.rows(*IDENTITY)
        later_ms = (after.arrival_ns - before.arrival_ns) * 1e-6 if same else np.array([np.nan])
        mean_allowed = 0.01 * spec.latency_ms + mean_wait_allowed(wait, n) + 1e-6
        least_allowed = 0.01 * spec.latency_ms + least_wait_allowed(wait, n) + 1e-6
        note = "arrivals of the same messages, after against before"
        for word, asked, found, allowed in (
            ("mean latency", spec.latency_ms + wait, float(later_ms.mean()), mean_allowed),
            ("least latency", spec.latency_ms + wait / n, float(later_ms.min()), least_allowed),
        ):
            result.append(
                _judged(spec, step, f"{sensor} {word}", "ms", asked, found, ARRIVAL_SD_MS, allowed, note)
            )
    return (*result, *elsewhere(spec, step, site.rig, IDENTITY))


def reordered(spec: Reordered, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How many arrive after one that was behind them."""
    counts = []
    for sensor, before, after in _pairs(spec, step, site):
        place = {row[1:]: i for i, row in enumerate(sorted(before.rows("arrival_ns", *IDENTITY)))}
        order = np.array([place.get(row[1:], -1) for row in sorted(after.rows("arrival_ns", *IDENTITY))])
        overtaken = float(np.sum(order < np.maximum.accumulate(order))) if len(order) else 0.0
        if len(before) > 1:  # the last one cannot be overtaken
            counts.append((sensor, overtaken, len(before) - 1))
    result = _shares(spec, step, "overtaken", counts)
    return (*result, *elsewhere(spec, step, site.rig, IDENTITY))
