"""MuJoCo steps a vehicle over the heights that its wheels meet.

Per step: MuJoCo's positions and velocities, then the tyres' forces on the hubs (`xfrc_applied`), then its
accelerations and the step. The frame's own acceleration along and across the path enters as gravity.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float64, Int64

from simbench.dynamics.body import GRAVITY_MPS2, Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """What drives a vehicle, one row per step: heights under the wheels, their rates, and the path's
    accelerations ahead and to the left.
    """

    road_m: Float64[np.ndarray, "n w"]
    road_rate_mps: Float64[np.ndarray, "n w"]
    ahead_mps2: Float64[np.ndarray, " n"]
    left_mps2: Float64[np.ndarray, " n"]


def course(road_m: Float64[np.ndarray, "n w"], step_s: float) -> Course:
    """A course straight on at constant speed over these heights."""
    none = np.zeros(len(road_m))
    return Course(
        road_m=road_m, road_rate_mps=np.gradient(road_m, step_s, axis=0), ahead_mps2=none, left_mps2=none
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """One row per step, at the instant the step begins. qpos, qvel: MuJoCo's. Attitudes as quaternions (w
    first) and positions of (base, body, mount) in the vehicle's frame. lift_n: how much a tyre that stuck to
    the road would have pulled where the real one let go; 0 while it touches.
    """

    qpos: Float64[np.ndarray, "n q"]
    qvel: Float64[np.ndarray, "n q"]
    quaternion: Float64[np.ndarray, "n 3 4"]
    position_m: Float64[np.ndarray, "n 3 3"]
    lift_n: Float64[np.ndarray, "n w"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Grip:
    """How the ground acts on a vehicle: tables over its wheels, and where their forces and torques enter."""

    vehicle: Vehicle
    hubs: Int64[np.ndarray, " w"]
    pitch_dof: int
    lean_dof: int
    stiffness_npm: Float64[np.ndarray, " w"]
    damping_nspm: Float64[np.ndarray, " w"]
    at_rest_n: Float64[np.ndarray, " w"]  # of a tyre whose hub is at height 0 over a road at height 0

    def without_state_n(self, over: Course) -> Float64[np.ndarray, "n w"]:
        """The part of the tyres' forces that the road alone decides."""
        road: np.ndarray = (
            self.at_rest_n + self.stiffness_npm * over.road_m + self.damping_nspm * over.road_rate_mps
        )
        return road

    def press(self, data: Any, road_n: np.ndarray) -> np.ndarray:
        """Set the tyres' forces [w] for the state whose positions and velocities `data` holds.

        road_n [w]: a row of `without_state_n`. Returns the forces [w] that tyres which can pull would have.
        Called every step: its types are plain, so that checking them in tests stays cheap.
        """
        hub = data.sensordata.reshape(-1, 2, 3)
        push: np.ndarray = road_n - self.stiffness_npm * hub[:, 0, 2] - self.damping_nspm * hub[:, 1, 2]
        data.xfrc_applied[self.hubs, 2] = np.maximum(push, 0.0)
        return push

    def accelerate(self, model: Any, data: Any, ahead_mps2: float, left_mps2: float) -> None:
        """Set what the path's own acceleration does: all masses lag behind, the ground holds the wheels."""
        v = self.vehicle
        model.opt.gravity[:] = -ahead_mps2, -left_mps2, -GRAVITY_MPS2
        data.qfrc_applied[self.pitch_dof] = -v.mass_kg * v.pitch_joint_height_m * ahead_mps2
        lean_rad = math.atan2(-left_mps2, GRAVITY_MPS2)
        data.qfrc_applied[self.lean_dof] = (
            v.mass_kg * v.lean_joint_height_m * left_mps2 + v.lean_stiffness_nmprad * lean_rad
        )


def grip(vehicle: Vehicle) -> Grip:
    """The tables for a vehicle."""
    wheels, model = vehicle.wheels, vehicle.model
    stiffness = np.array([w.stiffness_npm for w in wheels])
    return Grip(
        vehicle=vehicle,
        hubs=np.array([model.body(w.body).id for w in wheels], dtype=np.int64),
        pitch_dof=int(model.joint(vehicle.pitch_joint).dofadr[0]),
        lean_dof=int(model.joint(vehicle.lean_joint).dofadr[0]),
        stiffness_npm=stiffness,
        damping_nspm=np.array([w.damping_nspm for w in wheels]),
        at_rest_n=np.array([w.preload_n for w in wheels]) + stiffness * [w.radius_m for w in wheels],
    )


def integrate(vehicle: Vehicle, over: Course, start_qpos: Float64[np.ndarray, " q"] | None = None) -> States:
    """Step `vehicle` from rest (or from rest at `start_qpos`) once per row of the course.

    FloatingPointError: a state is not finite.
    """
    model = copy.copy(vehicle.model)  # its gravity changes with the path's acceleration
    data = mujoco.MjData(model)
    if start_qpos is not None:
        data.qpos[:] = start_qpos
    ground = grip(vehicle)
    road_n = ground.without_state_n(over)
    straight_on = not (np.any(over.ahead_mps2) or np.any(over.left_mps2))
    read = np.array([model.body(name).id for name in (vehicle.base, vehicle.body, vehicle.mount)])
    n = len(road_n)
    qpos, qvel = np.empty((n, model.nq)), np.empty((n, model.nv))
    quaternion, position_m = np.empty((n, 3, 4)), np.empty((n, 3, 3))
    push_n = np.empty_like(road_n)
    for i in range(n):
        if not straight_on:
            ground.accelerate(model, data, float(over.ahead_mps2[i]), float(over.left_mps2[i]))
        mujoco.mj_step1(model, data)
        push_n[i] = ground.press(data, road_n[i])
        qpos[i], qvel[i] = data.qpos, data.qvel
        quaternion[i], position_m[i] = data.xquat[read], data.xpos[read]
        mujoco.mj_step2(model, data)
    if not np.isfinite(qvel).all():
        raise FloatingPointError(f"the {vehicle.name} flies off: its states are not finite")
    return States(
        qpos=qpos,
        qvel=qvel,
        quaternion=quaternion,
        position_m=position_m,
        lift_n=np.maximum(-push_n, 0.0),
    )


def attitude_rad(quaternion: Float64[np.ndarray, "n 4"]) -> Float64[np.ndarray, "n 3"]:
    """(roll, pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll), of unit quaternions, w first."""
    w, x, y, z = quaternion.T
    return np.stack(
        [
            np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        ],
        axis=1,
    )


def rotated(
    quaternion: Float64[np.ndarray, "n 4"], vector: Float64[np.ndarray, " 3"]
) -> Float64[np.ndarray, "n 3"]:
    """R(quaternion) vector, row by row."""
    w, u = quaternion[:, :1], quaternion[:, 1:]
    across = np.cross(u, vector[None])
    turned: np.ndarray = vector + 2.0 * (w * across + np.cross(u, across))
    return turned
