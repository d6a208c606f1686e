"""Bodies that swing as a mode, a spectrum or a recording says; brackets that are knocked or creep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from scenarios.errors import BadInput
from scenarios.fault_set import parse_fault_arguments
from scenarios.faults import (
    Drift,
    FaultSpec,
    Flex,
    Knock,
    Mode,
    Spectrum,
    Trace,
    TriggerOffset,
    Vibration,
)
from simbench.case import Job
from simbench.cli import main
from simbench.faults.mounts import drifting, knocked
from simbench.faults.receipt import MISMATCH, OK, Receipt
from simbench.faults.scripted import mode_shake, spectrum_rms, spectrum_shake
from simbench.faults.trace import COLUMNS, read_trace, trace_shake
from simbench.mount import Together
from simbench.stage import stage
from tests.simbench.support import posed_under, receipts_of, staged

DEG = np.deg2rad(1.0)
MS = 1_000_000


def found(
    *specs: FaultSpec, asked: tuple[FaultSpec, ...] | None = None, drawn: bool = True
) -> tuple[Receipt, ...]:
    """Receipts of `asked` (default: what acted) where `specs` acted; drawn: with what really was drawn."""
    captured, asked = posed_under(*specs), specs if asked is None else asked
    if not drawn:
        captured = replace(captured, drawn=posed_under(*asked).drawn)
    return receipts_of(captured, staged(specs=asked))


def power_at(signal: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    window = np.hanning(len(signal))
    return np.fft.rfftfreq(len(signal), step_s), np.abs(np.fft.rfft(window * signal)) ** 2


# -- single modes and spectra -------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_a_mode_swings_one_axis_at_its_frequency_by_the_requested_rms(damping: float) -> None:
    shake = mode_shake(Mode(rms_deg=0.5, axis="roll", frequency_hz=2.0, damping=damping), 20.0, 3)
    np.testing.assert_allclose(shake.rms(20.0), [0.5 * DEG, 0.0, 0.0, 0.0], rtol=1e-9, atol=1e-15)
    value = shake.at(np.arange(0, 20_000, 5, dtype=np.int64) * MS)[:, 0]
    hertz, power = power_at(value, 5e-3)
    near = np.abs(hertz - 2.0) < (0.15 if damping == 0.0 else 1.0)
    assert power[near].sum() > (0.999 if damping == 0.0 else 0.8) * power.sum()


def test_a_pure_tone_repeats_after_a_period() -> None:
    shake = mode_shake(Mode(rms_deg=1.0, frequency_hz=4.0), 5.0, 0)
    t_ns = np.arange(0, 1000, dtype=np.int64) * MS
    np.testing.assert_allclose(shake.at(t_ns), shake.at(t_ns + 250 * MS), atol=1e-9)


def test_a_spectrum_has_the_rms_of_its_integral_and_nothing_outside() -> None:
    spec = Spectrum(
        scale=2.0, pitch_deg2_per_hz=((1.0, 0.0), (2.0, 0.5), (3.0, 0.0)),
        heave_m2_per_hz=((1.0, 1e-5), (5.0, 1e-5)),
    )  # fmt: skip
    # A triangle of base 2 Hz and height 0.5; a rectangle of 4 Hz.
    np.testing.assert_allclose(spectrum_rms(spec), [0.0, 2 * np.sqrt(0.5) * DEG, 0.0, 2 * np.sqrt(4e-5)])
    shake = spectrum_shake(spec, 30.0, 1)
    np.testing.assert_allclose(shake.rms(30.0), spectrum_rms(spec), rtol=1e-9)
    hertz, power = power_at(shake.at(np.arange(0, 30_000, 5, dtype=np.int64) * MS)[:, 1], 5e-3)
    assert power[(hertz > 0.9) & (hertz < 3.1)].sum() > 0.999 * power.sum()


@pytest.mark.parametrize(
    "spec",
    [
        Mode(rms_deg=0.5),
        Mode(rms_deg=0.5, axis="yaw", frequency_hz=6.0, damping=0.2),
        Spectrum(
            scale=1.0, roll_deg2_per_hz=((0.8, 0.1), (4.0, 0.05)), heave_m2_per_hz=((1.0, 1e-4), (3.0, 1e-4))
        ),
    ],
    ids=["tone", "mode", "spectrum"],
)
def test_a_scripted_body_is_found_by_gyro_and_cameras(spec: FaultSpec) -> None:
    honest = found(spec)
    assert honest and {r.status for r in honest} == {OK}
    stronger = spec.model_copy(update={spec.strength: 2.0 * getattr(spec, spec.strength)})
    for drawn in (True, False):
        assert MISMATCH in {r.status for r in found(stronger, asked=(spec,), drawn=drawn)}


def test_another_axis_is_a_mismatch() -> None:
    spec = Mode(rms_deg=0.5)
    assert MISMATCH in {r.status for r in found(Mode(rms_deg=0.5, axis="roll"), asked=(spec,), drawn=False)}


# -- a recording ------------------------------------------------------------------------------------------


def written(folder: Path, rate: np.ndarray, step_s: float = 0.01, head: tuple[str, ...] = COLUMNS) -> Path:
    path = folder / "gyro.csv"
    rows = [",".join(map(repr, [i * step_s, *map(float, row)])) for i, row in enumerate(rate)]
    path.write_text("\n".join([",".join(head), *rows]) + "\n", encoding="utf-8")
    return path


def swing(seconds: float = 4.0, step_s: float = 0.01) -> np.ndarray:
    """Rates of a pitch of 1 deg at 1 Hz, with a gyro's bias on roll."""
    t = np.arange(0.0, seconds, step_s)
    pitch_rate = DEG * 2.0 * np.pi * np.cos(2.0 * np.pi * t)
    return np.stack([np.full_like(t, 0.02), pitch_rate, np.zeros_like(t)], axis=1)


