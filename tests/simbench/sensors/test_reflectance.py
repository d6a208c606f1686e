"""What surfaces send back to a LiDAR."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.sensors.reflectance import roughness_gain, sent_back

ANGLE = np.deg2rad(np.array([0.0, 30.0, 60.0, 80.0, 89.0]))


def test_a_smooth_surface_follows_lamberts_law() -> None:
    assert roughness_gain(np.zeros(1))[0] == 0.0
    np.testing.assert_allclose(sent_back(np.array(0.5), np.zeros(1), np.cos(ANGLE)), 0.5 * np.cos(ANGLE))


@pytest.mark.parametrize(
    ("slope_deg", "a", "b"),
    [(10.0, 0.95775, 0.11379), (20.0, 0.86514, 0.25881), (30.0, 0.77310, 0.33878), (40.0, 0.70189, 0.37987)],
)
def test_the_gain_of_a_roughness_is_oren_and_nayars_b_over_a(slope_deg: float, a: float, b: float) -> None:
    assert roughness_gain(np.array([np.deg2rad(slope_deg)]))[0] == pytest.approx(b / a, abs=2e-5)


@given(slope_deg=st.floats(0.0, 45.0), angle_deg=st.floats(0.0, 90.0))
def test_upright_every_surface_sends_back_its_reflectivity_and_never_more_than_a_tenth_above(
    slope_deg: float, angle_deg: float
) -> None:
    gain = roughness_gain(np.array([np.deg2rad(slope_deg)]))
    assert sent_back(np.array(0.3), gain, np.ones(1))[0] == pytest.approx(0.3, rel=1e-12)
    assert 0.0 <= sent_back(np.array(0.3), gain, np.cos(np.deg2rad([angle_deg])))[0] <= 0.3 * 1.15


def test_the_rougher_the_brighter_at_grazing_incidence() -> None:
    gain = roughness_gain(np.deg2rad(np.linspace(0.0, 45.0, 10)))
    assert (np.diff(gain) > 0.0).all()
    assert (np.diff(sent_back(np.array(0.2), gain, np.cos(np.deg2rad(85.0)) * np.ones(10))) > 0.0).all()
