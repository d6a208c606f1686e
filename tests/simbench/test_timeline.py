"""The timeline: it says what a recording delivers, and its numbers are those of a hand calculation."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner, Result
from rich.console import Console

from fusion.messages import Detections, EgoMotion, LidarScan
from scenarios.describe import describe
from scenarios.equipment import load_rig, rig_sensors
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.faults import TriggerOffset
from scenarios.load import load_scenario
from simbench.cli import main
from simbench.report.timeline import svg
from simbench.report.timeline_text import text
from simbench.score.frames import frames_of
from simbench.sensors.rig import assemble
from simbench.timeline import Timeline, plan, timeline
from tests.simbench.support import faults, recorded, staged

MS = 1_000_000
NONE: tuple[str, ...] = ()


def planned(rig: str, active: FaultSet | None = None, seed: int = 0, at_s: float = 0.0) -> Timeline:
    declared = load_rig(rig)
    return plan(assemble(declared, rig_sensors(declared)), 2.0, seed, active or faults(), at_s=at_s)


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_it_says_of_every_message_what_a_recording_with_faults_delivers(system: str) -> None:
    late = TriggerOffset(offset_ms=20.0, jitter_ms=5.0)
    at = staged(system, seed=3, specs=(late,), duration_s=0.5)
    recording = recorded(at, seed=3).recording
    found = plan(at.rig, 0.5, 3, at.faults)
    cameras = {camera.name: camera for camera in found.cameras}
    taken = {(i.sensor, i.seq): i.capture_ns for i in recording.truth.images}
    counts = dict.fromkeys((LidarScan, Detections, EgoMotion), 0)
    for m in recording.messages:
        counts[type(m)] += 1
        if isinstance(m, LidarScan):
            said = (found.lidar.start_ns[m.seq], found.lidar.arrival_ns[m.seq])
        elif isinstance(m, Detections):
            camera = cameras[m.sensor]
            said = (camera.stamp_ns[m.seq], camera.arrival_ns[m.seq])
            assert camera.mid_ns[m.seq] == taken[m.sensor, m.seq]
        else:
            imu = next(lane for lane in found.ticks if lane.name == m.sensor)
            said = (imu.taken_ns[m.seq], imu.delivered_ns[m.seq])
        assert (m.stamp_ns, m.arrival_ns) == said
    assert all(counts.values())
    assert counts[Detections] == sum(len(camera.mid_ns) for camera in found.cameras)
    gnss, reference = found.ticks[0], recording.truth.reference
    assert reference is not None
    n = len(gnss.taken_ns)
    assert np.array_equal(gnss.taken_ns, reference.fix_ns[:n]) and n >= 4
    assert np.array_equal(gnss.delivered_ns, reference.available_ns[:n])
    for frame in frames_of(recording):
        for camera in found.cameras:
            image = frame.views.get(camera.name)
            assert camera.paired[frame.index] == (-1 if image is None else image.truth.seq)


def test_the_points_along_a_cameras_axis_are_fired_when_the_timeline_says() -> None:
    """Independent of the encoder: by the directions of a scan's own points."""
    at = staged("car", duration_s=0.3, columns=512, background=True)
    recording = recorded(at).recording
    found = plan(at.rig, 0.3, 0, at.faults)
    scan = next(m for m in recording.messages if isinstance(m, LidarScan))
    azimuth = np.arctan2(scan.xyz_m[:, 1], scan.xyz_m[:, 0])
    for camera in found.cameras:
        turn = np.angle(np.exp(1j * (azimuth - np.deg2rad(camera.axis_deg))))
        along = np.abs(turn) < np.deg2rad(0.4)
        fired_ms = np.array([scan.offset_ns[along & (scan.ring % 4 == k)].mean() for k in range(4)]) / MS
        assert np.count_nonzero(along) > 20
        assert fired_ms.mean() == pytest.approx(camera.passed_ns[0] / MS, abs=0.25)


def test_one_pulse_for_six_cameras_leaves_each_an_offset_of_its_own() -> None:
    # The pulse is sent at 25 ms, mid-exposure is 1.05 ms later; the spin passes 45 degrees every 12.5 ms.
    by_hand = {
        "cam-front-left": 12.5, "cam-front": 25.0, "cam-front-right": 37.5,
        "cam-back-right": 62.5, "cam-back": 75.0, "cam-back-left": 87.5,
    }  # fmt: skip
    cameras = planned("car-six-cameras").cameras
    assert {camera.name for camera in cameras} == set(by_hand)
    for camera in cameras:
        passes = by_hand[camera.name]
        np.testing.assert_allclose(camera.fires_after_stamp_ms, passes - 25.0, atol=0.05)
        np.testing.assert_allclose(camera.fires_after_mid_ms, passes - 26.05, atol=0.05)


