"""Roads: ISO 8608 roughness under the left and the right wheels, and single events on top.

The displacement spectrum of a class is Gd(n) = Gd(n0) (n / n0)^-2, n0 = 0.1 cycles/m, one-sided (ISO 8608;
the standard speaks of 0.011 to 2.83 cycles/m). Above that, up to 10 cycles/m, the same law is
**extrapolated**: at 5 m/s the standard's band ends at 14 Hz, and small stiff wheels pass on more than that.

The two tracks follow from isotropy (Dodds and Robson 1973, Journal of Sound and Vibration 31; Kamash and
Robson 1978, ibid. 57): a surface whose every straight line has this spectrum has, between parallel lines
b metres apart, the cross spectrum g(n) Gd(n) with

    g(n) = x K1(x),  x = 2 pi n b,

because the plane's spectrum is proportional to (n^2 + m^2)^(-3/2), and this is its cosine transform across
the lines. K1 is the modified Bessel function of the second kind. Long waves lift both sides together, short
ones each side alone. Rolled roads are not quite isotropic (Bogsjo 2008, Vehicle System Dynamics 46).

A road is a Fourier series of period 4,096 m with fixed amplitudes sqrt(2 Gd dn) and drawn phases (Shinozuka
and Deodatis 1991), tabled every centimetre: the same seed is the same road, however far one drives on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import k1

from scenarios.faults import RoadEvent, Roughness

REFERENCE_CYCLES_PER_M = 0.1
LOWEST_CYCLES_PER_M, HIGHEST_CYCLES_PER_M = 0.011, 2.83
EXTRAPOLATED_CYCLES_PER_M = 10.0
ROUGHNESS_M3: Mapping[str, float] = MappingProxyType(
    {"smooth": 0.0, "A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
)
"""Gd(n0), the geometric mean of each class; a class reaches from half to twice that (ISO 8608)."""

STEP_M = 0.01
PERIOD_M = 4096.0
TRACK_WIDTH_M = 1.5  # of the two wheel paths: that of the car's part

Side = Literal["left", "right"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Road:
    """Heights in metres along the ego's path. left_m, right_m: roughness every centimetre over one period.

    `left_m[0]` lies where the vehicle's origin is at t = 0; the table repeats before and after.
    """

    left_m: Float64[np.ndarray, " k"]
    right_m: Float64[np.ndarray, " k"]
    events: tuple[RoadEvent, ...] = ()

    def heights_m(self, side: Side, arc_m: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Height of the surface at arc lengths [n]: cubic between the table's rows, events added."""
        rough = between(self.left_m if side == "left" else self.right_m, arc_m / STEP_M)
        for event in self.events:
            if event.track in (side, "both"):
                rough = rough + event_m(event, arc_m)
        return rough

    def met_m(
        self, side: Side | None, arc_m: Float64[np.ndarray, " n"], radius_m: float, contact_m: float
    ) -> Float64[np.ndarray, " n"]:
        """The height that a wheel meets when its hub is at arc lengths [n] (not decreasing).

        A rigid disc of the wheel's radius rolls over the events (its rim cannot follow a sharp edge), and the
        tyre averages everything over its contact length. side None: a single-track vehicle, which runs on the
        left profile and meets the events of either side.
        """
        if len(arc_m) == 0:
            return np.zeros(0)
        first = int(np.floor(arc_m[0] / STEP_M)) - MARGIN
        grid = np.arange(first, int(np.ceil(arc_m[-1] / STEP_M)) + MARGIN + 1, dtype=np.int64)
        table = self.right_m if side == "right" else self.left_m
        height = table[grid % len(table)]
        events = [e for e in self.events if side is None or e.track in (side, "both")]
        if events:
            edges = np.sum([event_m(event, grid * STEP_M) for event in events], axis=0)
            height = height + rolled_over(edges, radius_m)
        smooth = averaged(height, contact_m)
        return between(smooth, arc_m / STEP_M - first)


MARGIN = 64  # rows of the table on either side of a drive: more than a wheel's radius


