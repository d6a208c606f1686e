"""What every injector promises: zero is the identity, draws repeat and stay apart, more is more."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fusion.messages import Detections, EgoMotion, LidarScan
from scenarios.fault_set import parse_fault_arguments
from scenarios.faults import CalibrationRotation, EdgeError, FaultSpec, Flex, TriggerOffset, Vibration
from scenarios.severity import severe
from tests.simbench.support import (
    ALL_FAULTS,
    boxed,
    bytes_of,
    digest,
    drawn_for,
    posed,
    receipts_of,
    recorded,
    staged,
)

ZERO: tuple[FaultSpec, ...] = (
    TriggerOffset(offset_ms=0.0),
    Vibration(rms_deg=0.0),
    Flex(rms_deg=0.0),
    CalibrationRotation(angle_deg=0.0, axis="random"),
    EdgeError(sd_fraction=0.0),
)
NAMES = [spec.name for spec in ALL_FAULTS]


@pytest.fixture(scope="module")
def clean() -> dict[str, str]:
    return bytes_of(recorded(staged()).recording)


@pytest.fixture(scope="module")
def struck() -> dict[str, dict[str, str]]:
    """Bytes of a recording with each fault alone."""
    return {spec.name: bytes_of(recorded(staged(specs=(spec,))).recording) for spec in ALL_FAULTS}


@pytest.mark.parametrize("spec", ZERO, ids=NAMES)
def test_an_injector_of_zero_strength_changes_no_byte(spec: FaultSpec, clean: dict[str, str]) -> None:
    """Past the fault set, which would leave it out: the injector itself runs."""
    assert bytes_of(recorded(staged(specs=(spec,))).recording) == clean


@pytest.mark.parametrize("spec", ZERO, ids=NAMES)
def test_a_fault_of_zero_strength_is_left_out_of_the_set(spec: FaultSpec) -> None:
    text = f"{spec.name}={{{', '.join(f'{field}: 0' for field in spec.zero_when_off)}}}"
    change = parse_fault_arguments([text])
    assert len(staged().faults.override(change)) == 0


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(clean: dict[str, str]) -> None:
    assert bytes_of(recorded(staged()).recording) == clean
    assert bytes_of(recorded(staged(seed=1), seed=1).recording)["messages"] != clean["messages"]


@pytest.mark.parametrize("spec", ALL_FAULTS, ids=NAMES)
def test_a_draw_repeats_and_differs_from_seed_to_seed(spec: FaultSpec) -> None:
    random = spec if not isinstance(spec, TriggerOffset) else TriggerOffset(offset_ms=50.0, jitter_ms=5.0)
    at = staged(specs=(random,))
    assert digest(drawn_for(at, 0)) == digest(drawn_for(at, 0)) != digest(drawn_for(at, 1))


@pytest.mark.parametrize("spec", ALL_FAULTS, ids=NAMES)
def test_a_fault_draws_the_same_whatever_else_is_on(spec: FaultSpec) -> None:
    alone, together = drawn_for(staged(specs=(spec,))), drawn_for(staged(specs=ALL_FAULTS))
    part = {
        TriggerOffset: "delays_ns", Vibration: "body_shake", Flex: "flex",
        CalibrationRotation: "told", EdgeError: "edge_errors",
    }[type(spec)]  # fmt: skip
    assert digest(getattr(alone, part)) == digest(getattr(together, part))


@pytest.mark.parametrize(
    ("name", "moved"),
    [
        ("timing.trigger_offset_ms", {"messages", "boxes", "true images"}),
        ("calibration.rotation_deg", {"calibration"}),
        ("detector.edge_error", {"messages", "boxes"}),
        ("motion.flex_deg", {"messages", "boxes", "true images", "poses"}),
    ],
)
def test_a_fault_moves_only_what_it_acts_on(
    name: str, moved: set[str], clean: dict[str, str], struck: dict[str, dict[str, str]]
) -> None:
    assert {part for part in clean if struck[name][part] != clean[part]} <= moved
    assert struck[name] != clean


def test_a_shaking_body_leaves_script_and_noise_alone() -> None:
    still = recorded(staged()).recording
    shaking = recorded(staged(specs=(Vibration(rms_deg=1.0),))).recording
    for part in ("truth", "calibration", "categories"):
        assert bytes_of(shaking)[part] == bytes_of(still)[part]
    for part in ("scans", "boxes", "ego motion", "poses"):
        assert bytes_of(shaking)[part] != bytes_of(still)[part]
    one, two = still.truth.reference, shaking.truth.reference
    assert one is not None and two is not None
    assert digest(one.noise_m, one.centre_ego_m, one.fix_ns) == digest(
        two.noise_m, two.centre_ego_m, two.fix_ns
    )
    speeds = [
        digest([m.velocity_mps for m in recording.messages if isinstance(m, EgoMotion)])
        for recording in (still, shaking)
    ]
    assert speeds[0] == speeds[1]


def test_a_fault_moves_no_sensors_draws() -> None:
    """Noise of the ranges, of the gyro, bursts of misses and confidences stay: only the world differs."""
    at = staged(duration_s=1.0, columns=64, background=True)
    hit = staged(duration_s=1.0, columns=64, background=True, specs=(TriggerOffset(offset_ms=0.001),))
    first, second = recorded(at).recording, recorded(hit).recording
    assert digest([m for m in first.messages if isinstance(m, LidarScan)]) == digest(
        [m for m in second.messages if isinstance(m, LidarScan)]
    )
    for one, two in zip(
        (m for m in first.messages if isinstance(m, Detections)),
        (m for m in second.messages if isinstance(m, Detections)),
        strict=True,
    ):
        assert [(b.track_id, b.confidence) for b in one.boxes] == [
            (b.track_id, b.confidence) for b in two.boxes
        ]
        assert two.arrival_ns - one.arrival_ns == 1000


def test_a_late_camera_stamps_the_nominal_time_and_arrives_late() -> None:
    clean, late = recorded(staged()).recording, recorded(staged(specs=ALL_FAULTS[:1])).recording
    for one, two in zip(clean.truth.images, late.truth.images, strict=True):
        assert two.capture_ns - one.capture_ns == 50_000_000
    stamps = [{(m.sensor, m.seq): m for m in r.messages if isinstance(m, Detections)} for r in (clean, late)]
    for key, message in stamps[0].items():
        assert stamps[1][key].stamp_ns == message.stamp_ns
        assert stamps[1][key].arrival_ns - message.arrival_ns == 50_000_000


def test_a_miscalibration_turns_only_the_cameras_that_it_names() -> None:
    at = staged(specs=(CalibrationRotation(angle_deg=1.0, axis="yaw", sensors=("cam-front",)),))
    told, true = drawn_for(at).told, at.rig.calibration
    for name, rest in true.T_ego_sensor.items():
        same = digest(told.T_ego_sensor[name]) == digest(rest)
        assert same == (name != "cam-front")
    # Yaw turns the viewing direction to the left, about the camera's own centre.
    axis = told.T_ego_sensor["cam-front"].rotation[:, 2]
    np.testing.assert_allclose(axis, [np.cos(np.deg2rad(1)), np.sin(np.deg2rad(1)), 0.0], atol=1e-12)
    np.testing.assert_array_equal(
        told.T_ego_sensor["cam-front"].translation_m, true.T_ego_sensor["cam-front"].translation_m
    )


def test_edge_errors_are_an_ar1_process_of_the_asked_spread_and_time_constant() -> None:
    at = staged(specs=(EdgeError(sd_fraction=0.05, tau_s=0.3, bias_fraction=0.02),), duration_s=400.0)
    errors = np.concatenate(
        [e for by_object in drawn_for(at).edge_errors.values() for e in by_object.values()], axis=1
    )
    outward = np.tile([-1.0, -1.0, 1.0, 1.0], errors.shape[1] // 4)
    assert np.mean(errors * outward) == pytest.approx(0.02, abs=2e-3)
    free = errors - 0.02 * outward
    assert free.std() == pytest.approx(0.05, rel=0.02)
    assert np.mean(free[1:] * free[:-1]) / np.mean(free**2) == pytest.approx(np.exp(-0.1 / 0.3), abs=0.02)


LADDERS: dict[str, list[FaultSpec]] = {
    **{
        name: [severe(name, level) for level in range(1, 6)]
        for name in NAMES
        if name != "detector.edge_error"
    },
    "detector.edge_error": [EdgeError(sd_fraction=sd) for sd in (0.01, 0.02, 0.03, 0.05, 0.08)],
}


@pytest.mark.parametrize("name", NAMES)
def test_more_of_a_fault_is_more_of_its_measured_effect(name: str) -> None:
    edges = name == "detector.edge_error"
    measured = []
    for spec in LADDERS[name]:
        at = staged(
            specs=(spec,), duration_s=1.0, size_px=(320, 200) if edges else (96, 64), background=edges
        )
        found = receipts_of(boxed(at) if edges else posed(at), at)
        assert found and all(r.status != "mismatch" for r in found)
        measured.append([r.measured for r in found if "link" not in r.quantity])
    for weaker, stronger in pairwise(np.array(measured, dtype=float)):
        assert (stronger > weaker).all()
