"""motion.trace: the body turns as a gyro recorded it.

angle(t) = scale * (integral of the rate, less the straight line of the integral over the run). Past the ends
of the file the body keeps still.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import CubicSpline

from scenarios.errors import BadInput, show
from scenarios.faults import Trace
from simbench.shake import RMS_STEP_S, rms_about_line, times_ns

COLUMNS = ("time_s", "roll_rate_radps", "pitch_rate_radps", "yaw_rate_radps")
GAP = 2.5  # times the usual step is a gap
LONGEST_STEP_S = 0.05
MOST_BYTES = 100_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded:
    """Angles (roll, pitch, yaw in rad; heave 0) at `t_s` [n], seconds into the run."""

    t_s: Float64[np.ndarray, " n"]
    angle_rad: Float64[np.ndarray, "n 4"]

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.t_s, self.angle_rad)

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 4"]:
        """All axes at the true times t_ns [n]."""
        seconds = np.clip(np.asarray(t_ns, dtype=np.float64) * 1e-9, self.t_s[0], self.t_s[-1])
        value: np.ndarray = self._spline(seconds)
        return value

    def rms(self, duration_s: float) -> Float64[np.ndarray, "4"]:
        """RMS per axis about its straight-line fit over [0, duration_s]."""
        return rms_about_line(self.at(times_ns(duration_s)))

    def rate_rms(self, duration_s: float) -> Float64[np.ndarray, "4"]:
        """RMS per axis of the time derivative over [0, duration_s]."""
        rms: np.ndarray = np.std(np.diff(self.at(times_ns(duration_s)), axis=0) / RMS_STEP_S, axis=0)
        return rms


def trace_shake(spec: Trace, duration_s: float) -> Recorded:
    """The body's shake. BadInput as `read_trace`, or the file ends before the run."""
    t_s, rate = read_trace(spec.file)
    if t_s[-1] < duration_s:
        raise BadInput(
            f"{spec.file}: ends after {t_s[-1]:.3g} s, and the run takes {duration_s:.3g} s", field=spec.name
        )
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s)[:, None]
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    inside = t_s <= duration_s
    line = np.polynomial.polynomial.polyfit(t_s[inside], angle[inside], 1)
    angle = spec.scale * (angle - np.polynomial.polynomial.polyval(t_s, line).T)
    return Recorded(t_s=t_s, angle_rad=np.column_stack([angle, np.zeros(len(t_s))]))


def trace_rms(spec: Trace, duration_s: float) -> Float64[np.ndarray, "4"]:
    """RMS of roll, pitch, yaw in rad (heave 0) that the file asks for: every row integrated by Simpson's
    rule."""
    from scipy.integrate import cumulative_simpson

    t_s, rate = read_trace(spec.file)
    inside = t_s <= duration_s
    angle = cumulative_simpson(rate[inside], x=t_s[inside], axis=0, initial=0.0)
    rms: np.ndarray = abs(spec.scale) * rms_about_line(np.column_stack([angle, np.zeros(len(angle))]))
    return rms


@lru_cache(maxsize=2)
def read_trace(file: str) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n 3"]]:
    """Times (s, from 0) and rates (rad/s) of a file. BadInput: it is not there, too large, has other columns,
    something that is no number, times that do not ascend, or a gap.
    """
    path = Path(file)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise BadInput(f"{file}: is larger than {MOST_BYTES // 1_000_000} MB", field=Trace.name)
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: cannot be read as a text file", field=Trace.name) from error
    head = tuple(word.strip() for word in lines[0].split(",")) if lines else ()
    if head != COLUMNS:
        raise BadInput(
            f"{file}, line 1: the columns are {show(', '.join(head))}", field=Trace.name,
            allowed=", ".join(COLUMNS),
        )  # fmt: skip
    rows = [_row(file, number, line) for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if len(rows) < 4:
        raise BadInput(f"{file}: has {len(rows)} rows", field=Trace.name, allowed="4 or more")
    table = np.array(rows)
    step_s = np.diff(table[:, 0])
    longest_s = min(GAP * float(np.median(step_s)), LONGEST_STEP_S)
    for i in np.flatnonzero((step_s <= 0.0) | (step_s > longest_s))[:1]:
        what = (
            "is not later than the row before"
            if step_s[i] <= 0.0
            else f"comes after a gap of {step_s[i]:.3g} s"
        )
        raise BadInput(f"{file}, line {i + 3}: {what}", field=Trace.name)
    return table[:, 0] - table[0, 0], table[:, 1:]


def _row(file: str, number: int, line: str) -> list[float]:
    words = line.split(",")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != len(COLUMNS) or not np.isfinite(values).all():
        raise BadInput(f"{file}, line {number}: {show(line)} is not {len(COLUMNS)} numbers", field=Trace.name)
    return values
