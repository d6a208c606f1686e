"""`Transform` obeys the laws of a group, and its exponential and logarithm are inverse to each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fusion.geometry import Transform, readonly, rotation_exp, rotation_log, rotation_rpy

metres = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0))
rotvecs = arrays(np.float64, 3, elements=st.floats(-1.8, 1.8))  # below pi in length
transforms = st.builds(
    lambda rotvec, t: Transform(rotation=rotation_exp(rotvec), translation_m=t), rotvecs, metres
)


def same(a: Transform, b: Transform) -> None:
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-9)
    np.testing.assert_allclose(a.translation_m, b.translation_m, atol=1e-9)


@given(transforms)
def test_the_identity_changes_nothing_on_either_side(t: Transform) -> None:
    same(Transform.identity() @ t, t)
    same(t @ Transform.identity(), t)


@given(transforms)
def test_a_transform_and_its_inverse_cancel(t: Transform) -> None:
    same(t @ t.inverse(), Transform.identity())
    same(t.inverse() @ t, Transform.identity())


@given(transforms, transforms, transforms)
def test_composition_is_associative(a: Transform, b: Transform, c: Transform) -> None:
    same((a @ b) @ c, a @ (b @ c))


@given(transforms, transforms, arrays(np.float64, (4, 3), elements=st.floats(-50.0, 50.0)))
def test_composition_applies_the_right_one_first(a: Transform, b: Transform, points: np.ndarray) -> None:
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-9)


@given(arrays(np.float64, 3, elements=st.floats(-10.0, 10.0)), rotvecs)
def test_log_undoes_exp(rho: np.ndarray, phi: np.ndarray) -> None:
    twist = np.concatenate([rho, phi])
    np.testing.assert_allclose(Transform.exp(twist).log(), twist, atol=1e-7)


@pytest.mark.parametrize("length", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1.0, 3.0, np.pi - 1e-7, np.pi])
def test_exp_and_log_agree_with_scipy_from_zero_to_pi(length: float) -> None:
    rotvec = length * np.array([2.0, -3.0, 6.0]) / 7.0
    oracle = Rotation.from_rotvec(rotvec).as_matrix()
    np.testing.assert_allclose(rotation_exp(rotvec), oracle, atol=1e-14)
    recovered = rotation_log(rotation_exp(rotvec))
    np.testing.assert_allclose(rotation_exp(recovered), oracle, atol=1e-9)
    assert np.linalg.norm(recovered) == pytest.approx(length, abs=1e-8)


@pytest.mark.parametrize("scale", [1e-7, 1e-4, 1e-2, 1.0])
def test_exp_is_the_matrix_exponential_of_the_twist(scale: float) -> None:
    rho, phi = np.array([3.0, -1.0, 2.0]), scale * np.array([0.3, 0.8, -0.4])
    twist = np.zeros((4, 4))
    twist[:3, :3] = [[0, -phi[2], phi[1]], [phi[2], 0, -phi[0]], [-phi[1], phi[0], 0]]
    twist[:3, 3] = rho
    oracle = expm(twist)
    t = Transform.exp(np.concatenate([rho, phi]))
    np.testing.assert_allclose(t.rotation, oracle[:3, :3], atol=1e-12)
    np.testing.assert_allclose(t.translation_m, oracle[:3, 3], atol=1e-9)


def test_positive_yaw_turns_left_and_positive_pitch_looks_down() -> None:
    forward = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(rotation_rpy(0, 0, np.pi / 2) @ forward, [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotation_rpy(0, np.pi / 2, 0) @ forward, [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize(
    "rotation", [2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), np.nan), np.zeros((3, 3))]
)
def test_a_matrix_that_is_no_rotation_is_refused(rotation: np.ndarray) -> None:
    with pytest.raises(ValueError, match="orthonormal"):
        Transform(rotation=rotation, translation_m=np.zeros(3))


def test_a_translation_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        Transform(rotation=np.eye(3), translation_m=np.array([0.0, np.inf, 0.0]))


def test_a_readonly_copy_shares_no_memory_and_refuses_writing() -> None:
    source = np.arange(6.0).reshape(2, 3)[:, ::-1]
    copy = readonly(source)
    assert copy.base is None and not np.shares_memory(copy, source)
    with pytest.raises(ValueError, match="read-only"):
        copy[0, 0] = 1.0
