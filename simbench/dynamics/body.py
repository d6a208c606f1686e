"""What a vehicle model is to the integrator: a MuJoCo model, its wheels, and the bodies that are read out.

Models live in a frame that moves with the scripted path: x forward, y left, z up, its origin on the flat
ground below the part's root. They hold joints only (slides and hinges from their rest pose), no geometry and
no contacts. Springs are preloaded, so that the rest pose on a flat road is an equilibrium: without that a car
sags by 15 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from simbench.dynamics.road import Side

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A wheel whose hub is the body `body`. side: whose track it runs on; None for a single-track vehicle.

    The tyre pushes with preload_n + stiffness (road - hub) + damping (their rates), never pulls.
    """

    body: str
    x_m: float
    y_m: float
    side: Side | None
    radius_m: float
    contact_m: float
    stiffness_npm: float
    damping_nspm: float
    preload_n: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Vehicle:
    """A compiled model at rest on a flat road, and what its bodies and joints are called.

    base: the body on the wheels (chassis, deck). body: what carries the sensors' mount (chassis, torso).
    mount: what the sensors ride on. pitch_joint, lean_joint: about y and x; the wheels' grip acts on the
    ground below them, which turns the vehicle by `mass_kg` times their height above the ground when it brakes
    or corners. lean_stiffness_nmprad: of the spring that holds a single-track rider to the path's lean.
    """

    name: str
    model: Any  # mujoco.MjModel
    wheels: tuple[Wheel, ...]
    base: str
    body: str
    mount: str
    pitch_joint: str
    lean_joint: str
    mass_kg: float
    pitch_joint_height_m: float
    lean_joint_height_m: float
    lean_stiffness_nmprad: float


def empty_spec(step_s: float) -> Any:
    """A MuJoCo spec for springs and masses only: gravity, no contacts, semi-implicit in the dampers."""
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.gravity = [0.0, 0.0, -GRAVITY_MPS2]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # What goes wrong must show, not start again from the rest pose.
    off = mujoco.mjtDisableBit
    spec.option.disableflags = off.mjDSBL_CONTACT | off.mjDSBL_AUTORESET
    return spec


def add_body(
    parent: Any,
    name: str,
    *,
    at_m: tuple[float, float, float],
    parent_at_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    mass_kg: float,
    inertia_kgm2: tuple[float, float, float],
    com_m: tuple[float, float, float] | None = None,
) -> Any:
    """A body at `at_m` with its centre of mass at `com_m` (default: the same), all in the vehicle's frame."""
    origin = np.asarray(at_m)
    body = parent.add_body(name=name, pos=origin - np.asarray(parent_at_m))
    body.explicitinertial = True
    body.mass = mass_kg
    body.inertia = inertia_kgm2
    body.ipos = np.zeros(3) if com_m is None else np.asarray(com_m) - origin
    return body


def add_joint(
    body: Any,
    name: str,
    kind: str,
    axis: tuple[float, float, float],
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    pos_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """A slide (N/m, N s/m) or hinge (N m/rad, N m s/rad) through `pos_m` of the body's own frame."""
    joint = body.add_joint(
        name=name,
        type={"slide": mujoco.mjtJoint.mjJNT_SLIDE, "hinge": mujoco.mjtJoint.mjJNT_HINGE}[kind],
        axis=axis,
        pos=pos_m,
    )
    joint.stiffness[0] = stiffness
    joint.damping[0] = damping


def add_hub_sensors(spec: Any, wheels: Sequence[Wheel]) -> None:
    """Per wheel the hub's position [3] and velocity [3], in this order, as the model's only sensors."""
    kinds = mujoco.mjtSensor
    for wheel in wheels:
        for kind, what in ((kinds.mjSENS_FRAMEPOS, "position"), (kinds.mjSENS_FRAMELINVEL, "velocity")):
            spec.add_sensor(
                name=f"{wheel.body}_{what}", type=kind, objtype=mujoco.mjtObj.mjOBJ_BODY, objname=wheel.body
            )


def preloaded(model: Any, wheels: Sequence[Wheel]) -> tuple[Wheel, ...]:
    """The wheels with their static loads; sets the springs of `model` so that its rest pose is in balance.

    The two axles share the weight by the lever rule, and left and right equally. RuntimeError: the rest pose
    cannot be held (a joint without spring carries a load).
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    weight = float(np.sum(model.body_mass)) * GRAVITY_MPS2
    com_x = float(data.subtree_com[0, 0])
    front, rear = max(w.x_m for w in wheels), min(w.x_m for w in wheels)
    share = {front: (com_x - rear) / (front - rear), rear: (front - com_x) / (front - rear)}
    a_side = len(wheels) / 2
    loaded = tuple(replace(w, preload_n=weight * share[w.x_m] / a_side) for w in wheels)
    for wheel in loaded:
        data.xfrc_applied[model.body(wheel.body).id, 2] = wheel.preload_n
    mujoco.mj_forward(model, data)
    for j in range(model.njnt):
        stiffness = float(np.ravel(model.jnt_stiffness[j])[0])
        missing = float(data.qfrc_smooth[model.jnt_dofadr[j]])
        if stiffness > 0.0:
            model.qpos_spring[model.jnt_qposadr[j]] = -missing / stiffness
        elif abs(missing) > 1e-6 * weight:
            raise RuntimeError(f"{model.joint(j).name} carries {missing:g} at rest and has no spring")
    return loaded
