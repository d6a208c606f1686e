"""The e-scooter with its rider: small stiff wheels, legs and torso as damped joints, sensors on the torso.

Deck: leans about the line of its wheels (held by a spring to the scripted lean), heaves and pitches; its
tyres are all its suspension. Legs: an ankle hinge and a slide (bent knees) carry the thighs. Torso: hinges at
the hips. Harness: hinges in pitch and roll between torso and sensors, one mode near 10 Hz (soft).
Masses: shares of a 75 kg body by Winter (2009), table 4.1: head, arms and trunk 0.678, thighs 0.2, shanks and
feet 0.122. Legs: a standing body's vertical mode lies at 5.5 Hz with straight and near 3 Hz with bent legs
(Matsumoto and Griffin 1998, Journal of Sound and Vibration 212); 4 Hz here. All else is judgement.
"""

from __future__ import annotations

import numpy as np

from simbench.dynamics.body import Vehicle, Wheel, add_body, add_hub_sensors, add_joint, empty_spec, preloaded

RIDER_KG = 75.0
TORSO_KG, THIGHS_KG, SHANKS_KG = 0.678 * RIDER_KG, 0.2 * RIDER_KG, 0.122 * RIDER_KG
FRAME_KG = 16.0
FRONT_X_M, REAR_X_M, HUB_Z_M = 0.61, -0.585, 0.14
TYRE_NPM, TYRE_NSPM, CONTACT_M = 70e3, 120.0, 0.05
DECK_M = (0.0, 0.0, 0.22)  # centre of mass of frame, shanks and feet
DECK_INERTIA_KGM2 = (0.6, 3.5, 3.2)
ANKLE_M, HIP_M = (-0.08, 0.0, 0.20), (-0.08, 0.0, 0.88)
THIGHS_Z_M = 0.72
TORSO_CENTRE_M = (-0.04, 0.0, 1.19)  # arms on the handlebar: ahead of the hips
TORSO_INERTIA_KGM2 = (3.1, 3.1, 0.8)
KNEES_HZ, KNEES_DAMPING = 4.0, 0.35
ANKLE_NMPRAD, ANKLE_NMSPRAD = 2400.0, 160.0  # the grip on the handlebar among it
HIP_NMPRAD, HIP_NMSPRAD = 1100.0, 50.0
HARNESS_KG, HARNESS_Z_M, HARNESS_INERTIA_KGM2 = 4.0, 1.35, (0.05, 0.05, 0.05)
HARNESS_HZ, HARNESS_DAMPING = 10.0, 0.15
WEIGHTLESS = 1e-3, (1e-6, 1e-6, 1e-6)  # kg, kg m^2: MuJoCo wants some
LEAN_HZ, LEAN_DAMPING = 0.8, 0.5


