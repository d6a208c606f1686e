"""Poses of everything at any time, in closed form. Every sensor asks only this."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import Transform
from simbench.kinematics import chain
from simbench.mount import BracketMotion
from simbench.path import Track
from simbench.shake import BodyShake
from simbench.world import STRIDE_HZ, STRIDE_RAD, SWAY_HZ, SWAY_RAD, Body, World

FULL_SWAY_MPS = 1.0
PIVOT_M = (0.0, 0.0, 0.4)  # about what the ego's body shakes, in the ego frame
Poses = tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]


def rotations_about(
    axis: Float64[np.ndarray, " 3"], angle_rad: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, "n 3 3"]:
    """Rotation matrices [n 3 3] about one unit axis by angles [n]."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle_rad)[:, None, None], np.cos(angle_rad)[:, None, None]
    turned: np.ndarray = np.eye(3) + s * k + (1.0 - c) * (k @ k)
    return turned


def rotations_about_z(angle_rad: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3 3"]:
    """The same about the z axis, which is needed most."""
    turned = np.zeros((len(angle_rad), 3, 3))
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    turned[:, 0, 0], turned[:, 0, 1] = cosine, -sine
    turned[:, 1, 0], turned[:, 1, 1] = sine, cosine
    turned[:, 2, 2] = 1.0
    return turned


def rotations_rpy(rpy_rad: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3 3"]:
    """Rz(yaw) Ry(pitch) Rx(roll) for rows (roll, pitch, yaw) in radians."""
    rx = rotations_about(np.array([1.0, 0.0, 0.0]), rpy_rad[:, 0])
    ry = rotations_about(np.array([0.0, 1.0, 0.0]), rpy_rad[:, 1])
    rz = rotations_about(np.array([0.0, 0.0, 1.0]), rpy_rad[:, 2])
    turned: np.ndarray = rz @ ry @ rx
    return turned


def then(first: Poses, second: Poses) -> Poses:
    """Row-wise product: T_a_b @ T_b_c."""
    return (
        first[0] @ second[0],
        np.einsum("nij,nj->ni", first[0], second[1]) + first[1],
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """How far and how fast an actor has gone at some times: what its wheels and limbs follow."""

    t_s: Float64[np.ndarray, " n"]
    arc_m: Float64[np.ndarray, " n"]
    speed_mps: Float64[np.ndarray, " n"]

    @classmethod
    def of(cls, track: Track, t_ns: Int64[np.ndarray, " n"]) -> Drive:
        """The drive along a track at true times t_ns."""
        t_s = np.asarray(t_ns, dtype=np.float64) * 1e-9
        return cls(t_s=t_s, arc_m=track.arc_m(t_ns), speed_mps=track.speed_at(t_ns))


def joint_angle_rad(body: Body, drive: Drive) -> Float64[np.ndarray, " n"]:
    """Angle of a body's joint: wheels roll, riders sway, walkers' limbs swing."""
    angle: np.ndarray
    phase = 2.399963 * body.actor  # walkers out of step (golden angle)
    if body.joint == "wheel":
        return drive.arc_m / body.wheel_radius_m
    if body.joint == "sway":
        riding = np.clip(drive.speed_mps / FULL_SWAY_MPS, 0.0, 1.0)  # who stands does not sway
        angle = riding * SWAY_RAD * np.sin(2.0 * np.pi * SWAY_HZ * drive.t_s + phase)
        return angle
    walking = np.clip(drive.speed_mps / 1.3, 0.0, 1.5)
    angle = body.swing_sign * walking * STRIDE_RAD * np.sin(2.0 * np.pi * STRIDE_HZ * drive.t_s + phase)
    return angle


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """The scripted motion of a world and of the sensors on its ego.

    T_ego_root: where the carrying actor's root sits in the ego reference frame. T_ego_sensor: sensors at
    rest. body_shake: (roll, pitch, yaw in rad, heave in m) of the ego's body about `pivot_m` in the ego
    frame; sensors ride on the body. flex: how one sensor's bracket moves against the body, (roll, pitch, yaw
    in rad) about the sensor itself and perhaps (x, y, z in m), axes parallel to the ego's.
    """

    world: World
    ego_actor: int
    T_ego_root: Transform
    T_ego_sensor: Mapping[str, Transform]
    body_shake: BodyShake | None = None
    pivot_m: tuple[float, float, float] = PIVOT_M
    flex: Mapping[str, BracketMotion] = field(default_factory=dict)

    def ego(self, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_ego: follows the script, does not shake."""
        rotation, position = self._script(self.ego_actor, t_ns)
        T_root_ego = self.T_ego_root.inverse()
        return rotation @ T_root_ego.rotation, position + rotation @ T_root_ego.translation_m

    def shaken_ego(self, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """The ego frame as the shaking body carries it."""
        ego = self.ego(t_ns)
        if self.body_shake is None:
            return ego
        value = self.body_shake.at(t_ns)
        rotation = rotations_rpy(value[:, :3])
        pivot = np.asarray(self.pivot_m)
        position = pivot - rotation @ pivot
        position[:, 2] += value[:, 3]
        return then(ego, (rotation, position))

    def sensor(self, sensor: str, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_sensor as it really is, shake and flex included."""
        rest = self.T_ego_sensor[sensor]
        rotation = np.broadcast_to(rest.rotation, (len(t_ns), 3, 3))
        position = np.broadcast_to(rest.translation_m, (len(t_ns), 3))
        if sensor in self.flex:
            moved = self.flex[sensor].at(t_ns)
            rotation = rotations_rpy(moved[:, :3]) @ rotation
            if moved.shape[1] > 3:
                position = position + moved[:, 3:]
        return then(self.shaken_ego(t_ns), (rotation, position))

    def object_root(self, object_id: int, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_root of an object."""
        number = self.world.actor_of_object.get(object_id)
        if number is None:
            n = len(t_ns)
            return (
                np.broadcast_to(self.world.static_rotation[object_id], (n, 3, 3)),
                np.broadcast_to(self.world.static_position_m[object_id], (n, 3)),
            )
        return self._root(number, t_ns)

    def object_centre(self, object_id: int, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_box: centre and axes of the object's rest-pose box."""
        moves = object_id in self.world.actor_of_object
        rotation, position = self.object_root(object_id, t_ns if moves else t_ns[:1])
        centre = position + rotation @ self.world.box_centre_m[object_id]
        if moves:
            return rotation, centre
        return np.broadcast_to(rotation, (len(t_ns), 3, 3)), np.broadcast_to(centre, (len(t_ns), 3))

    def poses(
        self, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n b 3 3"], Float64[np.ndarray, "n b 3"]]:
        """T_world_body of the static world (index 0) and every moving body."""
        t_ns = np.asarray(t_ns, dtype=np.int64)
        n, bodies, table = len(t_ns), self.world.bodies, self.world.chain
        rotation = np.empty((n, len(bodies) + 1, 3, 3))
        position = np.empty((n, len(bodies) + 1, 3))
        rotation[:, 0], position[:, 0] = np.eye(3), 0.0
        angle = np.zeros((n, len(bodies)))
        drives = [Drive.of(actor.track, t_ns) for actor in self.world.actors]
        for row, body in enumerate(bodies):
            if body.parent == 0:
                rotation[:, row + 1], position[:, row + 1] = self._root(body.actor, t_ns)
            elif body.joint:
                angle[:, row] = joint_angle_rad(body, drives[body.actor])
        chain(
            table.parent,
            table.rotation,
            table.position_m,
            table.axis,
            table.anchor_m,
            angle,
            rotation,
            position,
        )
        return rotation, position

    def joint_angle_rad(self, row: int, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"] | None:
        """Angle of the joint of `world.bodies[row]`; None where it has none."""
        body = self.world.bodies[row]
        if not body.joint:
            return None
        return joint_angle_rad(body, Drive.of(self.world.actors[body.actor].track, t_ns))

    def _script(self, actor: int, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        xy, heading = self.world.actors[actor].track.at(t_ns)
        position = np.zeros((len(xy), 3))
        position[:, :2] = xy
        return rotations_about_z(heading), position

    def _root(self, actor: int, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        if actor != self.ego_actor:
            return self._script(actor, t_ns)
        rest = self.T_ego_root
        n = len(t_ns)
        return then(
            self.shaken_ego(t_ns),
            (np.broadcast_to(rest.rotation, (n, 3, 3)), np.broadcast_to(rest.translation_m, (n, 3))),
        )


def at(poses: Poses, row: int = 0) -> Transform:
    """One row of a pose table."""
    return Transform(rotation=poses[0][row], translation_m=poses[1][row])
