"""Step 2: boxes grow about their centre, and exactly the points that eq. 6 maps into them are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.aoi import AoiConfig, clip, enlarge, map_into_boxes
from fusion.camera import PinholeCamera, inside_box, project_points
from fusion.geometry import Transform, rotation_exp

CAMERA = PinholeCamera(fx_px=432.0, fy_px=432.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)
WIDE = replace(CAMERA, distortion=(-0.21, 0.06, 0.002, -0.003, 0.0))
OPTICAL = Transform(rotation=np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), translation_m=np.zeros(3))


def test_full_enlargement_doubles_the_width_and_leaves_the_height() -> None:
    assert enlarge((100.0, 50.0, 140.0, 150.0), AoiConfig()) == (80.0, 50.0, 160.0, 150.0)


def test_the_vertical_ratio_is_its_own() -> None:
    assert enlarge((100.0, 50.0, 140.0, 150.0), AoiConfig(widen=0.0, heighten=0.5)) == (
        100.0,
        25.0,
        140.0,
        175.0,
    )


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((-5.0, 10.0, 20.0, 700.0), (0.0, 10.0, 20.0, 600.0)),
        ((970.0, 10.0, 990.0, 20.0), None),
        ((10.0, 20.0, 10.0, 30.0), None),
        ((float("nan"), 0.0, 10.0, 10.0), None),
    ],
)
def test_an_aoi_ends_where_the_image_ends(
    box: tuple[float, float, float, float], expected: tuple[float, float, float, float] | None
) -> None:
    assert clip(box, CAMERA) == expected


@pytest.mark.parametrize("camera", [CAMERA, WIDE], ids=["plain", "distorted"])
@given(seed=st.integers(0, 2**32 - 1))
def test_the_points_found_are_those_of_projecting_everything(camera: PinholeCamera, seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    turned = Transform(rotation=rotation_exp(rng.normal(0, 0.05, 3)), translation_m=rng.normal(0, 0.3, 3))
    T = turned @ OPTICAL
    xyz = np.column_stack(
        [rng.uniform(-20, 40, 3000), rng.uniform(-20, 20, 3000), rng.uniform(-3, 6, 3000)]
    ).astype(np.float32)
    # A bearing far outside the lens may be folded back by the polynomial: keep to where it is monotonic.
    ahead = T.apply(xyz)
    xyz = xyz[(ahead[:, 2] <= 0.05) | (np.hypot(ahead[:, 0], ahead[:, 1]) < 1.5 * ahead[:, 2])]
    corners = rng.uniform([0, 0, 0, 0], [900, 560, 0, 0], (3, 4))
    corners[:, 2:] = np.minimum(corners[:, :2] + rng.uniform(5, 400, (3, 2)), [960.0, 600.0])
    boxes = [(float(a), float(b), float(c), float(d)) for a, b, c, d in corners]
    uv = project_points(xyz, T, camera)
    for box, found in zip(boxes, map_into_boxes(xyz.T.copy(), T, camera, boxes), strict=True):
        assert found.points.tolist() == np.flatnonzero(inside_box(uv, box)).tolist()
        np.testing.assert_allclose(found.uv_px, uv[found.points], atol=1e-9)


def test_a_point_that_the_distortion_would_fold_into_the_image_is_left_out() -> None:
    xyz = np.array([[1.0, 2.2, 0.0]], dtype=np.float32)  # 65 degrees to the left, far outside 96 degrees
    folding = replace(CAMERA, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    image = (0.0, 0.0, 960.0, 600.0)
    assert inside_box(project_points(xyz, OPTICAL, folding), image).all()
    box = (400.0, 250.0, 560.0, 350.0)
    assert len(map_into_boxes(xyz.T.copy(), OPTICAL, folding, [box])[0].points) == 0


def test_points_that_are_not_finite_are_in_no_box() -> None:
    xyz = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [5, np.inf, 0], [5, 0, 0]], dtype=np.float32)
    (found,) = map_into_boxes(xyz.T.copy(), OPTICAL, CAMERA, [(0.0, 0.0, 960.0, 600.0)])
    assert found.points.tolist() == [3]


def test_without_boxes_nothing_is_mapped() -> None:
    assert map_into_boxes(np.zeros((3, 0), np.float32), OPTICAL, CAMERA, []) == ()
