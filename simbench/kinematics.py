"""Forward kinematics of many bodies at many times: MuJoCo's `mj_kinematics` for hinge chains, compiled."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from simbench.sensors.rays import jit


def chain(
    parent: Int64[np.ndarray, " b"],
    rotation: Float64[np.ndarray, "b 3 3"],
    position_m: Float64[np.ndarray, "b 3"],
    axis: Float64[np.ndarray, "b 3"],
    anchor_m: Float64[np.ndarray, "b 3"],
    angle_rad: Float64[np.ndarray, "n b"],
    out_rotation: Float64[np.ndarray, "n c 3 3"],
    out_position_m: Float64[np.ndarray, "n c 3"],
) -> None:
    """Fill in row i + 1 of the outputs for every body i with a parent row > 0, parents before children.

    A body's joint turns it by `angle_rad` about `axis` through `anchor_m`, both in its own frame; `rotation`
    and `position_m` are its pose in the parent at angle 0.
    """
    _chain(parent, rotation, position_m, axis, anchor_m, angle_rad, out_rotation, out_position_m)


@jit
def _chain(parent, rotation, position, axis, anchor, angle, out_R, out_p):  # type: ignore[no-untyped-def]
    turn, local, offset = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for n in range(angle.shape[0]):
        for i in range(parent.shape[0]):
            up = parent[i]
            if up == 0:
                continue
            s, c = np.sin(angle[n, i]), np.cos(angle[n, i])
            x, y, z = axis[i, 0], axis[i, 1], axis[i, 2]
            v = 1.0 - c
            turn[0, 0], turn[0, 1], turn[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
            turn[1, 0], turn[1, 1], turn[1, 2] = y * x * v + z * s, c + y * y * v, y * z * v - x * s
            turn[2, 0], turn[2, 1], turn[2, 2] = z * x * v - y * s, z * y * v + x * s, c + z * z * v
            if x == 0.0 and y == 0.0 and z == 0.0:
                turn[:] = np.eye(3)
            for r in range(3):
                for k in range(3):
                    local[r, k] = (
                        rotation[i, r, 0] * turn[0, k]
                        + rotation[i, r, 1] * turn[1, k]
                        + rotation[i, r, 2] * turn[2, k]
                    )
            for r in range(3):
                offset[r] = position[i, r]
                for k in range(3):
                    offset[r] += (rotation[i, r, k] - local[r, k]) * anchor[i, k]
            for r in range(3):
                p = out_p[n, up, r]
                for k in range(3):
                    p += out_R[n, up, r, k] * offset[k]
                    out_R[n, i + 1, r, k] = (
                        out_R[n, up, r, 0] * local[0, k]
                        + out_R[n, up, r, 1] * local[1, k]
                        + out_R[n, up, r, 2] * local[2, k]
                    )
                out_p[n, i + 1, r] = p