def draw_road(rng: np.random.Generator, roughness: Roughness, events: Sequence[RoadEvent] = ()) -> Road:
    """A road of this class. Phases do not depend on the class: a rougher road is the same one, higher."""
    rows = round(PERIOD_M / STEP_M)
    harmonic = np.arange(
        int(np.ceil(LOWEST_CYCLES_PER_M * PERIOD_M)), int(EXTRAPOLATED_CYCLES_PER_M * PERIOD_M) + 1
    )
    cycles_per_m = harmonic / PERIOD_M
    phase_rad = rng.uniform(0.0, 2.0 * np.pi, size=(2, len(harmonic)))
    density = ROUGHNESS_M3[roughness] * (cycles_per_m / REFERENCE_CYCLES_PER_M) ** -2.0
    shared = cross_ratio(cycles_per_m, TRACK_WIDTH_M)
    # left = mean + half the difference, right = mean - it: both of density Gd, their cross density g Gd.
    parts = []
    for share, phase in zip((0.5 * (1.0 + shared), 0.5 * (1.0 - shared)), phase_rad, strict=True):
        series = np.zeros(rows // 2 + 1, dtype=np.complex128)
        series[harmonic] = 0.5 * np.sqrt(2.0 * share * density / PERIOD_M) * np.exp(1j * phase)
        parts.append(np.fft.irfft(series, n=rows, norm="forward"))
    mean, half = parts
    return Road(left_m=mean + half, right_m=mean - half, events=tuple(events))


def roughness_m3(road: Road) -> float:
    """Gd(0.1 cycles/m) of a road as its tables have it: the mean of Gd(n) (n / n0)^2 over the standard's
    band, every octave alike, by the periodograms of both tracks. Events do not count.
    """
    rows = len(road.left_m)
    period_m = rows * STEP_M
    n = np.arange(int(LOWEST_CYCLES_PER_M * period_m) + 1, int(HIGHEST_CYCLES_PER_M * period_m)) / period_m
    found = []
    for table in (road.left_m, road.right_m):
        series = np.fft.rfft(table, norm="forward")[np.round(n * period_m).astype(np.int64)]
        density = 2.0 * np.abs(series) ** 2 * period_m * (n / REFERENCE_CYCLES_PER_M) ** 2
        found.append(float(np.average(density, weights=1.0 / n)))
    return float(np.mean(found))


def mirrored(road: Road) -> Road:
    """The road with left and right exchanged."""
    other = {"left": "right", "right": "left", "both": "both"}
    return Road(
        left_m=road.right_m,
        right_m=road.left_m,
        events=tuple(e.model_copy(update={"track": other[e.track]}) for e in road.events),
    )


def cross_ratio(cycles_per_m: Float64[np.ndarray, " k"], apart_m: float) -> Float64[np.ndarray, " k"]:
    """g(n): cross spectrum of two parallel tracks over the spectrum of one, on an isotropic surface."""
    x = 2.0 * np.pi * cycles_per_m * apart_m
    ratio: np.ndarray = x * k1(x)
    return ratio


# -- single events ----------------------------------------------------------------------------------------


def event_m(event: RoadEvent, arc_m: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Height of one event at arc lengths [n]; 0 outside [at_m, at_m + length_m].

    bump: sin^2, as high as `height_m` in its middle. kerb: a step up and one down. pothole, joint: a step
    down and one up, `height_m` deep. seam: a step up that fades in a straight line.
    """
    x = (arc_m - event.at_m) / event.length_m
    inside = (x >= 0.0) & (x <= 1.0)
    shape = {
        "bump": np.sin(np.pi * np.clip(x, 0.0, 1.0)) ** 2,
        "kerb": np.ones_like(x),
        "pothole": -np.ones_like(x),
        "joint": -np.ones_like(x),
        "seam": 1.0 - x,
    }[event.kind]
    return np.where(inside, event.height_m * shape, 0.0)


# -- what a wheel makes of it ------------------------------------------------------------------------------


def rolled_over(height_m: Float64[np.ndarray, " n"], radius_m: float) -> Float64[np.ndarray, " n"]:
    """Path of a rigid disc's lowest point over heights tabled every centimetre: max_x h(s + x) - drop(x)."""
    reach = min(int(radius_m / STEP_M), MARGIN)
    path = height_m.copy()
    for k in range(1, reach + 1):
        drop = radius_m - np.sqrt(max(radius_m**2 - (k * STEP_M) ** 2, 0.0))  # rounding may pass the rim
        path[:-k] = np.maximum(path[:-k], height_m[k:] - drop)
        path[k:] = np.maximum(path[k:], height_m[:-k] - drop)
    return path


def averaged(height_m: Float64[np.ndarray, " n"], length_m: float) -> Float64[np.ndarray, " n"]:
    """Mean over `length_m` around each row of a table in centimetres; the table's ends are held."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (height_m[1:] + height_m[:-1]))])
    rows, half = np.arange(len(height_m), dtype=np.float64), 0.5 * length_m / STEP_M
    low, high = np.maximum(rows - half, 0.0), np.minimum(rows + half, rows[-1])
    return (_area_to(height_m, area, high) - _area_to(height_m, area, low)) / (high - low)


def _area_to(
    height_m: Float64[np.ndarray, " n"], area: Float64[np.ndarray, " n"], row: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """Integral of the straight lines between the rows, from the first row to `row`."""
    i = np.minimum(row.astype(np.int64), len(height_m) - 2)
    part = row - i
    whole: np.ndarray = area[i] + part * (height_m[i] + 0.5 * part * (height_m[i + 1] - height_m[i]))
    return whole


def between(table: Float64[np.ndarray, " k"], row: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Cubic (Catmull-Rom) between the rows of a table that repeats."""
    i: Int64[np.ndarray, " n"] = np.floor(row).astype(np.int64)
    u = row - i
    a, b, c, d = (table[(i + k) % len(table)] for k in (-1, 0, 1, 2))
    value: np.ndarray = b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)))
    return value
