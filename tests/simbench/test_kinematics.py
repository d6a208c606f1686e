"""The chain kernel against MuJoCo's kinematics on random trees of hinges."""

from __future__ import annotations

import mujoco
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.kinematics import chain


@settings(max_examples=40)
@given(parents=st.lists(st.integers(0, 100), min_size=1, max_size=8), seed=st.integers(0, 2**32 - 1))
def test_a_tree_of_hinges_stands_as_mujoco_has_it(parents: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    root = spec.worldbody.add_body(name="root", mocap=True)
    root.add_geom(size=[0.1, 0.1, 0.1])
    bodies, rows = [root], []
    for i, wish in enumerate(parents):
        up = wish % len(bodies)
        quaternion, axis = rng.standard_normal(4), rng.standard_normal(3)
        position, anchor = rng.standard_normal(3), rng.standard_normal(3)
        quaternion, axis = quaternion / np.linalg.norm(quaternion), axis / np.linalg.norm(axis)
        body = bodies[up].add_body(name=f"b{i}", pos=position, quat=quaternion)
        body.add_geom(size=[0.1, 0.1, 0.1])
        hinged = bool(rng.random() < 0.8)
        if hinged:
            body.add_joint(name=f"j{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, pos=anchor)
        bodies.append(body)
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, quaternion)
        zero = np.zeros(3)
        rows.append(
            (up + 1, matrix.reshape(3, 3), position, axis if hinged else zero, anchor if hinged else zero)
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    times = 3
    angle = np.zeros((times, len(rows) + 1))
    out_R, out_p = np.empty((times, len(rows) + 2, 3, 3)), np.empty((times, len(rows) + 2, 3))
    expected = []
    for n in range(times):
        quaternion = rng.standard_normal(4)
        data.mocap_pos[0], data.mocap_quat[0] = (
            rng.standard_normal(3),
            quaternion / np.linalg.norm(quaternion),
        )
        data.qpos[:] = rng.uniform(-3.0, 3.0, model.nq)
        mujoco.mj_kinematics(model, data)
        for i in range(len(rows)):
            joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"j{i}")
            angle[n, i + 1] = data.qpos[model.jnt_qposadr[joint]] if joint >= 0 else 0.0
        out_R[n, 0], out_p[n, 0] = np.eye(3), 0.0
        out_R[n, 1], out_p[n, 1] = data.body("root").xmat.reshape(3, 3), data.body("root").xpos
        expected.append(
            [(data.body(f"b{i}").xmat.copy(), data.body(f"b{i}").xpos.copy()) for i in range(len(rows))]
        )
    chain(
        np.array([0, *(r[0] for r in rows)]),
        np.array([np.eye(3), *(r[1] for r in rows)]),
        np.array([np.zeros(3), *(r[2] for r in rows)]),
        np.array([np.zeros(3), *(r[3] for r in rows)]),
        np.array([np.zeros(3), *(r[4] for r in rows)]),
        angle, out_R, out_p,
    )  # fmt: skip
    for n in range(times):
        for i in range(len(rows)):
            np.testing.assert_allclose(out_R[n, i + 2].ravel(), expected[n][i][0], atol=1e-10)
            np.testing.assert_allclose(out_p[n, i + 2], expected[n][i][1], atol=1e-10)
