"""The MuJoCo parts: each compiles alone, keeps the conventions that the world relies on, and can be attached
many times. MuJoCo and the files only; nothing of the bench is imported."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

PARTS = Path(__file__).resolve().parents[2] / "scenarios" / "parts"
PALETTE: dict[str, dict[str, Any]] = yaml.safe_load((PARTS / "materials.yaml").read_text(encoding="utf-8"))
PRIMITIVES = {
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}
GROUND = {"asphalt", "marking", "grass", "concrete"}


@dataclass(frozen=True, kw_only=True)
class Category:
    """What a part of this kind measures (length, width, height of its rest-pose box, metres) and may cost."""

    size_m: tuple[float, float, float]
    budget: int  # geoms: the ray caster tests every one
    centred: bool = True  # the origin is the footprint's centre; else the foot of the trunk or the pole


CATEGORIES = {
    "car": Category(size_m=(4.5, 1.8, 1.5), budget=32),
    "van": Category(size_m=(5.4, 2.0, 2.2), budget=26),
    "escooter_rider": Category(size_m=(1.5, 0.65, 1.75), budget=36),
    "pedestrian": Category(size_m=(0.30, 0.56, 1.76), budget=16),
    "tree": Category(size_m=(4.5, 4.1, 6.6), budget=7, centred=False),
    "post": Category(size_m=(1.87, 0.34, 6.0), budget=5, centred=False),
    "building": Category(size_m=(14.0, 8.0, 6.0), budget=22),
    "board": Category(size_m=(0.84, 1.2, 1.7), budget=40),
}
WHEELS = {
    "car": {"wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"},
    "van": {"wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"},
    "escooter_rider": {"wheel_front", "wheel_rear"},
}
OTHER_JOINTS = {
    "pedestrian": {"swing_leg_l", "swing_leg_r", "swing_arm_l", "swing_arm_r"},
    "escooter_rider": {"sway"},
}
every_part = pytest.mark.parametrize("part", sorted(CATEGORIES))


def spec_of(part: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(PARTS / f"{part}.xml"))


def at_rest(part: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = spec_of(part).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def half_extent_m(kind: int, size: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Half sides [3] of the axis-aligned box around a primitive with this rotation [3 3] [m]."""
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.full(3, size[0])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.asarray(np.abs(rotation) @ size)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.asarray(np.sqrt(rotation**2 @ size**2))
    along = np.abs(rotation[:, 2])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.asarray(along * size[1] + size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.asarray(along * size[1] + size[0] * np.sqrt(np.maximum(0.0, 1.0 - along**2)))
    raise ValueError(f"not a primitive: {kind}")


def bounds_m(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner [3] of the box around all geoms."""
    half = np.array(
        [
            half_extent_m(model.geom_type[g], model.geom_size[g], data.geom_xmat[g].reshape(3, 3))
            for g in range(model.ngeom)
        ]
    )
    return (data.geom_xpos - half).min(axis=0), (data.geom_xpos + half).max(axis=0)


# -- laws of the helper itself ------------------------------------------------------------------------------


@given(
    quat=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 0.01),
    size=st.tuples(*[st.floats(0.05, 2.0)] * 3),
    kind=st.sampled_from(sorted(int(k) for k in PRIMITIVES)),
)
def test_the_box_around_a_primitive_touches_its_surface_as_mujoco_casts_rays_on_it(
    quat: tuple[float, float, float, float], size: tuple[float, float, float], kind: int
) -> None:
    rotation = np.zeros(9)
    unit = np.array(quat) / np.linalg.norm(quat)
    mujoco.mju_quat2Mat(rotation, unit)
    half = half_extent_m(kind, np.array(size), rotation.reshape(3, 3))
    span = float(np.linalg.norm(half)) * 4
    inside = np.linspace(-1.0, 1.0, 9) * 0.999
    for axis in range(3):
        start, direction = np.zeros((81, 3)), np.zeros(3)
        others = [a for a in range(3) if a != axis]
        start[:, others] = np.stack(np.meshgrid(inside, inside), -1).reshape(-1, 2) * half[others]
        start[:, axis], direction[axis] = span, -1.0
        ranges = [
            mujoco.mju_rayGeom(np.zeros(3), rotation, np.array(size), s, direction, kind) for s in start
        ]
        highest = max((span - r for r in ranges if r >= 0), default=-math.inf)
        assert highest <= half[axis] + 1e-6
        assert highest > 0.0


# -- every part ---------------------------------------------------------------------------------------------


def test_the_folder_holds_exactly_the_parts_that_are_tested_here() -> None:
    assert {f.stem for f in PARTS.glob("*.xml")} == set(CATEGORIES)


@every_part
def test_compiles_alone_under_its_own_name_and_within_its_budget(part: str) -> None:
    spec = spec_of(part)
    assert spec.modelname == part
    assert 0 < spec.compile().ngeom <= CATEGORIES[part].budget


@every_part
def test_geoms_are_named_primitives_that_collide_with_nothing(part: str) -> None:
    model, _ = at_rest(part)
    assert set(model.geom_type.tolist()) <= {int(k) for k in PRIMITIVES}
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
    assert (model.geom_group == 1).all()
    names = [model.geom(g).name for g in range(model.ngeom)]
    assert all(names)
    assert len(set(names)) == len(names)
    assert model.nmesh == model.nhfield == model.ntex == 0


@every_part
def test_every_colour_comes_from_a_material_of_the_palette(part: str) -> None:
    spec = spec_of(part)
    declared = {m.name for m in spec.materials}
    used = {g.material for g in spec.geoms}
    assert used == declared
    assert declared <= set(PALETTE)
    default_rgba = np.array([0.5, 0.5, 0.5, 1.0])
    for geom in spec.geoms:
        np.testing.assert_allclose(geom.rgba, default_rgba, err_msg=geom.name)
    for material in spec.materials:
        entry = PALETTE[material.name]
        assert material.rgba[3] == 1.0
        assert np.isclose(np.array(entry["colours"]), material.rgba[:3]).all(axis=1).any(), material.name
        assert (material.specular, material.shininess) == pytest.approx(
            (entry["specular"], entry["shininess"])
        )


@every_part
def test_one_root_at_the_origin_without_a_joint(part: str) -> None:
    spec = spec_of(part)
    (root,) = spec.worldbody.bodies
    assert root.name == "root"
    np.testing.assert_array_equal(root.pos, 0.0)
    np.testing.assert_array_equal(root.quat, [1, 0, 0, 0])
    assert not root.joints
    assert not spec.worldbody.geoms
    assert not spec.cameras
    assert not spec.lights


@every_part
def test_measures_what_its_category_measures_and_stands_on_the_ground(part: str) -> None:
    low, high = bounds_m(*at_rest(part))
    category = CATEGORIES[part]
    np.testing.assert_allclose(high - low, category.size_m, rtol=0.02)
    assert abs(low[2]) <= 0.005
    if category.centred:
        np.testing.assert_allclose((high + low)[:2] / 2, 0.0, atol=0.025)
    else:
        assert (low[:2] < 0).all()
        assert (high[:2] > 0).all()


def test_the_car_is_exactly_4_5_by_1_8_m() -> None:
    low, high = bounds_m(*at_rest("car"))
    np.testing.assert_allclose((high - low)[:2], (4.5, 1.8), atol=1e-9)


@every_part
def test_no_piece_floats(part: str) -> None:
    """The geoms' touch graph is connected (MuJoCo's own distance; a gap of 1 mm is allowed)."""
    model, data = at_rest(part)
    mujoco.mj_forward(model, data)
    reached, todo = {0}, [0]
    while todo:
        here = todo.pop()
        for other in set(range(model.ngeom)) - reached:
            if mujoco.mj_geomDistance(model, data, here, other, 0.01, None) < 0.001:
                reached.add(other)
                todo.append(other)
    assert [model.geom(g).name for g in set(range(model.ngeom)) - reached] == []


@every_part
def test_joints_are_the_agreed_hinges_without_limits(part: str) -> None:
    model, _ = at_rest(part)
    names = {model.joint(j).name for j in range(model.njnt)}
    assert names == WHEELS.get(part, set()) | OTHER_JOINTS.get(part, set())
    for j in range(model.njnt):
        name = model.joint(j).name
        assert model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
        assert not model.jnt_limited[j]
        np.testing.assert_array_equal(model.jnt_axis[j], [1, 0, 0] if name == "sway" else [0, 1, 0])
        np.testing.assert_array_equal(model.jnt_pos[j], 0.0)
        assert "root" == model.body(model.body_parentid[model.jnt_bodyid[j]]).name


# -- moving pieces ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part, wheel", [(p, w) for p in sorted(WHEELS) for w in sorted(WHEELS[p])])
def test_a_wheels_first_geom_is_a_tyre_that_stands_on_the_ground(part: str, wheel: str) -> None:
    model, data = at_rest(part)
    body = model.body(wheel)
    tyre = int(body.geomadr[0])
    assert model.geom_type[tyre] == mujoco.mjtGeom.mjGEOM_CYLINDER
    np.testing.assert_allclose(np.abs(data.geom_xmat[tyre].reshape(3, 3)[:, 2]), [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(data.geom_xpos[tyre], data.xpos[body.id], atol=1e-9)
    assert data.geom_xpos[tyre][2] == pytest.approx(model.geom_size[tyre][0], abs=1e-6)


@pytest.mark.parametrize(
    "part, wheel", [(p, w) for p in ("car", "escooter_rider") for w in sorted(WHEELS[p])]
)
def test_a_turning_wheel_shows_and_a_positive_angle_rolls_forward(part: str, wheel: str) -> None:
    model, data = at_rest(part)
    body, joint = model.body(wheel), model.joint(wheel)
    spokes = [
        g
        for g in range(int(body.geomadr[0]), int(body.geomadr[0] + body.geomnum[0]))
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX
    ]
    assert spokes
    rest = data.geom_xmat[spokes[0]].reshape(3, 3).copy()
    data.qpos[joint.qposadr[0]] = math.radians(10)
    mujoco.mj_kinematics(model, data)
    turned = data.geom_xmat[spokes[0]].reshape(3, 3) @ rest.T
    assert (turned @ [0, 0, 1])[0] > 0.17  # the wheel's top moves forward


def test_a_spoke_stands_out_of_its_rim_by_millimetres_that_do_not_flicker() -> None:
    for part in ("car", "escooter_rider"):
        model, _ = at_rest(part)
        for wheel in WHEELS[part]:
            first = int(model.body(wheel).geomadr[0])
            widths = model.geom_size[first, 1], model.geom_size[first + 1, 1], model.geom_size[first + 2, 1]
            assert np.diff(widths).min() >= 0.004


@pytest.mark.parametrize("degrees", [-2.0, 2.0])
def test_the_swaying_riders_hands_stay_at_the_bar(degrees: float) -> None:
    model, data = at_rest("escooter_rider")
    hands = [model.geom(f"hand_{side}").id for side in "lr"]
    bar = model.geom("bar").id
    rest = data.geom_xpos[hands].copy()
    data.qpos[model.joint("sway").qposadr[0]] = math.radians(degrees)
    mujoco.mj_forward(model, data)
    assert np.linalg.norm(data.geom_xpos[hands] - rest, axis=1).max() < 0.03
    assert all(mujoco.mj_geomDistance(model, data, h, bar, 0.1, None) < 0 for h in hands)


@pytest.mark.parametrize("shoe", ["shoe_l", "shoe_r"])
def test_the_rider_stands_on_the_deck(shoe: str) -> None:
    model, data = at_rest("escooter_rider")
    g, deck = model.geom(shoe).id, model.geom("grip_mat").id
    mat = data.geom_xmat[g].reshape(3, 3)
    sole = data.geom_xpos[g][2] - half_extent_m(model.geom_type[g], model.geom_size[g], mat)[2]
    top = data.geom_xpos[deck][2] + model.geom_size[deck][2]
    assert sole == pytest.approx(top, abs=0.01)


def test_one_foot_of_the_rider_is_behind_the_other() -> None:
    model, data = at_rest("escooter_rider")
    left, right = (data.geom_xpos[model.geom(f"shoe_{s}").id] for s in "lr")
    assert left[0] - right[0] > 0.25


@given(degrees=st.floats(-35, 35))
def test_a_walkers_feet_never_dip_far_below_the_ground(degrees: float) -> None:
    model, data = at_rest("pedestrian")
    for limb, sign in (("leg_l", 1), ("leg_r", -1), ("arm_l", -1), ("arm_r", 1)):
        data.qpos[model.joint(f"swing_{limb}").qposadr[0]] = sign * math.radians(degrees)
    mujoco.mj_kinematics(model, data)
    low, _ = bounds_m(model, data)
    assert low[2] > -0.035


# -- attaching ----------------------------------------------------------------------------------------------


@every_part
def test_can_be_attached_three_times_in_one_world_and_keeps_its_shape(part: str) -> None:
    alone, _ = at_rest(part)
    world = mujoco.MjSpec()
    for k in range(3):
        frame = world.worldbody.add_frame(pos=[20.0 * k, 0, 0])
        frame.attach_body(spec_of(part).body("root"), f"{part}{k}_", "")
    model = world.compile()
    assert model.ngeom == 3 * alone.ngeom
    assert model.njnt == 3 * alone.njnt
    assert model.nmat == 3 * alone.nmat
    for k in range(3):
        for g in range(alone.ngeom):
            copy = model.geom(f"{part}{k}_{alone.geom(g).name}")
            np.testing.assert_allclose(copy.size, alone.geom_size[g])
            assert model.mat(copy.matid[0]).name == f"{part}{k}_{alone.mat(alone.geom_matid[g]).name}"


@every_part
def test_a_mocap_root_carries_all_its_children(part: str) -> None:
    """How the world moves an actor: its root is a mocap body, mj_kinematics takes the children along."""
    alone, rest = at_rest(part)
    world = mujoco.MjSpec()
    root = world.worldbody.add_frame().attach_body(spec_of(part).body("root"), "a_", "")
    root.mocap = True
    model = world.compile()
    data = mujoco.MjData(model)
    turn = np.zeros(9)
    quat = np.array([math.cos(0.4), 0.0, 0.0, math.sin(0.4)])
    mujoco.mju_quat2Mat(turn, quat)
    shift = np.array([12.0, -3.0, 0.5])
    mocap = model.body("a_root").mocapid[0]
    data.mocap_pos[mocap], data.mocap_quat[mocap] = shift, quat
    mujoco.mj_kinematics(model, data)
    want = rest.geom_xpos @ turn.reshape(3, 3).T + shift
    got = np.array([data.geom_xpos[model.geom(f"a_{alone.geom(g).name}").id] for g in range(alone.ngeom)])
    np.testing.assert_allclose(got, want, atol=1e-9)


# -- the palette --------------------------------------------------------------------------------------------


def test_the_palette_holds_what_the_parts_and_the_ground_use_and_nothing_else() -> None:
    used = {m.name for part in CATEGORIES for m in spec_of(part).materials}
    assert set(PALETTE) == used | GROUND


@pytest.mark.parametrize("name", sorted(PALETTE))
def test_a_palette_entry_is_complete_and_physical(name: str) -> None:
    entry = PALETTE[name]
    keys = {"per", "colours", "reflectivity", "specular", "shininess", "source"}
    assert set(entry) - {"roughness_deg"} == keys
    assert 0 <= entry.get("roughness_deg", 0) <= 45
    assert entry["per"] in ("instance", "scene")
    colours = np.array(entry["colours"], dtype=float)
    assert colours.ndim == 2
    assert colours.shape[1] == 3
    assert ((colours >= 0) & (colours <= 1)).all()
    low, high = entry["reflectivity"]
    assert 0.02 <= low < high <= 0.9
    assert 0 <= entry["specular"] <= 1
    assert 0 <= entry["shininess"] <= 1
    assert entry["source"].startswith(("[J]", "[D]", "[C]"))


def test_reflectivity_ranks_as_the_materials_do() -> None:
    mean = {name: float(np.mean(entry["reflectivity"])) for name, entry in PALETTE.items()}
    order = ["rubber", "asphalt", "concrete", "metal", "plate", "board_white"]
    assert [mean[n] for n in order] == sorted(mean[n] for n in order)


def surface_reflectivity(part: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One instance: reflectivity of each geom, and its bounding area as the weight [m²]."""
    model, _ = at_rest(part)
    drawn = {
        model.mat(m).name: rng.uniform(*PALETTE[model.mat(m).name]["reflectivity"]) for m in range(model.nmat)
    }
    value = np.array([drawn[model.mat(m).name] for m in model.geom_matid])
    return value, np.array([np.prod(np.sort(s)[-2:]) for s in np.maximum(model.geom_size, 0.02)])


def test_reflectivity_alone_does_not_tell_the_rider_from_the_background() -> None:
    rng = np.random.default_rng(7)
    background = ["car", "car", "van", "pedestrian", "pedestrian", "tree", "post", "building"]
    target = [surface_reflectivity("escooter_rider", rng) for _ in range(150)]
    others = [surface_reflectivity(p, rng) for _ in range(30) for p in background]
    # every object weighs the same, whatever its size
    t, tw = np.concatenate([v for v, _ in target]), np.concatenate([w / w.sum() for _, w in target])
    o, ow = np.concatenate([v for v, _ in others]), np.concatenate([w / w.sum() for _, w in others])
    above = (t[:, None] > o[None, :]).astype(float)
    auc = float(tw @ above @ ow / (tw.sum() * ow.sum()))
    assert 0.3 < auc < 0.7
