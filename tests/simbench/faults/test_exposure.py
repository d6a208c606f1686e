"""A longer exposure: what it does to times and pictures, and that its receipts see it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from scenarios.errors import BadInput
from scenarios.faults import MotionBlur
from scenarios.severity import severe
from simbench.capture import Captured, capture
from simbench.case import Job
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt
from simbench.faults.refit import refit
from simbench.faults.streak import weights
from simbench.motion import Motion
from simbench.sensors.clock import CameraTiming
from simbench.sensors.pictures import by_rays
from simbench.stage import CATEGORIES, Stage, pictures, stage
from simbench.timeline import timeline
from tests.simbench.support import bytes_of, faults, posed, receipts_of, staged

FRONT = ("cam-front",)
SPEC = MotionBlur(longer_ms=12.0)


def at(spec: MotionBlur, system: str = "car") -> Stage:
    return staged(system, specs=(spec,), size_px=(160, 100), duration_s=0.4, background=True)


LOOKED_AT = 3  # of seven frames the one in the middle: all that the streaks' receipt looks at


def taken(here: Stage) -> Captured:
    """A short drive with pictures by rays, black where no receipt looks."""
    rays = by_rays(here.rig, 0)

    def picture(motion: Motion, camera: str, seq: int, mid_ns: int) -> np.ndarray:
        if seq == LOOKED_AT:
            return rays(motion, camera, seq, mid_ns)
        sensor = here.rig.cameras[camera]
        return np.zeros((sensor.height_px, sensor.width_px, 3), dtype=np.uint8)

    return capture(here.system, here.rig, here.world, here.faults, CATEGORIES, 0, picture)


@cache
def photographed(spec: MotionBlur, system: str = "car") -> Captured:
    return taken(at(spec, system))


def proof(spec: MotionBlur, system: str = "car", acted: MotionBlur | None = None) -> tuple[Receipt, ...]:
    """Receipts of `spec` where `acted` did."""
    return receipts_of(photographed(acted or spec, system), at(spec, system))


def statuses(found: tuple[Receipt, ...]) -> set[str]:
    return {receipt.status for receipt in found}


def timing(system: str, spec: MotionBlur) -> CameraTiming:
    rig = at(spec, system).rig
    return rig.timing(next(iter(rig.cameras)), 0.4, 0)


# -- what a real camera does ------------------------------------------------------------------------------


def test_a_stamp_of_the_trigger_stays_while_the_middle_moves_by_half() -> None:
    before, after = timing("car", MotionBlur()), timing("car", SPEC)
    np.testing.assert_array_equal(after.start_ns, before.start_ns)
    np.testing.assert_array_equal(after.stamp_ns, before.stamp_ns)
    np.testing.assert_array_equal(after.mid_ns - before.mid_ns, 6_000_000)
    np.testing.assert_array_equal(after.arrival_ns - before.arrival_ns, 12_000_000)


def test_a_stamp_of_the_host_moves_by_all_of_it() -> None:
    before, after = timing("wearable", MotionBlur()), timing("wearable", SPEC)
    np.testing.assert_array_equal(after.start_ns, before.start_ns)
    np.testing.assert_array_equal(after.mid_ns - before.mid_ns, 6_000_000)
    np.testing.assert_allclose(after.stamp_ns - before.stamp_ns, 12_000_000, atol=1)
    np.testing.assert_allclose(after.arrival_ns - before.arrival_ns, 12_000_000, atol=1)


def test_zero_strength_is_the_identity() -> None:
    here = at(MotionBlur())
    rig, _ = refit(here.rig, faults())
    assert here.rig is rig or here.rig == rig
    clean = replace(here, faults=faults(), refits=())
    assert bytes_of(posed(here).recording) == bytes_of(posed(clean).recording)


def test_only_the_named_camera_exposes_longer() -> None:
    spec = MotionBlur(longer_ms=12.0, sensors=FRONT)
    before, after = at(MotionBlur()).rig.cameras, at(spec).rig.cameras
    assert [name for name in before if before[name] != after[name]] == list(FRONT)
    assert (after["cam-front"].exposure_ms, after["cam-front"].motion_blur_samples) == (14.0, 9)


def test_a_streak_is_as_wide_as_the_mean_of_its_instants() -> None:
    """Weights of the nodes are an even mean: their middle is 0 and their spread that of the exposure."""
    node_ms = np.linspace(-20.0, 20.0, 33)
    for exposure_ms in (10.0, 20.0, 40.0):
        share = weights(node_ms, exposure_ms)
        assert share.sum() == pytest.approx(1.0)
        assert share @ node_ms == pytest.approx(0.0, abs=1e-9)
        assert np.sqrt(share @ node_ms**2) == pytest.approx(exposure_ms / np.sqrt(12.0), rel=0.03)
    assert weights(node_ms, 0.0)[16] == pytest.approx(1.0)


# -- bad input --------------------------------------------------------------------------------------------


def test_an_exposure_longer_than_the_period_is_refused_in_one_sentence() -> None:
    with pytest.raises(BadInput, match=r"cam-centre exposes for 4 ms .* 77 ms do not fit.*up to 76 ms"):
        at(MotionBlur(longer_ms=77.0), "wearable")
    assert at(MotionBlur(longer_ms=76.0), "wearable").rig.cameras["cam-centre"].exposure_ms == 80.0


def test_a_camera_that_is_not_there_is_refused_by_its_name() -> None:
    words = ("camera.motion_blur_ms={longer_ms: 5, sensors: [cam-frnt]}",)
    with pytest.raises(BadInput, match="cam-front"):
        stage(Job(scenario="overtake-approach", system="car", seed=0, pipelines=(), faults=words))


def test_pictures_by_opengl_are_refused() -> None:
    here = at(SPEC)
    job = Job(scenario="overtake-approach", system="car", seed=0, pipelines=("nobody",), images="gl")
    with (
        pytest.MonkeyPatch.context() as patch,
        pytest.raises(BadInput, match=r"camera\.motion_blur_ms; take --images raycast"),
    ):
        patch.setattr("simbench.stage.reads_images", lambda _: True)
        with pictures(job, here):
            raise AssertionError("a picture by OpenGL")


def test_the_timeline_shows_the_longer_exposure() -> None:
    short, long = (
        timeline("overtake-approach", "car", 0, words, 0.0).cameras[0]
        for words in ((), ("camera.motion_blur_ms=12",))
    )
    assert long != short


# -- receipts ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_a_clean_draw_is_ok(system: str) -> None:
    found = proof(SPEC, system)
    assert statuses(found) == {OK}, found
    assert any("streaks" in receipt.quantity for receipt in found)


def test_without_pictures_the_instants_are_proved_and_the_streaks_are_not() -> None:
    here = at(SPEC)
    found = receipts_of(posed(here), here)
    by_pictures = [r for r in found if "streaks" in r.quantity]
    assert {r.status for r in by_pictures} == {UNVERIFIABLE}
    assert all("--images raycast" in r.note for r in by_pictures)
    assert {r.status for r in found if r not in by_pictures} == {OK}


@pytest.mark.parametrize("longer_ms", [0.0, 6.0, 24.0, 12e-3], ids=["off", "half", "twice", "us for ms"])
def test_an_injector_that_acts_otherwise_than_asked_is_caught(longer_ms: float) -> None:
    found = proof(SPEC, acted=MotionBlur(longer_ms=longer_ms))
    bad = [r.quantity for r in found if r.status == MISMATCH]
    assert any("streaks" in quantity for quantity in bad)
    assert any("longer exposure" in quantity for quantity in bad)


def test_a_sensor_that_was_never_refitted_is_caught() -> None:
    idle = replace(at(SPEC), rig=at(MotionBlur()).rig, refits=())
    assert MISMATCH in statuses(receipts_of(posed(idle), idle))


def test_a_camera_struck_besides_the_named_one_is_caught() -> None:
    found = proof(MotionBlur(longer_ms=12.0, sensors=FRONT), acted=SPEC)
    assert [r.quantity for r in found if r.status == MISMATCH] == ["longer exposure of the other cameras"]


def test_the_wrong_camera_is_caught() -> None:
    one = MotionBlur(longer_ms=12.0, sensors=FRONT)
    found = proof(one, acted=MotionBlur(longer_ms=12.0, sensors=("cam-back",)))
    assert len([r for r in found if r.status == MISMATCH]) >= 2


def test_times_without_a_streak_are_caught() -> None:
    """The exposure is longer by its instants, but the picture is that of one instant."""
    here = at(SPEC)
    sharp = {n: c.model_copy(update={"motion_blur_samples": 1}) for n, c in here.rig.cameras.items()}
    rig = replace(here.rig, cameras=sharp)
    still = taken(replace(here, rig=rig))
    bad = [r.quantity for r in receipts_of(still, here) if r.status == MISMATCH]
    assert bad and all("streaks" in quantity for quantity in bad)


def test_severity_is_monotone_in_the_measured_exposure() -> None:
    specs = [severe(MotionBlur.name, level) for level in range(1, 6)]
    found = [receipts_of(posed(here), here)[0] for here in (at(spec) for spec in specs)]  # type: ignore[arg-type]
    assert all(receipt.status == OK for receipt in found)
    measured = [receipt.measured or 0.0 for receipt in found]
    assert measured == sorted(set(measured))
