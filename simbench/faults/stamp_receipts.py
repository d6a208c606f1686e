"""Receipts of what stamps claim: stamps of the same exposures before and after, against true times.

An exposure is known by its true middle, a sweep by its true first firing: where these differ before and
after, nothing can be compared and the receipt is a mismatch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from scenarios.faults import (
    ClockDrift,
    ClockOffset,
    FaultSpec,
    StampJitter,
    StampMeaning,
    StampOnSave,
    StampQuantum,
    StampStep,
)
from simbench.faults.chances import (
    SPREADS,
    least_wait_allowed,
    mean_wait_allowed,
    spread_allowed,
)
from simbench.faults.fault import Site, Step
from simbench.faults.flow import Times, elsewhere, times
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import struck

STAMP_SD_MS = 2e-6  # stamps are whole nanoseconds
NOTE = "stamps of the same exposures, found by their true times, after against before"


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """One struck sensor: its messages before and after (None: not the same ones), what was drawn for it."""

    sensor: str
    before: Times
    after: Times
    drawn: Mapping[str, float]
    site: Site

    @property
    def same(self) -> bool:
        """Whether the messages are the same before and after."""
        return np.array_equal(self.before.true_ns, self.after.true_ns)

    @property
    def change_ms(self) -> Float64[np.ndarray, " n"]:
        """Of every stamp; nan where the messages are not the same."""
        if not self.same:
            return np.full(max(len(self.before), 1), np.nan)
        change: np.ndarray = (self.after.stamp_ns - self.before.stamp_ns) * 1e-6
        return change

    def judged(
        self,
        spec: FaultSpec,
        quantity: str,
        unit: str,
        requested: float,
        measured: float | None,
        sd: float,
        allowed: float,
        note: str = NOTE,
    ) -> Receipt:
        return judge(
            fault=spec.name, quantity=f"{self.sensor} {quantity}", unit=unit, requested=requested,
            realised=self.drawn.get(f"{self.sensor} {quantity}", 0.0), measured=measured, systematic=5.0 * sd,
            allowed=allowed, note=note,
        )  # fmt: skip


def of_every(
    of_one: Callable[[Any, Seen], tuple[Receipt, ...]],
) -> Callable[[Any, Step, Site], tuple[Receipt, ...]]:
    """Receipts of every struck sensor, and that nothing else changed."""

    def receipts(spec: FaultSpec, step: Step, site: Site) -> tuple[Receipt, ...]:
        result: list[Receipt] = []
        for sensor in struck(spec, site.rig):
            before, after = times(step.before, site.rig, sensor), times(step.after, site.rig, sensor)
            seen = Seen(sensor=sensor, before=before, after=after, drawn=step.realised, site=site)
            if len(before):
                result += of_one(spec, seen)
            else:
                result.append(_nothing(spec, sensor))
        return (*result, *elsewhere(spec, step, site.rig, ("true_ns", "arrival_ns")))

    return receipts


def _nothing(spec: FaultSpec, sensor: str) -> Receipt:
    strength = float(getattr(spec, spec.strength))
    return judge(
        fault=spec.name, quantity=f"{sensor} stamps", unit=spec.unit, requested=strength, realised=strength,
        measured=None, estimator_sd=0.0, allowed=0.0, note="no message shows an instant",
    )  # fmt: skip


def offset(spec: ClockOffset, seen: Seen) -> tuple[Receipt, ...]:
    ms = spec.offset_ms
    return (
        seen.judged(
            spec, "offset", "ms", ms, float(seen.change_ms.mean()), STAMP_SD_MS, max(0.01 * abs(ms), 1e-6)
        ),
    )


def another_instant(spec: StampMeaning, seen: Seen) -> tuple[Receipt, ...]:
    """Against the time from the start of the exposure to the end of the read-out, or a turn."""
    camera = seen.site.rig.cameras.get(seen.sensor)
    if camera is not None:
        lasts_ms = camera.exposure_ms + camera.readout_ms
    elif len(seen.before) > 1:
        lasts_ms = float(np.median(np.diff(seen.before.true_ns))) * 1e-6
    else:
        lasts_ms = 1e3 / seen.site.rig.lidar.rate_hz
    requested, found = spec.share * lasts_ms, float(seen.change_ms.mean())
    return (
        seen.judged(spec, "shift", "ms", requested, found, STAMP_SD_MS, max(0.01 * abs(requested), 1e-6)),
    )


def drift(spec: ClockDrift, seen: Seen) -> tuple[Receipt, ...]:
    """Rate and error at time 0: a straight line through the changes over the stamps."""
    at_s, change_ms = seen.before.stamp_ns * 1e-9, seen.change_ms
    rate: float | None = None
    start_ms: float | None = None
    rate_sd = start_sd = 0.0
    if np.ptp(at_s) > 0.0:
        slope, start_ms = (float(c) for c in np.polyfit(at_s, change_ms, 1)) if seen.same else (np.nan,) * 2
        rate = 1e3 * slope
        rate_sd = 1e3 * STAMP_SD_MS / float(at_s.std())
        start_sd = STAMP_SD_MS + 1e-3 * rate_sd * float(np.abs(at_s).max())
    least = 0.01 * abs(spec.rate_ppm)
    result = [seen.judged(spec, "rate", "ppm", spec.rate_ppm, rate, rate_sd, least)]
    if spec.since_s > 0.0:
        requested_ms = spec.rate_ppm * 1e-3 * spec.since_s
        result.append(
            seen.judged(
                spec, "error at time 0", "ms", requested_ms, start_ms, start_sd, 0.01 * abs(requested_ms)
            )
        )
    return tuple(result)


def step(spec: StampStep, seen: Seen) -> tuple[Receipt, ...]:
    """The change of the last stamps against that of the first, and when it sets in: to half a period."""
    change_ms = seen.change_ms
    at_s = seen.before.stamp_ns[np.argsort(seen.before.stamp_ns)] * 1e-9
    size: float | None = float(change_ms[-1])
    when: float | None = None
    sd_s, note = 0.0, NOTE
    if at_s[-1] < spec.at_s:
        size = None if seen.same and not change_ms.any() else size
        note = "the run ends before the step"
    elif seen.same and len(at_s) > 1 and at_s[0] < spec.at_s:
        moved = np.sort(seen.before.stamp_ns[np.abs(change_ms) > 1e-6]) * 1e-9
        kept = np.sort(seen.before.stamp_ns[np.abs(change_ms) <= 1e-6]) * 1e-9
        when = 0.5 * float(moved[0] + kept[-1]) if len(moved) and len(kept) else np.nan
        sd_s = float(np.diff(at_s).max()) / 10.0
    ms = spec.step_ms
    result = [seen.judged(spec, "step", "ms", ms, size, STAMP_SD_MS, 0.01 * abs(ms), note)]
    if when is not None:
        result.append(seen.judged(spec, "at", "s", spec.at_s, when, sd_s, 1e-9))
    return tuple(result)


def jitter(spec: StampJitter, seen: Seen) -> tuple[Receipt, ...]:
    """Mean of the changes, and their SD by their median size, which heavy tails do not move."""
    n, sd, change_ms = len(seen.before), spec.sd_ms, seen.change_ms
    spread = float(np.median(np.abs(change_ms)) / SPREADS[spec.distribution](0.75))
    heavy = 20.0 if spec.distribution == "heavy_tailed" else 5.0  # one far draw moves a mean of t with 3
    return (
        seen.judged(spec, "mean", "ms", 0.0, float(change_ms.mean()), STAMP_SD_MS, heavy * sd / np.sqrt(n)),
        seen.judged(spec, "spread", "ms", sd, spread, STAMP_SD_MS, spread_allowed(sd, n, spec.distribution)),
    )


def saved(spec: StampOnSave, seen: Seen) -> tuple[Receipt, ...]:
    """How late stamps are against the truth: their mean, and the least: the n-th part of a wait's mean."""
    n, wait = len(seen.before), spec.jitter_ms
    lag_ms = (seen.after.stamp_ns - seen.after.true_ns) * 1e-6 if seen.same else np.array([np.nan])
    note, least_ms = "stamps against true times of exposures and first firings", spec.delay_ms + wait / n
    mean_allowed = 0.01 * spec.delay_ms + mean_wait_allowed(wait, n)
    least_allowed = 0.01 * spec.delay_ms + least_wait_allowed(wait, n)
    return (
        seen.judged(
            spec, "mean lag", "ms", spec.delay_ms + wait, float(lag_ms.mean()), STAMP_SD_MS, mean_allowed,
            note,
        ),
        seen.judged(
            spec, "least lag", "ms", least_ms, float(lag_ms.min()), STAMP_SD_MS, least_allowed, note
        ),
    )  # fmt: skip


def quantum(spec: StampQuantum, seen: Seen) -> tuple[Receipt, ...]:
    """What is rounded off on average (anything up to a quantum: stamps may lie on the grid already), that no
    stamp loses a quantum or gains anything, and that every stamp lies on the grid.
    """
    half = 0.5 * spec.quantum_ms
    beyond_ms = np.maximum(-seen.change_ms - spec.quantum_ms, seen.change_ms).max()
    rest_ms = seen.after.stamp_ns % max(round(spec.quantum_ms * 1e6), 1) * 1e-6
    return (
        seen.judged(spec, "rounded off", "ms", half, -float(seen.change_ms.mean()), STAMP_SD_MS, half),
        *untouched(
            fault=spec.name, quantity=f"{seen.sensor} farthest off the grid", unit="ms",
            found=[(float(rest_ms.max()), STAMP_SD_MS)], note="stamps modulo the quantum",
        ),
        *untouched(
            fault=spec.name, quantity=f"{seen.sensor} rounded by more than a quantum", unit="ms",
            found=[(max(float(beyond_ms), 0.0), STAMP_SD_MS)], note=NOTE,
        ),
    )  # fmt: skip
