"""Small laws of the page's numbers, and places in the ego frame by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fusion.geometry import rotation_rpy
from simbench.formats.store import Stored
from simbench.view import caps
from simbench.view.caps import every_kth, short
from simbench.view.packed import FARTHEST_M, centimetres, packed
from simbench.view.placed import placed
from tests.simbench.view.viewed import numbers

HALF_CM = 0.005 + 1e-9
EAST, NORTH, WEST = 0.0, 0.5 * np.pi, np.pi


@given(st.lists(st.floats(-FARTHEST_M, FARTHEST_M), max_size=20))
@example([FARTHEST_M, -FARTHEST_M, 0.005, -0.0])
def test_a_length_comes_back_within_half_a_centimetre(metres: list[float]) -> None:
    was = np.array(metres, dtype=np.float64)
    again = numbers(packed(centimetres(was)), "<i2") / 100.0
    assert np.abs(again - was).max(initial=0.0) <= HALF_CM


@given(st.integers(0, 10**6), st.integers(1, 10**4))
@example(6000, 6000)
@example(6001, 6000)
def test_every_kth_is_the_least_thinning_that_does(count: int, most: int) -> None:
    k = every_kth(count, most)
    assert len(range(0, count, k)) <= most
    assert k == 1 or len(range(0, count, k - 1)) > most


@given(st.text(max_size=80))
def test_a_name_is_shown_on_one_line_and_short(name: str) -> None:
    shown = short(name)
    assert len(shown) <= caps.LONGEST_NAME and shown.isprintable()
    assert shown == name or len(name) > caps.LONGEST_NAME or not name.isprintable()


class Still:
    """An ego and one object that stand, each at (east, north) in metres with a heading in radians."""

    def __init__(
        self, ego: tuple[float, float, float], thing: tuple[float, float, float], until_ns: int = 10
    ) -> None:
        self._ego, self._thing, self._until_ns = ego, thing, until_ns

    def ego(self, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if t_ns.max() > self._until_ns:
            raise ValueError("not known so late")
        return self._at(self._ego)

    def object_centre(self, object_id: int, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._at(self._thing)

    def sensor(self, sensor: str, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise KeyError(sensor)

    @staticmethod
    def _at(place: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
        east, north, heading = place
        return rotation_rpy(0.0, 0.0, heading)[None], np.array([[east, north, 0.0]])


def with_poses(stored: Stored, poses: Still) -> Stored:
    truth = replace(stored.recording.truth, poses=poses)
    return replace(stored, recording=replace(stored.recording, truth=truth))


@pytest.mark.parametrize(
    ("ego", "thing", "x_m", "y_m", "yaw_deg"),
    [
        pytest.param((10, 5, EAST), (30, 5, EAST), 20, 0, 0, id="ahead, going the same way"),
        pytest.param(
            (10, 5, NORTH), (10, 25, WEST), 20, 0, 90, id="ahead of one that goes north, to its left"
        ),
        pytest.param((10, 5, NORTH), (7, 5, NORTH), 0, 3, 0, id="beside it on its left, going the same way"),
        pytest.param((0, 0, WEST), (5, 1, EAST), -5, -1, 180, id="behind on its right, going the other way"),
    ],
)
def test_places_are_in_the_ego_frame(
    stored: Stored, ego: tuple[float, float, float], thing: tuple[float, float, float], x_m: float,
    y_m: float, yaw_deg: float,
) -> None:  # fmt: skip
    at = placed(with_poses(stored, Still(ego, thing)).recording, [3], 5)
    assert at is not None
    assert at.centre_m == pytest.approx(np.array([[x_m, y_m, 0.0]]), abs=1e-9)
    yaw = np.arctan2(at.rotation[0, 1, 0], at.rotation[0, 0, 0])
    assert np.cos(yaw - np.radians(yaw_deg)) == pytest.approx(1.0)


@pytest.mark.parametrize("t_ns", [11, 2**70], ids=["after the poses end", "beyond 64 bits"])
def test_a_time_without_poses_has_no_places(stored: Stored, t_ns: int) -> None:
    still = with_poses(stored, Still((0, 0, 0), (1, 0, 0))).recording
    assert placed(still, [0], 10) is not None and placed(still, [0], t_ns) is None


def test_the_document_says_how_much_a_page_holds() -> None:
    text = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
    together = (caps.MOST_CAMERAS, caps.MOST_STREAMS, caps.MOST_OBJECTS, caps.MOST_BOXES)
    for row in (
        f"| sweeps | {caps.MOST_SWEEPS}, then",
        f"| points | {caps.MOST_POINTS:,} a sweep and {caps.MOST_POINTS_TOGETHER:,} together",
        f"within {FARTHEST_M:.0f} m",
        f"| images | {caps.MOST_IMAGES}, then those of every k-th sweep; {caps.IMAGE_WIDTH_PX} px wide",
        f"| {', '.join(map(str, together))} |",
    ):
        assert row in text, row
