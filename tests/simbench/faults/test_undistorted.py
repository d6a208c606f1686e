"""A lens that bends and is taken for straight; and the zone in which a calibration makes up for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion.messages import Calibration
from scenarios.fault_set import load_fault_set
from scenarios.faults import ClickNoise, FaultSpec, Undistorted
from simbench.faults.draw import place_of
from simbench.faults.receipt import MISMATCH, OK, Receipt
from simbench.faults.refit import refit
from simbench.faults.tell import tell, told_receipts
from simbench.faults.telling import Witness
from simbench.sensors.rig import SensorRig
from tests.simbench.support import bytes_of, faults, posed, receipts_of, staged

FRONT = ("cam-front",)
STRAIGHT = (0.0,) * 5
SPEC = Undistorted(corner_px=20.0)


def rig(*specs: FaultSpec) -> SensorRig:
    return refit(staged(size_px=(960, 600)).rig, faults(*specs))[0]


def proof(spec: Undistorted, bent: FaultSpec | None, straightened: FaultSpec | None) -> tuple[Receipt, ...]:
    """Receipts of `spec` where the lens was bent by one spec and straightened by another."""
    place = place_of(rig(*filter(None, (bent,))), 0)
    told, tellings = tell(faults(*filter(None, (straightened,))), place)
    return told_receipts(faults(spec), tellings, told, Witness(place=place, evidence=(), body=None))


def lies_px(calibration: Calibration, camera: str, xyz_camera_m: np.ndarray) -> np.ndarray:
    return calibration.cameras[camera].project(xyz_camera_m)


@pytest.mark.parametrize("corner_px", [-20.0, 2.0, 40.0])
def test_a_corner_lies_so_many_pixels_farther_in_than_is_told(corner_px: float) -> None:
    bent = rig(Undistorted(corner_px=corner_px))
    lens = bent.pinholes["cam-front"]
    corner_m = np.array([[-lens.cx_px / lens.fx_px, -lens.cy_px / lens.fy_px, 1.0]])
    seen = lens.project(corner_m)[0]
    assert np.hypot(*seen) == pytest.approx(abs(corner_px), rel=0.02)  # the straight lens puts it at (0, 0)
    assert (seen > 0.0).all() == (corner_px > 0.0)


def test_the_told_lens_is_straight_and_has_the_true_focal_length_and_pose() -> None:
    place = place_of(rig(SPEC), 0)
    told, _ = tell(faults(SPEC), place)
    for name, lens in place.true.cameras.items():
        assert lens.distortion[0] < 0.0
        assert told.cameras[name] == replace(lens, distortion=STRAIGHT)
        assert told.T_ego_sensor[name] == place.true.T_ego_sensor[name]


def test_named_cameras_bend_alone() -> None:
    bent = rig(Undistorted(corner_px=20.0, sensors=FRONT))
    assert [name for name, lens in bent.pinholes.items() if any(lens.distortion)] == list(FRONT)


def test_a_recording_is_proved_and_its_boxes_are_bent() -> None:
    at, clean = (staged(specs=specs, duration_s=0.5, size_px=(480, 300)) for specs in ((SPEC,), ()))
    bent = posed(at)
    found = receipts_of(bent, at)
    assert {r.status for r in found} == {OK} and len(found) == len(at.rig.cameras)
    assert bytes_of(bent.recording)["calibration"] == bytes_of(posed(clean).recording)["calibration"]


@pytest.mark.parametrize(
    ("bent", "straightened"),
    [
        (None, SPEC),
        (SPEC, None),
        (Undistorted(corner_px=10.0), SPEC),
        (Undistorted(corner_px=40.0), SPEC),
        (Undistorted(corner_px=-20.0), SPEC),
        (Undistorted(corner_px=20.0, sensors=FRONT), SPEC),
        (SPEC, Undistorted(corner_px=20.0, sensors=FRONT)),
    ],
)
def test_a_lens_that_is_not_bent_or_not_straightened_as_asked_is_a_mismatch(
    bent: Undistorted | None, straightened: Undistorted | None
) -> None:
    assert {r.status for r in proof(SPEC, SPEC, SPEC)} == {OK}
    assert MISMATCH in {r.status for r in proof(SPEC, bent, straightened)}


def test_a_calibration_in_a_zone_is_right_there_and_wrong_outside() -> None:
    """Exact clicks, 2.5 to 3.5 m away: the pose makes up for the lens in the middle of the picture."""
    specs = (SPEC, ClickNoise(noise_px=1e-6, near_m=2.5, far_m=3.5))
    place = place_of(rig(SPEC), 0)
    found, _ = tell(faults(*specs), place)
    lens = place.true.cameras["cam-front"]
    u, v = np.meshgrid(
        np.linspace(0.02, 0.98, 15) * lens.width_px, np.linspace(0.02, 0.98, 11) * lens.height_px
    )
    slope = np.stack([(u.ravel() - lens.cx_px) / lens.fx_px, (v.ravel() - lens.cy_px) / lens.fy_px], axis=1)
    inner = np.hypot(u.ravel() / lens.width_px - 0.5, v.ravel() / lens.height_px - 0.5) < 0.25
    error_px = {}
    for far_m in (3.0, 25.0):
        xyz = np.column_stack([slope, np.ones(len(slope))]) * far_m
        in_told = (found.T_ego_sensor["cam-front"].inverse() @ place.true.T_ego_sensor["cam-front"]).apply(
            xyz
        )
        error_px[far_m] = np.linalg.norm(
            lies_px(found, "cam-front", in_told) - lies_px(place.true, "cam-front", xyz), axis=1
        )
    inside, outside = error_px[3.0][inner].mean(), error_px[25.0][~inner].mean()
    assert inside < 0.4 * outside, (inside, outside)


def test_zone_is_a_set_of_both() -> None:
    names = {spec.name for spec in load_fault_set("zone").specs}
    assert names == {"calibration.undistorted_px", "calibration.click_noise_px"}
