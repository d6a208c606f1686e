"""The RTK reference: its parts, its errors one by one, and what holds between fixes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion.geometry import Transform
from scenarios.load import load_sensor
from scenarios.scenario import GnssSensor
from simbench.motion import Motion
from simbench.score.pairs import held_fix
from simbench.sensors import gnss, rays
from simbench.truth import GnssReference
from tests.simbench.scenes import Shape, a_shake, straight, toy_world

S = 1_000_000_000
MS = 1_000_000


def receiver(**changes: object) -> GnssSensor:
    sensor = load_sensor("gnss-rtk")
    assert isinstance(sensor, GnssSensor)
    quiet: dict[str, object] = {
        "bias_m": 0.0,
        "noise_m": 0.0,
        "heading_deg": 0.0,
        "target_lever_m": (0.0, 0.0, 0.0),
    }
    return sensor.model_copy(update={**quiet, **changes})


def two_drives(shaken: bool = False, ego_heading_deg: float = 30.0) -> Motion:
    """The ego with its frame off the root, and a target on its own heading."""
    ball = Shape(kind=rays.SPHERE, size_m=(0.5, 0.0, 0.0), mover=1)
    tracks = [straight((5.0, 2.0), ego_heading_deg, 12.0), straight((25.0, 10.0), 75.0, 7.0)]
    world = toy_world([ball], tracks)
    world = replace(world, box_centre_m=np.array([[0.0, 0.0, 0.7], [0.1, 0.0, 0.9]]))
    return Motion(
        world=world,
        ego_actor=0,
        T_ego_root=Transform(rotation=np.eye(3), translation_m=np.array([0.5, 0.0, 0.0])),
        T_ego_sensor={},
        body_shake=a_shake(4, 0.03) if shaken else None,
    )


def reference(
    sensor: GnssSensor,
    motion: Motion,
    antenna: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = 0,
    end_s: float = 6.0,
    phase_ns: int = 0,
) -> GnssReference:
    rng = np.random.default_rng(seed)
    return gnss.reference(sensor, np.array(antenna), motion, 1, round(end_s * S), rng, phase_ns)


def exact(motion: Motion, t_ns: np.ndarray) -> np.ndarray:
    """Target's box centre in the ego frame by plane trigonometry."""
    t = t_ns / S
    h, g = np.deg2rad(30.0), np.deg2rad(75.0)
    root = np.column_stack([5.0 + 12.0 * t * np.cos(h), 2.0 + 12.0 * t * np.sin(h)])
    ego = root - 0.5 * np.array([np.cos(h), np.sin(h)])
    target = np.column_stack([25.0 + 7.0 * t * np.cos(g), 10.0 + 7.0 * t * np.sin(g)])
    target = target + 0.1 * np.array([np.cos(g), np.sin(g)])
    d = target - ego
    return np.column_stack([d @ [np.cos(h), np.sin(h)], d @ [-np.sin(h), np.cos(h)], np.full(len(t), 0.9)])


def test_without_noise_heading_and_lever_a_fix_is_the_exact_relative_position() -> None:
    motion = two_drives()
    found = reference(receiver(), motion)
    np.testing.assert_allclose(found.position_ego_m, exact(motion, found.fix_ns), atol=1e-9)
    np.testing.assert_allclose(found.centre_ego_m, found.position_ego_m, atol=1e-12)
    for part in (found.lever_m, found.heading_m, found.noise_m):
        assert not part.any()


@pytest.mark.parametrize("shaken", [False, True])
def test_the_parts_add_up(shaken: bool) -> None:
    sensor = receiver(bias_m=0.02, noise_m=0.005, heading_deg=1.0, target_lever_m=(-1.0, 0.2, 0.7))
    found = reference(sensor, two_drives(shaken), antenna=(-1.0, 0.3, 1.45))
    total = found.centre_ego_m + found.lever_m + found.heading_m + found.noise_m
    np.testing.assert_allclose(found.position_ego_m, total, rtol=0, atol=1e-12)
    for part in (found.lever_m, found.heading_m, found.noise_m):
        assert np.abs(part).max() > 1e-3


def test_levers_are_the_antennas_offsets_turned_into_the_ego_frame() -> None:
    found = reference(receiver(target_lever_m=(-1.0, 0.0, 0.75)), two_drives(), antenna=(-1.2, 0.3, 1.5))
    turn = np.deg2rad(75.0 - 30.0)
    expected = np.array([-np.cos(turn), -np.sin(turn), 0.75]) - [-1.2, 0.3, 1.5]
    np.testing.assert_allclose(found.lever_m, np.tile(expected, (len(found.fix_ns), 1)), atol=1e-9)


