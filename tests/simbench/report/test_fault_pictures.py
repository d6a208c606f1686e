"""The picture of a fault: it shows a difference, and the same bytes each time, or is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner

from scenarios.errors import BadInput
from scenarios.faults import FAULTS, StampJitter, Trace
from scenarios.severity import severe
from simbench.cli import main
from simbench.proving.places import place_where
from simbench.proving.prove import levels_of
from simbench.report.fault_pictures import picture, timing
from simbench.report.fault_pictures.picture import drawn, rendered, strength
from simbench.report.fault_pictures.sketch import Sketch

ONE_OF_EACH = (
    "calibration.shift_px", "camera.jpeg_loss", "detector.misses_percent", "detector.lag_frames",
    "lidar.dropout_percent", "motion.mode_deg", "reference.outage_s", "timing.latency_ms",
)  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_drawn_with_a_fault_differs_from_what_is_drawn_without(fault: str) -> None:
    sketch = drawn(fault).sketch
    assert sketch.shows_a_difference
    assert any(array.size for array in sketch.before.values())


def test_one_fault_of_each_family_is_drawn_to_the_same_bytes_again() -> None:
    assert {fault.partition(".")[0] for fault in ONE_OF_EACH} == set(picture.FAMILIES)
    for fault in ONE_OF_EACH:
        once, again = drawn(fault), drawn(fault)
        code = rendered(once, once.sketch.ending)
        assert code and code == rendered(again, again.sketch.ending), fault


def test_a_file_is_of_the_kind_that_its_name_ends_with(tmp_path: Path) -> None:
    for ending, begin in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("jpg", b"\xff\xd8")):
        path = tmp_path / "new" / f"it.{ending}"
        done = CliRunner().invoke(main, ["describe", "fault", "timing.stale_frames", "--picture", str(path)])
        assert done.exit_code == 0, done.output
        assert path.read_bytes().startswith(begin)


def test_a_picture_says_which_fault_how_strong_and_what_it_does() -> None:
    text = rendered(drawn("timing.clock_offset_ms", 3), "svg").decode()
    for words in (
        "timing.clock_offset_ms",
        "severity 3 of 5: 30 ms",
        "only the stamp moves",
        "true time (s)",
    ):
        assert words in text


def test_a_strength_is_said_in_its_unit_or_by_its_word() -> None:
    assert strength(severe("detector.misses_percent", 4)) == "20 % of boxes"
    assert strength(severe("motion.road", 4)) == "ISO 8608 class D"
    assert strength(levels_of("calibration.mixup")[0]) == "transposed rotation"
    assert strength(Trace(file="some/where.csv", scale=2.0)) == "a recorded gyro, 2 times"


def test_the_picture_of_a_fault_that_changes_nothing_is_refused() -> None:
    off = (StampJitter(),)
    with (
        mock.patch.object(picture, "levels_of", lambda _: off),
        pytest.raises(BadInput, match="changes nothing"),
    ):
        drawn("timing.stamp_jitter_ms", 1)


def test_one_changed_number_is_a_difference_and_none_is_not() -> None:
    row = np.array([1.0, 2.0])
    sketch = Sketch(before={"row": row}, after={"row": row.copy()}, paint=lambda _: None, height=1.0)
    assert not sketch.shows_a_difference
    assert replace(sketch, after={"row": np.array([1.0, 2.5])}).shows_a_difference
    assert replace(sketch, after={"row": row[:1]}).shows_a_difference


# -- what the sketches say --------------------------------------------------------------------------------


def sketched(fault: str, level: int = 4) -> Sketch:
    return drawn(fault, level).sketch


def test_a_clocks_offset_moves_the_stamps_alone_by_itself() -> None:
    sketch = sketched("timing.clock_offset_ms")
    moved = sketch.after["messages"] - sketch.before["messages"]
    np.testing.assert_allclose(moved, np.broadcast_to([0.0, 0.05, 0.0], moved.shape), atol=1e-9)


def test_a_late_shutter_loses_no_frame_and_a_dropped_message_one() -> None:
    spec = severe("timing.trigger_offset_ms", 4)
    place = place_where(type(spec))
    without, late = place.make((), 0).data, place.make((spec,), 0).data
    sketch = timing.sketch(spec, without, late)
    assert len(sketch.before["messages"]) == len(sketch.after["messages"])
    assert not len(sketch.after["lost"])
    dropped = sketched("timing.dropped_percent")
    gone = len(dropped.before["messages"]) - len(dropped.after["messages"])
    assert len(dropped.after["lost"]) == gone > 0


def test_a_knock_turns_a_bracket_by_its_angle_from_its_instant_on() -> None:
    turn_deg = sketched("motion.knock_deg").after["turn"]
    np.testing.assert_allclose(turn_deg[-1], (0.0, 0.0, 1.0), atol=1e-4)
    np.testing.assert_allclose(turn_deg[0], 0.0, atol=1e-6)


def test_without_a_fault_points_lie_where_the_fusion_is_told() -> None:
    for fault in ("calibration.drift_deg", "calibration.undistorted_px", "calibration.mixup"):
        sketch = sketched(fault)
        np.testing.assert_allclose(sketch.before["true"], sketch.before["told"], atol=1e-6)


def test_a_moved_image_centre_moves_what_is_told_and_nothing_that_is_true() -> None:
    sketch = sketched("calibration.shift_px")
    np.testing.assert_allclose(sketch.after["true"], sketch.before["true"])
    moved = sketch.after["told"] - sketch.after["true"]
    np.testing.assert_allclose(moved, np.broadcast_to([10.0, 0.0], moved.shape), atol=1e-6)


def test_a_drifting_mount_moves_what_is_true_and_nothing_that_is_told() -> None:
    sketch = sketched("calibration.drift_deg")
    np.testing.assert_allclose(sketch.after["told"], sketch.before["told"])
    assert np.hypot(*(sketch.after["true"] - sketch.before["true"]).T).min() > 1.0


def test_an_outage_lets_the_held_fix_age_for_as_long_as_it_lasts() -> None:
    sketch = sketched("reference.outage_s")
    assert sketch.after["age"][:, 1].max() - sketch.before["age"][:, 1].max() == pytest.approx(5.0, abs=0.21)


def test_ids_are_swapped_within_those_that_there_are() -> None:
    sketch = sketched("detector.identity_switches_per_s")
    ids = [{i for rows in side.values() for i in rows[:, 3]} for side in (sketch.before, sketch.after)]
    assert ids[0] == ids[1]


# -- what the user may get wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["fault", "timing.clock_ofset_ms", "--picture", "x.svg"], "did you mean 'timing.clock_offset_ms'?"),
        (["fault", "timing.latency_ms", "--picture", "x.gif"], "no picture (allowed: .svg, .png, .jpg)"),
        (["fault", "timing.latency_ms", "--picture", "x"], "x is no picture"),
        (["fault", "calibration.mixup", "--picture", "x.svg", "--level", "5"], "(allowed: 1 to 4)"),
        (["fault", "timing.latency_ms", "--picture", "x.svg", "--level", "6"], "--level"),
        (["faults", "--picture", "x.svg"], "'faults' with --pictures FOLDER"),
        (["overtake-approach", "--pictures", "x"], "'faults' with --pictures FOLDER"),
        (["fault", "timing.latency_ms", "--picture", "x.svg", "--pictures", "x"], "goes with --picture FILE"),
    ],
)  # fmt: skip
def test_a_wrong_wish_costs_one_sentence_and_writes_nothing(
    words: list[str], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["describe", *words])
    assert done.exit_code == 2
    assert sentence in done.output
    assert not list(tmp_path.iterdir())
