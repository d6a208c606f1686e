"""What every fault of pictures promises: laws, receipts, and the mutants that the receipts must catch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.messages import CameraImage
from scenarios.faults import FaultSpec, Frozen
from scenarios.faults import camera as specs
from scenarios.severity import severe
from simbench.capture import capture
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Acted
from simbench.faults.pictures import linear, shown
from simbench.faults.pixels import DELIVERED
from simbench.faults.pixels_lens import disc, shade
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt
from simbench.faults.seen import levels, light_of
from simbench.sensors.pictures import by_rays
from simbench.stage import CATEGORIES
from tests.simbench.faults import laws
from tests.simbench.faults.albums import FRAMES, album, site
from tests.simbench.support import digest, receipts_of, staged


@dataclass(frozen=True, kw_only=True)
class Example:
    """A fault at a strength that can be halved and doubled. unit: what a wrong unit makes of the strength."""

    spec: FaultSpec
    signed: bool = False
    drawn: bool = False
    unit: Callable[[float], float] = lambda strength: 100.0 * strength


EXAMPLES: dict[str, Example] = {
    "dirt": Example(spec=specs.Dirt(percent=12.0), drawn=True, unit=lambda p: 0.01 * p),
    "thin dirt": Example(spec=specs.Dirt(percent=20.0, opacity=0.4), drawn=True, unit=lambda p: 0.01 * p),
    "defocus": Example(spec=specs.Defocus(radius_px=3.0), unit=lambda r: 0.01 * r),
    "too bright": Example(spec=specs.WrongExposure(stops=1.2), signed=True, unit=lambda s: 2.0**s),
    "too dark": Example(spec=specs.WrongExposure(stops=-1.5), signed=True, unit=lambda s: 2.0**s),
    "low light": Example(spec=specs.LowLight(stops=4.0), drawn=True, unit=lambda s: s * np.log(2.0)),
    "noise": Example(spec=specs.ExtraNoise(read_e=150.0), drawn=True, unit=lambda e: 0.01 * e),
    "jpeg": Example(spec=specs.JpegLoss(loss=44), unit=lambda loss: 100 - loss),
}
ids = pytest.mark.parametrize("which", EXAMPLES)
SYSTEMS = pytest.mark.parametrize("system", ["car", "wearable"])
FRONT = ("cam-front",)


def act(spec: FaultSpec, system: str = "car", seed: int = 0, on: Delivery | None = None) -> Acted:
    return laws.act(spec, album(system) if on is None else on, site(seed, system))


def proof(
    spec: FaultSpec, acted: Acted, system: str = "car", realised: Acted | None = None
) -> tuple[Receipt, ...]:
    """Receipts of what acted, with what the bench says it drew (`realised`: of another act)."""
    told = acted if realised is None else replace(acted, realised=realised.realised)
    return laws.receipts(spec, album(system), told, site(0, system))


def statuses(found: tuple[Receipt, ...]) -> set[str]:
    return {receipt.status for receipt in found}


def pictures(delivery: Delivery) -> list[np.ndarray]:
    return [s.image.rgb for shots in delivery.shots.values() for s in shots if s.image is not None]


def strength(spec: FaultSpec) -> float:
    return float(getattr(spec, spec.strength))


def at_strength(spec: FaultSpec, value: float) -> FaultSpec:
    """The same fault with another strength, past what its rules allow."""
    whole = isinstance(spec, specs.JpegLoss)
    return laws.other(spec, **{spec.strength: min(round(value), 99) if whole else value})


# -- laws -------------------------------------------------------------------------------------------------


def test_every_fault_of_the_room_has_an_example_severities_and_an_injector() -> None:
    assert {type(e.spec) for e in EXAMPLES.values()} == {f.spec for f in DELIVERED}
    assert {f.spec for f in DELIVERED} | {specs.MotionBlur} == set(specs.SPECS)
    assert {s.fault for s in specs.SEVERITIES} == {spec.name for spec in specs.SPECS}


@ids
def test_zero_strength_is_the_identity(which: str) -> None:
    zero = at_strength(EXAMPLES[which].spec, 0.0)
    assert zero.is_off
    assert digest(*pictures(act(zero).delivery)) == digest(*pictures(album()))


@ids
@SYSTEMS
def test_inputs_stay_untouched_and_everything_but_the_pictures_as_it_was(which: str, system: str) -> None:
    was = digest(*pictures(album(system)))
    after = act(EXAMPLES[which].spec, system).delivery
    assert digest(*pictures(album(system))) == was != digest(*pictures(after))
    for name, shots in album(system).shots.items():
        for before, now in zip(shots, after.shots[name], strict=True):
            assert (now.detections, now.truth) == (before.detections, before.truth)
            assert now.image is not None and before.image is not None
            assert (now.image.seq, now.stamp_ns, now.image.arrival_ns) == (
                before.image.seq, before.stamp_ns, before.image.arrival_ns,
            )  # fmt: skip
            if site(0, system).rig.cameras[name].monochrome:
                assert (now.image.rgb == now.image.rgb[..., :1]).all()


@ids
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(which: str) -> None:
    example = EXAMPLES[which]
    first = digest(*pictures(act(example.spec).delivery))
    assert digest(*pictures(act(example.spec).delivery)) == first
    assert (digest(*pictures(act(example.spec, seed=1).delivery)) != first) == example.drawn


@ids
def test_a_picture_does_not_depend_on_which_others_there_are(which: str) -> None:
    """One camera's pictures alone come out as among those of all."""
    spec = EXAMPLES[which].spec
    name = next(iter(album().shots))
    alone = replace(album(), shots={n: s if n == name else () for n, s in album().shots.items()})
    one, all_of_them = act(spec, on=alone).delivery.shots[name], act(spec).delivery.shots[name]
    assert digest(*(s.image for s in one)) == digest(*(s.image for s in all_of_them))