def test_what_an_offset_does_to_a_crossing_target_is_speed_times_time_and_its_picture() -> None:
    camera = next(c for c in planned("car-six-cameras").cameras if c.name == "cam-back-right")
    # 36.45 ms at 5 m/s are 182 mm; a lens of 96 degrees and 960 px has f = 480 / tan 48 = 432 px.
    assert camera.apart_m == pytest.approx(0.18225, abs=3e-4)
    assert camera.apart_px == pytest.approx(432.19 * 0.018225, abs=0.02)


def test_a_timing_fault_moves_the_exposure_and_not_the_stamp() -> None:
    clean = planned("car-six-cameras")
    late = planned("car-six-cameras", faults(TriggerOffset(offset_ms=50.0, sensors=("cam-back",))))
    for a, b in zip(clean.cameras, late.cameras, strict=True):
        shift_ms = 50.0 if b.name == "cam-back" else 0.0
        np.testing.assert_allclose(a.fires_after_mid_ms - b.fires_after_mid_ms, shift_ms, atol=1e-9)
        assert np.array_equal(a.fires_after_stamp_ms, b.fires_after_stamp_ms)
        assert np.array_equal(a.stamp_ns, b.stamp_ns) and np.array_equal(a.paired, b.paired)


def test_a_host_stamped_camera_is_paired_by_what_it_claims() -> None:
    for camera in planned("wearable-back", seed=1).cameras:
        gap = np.abs(camera.stamp_ns[None, :] - np.arange(20)[:, None] * 100 * MS)
        nearest = np.where(gap.min(axis=1) <= 50 * MS, gap.argmin(axis=1), -1)
        assert np.array_equal(camera.paired, nearest)
        late_ms = (camera.stamp_ns - camera.mid_ns) / MS
        assert (late_ms >= 20.0).all() and np.ptp(late_ms) > 5.0


def test_a_camera_without_any_paired_image_has_no_number() -> None:
    declared = load_rig("wearable-back")
    rig = assemble(declared, rig_sensors(declared))
    far = rig.cameras["cam-left"].model_copy(update={"stamp_delay_ms": 900.0, "phase_ms": 0.0})
    found = plan(replace(rig, cameras={"cam-left": far}), 0.5, 0, faults())
    (camera,) = found.cameras
    assert (camera.paired == -1).all() and camera.apart_m is None and camera.apart_px is None
    assert "no image is paired" in svg(found)
    assert "0 of 5" in printed(found, 120)


@pytest.mark.parametrize(
    ("at_s", "first", "last"), [(0.0, 0, 200), (0.199, 100, 300), (0.2, 200, 400), (1.99, 1800, 2000)]
)
def test_two_sweeps_from_the_asked_instant_are_shown(at_s: float, first: int, last: int) -> None:
    found = planned("car-six-cameras", at_s=at_s)
    assert (found.from_ns, found.to_ns) == (first * MS, last * MS)


def test_a_run_of_one_sweep_shows_that_one() -> None:
    declared = load_rig("car-six-cameras")
    found = plan(assemble(declared, rig_sensors(declared)), 0.1, 0, faults())
    assert (found.from_ns, found.to_ns) == (0, 100 * MS)
    assert "sweep 1 of 1" in svg(found)


# -- drawings -----------------------------------------------------------------------------------------------


def printed(found: Timeline, width: int) -> str:
    console = Console(file=io.StringIO(), width=width, color_system=None)
    console.print(text(found, width))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("rig", ["car-six-cameras", "wearable-front"])
def test_the_picture_names_every_lane_and_number_and_is_the_same_every_time(rig: str) -> None:
    found = planned(rig)
    picture = svg(found)
    assert picture == svg(planned(rig))
    root = ElementTree.fromstring(picture)
    assert root.attrib["width"] == "1280px" and root.attrib["viewBox"].startswith("0 0 1280 ")
    words = " ".join(part.strip() for part in root.itertext())
    for name in ("lidar", "gnss", "imu", "odometer", *(camera.name for camera in found.cameras)):
        assert name in words
    for camera in found.cameras:
        assert camera.apart_m is not None and f"{camera.apart_m * 1e3:.0f} mm" in words
        assert f"{camera.apart_px:.1f} px" in words
    if rig.startswith("car"):
        assert "+61.45 ms" in words and "−13.55 ms" in words


@pytest.mark.parametrize("width", [80, 132])
def test_the_drawing_fits_the_terminal_and_holds_the_numbers(width: int) -> None:
    found = planned("wearable-front")
    lines = printed(found, width).splitlines()
    assert max(map(len, lines)) <= width
    for camera in found.cameras:
        (strip,) = [line for line in lines if line.startswith(f"{camera.name:18s} ") and "█" in line]
        assert strip.count("◆") == 2
    joined = " ".join(" ".join(lines).split())
    assert found.cameras[0].apart_m is not None
    assert f"{found.cameras[0].apart_m * 1e3:.0f} mm" in joined