def test_a_heading_error_turns_the_whole_difference_one_degree_at_twenty_metres_is_35_cm() -> None:
    found = reference(receiver(heading_deg=1.0), two_drives(), seed=3)
    r = np.linalg.norm(found.centre_ego_m[:, :2], axis=1)
    angle = np.linalg.norm(found.heading_m[:, :2], axis=1) / r
    np.testing.assert_allclose(angle, angle[0], rtol=1e-9)  # constant over the pass
    np.testing.assert_allclose(np.linalg.norm(found.position_ego_m[:, :2], axis=1), r, rtol=1e-12)
    assert not found.heading_m[:, 2].any()
    draws = []
    for seed in range(150):
        one = reference(receiver(heading_deg=1.0), two_drives(), seed=seed, end_s=0.0)
        c, p = one.centre_ego_m[0], one.position_ego_m[0]
        draws.append(np.rad2deg(np.arctan2(c[0] * p[1] - c[1] * p[0], c[:2] @ p[:2])))
    assert np.std(draws) == pytest.approx(1.0, rel=0.25)
    assert 20.0 * np.deg2rad(1.0) == pytest.approx(0.35, abs=0.01)


def test_heading_measured_too_large_turns_the_target_to_the_right() -> None:
    """Target dead ahead; where the target appears to the right, the lateral error is negative."""
    motion = two_drives(ego_heading_deg=0.0)
    found = reference(receiver(heading_deg=2.0), motion, seed=1, end_s=0.0)
    drawn = np.deg2rad(2.0) * np.random.default_rng(1).standard_normal()
    c, s = np.cos(drawn), np.sin(drawn)
    x, y, _ = found.centre_ego_m[0]
    np.testing.assert_allclose(found.position_ego_m[0, :2], [c * x + s * y, -s * x + c * y], atol=1e-12)


def test_bias_is_constant_over_a_pass_and_noise_is_white() -> None:
    means, whites = [], []
    for seed in range(120):
        found = reference(receiver(bias_m=0.02, noise_m=0.005), two_drives(), seed=seed)
        means.append(found.noise_m.mean(axis=0))
        whites.append(found.noise_m - found.noise_m.mean(axis=0))
    n = whites[0].shape[0]
    # Two receivers: each contributes, so both grow by sqrt 2.
    expected = np.sqrt(2.0) * np.hypot(0.02, 0.005 / np.sqrt(n))
    np.testing.assert_allclose(np.std(means, axis=0), expected, rtol=0.25)
    white = np.concatenate(whites) * np.sqrt(n / (n - 1))
    np.testing.assert_allclose(white.std(axis=0), np.sqrt(2.0) * 0.005, rtol=0.06)
    lag = np.concatenate([w[1:, 0] * w[:-1, 0] for w in whites]).mean() / white[:, 0].var()
    assert abs(lag) < 0.15


def test_shake_moves_the_antenna_but_not_the_exact_centre() -> None:
    still, shaken = (reference(receiver(), two_drives(s), antenna=(0.0, 0.0, 1.8)) for s in (False, True))
    np.testing.assert_allclose(still.centre_ego_m, shaken.centre_ego_m, atol=1e-12)
    assert np.ptp(still.lever_m, axis=0).max() < 1e-9
    assert np.ptp(shaken.lever_m, axis=0).max() > 0.02


def test_fixes_come_at_the_rate_and_are_known_after_the_latency() -> None:
    found = reference(receiver(latency_ms=20.0), two_drives(), end_s=1.0)
    assert np.array_equal(found.fix_ns, np.arange(0, S + 1, 200 * MS))
    assert np.array_equal(found.available_ns - found.fix_ns, np.full(6, 20 * MS))


def test_the_first_fix_comes_at_the_phase() -> None:
    found = reference(receiver(), two_drives(), end_s=1.0, phase_ns=130 * MS)
    assert np.array_equal(found.fix_ns, np.arange(130, 1001, 200) * MS)
    np.testing.assert_allclose(found.centre_ego_m, exact(two_drives(), found.fix_ns), atol=1e-9)


def test_a_fix_holds_from_when_it_is_known_not_from_when_it_was_taken() -> None:
    found = reference(receiver(latency_ms=20.0), two_drives(), end_s=1.0)
    asked = np.array([0, 19 * MS, 20 * MS, 219 * MS, 220 * MS, 5 * S])
    assert held_fix(found, asked).tolist() == [-1, -1, 0, 0, 1, 5]