@ids
def test_other_cameras_than_the_named_are_spared(which: str) -> None:
    one = laws.other(EXAMPLES[which].spec, sensors=FRONT)
    after = act(one).delivery
    changed = [n for n, shots in album().shots.items() if digest(*shots) != digest(*after.shots[n])]
    assert changed == list(FRONT)
    assert statuses(proof(one, act(one))) == {OK}


# -- physics ----------------------------------------------------------------------------------------------


def test_display_values_survive_the_way_to_light_and_back() -> None:
    values = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(shown(linear(values)), values)
    np.testing.assert_allclose(levels(), linear(values), rtol=1e-6)


def test_one_stop_doubles_the_light_and_white_stays_white() -> None:
    """Display values 99, 137, 188 show 0.124, 0.251, 0.503 of white."""
    table = np.array([[[99, 137, 188], [255, 200, 0]]], dtype=np.uint8)
    spec = specs.WrongExposure(stops=1.0)
    np.testing.assert_array_equal(_of_one(spec, table), [[[137, 188, 255], [255, 255, 0]]])


def _of_one(spec: FaultSpec, picture: np.ndarray) -> np.ndarray:
    """A single picture of a colour camera through a fault."""
    shot = album("wearable").shots["cam-centre"][0]
    image = CameraImage(sensor="cam-centre", seq=0, stamp_ns=0, arrival_ns=0, rgb=picture)
    alone = replace(album("wearable"), shots={"cam-centre": (replace(shot, image=image),)})
    only = laws.other(spec, sensors=("cam-centre",))
    found = act(only, "wearable", on=alone).delivery.shots["cam-centre"][0].image
    assert found is not None
    return found.rgb


@given(radius=st.floats(0.0, 12.0))
@settings(max_examples=30, deadline=None)
def test_a_disc_keeps_all_light_and_its_middle_is_as_bright_as_its_area_says(radius: float) -> None:
    kernel = disc(radius).astype(np.float64)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(kernel, kernel[::-1, ::-1], atol=1e-7)
    np.testing.assert_allclose(kernel, kernel.T, atol=2e-3)
    if radius <= 0.5:
        assert kernel.shape == (1, 1)
    if radius >= 0.75:  # the middle pixel lies wholly within
        assert kernel.max() == pytest.approx(1.0 / (np.pi * radius**2), rel=5e-3)


