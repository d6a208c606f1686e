"""Holm's adjustment of several p-values (Holm, Scand. J. Statist. 6, 1979): the chance of any false alarm
among them stays at alpha, however they depend on each other.
"""

from __future__ import annotations

from collections.abc import Sequence


def holm(p: Sequence[float]) -> tuple[float, ...]:
    """Adjusted p-values in the order given: reject where they are at most alpha.

    The i-th smallest of m becomes the largest of (m - j) p_(j) over j <= i (j from 0), at most 1. ValueError:
    a p outside 0 to 1.
    """
    if any(not 0.0 <= value <= 1.0 for value in p):
        raise ValueError("p-values lie between 0 and 1")
    adjusted = [0.0] * len(p)
    largest = 0.0
    for rank, place in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        largest = max(largest, min(1.0, (len(p) - rank) * p[place]))
        adjusted[place] = largest
    return tuple(adjusted)
