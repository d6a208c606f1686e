"""Rotations as quaternions (x, y, z, w), as ROS writes them; w is not negative."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

Quaternion = tuple[float, float, float, float]
LEAST_UNIT = 1e-3  # how far a quaternion's length may be from 1: digits that somebody printed


def quaternions_of(rotations: Float64[np.ndarray, "n 3 3"]) -> Float64[np.ndarray, "n 4"]:
    """Unit quaternions of rotation matrices, each from the largest of its four products (Shepperd)."""
    m = np.moveaxis(np.asarray(rotations, dtype=np.float64), 0, -1)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    xw, yw, zw = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xx, yy, zz = (1.0 + 2.0 * m[i, i] - trace for i in range(3))
    products = np.array([[xx, xy, xz, xw], [xy, yy, yz, yw], [xz, yz, zz, zw], [xw, yw, zw, 1.0 + trace]])
    largest = np.argmax(np.stack([xx, yy, zz, 1.0 + trace]), axis=0)
    rows = products[largest, :, np.arange(m.shape[-1])]
    rows *= np.where(rows[:, 3:] < 0.0, -1.0, 1.0) / np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows)


def matrix_of(quaternion: Quaternion) -> Float64[np.ndarray, "3 3"]:
    """The rotation matrix of a quaternion. ValueError: its length is not 1 (to 1e-3), or no number."""
    given = np.asarray(quaternion, dtype=np.float64)
    length = (
        float(np.linalg.norm(given)) if np.abs(given).max() < 2.0 else np.inf
    )  # NaN is no rotation either
    if not abs(length - 1.0) < LEAST_UNIT:
        raise ValueError(f"a quaternion of length {length:g}")
    x, y, z, w = given / length
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
