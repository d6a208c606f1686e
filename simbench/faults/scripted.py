"""motion.mode_deg and motion.spectrum: the body swings as a mode does, or as spectra say.

Both are sums of sinusoids with drawn phases (`shake.py`), rescaled to the requested RMS about the run's
straight line. A pure tone is one sinusoid.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from scenarios.faults import Mode, Spectrum
from scenarios.faults.motion import SPECTRA
from scenarios.seeding import stream
from simbench.faults.motion import AXES, LINES, TO_DEG_AND_M, mode_density
from simbench.shake import Shake, draw_shake

REACH = 4.0  # a damped mode has lines from its frequency over this to its frequency times this


def mode_rms(spec: Mode) -> Float64[np.ndarray, "4"]:
    """RMS of roll, pitch, yaw in rad and heave in m."""
    return np.array([np.deg2rad(spec.rms_deg) if name == spec.axis else 0.0 for name, _, _ in AXES])


def mode_shake(spec: Mode, duration_s: float, seed: int) -> Shake:
    """(roll, pitch, yaw in rad, heave in m) of the body."""
    rng = stream(seed, "fault", spec.name)
    if spec.damping == 0.0:
        phase = np.full((4, 1), rng.uniform(0.0, 2.0 * np.pi))
        tone = Shake(frequency_hz=np.array([spec.frequency_hz]), amplitude=np.ones((4, 1)), phase_rad=phase)
        return replace(tone, amplitude=(mode_rms(spec) / tone.rms(duration_s))[:, None])
    frequency = _lines(rng, spec.frequency_hz / REACH, spec.frequency_hz * REACH)
    density = np.tile(mode_density(frequency, (spec.frequency_hz, spec.damping, 1.0)), (4, 1))
    return draw_shake(rng, frequency, density, mode_rms(spec), duration_s)


def spectrum_rms(spec: Spectrum) -> Float64[np.ndarray, "4"]:
    """RMS of roll, pitch, yaw in rad and heave in m: the root of the integral of each density."""
    power = [np.trapezoid(*reversed(_points(spec, axis))) for axis in SPECTRA]
    rms: np.ndarray = spec.scale * np.sqrt(power) / TO_DEG_AND_M
    return rms


def spectrum_shake(spec: Spectrum, duration_s: float, seed: int) -> Shake:
    """(roll, pitch, yaw in rad, heave in m) of the body."""
    rng = stream(seed, "fault", spec.name)
    given = [_points(spec, axis) for axis in SPECTRA]
    ends = np.concatenate([hertz for hertz, _ in given if len(hertz)])
    frequency = _lines(rng, float(ends.min()), float(ends.max()))
    density = np.stack(
        [
            np.interp(frequency, hertz, power, left=0.0, right=0.0) if len(hertz) else np.zeros(LINES)
            for hertz, power in given
        ]
    )
    return draw_shake(rng, frequency, density, spectrum_rms(spec), duration_s)


def _points(spec: Spectrum, axis: str) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]]:
    """Frequencies and densities of one axis; empty where it has none."""
    table = np.array(getattr(spec, axis), dtype=np.float64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def _lines(rng: np.random.Generator, low_hz: float, high_hz: float) -> Float64[np.ndarray, " k"]:
    """One frequency in each of equal steps of the logarithm."""
    edges = np.geomspace(low_hz, high_hz, LINES + 1)
    lines: np.ndarray = edges[:-1] + np.diff(edges) * rng.uniform(0.0, 1.0, LINES)
    return lines
