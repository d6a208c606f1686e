"""Arrays as the page holds them: little-endian integers in base64, which JavaScript reads as typed arrays."""

from __future__ import annotations

import base64

import numpy as np
from jaxtyping import Float64, Int16, Integer

CM_PER_M = 100.0
YAW_STEPS = 1e4  # a radian
FARTHEST_M = 327.0  # what 16 bits of centimetres hold
NOWHERE = -32768  # the first number of a place that is not known, or too far away


def packed(array: Integer[np.ndarray, "..."]) -> str:
    """All elements, row by row, in base64."""
    little = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False)
    return base64.b64encode(little.tobytes()).decode("ascii")


def centimetres(position_m: Float64[np.ndarray, "*n"]) -> Int16[np.ndarray, "*n"]:
    """Metres within FARTHEST_M, to the nearest centimetre."""
    return np.rint(position_m * CM_PER_M).astype(np.int16)
