"""Rigid transforms. `T_a_b` maps coordinates in frame b to those in frame a; adjacent letters must match."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


def readonly(array: np.ndarray, dtype: np.dtype | type | None = None) -> np.ndarray:
    """A C-contiguous copy that owns its memory and cannot be written to."""
    copy = np.array(array, dtype=dtype, order="C", copy=True)
    copy.setflags(write=False)
    return copy


def skew(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix [v]x with [v]x @ w == cross(v, w)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_exp(rotvec_rad: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix of a rotation vector in radians (Rodrigues), exact to rounding near zero."""
    rotvec_rad = np.asarray(rotvec_rad, dtype=float)
    angle = float(np.linalg.norm(rotvec_rad))
    k = skew(rotvec_rad)
    k2: np.ndarray = k @ k
    if angle < 1e-8:
        near_identity: np.ndarray = np.eye(3) + k + 0.5 * k2
        return near_identity
    rotation: np.ndarray = np.eye(3) + (np.sin(angle) / angle) * k + ((1.0 - np.cos(angle)) / angle**2) * k2
    return rotation


def rotation_log(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
    """Rotation vector in radians of a rotation matrix; inverse of `rotation_exp` for angles up to pi."""
    axis2 = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    sine2 = float(np.linalg.norm(axis2))
    angle = float(np.arctan2(sine2, np.trace(rotation) - 1.0))
    if sine2 > 1e-6:
        return axis2 * (angle / sine2)
    if angle < 1.0:
        return axis2 * 0.5
    # Near pi the antisymmetric part vanishes: take the axis from the symmetric part.
    outer = 0.5 * (rotation + np.eye(3))
    column = int(np.argmax(np.diag(outer)))
    axis = outer[:, column] / np.sqrt(outer[column, column])
    signed_angle = angle if float(axis @ axis2) >= 0.0 else -angle
    rotvec_rad: np.ndarray = axis * signed_angle
    return rotvec_rad


def rotation_rpy(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Float[np.ndarray, "3 3"]:
    """Rz(yaw) Ry(pitch) Rx(roll), angles in radians; in a z-up frame positive pitch looks down."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]], dtype=float)
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]], dtype=float)
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]], dtype=float)
    rotation: np.ndarray = rz @ ry @ rx
    return rotation


@dataclass(frozen=True, kw_only=True, eq=False)
class Transform:
    """A rigid transform: `x_a = rotation @ x_b + translation_m`.

    rotation: [3 3], orthonormal with determinant +1 (ValueError otherwise). translation_m: [3].
    """

    rotation: Float[np.ndarray, "3 3"]
    translation_m: Float[np.ndarray, "3"]

    def __post_init__(self) -> None:
        rotation = readonly(self.rotation, np.float64)
        translation_m = readonly(self.translation_m, np.float64)
        if rotation.shape != (3, 3) or translation_m.shape != (3,):
            raise ValueError(
                f"a transform needs a [3 3] rotation and a [3] translation, got "
                f"{rotation.shape} and {translation_m.shape}"
            )
        with np.errstate(over="ignore", invalid="ignore"):  # then it is no rotation
            skewness = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if not (skewness <= 1e-6 and np.linalg.det(rotation) > 0.0):  # True for NaN
            raise ValueError("rotation is not orthonormal with determinant +1")
        if not np.isfinite(translation_m).all():
            raise ValueError("translation_m holds a number that is not finite")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation_m", translation_m)

    @staticmethod
    def identity() -> Transform:
        return Transform(rotation=np.eye(3), translation_m=np.zeros(3))

    @staticmethod
    def exp(twist: Float[np.ndarray, "6"]) -> Transform:
        """The rigid motion of a twist (translation part rho [3] m, rotation vector [3] rad)."""
        rho, phi = np.asarray(twist[:3], dtype=float), np.asarray(twist[3:], dtype=float)
        return Transform(rotation=rotation_exp(phi), translation_m=_left_jacobian(phi) @ rho)

    def log(self) -> Float[np.ndarray, "6"]:
        """The twist of this motion; inverse of `exp` for rotations below pi."""
        phi = rotation_log(self.rotation)
        return np.concatenate([np.linalg.solve(_left_jacobian(phi), self.translation_m), phi])

    def inverse(self) -> Transform:
        """`T_b_a` of `T_a_b`."""
        return Transform(rotation=self.rotation.T, translation_m=-self.rotation.T @ self.translation_m)

    def __matmul__(self, other: Transform) -> Transform:
        """`T_a_b @ T_b_c == T_a_c`."""
        return Transform(
            rotation=self.rotation @ other.rotation,
            translation_m=self.rotation @ other.translation_m + self.translation_m,
        )

    def apply(self, xyz_m: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Points [... 3] in frame b as points [... 3] in frame a, in float64."""
        moved: np.ndarray = np.asarray(xyz_m, dtype=np.float64) @ self.rotation.T + self.translation_m
        return moved


def _left_jacobian(phi: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Left Jacobian of SO(3): `exp`'s translation is J @ rho (Barfoot, State Estimation, eq. 7.83)."""
    angle = float(np.linalg.norm(phi))
    k = skew(phi)
    k2: np.ndarray = k @ k
    if angle < 1e-5:
        near_identity: np.ndarray = np.eye(3) + 0.5 * k + k2 / 6.0
        return near_identity
    jacobian: np.ndarray = (
        np.eye(3) + ((1.0 - np.cos(angle)) / angle**2) * k + ((angle - np.sin(angle)) / angle**3) * k2
    )
    return jacobian