def scooter(ego_xy_m: tuple[float, float], step_s: float = 1e-3) -> Vehicle:
    """The e-scooter with the sensors' harness above `ego_xy_m` (root frame), integrated with this step."""
    spec = empty_spec(step_s)
    upper_kg = TORSO_KG + THIGHS_KG + HARNESS_KG
    # Without weight: the line between the tyres' contacts, which heaves and pitches but does not lean.
    line = add_body(spec.worldbody, "line", at_m=DECK_M, mass_kg=WEIGHTLESS[0], inertia_kgm2=WEIGHTLESS[1])
    add_joint(line, "heave", "slide", (0, 0, 1))
    add_joint(line, "pitch", "hinge", (0, 1, 0))
    deck = add_body(
        line, "deck", at_m=DECK_M, parent_at_m=DECK_M, mass_kg=FRAME_KG + SHANKS_KG,
        inertia_kgm2=DECK_INERTIA_KGM2,
    )  # fmt: skip
    lean_inertia = upper_kg * 1.1**2
    lean_turning = 2.0 * np.pi * LEAN_HZ
    toppling = upper_kg * 9.81 * 1.1
    lean_stiffness = lean_inertia * lean_turning**2 + toppling
    add_joint(
        deck, "lean", "hinge", (1, 0, 0), pos_m=(0.0, 0.0, -DECK_M[2]), stiffness=lean_stiffness,
        damping=2.0 * LEAN_DAMPING * lean_inertia * lean_turning,
    )  # fmt: skip
    wheels = []
    for name, x_m in (("wheel_front", FRONT_X_M), ("wheel_rear", REAR_X_M)):
        hub = (x_m, 0.0, HUB_Z_M)
        add_body(line, name, at_m=hub, parent_at_m=DECK_M, mass_kg=WEIGHTLESS[0], inertia_kgm2=WEIGHTLESS[1])
        wheels.append(
            Wheel(
                body=name,
                x_m=x_m,
                y_m=0.0,
                side=None,
                radius_m=HUB_Z_M,
                contact_m=CONTACT_M,
                stiffness_npm=TYRE_NPM,
                damping_nspm=TYRE_NSPM,
            )
        )
    legs = add_body(
        deck, "legs", at_m=ANKLE_M, parent_at_m=DECK_M, mass_kg=THIGHS_KG, inertia_kgm2=(0.3, 0.3, 0.1),
        com_m=(ANKLE_M[0], 0.0, THIGHS_Z_M),
    )  # fmt: skip
    add_joint(legs, "ankle", "hinge", (0, 1, 0), stiffness=ANKLE_NMPRAD, damping=ANKLE_NMSPRAD)
    turning = 2.0 * np.pi * KNEES_HZ
    add_joint(
        legs, "knees", "slide", (0, 0, 1),
        stiffness=upper_kg * turning**2, damping=2.0 * KNEES_DAMPING * upper_kg * turning,
    )  # fmt: skip
    torso = add_body(
        legs, "torso", at_m=HIP_M, parent_at_m=ANKLE_M, mass_kg=TORSO_KG, inertia_kgm2=TORSO_INERTIA_KGM2,
        com_m=TORSO_CENTRE_M,
    )  # fmt: skip
    add_joint(torso, "hips", "hinge", (0, 1, 0), stiffness=HIP_NMPRAD, damping=HIP_NMSPRAD)
    add_joint(torso, "sway", "hinge", (1, 0, 0), stiffness=HIP_NMPRAD, damping=HIP_NMSPRAD)
    back = (HIP_M[0], 0.0, HARNESS_Z_M)
    centre = (*ego_xy_m, HARNESS_Z_M)
    harness = add_body(
        torso, "harness", at_m=back, parent_at_m=HIP_M, mass_kg=HARNESS_KG,
        inertia_kgm2=HARNESS_INERTIA_KGM2, com_m=centre,
    )  # fmt: skip
    arm_m = float(np.hypot(centre[0] - back[0], centre[1] - back[1]))
    turning = 2.0 * np.pi * HARNESS_HZ
    for name, axis, inertia in (
        ("harness_pitch", (0, 1, 0), HARNESS_INERTIA_KGM2[1] + HARNESS_KG * arm_m**2),
        ("harness_roll", (1, 0, 0), HARNESS_INERTIA_KGM2[0]),
    ):
        add_joint(
            harness, name, "hinge", axis,
            stiffness=inertia * turning**2, damping=2.0 * HARNESS_DAMPING * inertia * turning,
        )  # fmt: skip
    add_hub_sensors(spec, wheels)
    model = spec.compile()
    return Vehicle(
        name="e-scooter",
        model=model,
        wheels=preloaded(model, wheels),
        base="deck",
        body="torso",
        mount="harness",
        pitch_joint="pitch",
        lean_joint="lean",
        mass_kg=float(np.sum(model.body_mass)),
        pitch_joint_height_m=DECK_M[2],
        lean_joint_height_m=0.0,
        lean_stiffness_nmprad=lean_stiffness,
    )
