"""The compiled part of `lens.py`: Newton's iteration through a distorted lens for a whole picture.

The same arithmetic in the same order as `PinholeCamera.unproject`, so that it gives the same bits.
"""

# mypy: no-check-untyped-defs
from __future__ import annotations

import math

from simbench.sensors.compiled import jit, jit_inline

STEP = 1e-6
ITERATIONS = 20
SETTLED = 1e-12
CLOSE_PX = 1e-6


@jit_inline
def _distorted(x, y, k1, k2, p1, p2, k3):  # type: ignore[no-untyped-def]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@jit_inline
def _slopes(x, y, fx, fy, k1, k2, p1, p2, k3):  # type: ignore[no-untyped-def]
    """How the distorted bearings (fx, fy) of (x, y) change with x and y."""
    ax, ay = _distorted(x + STEP, y, k1, k2, p1, p2, k3)
    bx, by = _distorted(x, y + STEP, k1, k2, p1, p2, k3)
    return (ax - fx) / STEP, (ay - fy) / STEP, (bx - fx) / STEP, (by - fy) / STEP


@jit
def undistort(x_d, y_d, fx_px, fy_px, k1, k2, p1, p2, k3, x, y, good):  # type: ignore[no-untyped-def]
    """Ideal bearings of distorted ones (x_d, y_d) [n] into x and y [n], which hold the distorted ones at
    first. good [n]: they come back to where they are seen, and the lens keeps its orientation there: they
    were not found beyond a fold.
    """
    for _ in range(ITERATIONS):
        worst = 0.0
        lost = False
        for i in range(len(x)):
            fx, fy = _distorted(x[i], y[i], k1, k2, p1, p2, k3)
            off = max(abs(x_d[i] - fx), abs(y_d[i] - fy))
            worst = max(worst, off)
            lost |= off != off
        if worst < SETTLED and not lost:
            break
        for i in range(len(x)):
            fx, fy = _distorted(x[i], y[i], k1, k2, p1, p2, k3)
            ex, ey = x_d[i] - fx, y_d[i] - fy
            j00, j10, j01, j11 = _slopes(x[i], y[i], fx, fy, k1, k2, p1, p2, k3)
            det = j00 * j11 - j01 * j10
            x[i], y[i] = x[i] + (j11 * ex - j01 * ey) / det, y[i] + (j00 * ey - j10 * ex) / det
    for i in range(len(x)):
        fx, fy = _distorted(x[i], y[i], k1, k2, p1, p2, k3)
        j00, j10, j01, j11 = _slopes(x[i], y[i], fx, fy, k1, k2, p1, p2, k3)
        off_px = math.hypot((fx - x_d[i]) * fx_px, (fy - y_d[i]) * fy_px)
        good[i] = off_px < CLOSE_PX and j00 * j11 - j01 * j10 > 0.0
