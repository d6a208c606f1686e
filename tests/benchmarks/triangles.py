"""Primitives as triangles, fine enough that no chord is farther from its surface than a tolerance."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int32

from simbench.sensors import rays

Mesh = tuple[Float64[np.ndarray, "v 3"], Int32[np.ndarray, "f 3"]]
TOLERANCE_M = 0.005  # below half of the OS1-64's resolution of 12 mm
FEWEST_SLICES = 12


def slices(radius_m: float, tolerance_m: float) -> int:
    """Sides of a regular polygon in a circle whose chords are at most `tolerance_m` inside it."""
    if tolerance_m >= radius_m:
        return FEWEST_SLICES
    return max(FEWEST_SLICES, int(np.ceil(np.pi / np.arccos(1.0 - tolerance_m / radius_m))))


def tessellate(kind: int, size_m: Float64[np.ndarray, " 3"], tolerance_m: float) -> Mesh:
    """Vertices and faces of one MuJoCo primitive in its own frame, faces counter-clockwise seen from outside.

    Both angles of a round shape are cut so finely that each costs half the tolerance.
    """
    half = 0.5 * tolerance_m
    x, y, z = (float(v) for v in size_m)
    if kind == rays.PLANE:
        corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
        return corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    if kind == rays.BOX:
        return _turned(np.array([[1.0, -z], [1.0, z]]), 4, (x * np.sqrt(2), y * np.sqrt(2)), np.pi / 4)
    if kind == rays.CYLINDER:
        return _turned(np.array([[1.0, -y], [1.0, y]]), slices(x, tolerance_m), (x, x))
    if kind == rays.CAPSULE:
        n = slices(x, half)
        angle = np.linspace(0.0, np.pi / 2, -(-n // 4) + 1)
        arc = np.column_stack([np.cos(angle), x * np.sin(angle)])
        below, above = arc[::-1] * (1.0, -1.0) - np.array([0.0, y]), arc + np.array([0.0, y])
        return _turned(np.concatenate([below[1:], above[:-1]]), n, (x, x), poles=(-y - x, y + x))
    radii = (x, x, x) if kind == rays.SPHERE else (x, y, z)
    n = slices(max(radii), half)
    angle = np.linspace(-np.pi / 2, np.pi / 2, -(-n // 2) + 1)
    rings = np.column_stack([np.cos(angle), radii[2] * np.sin(angle)])[1:-1]
    return _turned(rings, n, radii[:2], poles=(-radii[2], radii[2]))


def _turned(
    profile: Float64[np.ndarray, "r 2"],
    n: int,
    radii_m: tuple[float, float],
    phase_rad: float = 0.0,
    poles: tuple[float, float] | None = None,
) -> Mesh:
    """A profile of rings (share of the radii, height), bottom to top, turned about z in n sides and closed at
    `poles` (without: flat)."""
    angle = phase_rad + 2.0 * np.pi * np.arange(n) / n
    circle = np.column_stack([radii_m[0] * np.cos(angle), radii_m[1] * np.sin(angle)])
    rings = len(profile)
    ends = (profile[0, 1], profile[-1, 1]) if poles is None else poles
    vertices = np.concatenate(
        [np.column_stack([share * circle, np.full(n, height)]) for share, height in profile]
        + [np.array([[0.0, 0.0, ends[0]], [0.0, 0.0, ends[1]]])]
    )
    i = np.arange(n)
    j = (i + 1) % n
    faces = [np.column_stack([np.full(n, rings * n), j, i])]
    for ring in range(rings - 1):
        low, high = ring * n, (ring + 1) * n
        faces.append(np.column_stack([low + i, low + j, high + j]))
        faces.append(np.column_stack([low + i, high + j, high + i]))
    top = (rings - 1) * n
    faces.append(np.column_stack([np.full(n, rings * n + 1), top + i, top + j]))
    return vertices, np.concatenate(faces).astype(np.int32)


def world_mesh(
    kind: Int32[np.ndarray, " g"],
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "g 3 3"],
    position_m: Float64[np.ndarray, "g 3"],
    tolerance_m: float = TOLERANCE_M,
) -> Mesh:
    """All primitives as one mesh in the world frame."""
    vertices, faces, count = [], [], 0
    for i in range(len(kind)):
        own, triangles = tessellate(int(kind[i]), size_m[i], tolerance_m)
        vertices.append(own @ rotation[i].T + position_m[i])
        faces.append(triangles + count)
        count += len(own)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)