def test_a_grey_field_gets_the_noise_of_its_electrons() -> None:
    """Value 188 is 0.503 of the 3,000 electrons of white: at a sixteenth of the light 94 are left, and the SD
    is that of 94 electrons, less what daylight had, plus the read noise of 4, of 187.5 for white."""
    grey = np.full((120, 160, 3), 188, dtype=np.uint8)
    after = light_of(_of_one(specs.LowLight(stops=4.0), grey))
    expected_e = np.sqrt(0.503 * 3000 / 16 * (1 - 1 / 16) + 16 * (1 - 1 / 256))
    assert after.std() == pytest.approx(expected_e / 187.5, rel=0.02)
    assert after.mean() == pytest.approx(0.503, rel=0.005)


def test_more_dirt_is_the_same_dirt_grown_and_covers_what_is_asked_for() -> None:
    little, much = (shade(specs.Dirt(percent=p), "cam", 3, (120, 160)) for p in (5.0, 25.0))
    assert (much >= little).all()
    assert np.mean(little >= 0.5) == pytest.approx(0.05, abs=1e-3)
    assert np.mean(much >= 0.5) == pytest.approx(0.25, abs=1e-3)


# -- receipts ---------------------------------------------------------------------------------------------


@ids
@SYSTEMS
def test_a_clean_draw_is_ok(which: str, system: str) -> None:
    spec = EXAMPLES[which].spec
    found = proof(spec, act(spec, system), system)
    assert statuses(found) == {OK}, [r for r in found if r.status != OK]
    assert all(r.fault == spec.name and r.unit and r.note for r in found)


@ids
def test_without_pictures_nothing_is_proved(which: str) -> None:
    spec = EXAMPLES[which].spec
    blind = laws.clean()
    acted = laws.act(spec, blind, site())
    found = laws.receipts(spec, blind, acted, site())
    assert statuses(found[: len(site().rig.cameras)]) == {UNVERIFIABLE}
    assert "--images raycast" in found[0].note
    assert MISMATCH not in statuses(found)


MUTANTS: dict[str, Callable[[Example], float]] = {
    "off": lambda e: 0.0,
    "half": lambda e: 0.5 * strength(e.spec),
    "twice": lambda e: 2.0 * strength(e.spec),
    "sign": lambda e: -strength(e.spec),
    "wrong unit": lambda e: e.unit(strength(e.spec)),
}


@ids
@pytest.mark.parametrize("mutant", MUTANTS)
def test_an_injector_that_acts_otherwise_than_asked_is_caught(which: str, mutant: str) -> None:
    example = EXAMPLES[which]
    if mutant == "sign" and not example.signed:
        pytest.skip("has no sign")
    honest, wrong = act(example.spec), act(at_strength(example.spec, MUTANTS[mutant](example)))
    assert MISMATCH in statuses(proof(example.spec, wrong, realised=honest))  # the draw was right
    assert MISMATCH in statuses(proof(example.spec, wrong))  # the draw itself was wrong


@ids
def test_an_injector_that_acts_twice_is_caught(which: str) -> None:
    if which == "jpeg":
        pytest.skip("what lies on the steps already stays there")
    spec = EXAMPLES[which].spec
    once = act(spec)
    assert MISMATCH in statuses(proof(spec, act(spec, seed=7, on=once.delivery), realised=once))


@ids
def test_the_wrong_camera_is_caught(which: str) -> None:
    here, there = (laws.other(EXAMPLES[which].spec, sensors=(name,)) for name in ("cam-front", "cam-back"))
    wrong = act(there)
    bad = laws.mismatches(proof(here, wrong, realised=act(here)))
    assert "anything but the struck pictures" in bad and len(bad) >= 2


def test_noise_that_is_the_same_in_every_picture_is_caught() -> None:
    """As of a stream that forgets the count of the picture."""
    spec = EXAMPLES["noise"].spec
    alike = album().with_shots(album().shots, lambda shot: _numbered(shot, 0))
    acted = act(spec, on=alike)
    back = acted.delivery.with_shots(album().shots, lambda shot: _numbered(shot, shot.detections.seq))
    bad = laws.mismatches(proof(spec, replace(acted, delivery=back)))
    assert bad == ["likeness of the noise of two pictures"]


def _numbered(shot: Shot, seq: int) -> Shot:
    assert shot.image is not None
    return replace(shot, image=replace(shot.image, seq=seq))


