"""Where the background is placed: without overlaps, off lanes and drives, by seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import BadInput
from scenarios.scenario import Scatter
from simbench import scatter
from simbench.scatter import Placement

RADIUS = {"post": 0.5, "car": 2.4, "pedestrian": 0.35}
LANES = ((-1.7, 1.7), (-4.2, -1.8))


def group(part: str = "post", count: int = 5, **changes: object) -> Scatter:
    category = part
    fields: dict[str, object] = {
        "part": part,
        "category": category,
        "count": count,
        "area_m": (0.0, -30.0, 60.0, 30.0),
    }
    return Scatter.model_validate({**fields, **changes})


def place(
    groups: tuple[Scatter, ...], seed: int, keep_off: np.ndarray | None = None
) -> tuple[Placement, ...]:
    circles = np.zeros((0, 3)) if keep_off is None else keep_off
    return scatter.place(groups, RADIUS, LANES, circles, 5.0, np.random.default_rng(seed))


CROWD = (
    group("car", 5, align_deg=0.0),
    group("pedestrian", 4, speed_mps=1.2),
    group("post", 6),
)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_nothing_touches_anything_else_nor_a_lane_nor_a_drive_while_it_walks(seed: int) -> None:
    drive = np.column_stack([np.arange(0.0, 60.0, 1.0), np.full(60, 6.0), np.full(60, 1.0)])
    placed = place(CROWD, seed, drive)
    t = np.linspace(0.0, 5.0, 51)
    where = np.array(
        [
            np.array(p.xy_m) + p.speed_mps * t[:, None] * [np.cos(p.heading_rad), np.sin(p.heading_rad)]
            for p in placed
        ]
    )
    radius = np.array([RADIUS[p.part] * p.scale for p in placed])
    assert len(placed) == 15
    for i in range(len(placed)):
        for lane in LANES:
            y = where[i, :, 1]
            assert np.all((y + radius[i] < lane[0]) | (y - radius[i] > lane[1]))
        gap = np.hypot(*(where[i, :, None] - drive[None, :, :2]).transpose(2, 0, 1)) - radius[i] - drive[:, 2]
        assert gap.min() > 0.0
        for j in range(i):
            assert np.all(np.hypot(*(where[i] - where[j]).T) > radius[i] + radius[j])


def test_the_same_generator_places_the_same_and_another_does_not() -> None:
    assert place(CROWD, 7) == place(CROWD, 7)
    assert place(CROWD, 7) != place(CROWD, 8)


def test_things_lie_in_their_area_with_their_heading_scale_and_speed() -> None:
    area = (10.0, 8.0, 50.0, 25.0)
    placed = place((group("car", 8, area_m=area, align_deg=90.0, scale_spread=0.1),), 0)
    for p in placed:
        assert area[0] <= p.xy_m[0] <= area[2]
        assert area[1] <= p.xy_m[1] <= area[3]
        assert p.heading_rad == pytest.approx(np.pi / 2)
        assert 0.9 <= p.scale <= 1.1
        assert p.speed_mps == 0.0
    assert np.std([p.scale for p in placed]) > 0.01


def test_headings_without_a_wish_go_all_ways() -> None:
    heading = [p.heading_rad for s in range(20) for p in place((group("post", 6),), s)]
    assert np.histogram(heading, bins=4, range=(0, 2 * np.pi))[0].min() > 15


def test_an_area_without_room_is_said_in_one_sentence_that_names_it() -> None:
    with pytest.raises(BadInput) as caught:
        place((group("car", 9, area_m=(0.0, 6.0, 10.0, 9.0)),), 0)
    text = str(caught.value)
    assert "no room for car" in text
    assert "of 9 in area_m [0.0, 6.0, 10.0, 9.0]" in text
    assert "make the area larger or the count smaller" in text
    assert "\n" not in text


def test_an_area_on_a_lane_has_no_room() -> None:
    with pytest.raises(BadInput, match="no room"):
        place((group("post", 1, area_m=(0.0, -1.5, 60.0, 1.5)),), 0)


def test_where_nothing_is_asked_nothing_is_placed() -> None:
    assert place((), 0) == ()
    assert place((group("car", 0),), 0) == ()
