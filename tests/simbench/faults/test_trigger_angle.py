"""Cameras that the beam fires at a wrong angle."""

from __future__ import annotations

import pytest

from scenarios.errors import BadInput
from scenarios.faults import TriggerAngle, TriggerOffset
from simbench.case import Job
from simbench.faults.receipt import OK
from simbench.faults.refit import refit
from simbench.stage import stage
from tests.simbench.support import faults, posed, receipts_of, recorded, staged

TURN_NS = 100_000_000


@pytest.mark.parametrize("angle_deg", [36.0, -36.0])
def test_exposure_and_stamp_come_a_share_of_a_turn_later(angle_deg: float) -> None:
    clean, wrong = posed(staged()), posed(staged(specs=(TriggerAngle(angle_deg=angle_deg),)))
    for camera, shots in clean.measured.shots.items():
        for one, two in zip(shots, wrong.measured.shots[camera], strict=True):
            later_ns = two.truth.capture_ns - one.truth.capture_ns
            assert later_ns == two.stamp_ns - one.stamp_ns  # an honest stamp
            assert abs(later_ns % TURN_NS) in (TURN_NS // 10, 9 * TURN_NS // 10)


def test_the_scan_stays_where_it_was() -> None:
    clean, wrong = (
        recorded(staged(duration_s=0.5)),
        recorded(staged(duration_s=0.5, specs=(TriggerAngle(angle_deg=20.0),))),
    )
    for one, two in zip(clean.measured.sweeps, wrong.measured.sweeps, strict=True):
        assert one.scan.xyz_m.tobytes() == two.scan.xyz_m.tobytes()


@pytest.mark.parametrize("angle_deg", [1.0, -10.0, 90.0])
def test_the_angle_is_read_off_the_sweeps_beside_other_faults(angle_deg: float) -> None:
    at = staged(
        duration_s=0.5, background=True,
        specs=(TriggerAngle(angle_deg=angle_deg, sensors=("cam-front",)), TriggerOffset(offset_ms=20.0)),
    )  # fmt: skip
    found = [r for r in receipts_of(recorded(at), at) if r.fault == "timing.trigger_angle_deg"]
    assert [r.status for r in found] == [OK, OK]
    assert found[0].measured == pytest.approx(angle_deg, abs=0.02)


def test_cameras_that_run_freely_have_no_such_angle() -> None:
    with pytest.raises(BadInput, match="no beam triggers"):
        refit(staged("wearable").rig, faults(TriggerAngle(angle_deg=5.0)))
    with pytest.raises(BadInput, match="which run freely"):
        stage(
            Job(
                scenario="overtake-approach",
                system="wearable",
                seed=0,
                pipelines=(),
                faults=("timing.trigger_angle_deg=5",),
            )
        )