def test_a_sign_stands_where_its_instant_is() -> None:
    lines = printed(planned("car-six-cameras"), 18 + 1 + 275).splitlines()
    cells = {line[:18].strip(): line[19:] for line in lines if len(line) == 18 + 1 + 275}
    # 275 cells from -15 ms to 260 ms: one a millisecond. The first exposure is from 25.05 to 27.05 ms.
    assert [i - 15 for i, sign in enumerate(cells["cam-back"]) if sign == "█"][:3] == [25, 26, 27]
    assert cells["cam-back"].index("◆") - 15 in (74, 75)


# -- where it comes from ------------------------------------------------------------------------------------


def run_folder(folder: Path, edit: Callable[[dict[str, Any]], None] | None = None) -> Path:
    """What `simbench run` leaves, as far as the timeline reads it."""
    folder.mkdir(parents=True)
    case = {"scenario": "overtake-approach", "system": "car", "seed": 3, "faults": "none", "fault_specs": {}}
    change = parse_fault_arguments(("timing.trigger_offset_ms=50",))
    specs = {spec.name: spec.model_dump(mode="json") for spec in change.specs}
    content = {"cases": [case, {**case, "system": "wearable", "faults": "mine", "fault_specs": specs}]}
    if edit is not None:
        edit(content)
    (folder / "result.json").write_text(json.dumps(content))
    scenario = load_scenario("overtake-approach").resolve(3)
    (folder / "scenario-overtake-approach-3.yaml").write_text(describe(scenario))
    return folder


def test_a_runs_folder_gives_the_same_as_its_scenario_with_its_faults(tmp_path: Path) -> None:
    folder = str(run_folder(tmp_path / "run"))
    fault = ("timing.trigger_offset_ms=50",)
    for given, same in (
        ((folder, None, None, NONE), ("overtake-approach", "wearable", 3, fault)),  # the case with faults
        ((folder, "car", None, NONE), ("overtake-approach", "car", 3, NONE)),
        ((folder, None, 3, ("none",)), ("overtake-approach", "wearable", 3, NONE)),
    ):
        a, b = timeline(*given, 0.2), timeline(*same, 0.2)
        assert a.title == b.title
        assert svg(replace(a, faults="")) == svg(replace(b, faults=""))


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, ["timeline", *words], prog_name="simbench")


def test_the_command_prints_the_numbers_and_writes_the_picture(tmp_path: Path) -> None:
    done = invoke("overtake-approach", "--system", "car", "--out", str(tmp_path / "pictures"))
    assert done.exit_code == 0, done.output
    assert "+61.45 ms" in done.output and "307 mm" in done.output
    picture = (tmp_path / "pictures" / "timeline.svg").read_text(encoding="utf-8")
    assert picture == svg(timeline("overtake-approach", "car", 0, NONE, 0.2))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["overtake-aproach"], "did you mean 'overtake-approach'?"),
        (["nothing/here"], "nothing/here"),
        (["static-board", "--system", "wearable"], "unknown system 'wearable'"),
        (["overtake-approach", "--at", "5.2"], "5.2 s is not within the run, whose sweeps end at 5.2 s"),
        (["overtake-approach", "--at", "-1"], "-1 s is not within the run"),
        (["overtake-approach", "--at", "nan"], "nan s is not within the run"),
        (["overtake-approach", "--faults", "timing.trigger_offset_m=1"], "did you mean"),
        (["overtake-approach", "--seed", "-1"], "-1 is not in the range"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(words: list[str], says: str, tmp_path: Path) -> None:
    done = invoke(*words, "--out", str(tmp_path / "out"))
    assert done.exit_code == 2 and says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda f: (f / "result.json").unlink(), "it has no result.json"),
        (lambda f: (f / "result.json").write_text("{"), "cannot be read"),
        (lambda f: (f / "result.json").write_text("[]"), "is no result of a run"),
        (lambda f: (f / "result.json").write_text('{"cases": [{"seed": "3"}]}'), "is no result of a run"),
        (lambda f: (f / "result.json").write_text('{"cases": []}'), "holds no case of any system any seed"),
        (lambda f: (f / "scenario-overtake-approach-3.yaml").unlink(), "scenario-overtake-approach-3.yaml"),
    ],
)
def test_a_folder_that_is_no_run_is_refused(
    tmp_path: Path, spoil: Callable[[Path], object], says: str
) -> None:
    folder = run_folder(tmp_path / "run")
    spoil(folder)
    with pytest.raises(BadInput) as error:
        timeline(str(folder), None, None, NONE, 0.2)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_a_case_that_a_run_does_not_hold_is_refused(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run")
    with pytest.raises(
        BadInput, match="holds no case of car seed 4 \\(allowed: car seed 3, wearable seed 3\\)"
    ):
        timeline(str(folder), "car", 4, NONE, 0.2)

    def unknown(content: dict[str, Any]) -> None:
        content["cases"][1]["fault_specs"] = {"no_such_fault": {}}

    shutil.rmtree(folder)
    with pytest.raises(BadInput, match="unknown fault 'no_such_fault'"):
        timeline(str(run_folder(tmp_path / "run", unknown)), None, None, NONE, 0.2)
