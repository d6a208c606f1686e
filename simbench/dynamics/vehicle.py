"""The car: chassis on four struts and tyres, a rack of sensors on its roof.

Chassis: heave, pitch, roll about its centre of mass. Wheels: slides along the chassis' z, each with its
spring and damper; an anti-roll bar couples the front ones. Rack: hinges in pitch and roll, one mode near
30 Hz. Numbers are judgement for a compact car of the part's size, inside what textbooks give (Wong 2008,
Rajamani 2012): heave 1.2 Hz, pitch 1.4 Hz, roll 2 Hz, damping ratios 0.3, wheel hop 12 Hz.
"""

from __future__ import annotations

import mujoco
import numpy as np

from simbench.dynamics.body import Vehicle, Wheel, add_body, add_hub_sensors, add_joint, empty_spec, preloaded

SPRUNG_KG = 1150.0
SPRUNG_INERTIA_KGM2 = (420.0, 1900.0, 2000.0)
CENTRE_M = (0.10, 0.0, 0.55)
FRONT_X_M, REAR_X_M, HALF_TRACK_M, HUB_Z_M = 1.36, -1.34, 0.75, 0.33
UNSPRUNG_KG = 38.0
SPRING_NPM = {"f": 21e3, "r": 20e3}
DAMPER_NSPM = {"f": 1500.0, "r": 1400.0}
ANTI_ROLL_NPM = 12e3  # front, per metre of difference between left and right travel
TYRE_NPM, TYRE_NSPM, CONTACT_M = 190e3, 80.0, 0.15
RACK_KG, RACK_ABOVE_ROOF_M, ROOF_Z_M = 15.0, 0.25, 1.5
RACK_OWN_INERTIA_KGM2 = (0.6, 0.6, 0.8)
RACK_HZ, RACK_DAMPING = 30.0, 0.04


def car(ego_xy_m: tuple[float, float], step_s: float = 1e-3) -> Vehicle:
    """The car with its rack above `ego_xy_m` (root frame), integrated with this step."""
    spec = empty_spec(step_s)
    chassis = add_body(
        spec.worldbody, "chassis", at_m=CENTRE_M, mass_kg=SPRUNG_KG, inertia_kgm2=SPRUNG_INERTIA_KGM2
    )
    add_joint(chassis, "heave", "slide", (0, 0, 1))
    add_joint(chassis, "pitch", "hinge", (0, 1, 0))
    add_joint(chassis, "roll", "hinge", (1, 0, 0))
    wheels = []
    for axle, x_m in (("f", FRONT_X_M), ("r", REAR_X_M)):
        for side, y_m in (("left", HALF_TRACK_M), ("right", -HALF_TRACK_M)):
            name = f"wheel_{axle}{side[0]}"
            wheel = add_body(
                chassis, name, at_m=(x_m, y_m, HUB_Z_M), parent_at_m=CENTRE_M, mass_kg=UNSPRUNG_KG,
                inertia_kgm2=(1.0, 1.0, 1.0),
            )  # fmt: skip
            add_joint(wheel, name, "slide", (0, 0, 1), stiffness=SPRING_NPM[axle], damping=DAMPER_NSPM[axle])
            wheels.append(
                Wheel(
                    body=name,
                    x_m=x_m,
                    y_m=y_m,
                    side="left" if side == "left" else "right",
                    radius_m=HUB_Z_M,
                    contact_m=CONTACT_M,
                    stiffness_npm=TYRE_NPM,
                    damping_nspm=TYRE_NSPM,
                )
            )
    bar = spec.add_tendon(name="anti_roll_bar")
    bar.stiffness[0] = ANTI_ROLL_NPM
    bar.wrap_joint("wheel_fl", 1.0)
    bar.wrap_joint("wheel_fr", -1.0)
    add_rack(chassis, (*ego_xy_m, ROOF_Z_M))
    add_hub_sensors(spec, wheels)
    model = spec.compile()
    return Vehicle(
        name="car",
        model=model,
        wheels=preloaded(model, wheels),
        base="chassis",
        body="chassis",
        mount="rack",
        pitch_joint="pitch",
        lean_joint="roll",
        mass_kg=float(np.sum(model.body_mass)),
        pitch_joint_height_m=CENTRE_M[2],
        lean_joint_height_m=CENTRE_M[2],
        lean_stiffness_nmprad=0.0,
    )


def add_rack(chassis: mujoco.MjsBody, at_m: tuple[float, float, float]) -> None:
    """The rack with its two hinges on the roof."""
    x, y, z = at_m
    rack = add_body(
        chassis, "rack", at_m=at_m, parent_at_m=CENTRE_M, mass_kg=RACK_KG,
        inertia_kgm2=RACK_OWN_INERTIA_KGM2, com_m=(x, y, z + RACK_ABOVE_ROOF_M),
    )  # fmt: skip
    inertia = RACK_OWN_INERTIA_KGM2[0] + RACK_KG * RACK_ABOVE_ROOF_M**2
    turning = 2.0 * np.pi * RACK_HZ
    for name, axis in (("rack_pitch", (0, 1, 0)), ("rack_roll", (1, 0, 0))):
        add_joint(
            rack, name, "hinge", axis,
            stiffness=inertia * turning**2, damping=2.0 * RACK_DAMPING * inertia * turning,
        )  # fmt: skip
