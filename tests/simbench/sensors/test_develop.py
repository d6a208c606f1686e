"""Exposure, noise, luminance and JPEG of flat grey light."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.scenario import CameraSensor, ImageNoise
from simbench.sensors import light
from simbench.sensors.develop import develop, grey, jpeg
from tests.simbench.scenes import a_camera


def flat(value: float | tuple[float, float, float], side: int = 200) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=np.float32), (side, side, 3)).copy()


def noisy(full_well_e: float, read_noise_e: float, gain: float = 1.0, **changes: object) -> CameraSensor:
    noise = ImageNoise(full_well_e=full_well_e, read_noise_e=read_noise_e, gain=gain)
    return a_camera(noise=noise, **changes)


def electrons(picture: np.ndarray, white_e: float) -> np.ndarray:
    return np.asarray(light.to_linear(picture / 255.0) * white_e)


@settings(max_examples=25)
@given(
    value=st.floats(0.1, 0.5),
    white_e=st.floats(150.0, 600.0),
    read_noise_e=st.floats(0.0, 10.0),
    gain=st.floats(0.5, 4.0),
)
def test_the_variance_of_noise_is_that_of_shots_plus_that_of_reading(
    value: float, white_e: float, read_noise_e: float, gain: float
) -> None:
    """In electrons: e + r^2 (and the 1/18 of the docstring), plus the rounding to display values."""
    sensor = noisy(white_e * gain, read_noise_e, gain)
    found = electrons(develop(flat(value), sensor, np.random.default_rng(0)), white_e)
    e = value * white_e
    code = 255.0 * light.to_srgb(np.array([value]))
    step = float(np.diff(light.to_linear(np.concatenate([code, code + 1.0]) / 255.0))[0]) * white_e
    assert found.mean() == pytest.approx(e, rel=0.01)
    assert found.var() == pytest.approx(e + read_noise_e**2 + step**2 / 12.0, rel=0.04)


def test_few_electrons_are_skewed_as_poisson_numbers_are() -> None:
    white_e = 100.0
    found = electrons(develop(flat(0.3, 600), noisy(white_e, 0.0), np.random.default_rng(1)), white_e)
    z = (found - found.mean()) / found.std()
    assert (z**3).mean() == pytest.approx(1.0 / np.sqrt(30.0), abs=0.02)


def test_without_a_generator_or_without_noise_nothing_is_random() -> None:
    plain = develop(flat(0.25), a_camera(), None)
    assert np.array_equal(plain, develop(flat(0.25), noisy(100.0, 5.0), None))
    assert np.array_equal(plain, develop(flat(0.25), a_camera(), np.random.default_rng(0)))
    assert np.unique(plain).tolist() == [round(255.0 * float(light.to_srgb(np.array([0.25]))[0]))]


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    first, again, other = (
        develop(flat(0.3), noisy(5000.0, 3.0), np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_noise_of_a_pixel_does_not_depend_on_what_others_show() -> None:
    light_a, light_b = flat(0.3), flat(0.3)
    light_b[:100] = 0.9
    a = develop(light_a, noisy(500.0, 3.0), np.random.default_rng(3))
    b = develop(light_b, noisy(500.0, 3.0), np.random.default_rng(3))
    assert np.array_equal(a[100:], b[100:])


def test_channels_have_noise_of_their_own() -> None:
    picture = develop(flat(0.3), noisy(300.0, 2.0), np.random.default_rng(4)).astype(float)
    assert abs(np.corrcoef(picture[..., 0].ravel(), picture[..., 1].ravel())[0, 1]) < 0.03


def test_light_beyond_white_stays_white() -> None:
    assert develop(flat(7.0), noisy(1000.0, 0.0), None).min() == 255
    assert develop(flat(1.0), a_camera(), None).min() == 255


def test_twice_the_exposure_shows_twice_the_light() -> None:
    assert np.array_equal(
        develop(flat(0.2), a_camera(exposure=2.0), None), develop(flat(0.4), a_camera(), None)
    )


@pytest.mark.parametrize(
    ("rgb", "luminance"), [((1.0, 0.0, 0.0), 0.2126), ((0.0, 1.0, 0.0), 0.7152), ((0.0, 0.0, 1.0), 0.0722)]
)
def test_a_monochrome_camera_shows_the_luminance_on_all_channels(
    rgb: tuple[float, float, float], luminance: float
) -> None:
    picture = develop(flat(rgb), a_camera(monochrome=True), None)
    shown = round(255.0 * float(light.to_srgb(np.array([luminance]))[0]))
    assert picture.shape == (200, 200, 3)
    assert np.unique(picture).tolist() == [shown]
    # What OpenGL drew in colour, turned grey.
    coded = np.rint(255.0 * light.to_srgb(np.broadcast_to(np.array(rgb), (4, 5, 3)))).astype(np.uint8)
    assert np.unique(grey(coded)).tolist() == [shown]


def test_monochrome_noise_is_one_number_per_pixel() -> None:
    picture = develop(flat(0.3), noisy(500.0, 3.0, monochrome=True), np.random.default_rng(0))
    assert (picture == picture[..., :1]).all()
    assert picture.std() > 3.0


def test_jpeg_changes_little_at_95_more_at_20_and_null_means_none() -> None:
    rng = np.random.default_rng(5)
    coarse = rng.uniform(0.1, 0.8, (10, 10, 3)).astype(np.float32)
    scene = np.kron(coarse, np.ones((16, 16, 1), dtype=np.float32))
    plain = develop(scene, a_camera(), None).astype(float)
    error = [np.abs(develop(scene, a_camera(jpeg_quality=q), None) - plain).mean() for q in (95, 20)]
    assert 0.0 < error[0] < 4.0 < error[1] + 2.0
    assert error[0] < error[1]
    one = jpeg(plain[..., :1].astype(np.uint8), 90)
    assert one.shape == (160, 160, 1)


def test_jpeg_keeps_red_red() -> None:
    picture = develop(flat((0.8, 0.05, 0.05)), a_camera(jpeg_quality=90), None)
    assert picture[..., 0].min() > 180 and picture[..., 2].max() < 100
