"""How one sensor's bracket moves against the body: bending, knocked, creeping; and all of them at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float64, Int64


class BracketMotion(Protocol):
    """Turn (roll, pitch, yaw in rad about the sensor, ego axes) and, in six columns, shift (x, y, z in m)."""

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n a"]:
        """At the true times t_ns [n]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ramp:
    """From nothing before `begin_ns` to `end` [6] at `end_ns`: evenly, or as a half cosine (`smooth`). Evenly
    goes on beyond its end, a half cosine stays there."""

    begin_ns: int
    end_ns: int
    end: Float64[np.ndarray, "6"]
    smooth: bool

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 6"]:
        """At the true times t_ns [n]."""
        share = (np.asarray(t_ns, dtype=np.float64) - self.begin_ns) / (self.end_ns - self.begin_ns)
        share = np.maximum(share, 0.0)
        if self.smooth:
            share = 0.5 - 0.5 * np.cos(np.pi * np.minimum(share, 1.0))
        value: np.ndarray = share[:, None] * self.end
        return value


@dataclass(frozen=True, kw_only=True, eq=False)
class Together:
    """The sum of several motions: small turns add."""

    parts: tuple[BracketMotion, ...]

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 6"]:
        """At the true times t_ns [n]."""
        total = np.zeros((len(t_ns), 6))
        for part in self.parts:
            value = part.at(t_ns)
            total[:, : value.shape[1]] += value
        return total