def test_a_recorded_swing_is_integrated_and_the_bias_falls_away(tmp_path: Path) -> None:
    shake = trace_shake(Trace(file=str(written(tmp_path, swing())), scale=2.0), 3.0)
    assert shake.rms(3.0)[0] < 1e-6
    t_ns = np.arange(0, 3000, 7, dtype=np.int64) * MS
    value, expected = shake.at(t_ns)[:, 1], 2.0 * DEG * np.sin(2e-9 * np.pi * t_ns)
    line = np.polynomial.polynomial.polyfit(t_ns * 1e-9, expected, 1)
    np.testing.assert_allclose(
        value, expected - np.polynomial.polynomial.polyval(t_ns * 1e-9, line), atol=0.01 * DEG
    )


def test_a_recording_is_found_by_the_gyro_and_a_halved_one_is_not(tmp_path: Path) -> None:
    file = str(written(tmp_path, swing()))
    assert {r.status for r in found(Trace(file=file))} == {OK}
    for scale in (0.5, -1.0, 2.0):
        wrong = found(Trace(file=file, scale=scale), asked=(Trace(file=file),), drawn=False)
        assert MISMATCH in {r.status for r in wrong}, scale


def test_a_bare_path_is_a_trace() -> None:
    (spec,) = parse_fault_arguments(["motion.trace=some/gyro.csv"]).specs
    assert spec == Trace(file="some/gyro.csv")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda t: t.replace("roll_rate_radps", "roll_rate"), "line 1"),
        (lambda t: t[: t.index("\n1.0,")] + t[t.index("\n1.2,") :], "line 102: comes after a gap"),
        (lambda t: t.replace("\n0.5,", "\n0.3,"), "line 52: is not later"),
        (lambda t: t.replace("\n0.5,", "\nhalf,"), "line 52"),
        (lambda t: t.replace("\n0.5,", "\nnan,"), "line 52"),
        (lambda t: t.split("\n")[0], "has 0 rows"),
        (lambda t: "", "line 1"),
    ],
)  # fmt: skip
def test_a_bad_recording_costs_one_sentence_and_no_run(spoil, says: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = written(tmp_path, swing(7.0))
    path.write_text(spoil(path.read_text(encoding="utf-8")), encoding="utf-8")
    read_trace.cache_clear()
    done = CliRunner().invoke(
        main, ["run", "overtake-approach", "--faults", f"motion.trace={path}", "--out", str(tmp_path / "out")]
    )
    assert done.exit_code == 2 and says in done.output and len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_recording_that_ends_too_soon_or_is_not_there_is_refused(tmp_path: Path) -> None:
    short = f"motion.trace={written(tmp_path, swing(4.0))}"
    for words, says in (
        (short, "ends after 3.99 s, and the run takes 5.2 s"),
        ("motion.trace=none.csv", "cannot be read"),
    ):
        with pytest.raises(BadInput, match=says):
            stage(Job(scenario="overtake-approach", system="car", seed=0, pipelines=(), faults=(words,)))


def test_two_faults_that_shake_the_body_contradict() -> None:
    faults = ("motion.mode_deg=1", "motion.vibration_deg=1")
    with pytest.raises(BadInput, match=r"motion.mode_deg and motion.vibration_deg both shake the body"):
        stage(Job(scenario="overtake-approach", system="car", seed=0, pipelines=(), faults=faults))


# -- brackets ---------------------------------------------------------------------------------------------


def test_a_knock_is_over_after_its_rise_and_a_drift_goes_on() -> None:
    knock = knocked(Knock(angle_deg=2.0, axis="pitch", at_s=1.0, rise_ms=20.0))
    t_ns = np.array([0, 999, 1010, 1020, 5000], dtype=np.int64) * MS
    np.testing.assert_allclose(knock.at(t_ns)[:, 1] / DEG, [0.0, 0.0, 1.0, 2.0, 2.0], atol=1e-12)
    drift = drifting(Drift(angle_deg=1.0, shift_cm=10.0, along="z"), duration_s=2.0)
    np.testing.assert_allclose(drift.at(t_ns)[[0, 4]][:, [2, 5]], [[0.0, 0.0], [2.5 * DEG, 0.25]], atol=1e-12)


def test_motions_of_a_bracket_add() -> None:
    knock, drift = knocked(Knock(angle_deg=2.0)), drifting(Drift(angle_deg=1.0), 2.0)
    t_ns = np.arange(0, 3000, 100, dtype=np.int64) * MS
    both = Together(parts=(knock, drift)).at(t_ns)
    np.testing.assert_allclose(both, knock.at(t_ns) + drift.at(t_ns))


BRACKETS: dict[str, FaultSpec] = {
    "knock": Knock(angle_deg=-1.0, axis="pitch", at_s=0.9),
    "knock of one": Knock(angle_deg=0.5, sensors=("cam-front",)),
    "drift": Drift(angle_deg=0.5, axis="roll"),
    "drift of one, shifted": Drift(angle_deg=0.5, shift_cm=4.0, along="z", sensors=("cam-back",)),
}


@pytest.mark.parametrize("which", BRACKETS)
def test_what_a_bracket_does_is_found(which: str) -> None:
    spec = BRACKETS[which]
    honest = found(spec)
    assert {r.status for r in honest} == {OK}
    assert any(r.requested for r in honest)
    for factor in (0.0, 0.5, 2.0, -1.0):
        wrong = spec.model_copy(update={name: factor * getattr(spec, name) for name in spec.zero_when_off})
        for drawn in (True, False):
            assert MISMATCH in {r.status for r in found(wrong, asked=(spec,), drawn=drawn)}, (factor, drawn)


def test_a_bracket_is_found_among_other_motions() -> None:
    specs = (
        BRACKETS["knock"], BRACKETS["drift of one, shifted"], Flex(rms_deg=0.1), Vibration(rms_deg=0.3),
        TriggerOffset(offset_ms=20.0),
    )  # fmt: skip
    receipts = found(*specs)
    assert not [r for r in receipts if r.status == MISMATCH]
    verified = {r.fault for r in receipts if r.status == OK and r.requested}
    assert verified >= {"motion.knock_deg", "calibration.drift_deg", "motion.vibration_deg"}


def test_of_cameras_that_could_not_be_measured_nothing_is_said() -> None:
    """A knock at once: neither that the struck one turned, nor that the others did not."""
    receipts = found(Knock(angle_deg=1.0, at_s=0.05, sensors=("cam-front",)))  # one frame comes before it
    assert [(r.quantity, r.status) for r in receipts] == [("cam-front yaw", "unverifiable")]
