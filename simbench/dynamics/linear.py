"""A vehicle linearised about its rest pose: its modes, and its response without MuJoCo's steps.

x' = A x + B u, y = C x with x = (q, q'), u = (heights and rates under the wheels, acceleration ahead and to
the left), y = (roll, pitch, yaw, heave) of the sensors' mount. A, B, C are central differences of MuJoCo's
accelerations and poses; the response is exact between the rows for inputs that are straight lines there
(first-order hold). It leaves out large angles, and tyres that let go of the road.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Complex128, Float64
from scipy.signal import cont2discrete

from simbench.dynamics.body import Vehicle
from simbench.dynamics.integrate import Course, attitude_rad, grip, rotated

SMALL = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """The matrices above."""

    A: Float64[np.ndarray, "x x"]
    B: Float64[np.ndarray, "x u"]
    C: Float64[np.ndarray, "4 x"]

    def modes(self) -> Complex128[np.ndarray, " m"]:
        """Eigenvalues (1/s) of the oscillating modes, slowest first, each pair once."""
        found = np.linalg.eigvals(self.A)
        found = found[found.imag > 0.0]
        slowest_first: np.ndarray = found[np.argsort(np.abs(found))]
        return slowest_first

    def response(self, over: Course, step_s: float) -> Float64[np.ndarray, "n 4"]:
        """y at every row of the course, from rest."""
        u = np.column_stack([over.road_m, over.road_rate_mps, over.ahead_mps2, over.left_mps2])
        identity = np.eye(len(self.A))
        none = np.zeros((len(self.A), u.shape[1]))
        Ad, Bd, Cd, Dd, _ = cont2discrete((self.A, self.B, identity, none), step_s, method="foh")
        driven = u @ Bd.T
        x = np.empty((len(u), len(self.A)))
        state = np.zeros(len(self.A))
        for i in range(len(u)):
            x[i] = state
            state = Ad @ state + driven[i]
        y: np.ndarray = (x @ Cd.T + u @ Dd.T) @ self.C.T
        return y


def linearised(vehicle: Vehicle, pivot_m: Float64[np.ndarray, " 3"]) -> Linear:
    """About rest on a flat road. pivot_m: where the mount's heave is read, in the vehicle's frame."""
    model = copy.copy(vehicle.model)
    data, ground = mujoco.MjData(model), grip(vehicle)
    n, w = model.nv, len(vehicle.wheels)
    mount = model.body(vehicle.mount).id
    mujoco.mj_kinematics(model, data)
    arm = pivot_m - data.xpos[mount]

    def acceleration(z: Float64[np.ndarray, " z"]) -> Float64[np.ndarray, " n"]:
        """q'' for z = (q, q', heights, rates, ahead, left)."""
        q, qd, road, rate, path = np.split(z, np.cumsum([n, n, w, w]))
        data.qpos[:], data.qvel[:] = q, qd
        ground.accelerate(model, data, float(path[0]), float(path[1]))
        mujoco.mj_step1(model, data)
        road_n = ground.at_rest_n + ground.stiffness_npm * road + ground.damping_nspm * rate
        ground.press(data, road_n)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        found: np.ndarray = data.qacc_smooth.copy()
        return found

    def pose(z: Float64[np.ndarray, " z"]) -> Float64[np.ndarray, " 4"]:
        """Attitude and heave of the mount for the same z."""
        data.qpos[:] = z[:n]
        mujoco.mj_kinematics(model, data)
        quaternion = data.xquat[mount][None]
        height = data.xpos[mount, 2] + rotated(quaternion, arm)[0, 2] - pivot_m[2]
        return np.append(attitude_rad(quaternion)[0], height)

    steps = SMALL * np.eye(2 * n + 2 * w + 2)
    qacc = np.stack([acceleration(e) - acceleration(-e) for e in steps], axis=1) / (2.0 * SMALL)
    moved = np.stack([pose(e) - pose(-e) for e in steps[: 2 * n]], axis=1) / (2.0 * SMALL)
    top = np.hstack([np.zeros((n, n)), np.eye(n)])
    return Linear(
        A=np.vstack([top, qacc[:, : 2 * n]]),
        B=np.vstack([np.zeros((n, 2 * w + 2)), qacc[:, 2 * n :]]),
        C=moved,
    )
