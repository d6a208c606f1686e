"""What a shake is to a moving body, and the scripted one: a sum of sinusoids per axis, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64, Int64

RMS_STEP_S = 1e-3


@runtime_checkable
class BodyShake(Protocol):
    """How a body moves against its script at any time, axis by axis: scripted (`Shake`) or integrated over a
    road (`dynamics.ride.Ride`).
    """

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n a"]:
        """All axes at the true times t_ns [n]."""

    def rms(self, duration_s: float) -> Float64[np.ndarray, " a"]:
        """RMS per axis about its straight-line fit over [0, duration_s]."""

    def rate_rms(self, duration_s: float) -> Float64[np.ndarray, " a"]:
        """RMS per axis of the time derivative over [0, duration_s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shake:
    """value[axis](t) = sum_k amplitude[axis, k] * sin(2 pi frequency_hz[k] t + phase_rad[axis, k])."""

    frequency_hz: Float64[np.ndarray, " k"]
    amplitude: Float64[np.ndarray, "a k"]
    phase_rad: Float64[np.ndarray, "a k"]

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n a"]:
        """All axes at the true times t_ns [n]."""
        angle = np.outer(np.asarray(t_ns, dtype=np.float64) * 2e-9 * np.pi, self.frequency_hz)
        in_phase = self.amplitude * np.cos(self.phase_rad)
        quadrature = self.amplitude * np.sin(self.phase_rad)
        value: np.ndarray = np.sin(angle) @ in_phase.T + np.cos(angle) @ quadrature.T
        return value

    def rms(self, duration_s: float) -> Float64[np.ndarray, " a"]:
        """RMS per axis about its straight-line fit over [0, duration_s], sampled every millisecond."""
        return rms_about_line(self.at(times_ns(duration_s)))

    def rate_rms(self, duration_s: float) -> Float64[np.ndarray, " a"]:
        """RMS per axis of the time derivative over [0, duration_s]."""
        rms: np.ndarray = np.std(np.diff(self.at(times_ns(duration_s)), axis=0) / RMS_STEP_S, axis=0)
        return rms


def rms_about_line(value: Float64[np.ndarray, "n a"]) -> Float64[np.ndarray, " a"]:
    """RMS of each column about its straight-line fit."""
    t = np.linspace(-1.0, 1.0, len(value))
    fit = np.polynomial.polynomial.polyfit(t, value, 1)
    rms: np.ndarray = np.std(value - np.polynomial.polynomial.polyval(t, fit).T, axis=0)
    return rms


def times_ns(duration_s: float) -> Int64[np.ndarray, " n"]:
    """Every millisecond of a run."""
    return np.arange(0, int(duration_s * 1e9), int(RMS_STEP_S * 1e9), dtype=np.int64)


def draw_shake(
    rng: np.random.Generator,
    frequency_hz: Float64[np.ndarray, " k"],
    density: Float64[np.ndarray, "a k"],
    rms: Float64[np.ndarray, " a"],
    duration_s: float,
) -> Shake:
    """A shake of the given spectral density whose RMS over the run is `rms` exactly.

    frequency_hz: ascending [k]. density: one-sided power density [a k] at those frequencies, any scale.
    Amplitudes are sqrt(2 S df) with random phases (Shinozuka and Deodatis 1991), then rescaled to the
    request: the RMS of five seconds of band noise would otherwise vary by 8 to 16 % from draw to draw.
    """
    phase = rng.uniform(0.0, 2.0 * np.pi, size=density.shape)
    amplitude = np.sqrt(2.0 * density * np.gradient(frequency_hz))
    raw = Shake(frequency_hz=frequency_hz, amplitude=amplitude, phase_rad=phase)
    scale = np.where(rms > 0.0, rms / np.maximum(raw.rms(duration_s), 1e-300), 0.0)
    return Shake(frequency_hz=frequency_hz, amplitude=amplitude * scale[:, None], phase_rad=phase)
