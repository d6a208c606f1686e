"""Statistics are those of what was put in, tables come back, and a comparison knows like from unlike."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import BadInput
from simbench.cards.compare import compare
from simbench.cards.page import Beside, Made, write_card
from simbench.cards.statistics import Sight, range_noise_m, sights
from simbench.cards.table import read_sights, write_sights
from simbench.case import Job
from simbench.run import recording_of

JOB = Job(
    scenario="overtake-approach", system="car", seed=0, pipelines=(), changes=("systems.car.duration_s=1.2",)
)


@lru_cache(maxsize=1)
def rows() -> tuple[Sight, ...]:
    return sights(recording_of(JOB)[2].recording)


def wall(noise_m: float, slope: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Three rings of 400 points on a plane 10 m ahead that leans by a slope, with noise along the ray."""
    rng = np.random.Generator(np.random.PCG64(seed))
    azimuth = np.tile(np.linspace(-0.2, 0.2, 400), 3)
    ring = np.repeat(np.arange(3), 400)
    elevation = np.radians(ring - 1.0)
    ray = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    distance = 10.0 / (ray[:, 0] + slope * ray[:, 1]) + noise_m * rng.standard_normal(1200)
    return ray * distance[:, None], ring


@pytest.mark.parametrize("slope", [0.0, 0.5, -1.0])
@pytest.mark.parametrize("noise_m", [0.005, 0.03, 0.1])
def test_noise_put_on_a_leaning_wall_is_found(noise_m: float, slope: float) -> None:
    xyz, ring = wall(noise_m, slope)
    assert range_noise_m(xyz, ring) == pytest.approx(noise_m, rel=0.15)


@given(st.permutations(range(30)))
@settings(max_examples=20)
def test_noise_does_not_depend_on_the_order_of_points(order: list[int]) -> None:
    xyz, ring = wall(0.02, 0.3)
    parts = np.concatenate([np.arange(40 * i, 40 * i + 40) for i in order])
    assert range_noise_m(xyz[parts], ring[parts]) == pytest.approx(range_noise_m(xyz, ring), rel=1e-12)


def test_without_rings_or_with_few_points_there_is_no_noise_to_tell() -> None:
    xyz, ring = wall(0.02, 0.0)
    assert np.isnan(range_noise_m(xyz, np.full(len(ring), -1)))
    assert np.isnan(range_noise_m(xyz[:5], ring[:5]))
    assert np.isnan(range_noise_m(xyz[:0], ring[:0]))


def test_the_rider_is_where_and_as_fast_as_the_scenario_says() -> None:
    rider = [row for row in rows() if row.category == "rider"]
    assert len(rider) == 3  # at 0, 0.5 and 1 s
    assert all(7.15 <= row.speed_mps <= 7.45 for row in rider)
    assert 28.0 < rider[0].range_m < 29.5
    assert 4.4 < rider[0].range_m - rider[-1].range_m < 5.6
    assert all(row.points > 0 and row.height_px > 10 and abs(row.shift_px) < 10 for row in rider)


def test_standing_things_stand_and_what_carries_the_sensors_is_not_seen() -> None:
    assert all(row.speed_mps < 1e-6 for row in rows() if row.category in ("tree", "post", "building"))
    assert all(row.range_m >= 1.0 for row in rows())


def test_a_table_comes_back(tmp_path: Path) -> None:
    write_sights(rows(), tmp_path)
    found = read_sights(tmp_path)
    assert [(r.sweep, r.object, r.category, r.points) for r in found] == [
        (r.sweep, r.object, r.category, r.points) for r in rows()
    ]
    for name in ("range_m", "visible", "noise_m", "intensity", "shift_px"):
        np.testing.assert_allclose(
            [getattr(r, name) for r in found], [getattr(r, name) for r in rows()], rtol=1e-5
        )


@pytest.mark.parametrize(
    ("content", "says"),
    [("a,b\n1,2\n", "has other columns"), (None, "cannot be read"), ("", "has other columns")],
)
def test_what_is_no_table_is_told(tmp_path: Path, content: str | None, says: str) -> None:
    if content is not None:
        (tmp_path / "objects.csv").write_text(content, encoding="utf-8")
    with pytest.raises(BadInput, match=says):
        read_sights(tmp_path)


def test_a_row_that_is_none_is_told_with_its_line(tmp_path: Path) -> None:
    write_sights(rows()[:2], tmp_path)
    text = (tmp_path / "objects.csv").read_text(encoding="utf-8")
    (tmp_path / "objects.csv").write_text(text + "1,a,b,far,3,,,,,,\n", encoding="utf-8")
    with pytest.raises(BadInput, match="line 4: is no row of statistics"):
        read_sights(tmp_path)


def cloud(rng: np.random.Generator, count: int, points: float) -> list[Sight]:
    """Riders anywhere up to 60 m, points as the square of the range asks, give or take a fifth."""
    ranges = rng.uniform(5.0, 60.0, count)
    hit = points * (20.0 / ranges) ** 2 * np.exp(0.2 * rng.standard_normal(count))
    plain = Sight(
        sweep=0, object="a", category="rider", range_m=1.0, points=1, visible=1.0, height_px=50.0,
        shift_px=0.0, speed_mps=5.0, intensity=0.2, noise_m=0.02,
    )  # fmt: skip
    return [replace(plain, range_m=float(r), points=round(n) + 1) for r, n in zip(ranges, hit, strict=True)]


def test_data_alike_lie_inside_and_data_of_seven_times_the_points_do_not() -> None:
    rng = np.random.Generator(np.random.PCG64(5))
    ours = cloud(rng, 3000, 60.0)
    alike = next(c for c in compare(ours, cloud(rng, 200, 60.0)) if c.quantity == "points")
    other = next(c for c in compare(ours, cloud(rng, 200, 420.0)) if c.quantity == "points")
    assert alike.known + alike.unmatched == 200
    assert alike.inside / alike.known > 0.8 and alike.ratio == pytest.approx(1.0, rel=0.15)
    assert other.inside / other.known < 0.2 and other.ratio == pytest.approx(7.0, rel=0.2)


def test_categories_that_are_not_simulated_are_not_compared() -> None:
    rng = np.random.Generator(np.random.PCG64(5))
    trams = [replace(row, category="tram") for row in cloud(rng, 20, 60.0)]
    assert {(c.known, c.unmatched) for c in compare(cloud(rng, 50, 60.0), trams)} == {(0, 20)}


def test_a_card_is_the_same_bytes_each_time_and_escapes_names(tmp_path: Path) -> None:
    made = [
        Made(
            name="<b>", status=status, why="<i>", scenario="<s>", system="car", seed=0, split="train",
            size_bytes=10**6,
        )
        for status in ("ok", "bench_error")
    ]  # fmt: skip
    beside = Beside(path="kitti:<q>", words="1 frame", sights=tuple(cloud(np.random.default_rng(1), 5, 60.0)))

    def card() -> str:
        page = write_card(made, rows(), tmp_path, title="<t>", command="<c>", beside=beside)
        return page.read_text(encoding="utf-8")

    text = card()
    assert card() == text
    for tag in ("<b>", "<i>", "<s>", "<q>", "<t>", "<c>"):
        assert tag not in text and f"&lt;{tag[1]}&gt;" in text, tag
    assert "Not covered" in text and "http://" not in text.replace("http://www.w3.org", "")
