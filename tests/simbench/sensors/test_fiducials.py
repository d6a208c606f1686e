"""The known points that receipts measure with."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import PinholeCamera, project_points
from fusion.geometry import Transform, rotation_rpy
from simbench.faults.estimate import camera_pose
from simbench.sensors.fiducials import DEPTHS_M, points_m

CAMERA = PinholeCamera(fx_px=571.0, fy_px=571.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)


@given(
    rpy=st.tuples(*[st.floats(-3, 3)] * 3),
    xyz=st.tuples(*[st.floats(-100, 100)] * 3),
)
def test_all_points_appear_well_inside_the_image_at_their_depths(
    rpy: tuple[float, float, float], xyz: tuple[float, float, float]
) -> None:
    pose = Transform(rotation=rotation_rpy(*rpy), translation_m=np.array(xyz))
    points = points_m(CAMERA, pose)
    uv = project_points(points, pose.inverse(), CAMERA)
    assert len(points) == 12
    assert ((uv > [100, 100]) & (uv < [860, 500])).all()
    depth = pose.inverse().apply(points)[:, 2]
    np.testing.assert_allclose(np.unique(np.round(depth, 6)), sorted(DEPTHS_M))


@given(turn=st.tuples(*[st.floats(-0.05, 0.05)] * 3), shift=st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_a_camera_that_moved_is_found_where_it_is(
    turn: tuple[float, float, float], shift: tuple[float, float, float]
) -> None:
    """Not on one plane and spread over the view: the pose that sees them so is unique, to a micrometre."""
    expected = Transform(rotation=rotation_rpy(0.4, -0.2, 1.1), translation_m=np.array([3.0, -2.0, 1.6]))
    true = Transform(
        rotation=rotation_rpy(*turn) @ expected.rotation,
        translation_m=expected.translation_m + np.array(shift),
    )
    field = points_m(CAMERA, expected)
    rotation, position = camera_pose(field, project_points(field, true.inverse(), CAMERA), CAMERA)
    np.testing.assert_allclose(rotation, true.rotation, atol=1e-6)
    np.testing.assert_allclose(position, true.translation_m, atol=1e-5)
