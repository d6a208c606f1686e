"""Actors that stand inside each other, against OpenCV's intersection of rotated rectangles."""

from __future__ import annotations

import math

import cv2
from hypothesis import assume, given
from hypothesis import strategies as st

from scenarios.checks import Box, overlap, start_box
from scenarios.scenario import Actor, Path

BOXES = st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(-7, 7), st.floats(0.2, 8), st.floats(0.2, 4))


def shared_area(a: Box, b: Box) -> float:
    rectangles = [((x, y), (length, width), math.degrees(h)) for x, y, h, length, width in (a, b)]
    kind, points = cv2.rotatedRectangleIntersection(*rectangles)
    if kind == cv2.INTERSECT_NONE or points is None or len(points) < 3:
        return 0.0
    return float(cv2.contourArea(cv2.convexHull(points)))


@given(a=BOXES, b=BOXES)
def test_boxes_overlap_exactly_when_they_share_area(a: Box, b: Box) -> None:
    area = shared_area(a, b)
    grown = shared_area((*a[:3], a[3] + 0.02, a[4] + 0.02), b)
    assume((area > 1e-9) == (grown > 1e-3))  # not within a centimetre of touching
    assert overlap(a, b) == (area > 1e-9)


@given(a=BOXES, b=BOXES)
def test_overlap_is_mutual_and_everything_overlaps_itself(a: Box, b: Box) -> None:
    assert overlap(a, b) == overlap(b, a)
    assert overlap(a, a)


@given(a=BOXES, b=BOXES, dx=st.floats(-50, 50), dy=st.floats(-50, 50))
def test_overlap_does_not_depend_on_where_the_pair_stands(a: Box, b: Box, dx: float, dy: float) -> None:
    near = shared_area(a, b)
    assume(near == 0.0 or near > 1e-3)
    grown = shared_area((*a[:3], a[3] + 0.02, a[4] + 0.02), b)
    assume((near > 0) == (grown > 0))
    moved = [(box[0] + dx, box[1] + dy, *box[2:]) for box in (a, b)]
    assert overlap(*moved) == overlap(a, b)  # type: ignore[arg-type]


def test_side_by_side_cars_touch_at_their_width() -> None:
    assert overlap((0, 0, 0, 4.5, 1.8), (0, 1.79, 0, 4.5, 1.8))
    assert not overlap((0, 0, 0, 4.5, 1.8), (0, 1.81, 0, 4.5, 1.8))
    assert not overlap((0, 0, 0, 4.5, 1.8), (0, 1.81, math.pi, 4.5, 1.8))
    assert overlap((0, 0, 0, 4.5, 1.8), (0, 3.1, math.pi / 2, 4.5, 1.8))


def test_an_actor_starts_at_its_first_waypoint_along_its_path() -> None:
    drives = Actor(part="car", category="car", path=Path(waypoints_m=((1.0, 2.0), (1.0, 9.0))), scale=1.1)
    x, y, heading, length, width = start_box(drives)
    assert (x, y) == (1.0, 2.0) and math.isclose(heading, math.pi / 2)
    assert math.isclose(length, 4.95) and math.isclose(width, 1.98)
    stands = Actor(part="car", category="rider", path=Path(waypoints_m=((0.0, 0.0),), heading_deg=90.0))
    assert start_box(stands)[2:] == (math.pi / 2, 1.5, 0.7)