@SYSTEMS
@pytest.mark.parametrize("spec", [f.spec for f in DELIVERED], ids=lambda spec: spec.name)
def test_more_of_a_fault_is_more_of_its_measured_effect(spec: type[FaultSpec], system: str) -> None:
    effects = []
    for level in range(1, 6):
        one = severe(spec.name, level)
        found = proof(one, act(one, system), system)
        assert statuses(found) == {OK}, [r for r in found if r.status != OK]
        assert found[0].measured is not None
        effects.append(found[0].measured)
    assert all(stronger > weaker for weaker, stronger in pairwise(effects)), effects


@pytest.mark.parametrize(
    "spec",
    [
        specs.Dirt(percent=100.0, opacity=1.0),
        specs.Defocus(radius_px=50.0),
        specs.Defocus(radius_px=0.4),
        specs.WrongExposure(stops=8.0),
        specs.WrongExposure(stops=-8.0),
        specs.LowLight(stops=12.0),
        specs.ExtraNoise(read_e=10_000.0),
        specs.ExtraNoise(read_e=0.1),
        specs.JpegLoss(loss=99),
        specs.JpegLoss(loss=1),
    ],
    ids=lambda spec: f"{spec.name} {strength(spec):g}",
)
@SYSTEMS
def test_the_strongest_and_the_weakest_are_no_mismatch(spec: FaultSpec, system: str) -> None:
    found = proof(spec, act(spec, system), system)
    assert MISMATCH not in statuses(found), [r for r in found if r.status == MISMATCH]


@pytest.mark.parametrize("which", [w for w in EXAMPLES if EXAMPLES[w].drawn])
def test_what_is_measured_lies_about_what_was_drawn_as_the_receipts_say(which: str) -> None:
    """z-scores of 48 draws: 8 seeds of 6 cameras."""
    spec, scores = EXAMPLES[which].spec, []
    for seed in range(8):
        for receipt in proof(spec, act(spec, seed=seed))[: len(site().rig.cameras)]:
            assert receipt.measured is not None
            error = receipt.measured - receipt.realised
            if receipt.estimator_sd == 0.0:  # rounding only
                assert abs(error) <= receipt.systematic, receipt
            else:
                scores.append(error / receipt.estimator_sd)
    if scores:
        assert abs(np.mean(scores)) < 0.6 and 0.6 < np.std(scores) < 1.4 and np.abs(scores).max() < 4.5


# -- with others ------------------------------------------------------------------------------------------


def test_a_frozen_frame_freezes_the_picture_too_and_the_receipt_looks_at_it() -> None:
    spec = Frozen(percent=50.0)
    acted = act(spec)
    assert MISMATCH not in statuses(proof(spec, acted))
    repeats = 0
    for shots in acted.delivery.shots.values():
        for one, two in pairwise(shots):
            assert one.image is not None and two.image is not None
            same = one.truth.capture_ns == two.truth.capture_ns
            assert np.array_equal(one.image.rgb, two.image.rgb) == same
            assert two.image.stamp_ns == two.detections.stamp_ns != one.image.stamp_ns
            repeats += same
    assert 0 < repeats < FRAMES * len(acted.delivery.shots)

    def thawed(shot: Shot) -> Shot:
        own = next(s for s in album().shots[shot.detections.sensor] if s.stamp_ns == shot.stamp_ns)
        return replace(shot, image=own.image)

    moving = replace(acted, delivery=acted.delivery.with_shots(album().shots, thawed))
    assert MISMATCH in statuses(proof(spec, moving))


def test_all_of_them_together_on_pictures_by_rays_are_ok() -> None:
    """From rays to receipts, at a small size; the wearable's pictures are JPEGs already."""
    together: tuple[FaultSpec, ...] = (
        specs.MotionBlur(longer_ms=6.0, samples=3),
        *{type(e.spec): e.spec for e in EXAMPLES.values()}.values(),
    )
    for system in ("car", "wearable"):
        at = staged(system, specs=together, size_px=(160, 104), duration_s=0.2, background=True)
        taken = capture(at.system, at.rig, at.world, at.faults, CATEGORIES, 0, by_rays(at.rig, 0))
        found = receipts_of(taken, at)
        assert {r.fault for r in found} == {spec.name for spec in together}
        assert MISMATCH not in statuses(found), [r for r in found if r.status == MISMATCH]
        assert {r.fault for r in found if r.status == OK} == {spec.name for spec in together}
