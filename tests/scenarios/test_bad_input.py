"""Bad scenario files: each is refused at load with one sentence, its file, line and field."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput, Where, dotted, nearest
from scenarios.library import PACKAGE
from scenarios.load import list_scenarios, load_scenario

GOOD = """\
name: small
description: A car behind a rider
road: {lanes_m: [[-1.7, 1.7]]}
systems:
  car:
    duration_s: 2
    ego: car
    target: rider
    rig: car-six-cameras
    actors:
      car:
        part: car
        category: car
        path:
          waypoints_m: [[0, 0]]
          speed_mps: 10
      rider:
        part: escooter_rider
        category: rider
        path:
          waypoints_m: [[20, -3]]
          speed_mps: [[0, 7], [2, 8]]
background:
  - {part: tree, category: tree, count: 2, area_m: [0, 10, 50, 20]}
faults:
  timing.trigger_offset_ms: 50
  motion.vibration_deg:
    rms_deg: 0.5
"""


def refused(tmp_path: Path, text: str) -> BadInput:
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        load_scenario(str(path))
    return caught.value


def test_the_file_that_the_others_break_is_good(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(GOOD)
    assert load_scenario(str(path)).resolve(0).name == "small"


# what is replaced, by what, line, field, what the sentence says
CORPUS = [
    ("duration_s: 2", "duraton_s: 2", 6, "systems.car.duraton_s", "did you mean 'duration_s'?"),
    ("speed_mps: 10", "speed-mps: 10", 16, "systems.car.actors.car.path.speed-mps", "mean 'speed_mps'?"),
    ("    ego: car\n", "", 5, "systems.car", "'ego' is missing"),
    ("duration_s: 2", "duration_s: two", 6, "systems.car.duration_s", "must be a number, is 'two'"),
    ("duration_s: 2", "duration_s: true", 6, "systems.car.duration_s", "must be a number, is true"),
    ("duration_s: 2", "duration_s: null", 6, "systems.car.duration_s", "must be a number, is null"),
    ("duration_s: 2", "duration_s: 0", 6, "systems.car.duration_s", "must be > 0, is 0"),
    ("duration_s: 2", "duration_s: 0.05", 6, "systems.car.duration_s", "zero frames"),
    ("duration_s: 2", "duration_s: .nan", 6, None, "not finite"),
    ("duration_s: 2", "duration_s: 1e9", 6, "systems.car.duration_s", "must be <= 3600"),
    ("ego: car", "ego: cart", 7, "systems.car.ego", "'cart' is not one of the actors (car, rider)"),
    ("target: rider", "target: car", 8, "systems.car.target", "another actor than the ego"),
    ("target: rider", "target: 3", 8, "systems.car.target", "must be text, is 3"),
    ("rig: car-six-cameras", "rig: car-six-camera", 9, "systems.car.rig", "did you mean 'car-six-cameras'?"),
    ("rig: car-six-cameras", "rig: ../rigs/x", 9, "systems.car.rig", "is no name"),
    ("part: car", "part: cra", 12, "systems.car.actors.car.part", "unknown part 'cra'"),
    ("category: rider", "category: ridder", 19, "systems.car.actors.rider.category", "mean 'rider'?"),
    (
        "speed_mps: 10",
        "speed_mps: -10",
        16,
        "systems.car.actors.car.path.speed_mps",
        "not be negative, is -10",
    ),
    ("speed_mps: 10", "speed_mps: fast", 16, "systems.car.actors.car.path.speed_mps", "a number or a list"),
    ("[2, 8]]", "[2, -8]]", 22, "systems.car.actors.rider.path.speed_mps[1][1]", "must not be negative"),
    ("[2, 8]]", "[0, 8]]", 22, "systems.car.actors.rider.path.speed_mps[1][0]", "not later than"),
    ("[2, 8]]", "[2]]", 22, "systems.car.actors.rider.path.speed_mps[1]", "at least 2 values"),
    ("[[20, -3]]", "[]", 21, "systems.car.actors.rider.path.waypoints_m", "at least 1 entries"),
    ("[[20, -3]]", "[[20]]", 21, "systems.car.actors.rider.path.waypoints_m[0]", "at least 2 values"),
    ("[[20, -3]]", "[[1, 2, 3]]", 21, "systems.car.actors.rider.path.waypoints_m[0]", "more than 2 values"),
    ("[[20, -3]]", "[[1, 9], [1, 9]]", 21, "systems.car.actors.rider.path.waypoints_m[1]", "the same point"),
    ("[[20, -3]]", "20", 21, "systems.car.actors.rider.path.waypoints_m", "must be a list, is 20"),
    (
        "[[20, -3]]\n",
        "[[20, -3], [30, -3]]\n          heading_deg: 9\n",
        22,
        "systems.car.actors.rider.path.heading_deg",
        "one waypoint only",
    ),
    (
        "[[20, -3]]",
        "[[1, 0.5]]",
        21,
        "systems.car.actors.rider.path.waypoints_m",
        "'rider' stands inside 'car' at the start",
    ),
    ("      rider:\n", "      Rider:\n", 17, "systems.car.actors.Rider", "is no name"),
    (
        "  car:\n    dur",
        "  bike:\n    dur",
        5,
        "systems.bike",
        "unknown value 'bike' (allowed: car, wearable)",
    ),
    ("{lanes_m: [[-1.7, 1.7]]}", "3", 3, "road", "must be a mapping, is 3"),
    ("name: small", "name: 3", 1, "name", "must be text, is 3"),
    ("name: small", "name: " + "x" * 70, 1, "name", "longer than 64"),
    ("name: small", "name: {choice: [a, b]}", 1, "name", "must not be a distribution"),
    ("[[-1.7, 1.7]]", "[[1.7, -1.7]]", 3, "road.lanes_m[0]", "y0 < y1"),
    ("count: 2", "count: 2.5", 24, "background[0].count", "must be a whole number, is 2.5"),
    ("count: 2", "count: 501", 24, "background[0].count", "must be <= 500"),
    ("part: tree", "part: treee", 24, "background[0].part", "did you mean 'tree'?"),
    ("[0, 10, 50, 20]", "[0, 10, 50]", 24, "background[0].area_m", "at least 4 values"),
    ("[0, 10, 50, 20]", "[0, 10, -50, 20]", 24, "background[0].area_m", "x1 > x0"),
    ("[0, 10, 50, 20]", "[0, -1, 50, 1]", 24, "background[0].area_m", "lies within the lane"),
    (
        "offset_ms: 50",
        "ofset_ms: 50",
        26,
        "faults.timing.trigger_ofset_ms",
        "did you mean 'timing.trigger_off",
    ),
    ("offset_ms: 50", "offset_ms: x", 26, "faults.timing.trigger_offset_ms.offset_ms", "a number, is 'x'"),
    (
        "offset_ms: 50",
        "offset_ms: [5]",
        26,
        "faults.timing.trigger_offset_ms",
        "number or a mapping, is a list",
    ),
    (
        "offset_ms: 50",
        "offset_ms: {offset_ms: 5, sensors: [cam-frnt]}",
        26,
        "faults.timing.trigger_offset_ms.sensors",
        "did you mean 'cam-front'?",
    ),
    ("rms_deg: 0.5", "rms_deg: -0.5", 28, "faults.motion.vibration_deg.rms_deg", "must not be negative"),
    ("rms_deg: 0.5", "profile: bike", 28, "faults.motion.vibration_deg.profile", "allowed: auto, car, rider"),
    ("name: small", "name: small\nname: small", 2, None, "stands here twice"),
    ("count: 2", "count: *n", 24, None, "alias *n"),
    # a sway, a bend, an actor's own materials
    (
        "speed_mps: 10",
        "speed_mps: 10\n          sway: {amplitude_m: -0.1, frequency_hz: 1}",
        17,
        "systems.car.actors.car.path.sway.amplitude_m",
        "must not be negative, is -0.1",
    ),
    (
        "speed_mps: 10",
        "speed_mps: [[0, 5], [1, 0]]\n          sway: {amplitude_m: 0.1, frequency_hz: 1}",
        17,
        "systems.car.actors.car.path.sway",
        "above 0 at all times: who stands does not sway",
    ),
    (
        "[[20, -3]]",
        "[[2.6, 1.4]]\n          sway: {amplitude_m: 0.3, frequency_hz: 1, phase_deg: -90}",
        21,
        "systems.car.actors.rider.path.waypoints_m",
        "'rider' stands inside 'car' at the start",
    ),
    (
        "{lanes_m: [[-1.7, 1.7]]}",
        "{bend: {at_m: 0, length_m: 50, radius_m: 50, turn: lft}}",
        3,
        "road.bend.turn",
        "did you mean 'left'?",
    ),
    (
        "{lanes_m: [[-1.7, 1.7]]}",
        "{bend: {at_m: 0, length_m: 18, radius_m: 50, turn: left}}",
        3,
        "road.bend.transition_m",
        "is more than half of length_m",
    ),
    (
        "{lanes_m: [[-1.7, 1.7]]}",
        "{bend: {at_m: 0, length_m: 168, radius_m: 50, turn: left}}",
        3,
        "road.bend.length_m",
        "by more than 180 degrees at this radius_m",
    ),
    (
        "{lanes_m: [[-1.7, 1.7]]}",
        "{bend: {at_m: 0, length_m: 50, radius_m: {uniform: [24, 50]}, turn: left}}",
        24,
        "background[0]",
        "too near the centre of a bend of 24 m",
    ),
    (
        "      rider:\n        part",
        "      rider:\n        materials: {topp: {reflectivity: 0.04}}\n        part",
        18,
        "systems.car.actors.rider.materials.topp",
        "(allowed: frame, helmet, shoes, skin, top, trousers); did you mean 'top'?",
    ),
    (
        "      rider:\n        part",
        "      rider:\n        materials: {rubber: {reflectivity: 0.04}}\n        part",
        18,
        "systems.car.actors.rider.materials.rubber",
        "the part 'escooter_rider' has no material 'rubber' of its own",
    ),
    (
        "      rider:\n        part",
        "      rider:\n        materials: {top: {reflectivity: 4}}\n        part",
        18,
        "systems.car.actors.rider.materials.top.reflectivity",
        "must be <= 1, is 4",
    ),
    # what a distribution could draw
    (
        "speed_mps: 10",
        "speed_mps: {uniform: [-1, 3]}",
        16,
        "systems.car.actors.car.path.speed_mps",
        "must not be negative, is -1.0 at an end of its distribution",
    ),
    (
        "speed_mps: 10",
        "speed_mps: {normal: {mean: 2, sd: 1}}",
        16,
        "systems.car.actors.car.path.speed_mps",
        "must not be negative, is -1.0 at an end",
    ),
    (
        "speed_mps: 10",
        "speed_mps: {choice: [3, 4, -5, 6]}",
        16,
        "systems.car.actors.car.path.speed_mps",
        "must not be negative, is -5 at an end",
    ),
    ("duration_s: 2", "duration_s: {uniform: [0.01, 2]}", 6, "systems.car.duration_s", "zero frames"),
    (
        "[[20, -3]]",
        "[[{uniform: [0, 40]}, 0]]",
        21,
        "systems.car.actors.rider.path.waypoints_m",
        "stands inside",
    ),
    ("part: car", "part: {choice: [car, cra]}", 12, "systems.car.actors.car.part", "unknown part 'cra'"),
    (
        "count: 2",
        "count: {uniform: [2, 4]}",
        24,
        "background[0].count",
        "must be a whole number, is 2.0 at an end",
    ),
    (
        "offset_ms: 50",
        "offset_ms: {uniform: [5, 2000]}",
        26,
        "faults.timing.trigger_offset_ms.offset_ms",
        "<= 1000",
    ),
    ("speed_mps: 10", "speed_mps: {uniform: [3, 1]}", 16, None, "low 3 is above high 1"),
]


@pytest.mark.parametrize(("old", "new", "line", "field", "says"), CORPUS)
def test_a_broken_file_is_refused_in_one_sentence_with_its_place(
    tmp_path: Path, old: str, new: str, line: int, field: str | None, says: str
) -> None:
    assert old in GOOD
    error = refused(tmp_path, GOOD.replace(old, new, 1))
    text = str(error)
    assert error.file == str(tmp_path / "s.yaml") and text.startswith(f"{error.file}, line {line}")
    assert error.line == line
    if field is not None:
        assert error.field == field and f", {field}: " in text
    assert says in text
    assert "\n" not in text and text[-1] in ".?" and "pydantic" not in text.lower()


@pytest.mark.parametrize("text", ["3", "[1]", "hello", "null"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    assert "is a mapping" in str(refused(tmp_path, text))


BENT = GOOD.replace("{lanes_m: [[-1.7, 1.7]]}", "{bend: {at_m: 0, length_m: 50, radius_m: 40, turn: left}}")


@pytest.mark.parametrize(
    ("old", "new", "line", "field", "says"),
    [
        ("[[20, -3]]", "[[20, -33]]", 21, "waypoints_m[0][1]", "too near the centre of a bend of 40 m"),
        ("[[20, -3]]", "[[20, 3], [30, 4], [40, 3]]", 21, "waypoints_m", "more than two points"),
    ],
)
def test_a_path_that_a_bend_has_no_room_for_is_refused(
    tmp_path: Path, old: str, new: str, line: int, field: str, says: str
) -> None:
    error = refused(tmp_path, BENT.replace(old, new, 1))
    assert error.line == line and error.field == f"systems.car.actors.rider.path.{field}"
    assert says in str(error)


def test_an_unknown_name_gets_the_nearest_and_the_list() -> None:
    with pytest.raises(BadInput) as caught:
        load_scenario("overtake-aproach")
    assert caught.value.hint == "overtake-approach"
    assert caught.value.allowed == ", ".join(list_scenarios())
    assert str(caught.value) == (
        f"unknown scenario 'overtake-aproach' (allowed: {', '.join(list_scenarios())}); "
        "did you mean 'overtake-approach'?"
    )


@pytest.mark.parametrize("name", ["", "nothing.yaml", "a/b", "..", "\x1b[2J", "x" * 500, "a\x00b.yaml"])
def test_a_name_that_leads_nowhere_is_refused_on_one_printable_line(name: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_scenario(name)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 700


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_seed_out_of_range_is_refused(seed: int) -> None:
    with pytest.raises(BadInput, match="seed"):
        load_scenario("static-board").resolve(seed)


# -- rigs and sensors beside a user's file ------------------------------------------------------------------

RIG = """\
name: mine
description: One camera
body: vehicle
sensors:
  lidar: {sensor: os1-64, pose: {xyz_m: [0, 0, 1.8]}}
  cam: {sensor: camera-40deg, pose: {xyz_m: [0, 0, 1.6]}}
pulse_deg: 0
source: judgement
"""


def with_rig(tmp_path: Path, rig: str, name: str = "mine") -> str:
    (tmp_path / "rigs").mkdir(exist_ok=True)
    (tmp_path / "rigs" / f"{name}.yaml").write_text(rig)
    return GOOD.replace("rig: car-six-cameras", f"rig: {name}")


def test_a_rig_beside_the_file_is_found(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(with_rig(tmp_path, RIG))
    family = load_scenario(str(tmp_path / "s.yaml"))
    assert family.rig("mine").description == "One camera"


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("  lidar: {sensor: os1-64, pose: {xyz_m: [0, 0, 1.8]}}\n", "", 4, "has no lidar"),
        ("  cam: {", "  two: {sensor: os1-64, pose: {xyz_m: [0, 0, 1]}}\n  cam: {", 6, "a second lidar"),
        ("  cam: {sensor: camera-40deg, pose: {xyz_m: [0, 0, 1.6]}}\n", "", 4, "has no camera"),
        ("[0, 0, 1.8]", "[0.1, 0, 1.8]", 5, "the ego frame's origin lies below it"),
        ("cam:", "cameras:", 6, "no sensor may be called 'cameras'"),
        ("camera-40deg", "camera-40", 6, "did you mean 'camera-40deg'?"),
        ("1.8]}", "1.8]}, trigger_deg: 3", 5, "counts for triggered cameras only"),
        (
            "camera-40deg, ",
            "camera-78deg-usb, trigger_deg: 3, ",
            7,
            "no camera of this rig waits for a pulse",
        ),
        ("camera-40deg, ", "camera-40deg, trigger_deg: 3, ", 7, "no camera of this rig waits for a pulse"),
        ("pulse_deg: 0\n", "", 6, "waits for a pulse that the rig never sends"),
        ("name: mine", "name: yours", 1, "the rig's name is 'yours', the file's is 'mine'"),
        ("body: vehicle", "body: boat", 3, "allowed: vehicle, rider"),
        ("source: judgement\n", "", 1, "'source' is missing"),
        ("1.6]}", "1.6], rpy_deg: [0, 0]}", 6, "at least 3 values"),
    ],
)
def test_a_rig_whose_parts_do_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, line: int, says: str
) -> None:
    assert old in RIG
    error = refused(tmp_path, with_rig(tmp_path, RIG.replace(old, new, 1)))
    assert error.file is not None and error.file.endswith("rigs/mine.yaml")
    assert error.line == line and says in str(error)


CAMERA = """\
kind: camera
rate_hz: 10
width_px: 960
height_px: 600
fov_deg: 40
trigger: lidar_angle
exposure_ms: 2
stamp: mid_exposure
latency_ms: 30
source: judgement
"""


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("kind: camera", "kind: camra", "did you mean 'camera'?"),
        ("kind: camera\n", "", "a mapping with a 'kind'"),
        ("rate_hz: 10", "rate_hz: 20", "runs at 20 Hz, the lidar that triggers it at 10 Hz"),
        ("exposure_ms: 2", "exposure_ms: 200", "longer than a period of 100 ms"),
        ("latency_ms: 30", "latency_ms: 30\nphase_ms: 3", "counts for trigger free_run only"),
        ("latency_ms: 30", "latency_ms: 30\ndelay_ms: 101", "more than a period of 100 ms"),
        ("lidar_angle", "free_run\ndelay_ms: 3", "counts for trigger lidar_angle only"),
        ("lidar_angle", "free_run\nphase_ms: 101", "more than a period of 100 ms"),
        ("lidar_angle", "free_run\nphase_ms: [9, 3]", "must be low, high with low <= high"),
        ("lidar_angle", "free_run\nphase_ms: [9]", "needs at least 2 values"),
        ("lidar_angle", "free_run\nphase_ms: soon", "must be a number or a list, is 'soon'"),
        ("lidar_angle", "free_run\nphase_ms: -1", "must not be negative, is -1"),
        ("latency_ms: 30", "latency_ms: 30\nreadout_ms: 5", "counts for a rolling shutter only"),
        ("latency_ms: 30", "latency_ms: 30\nshutter: rolling", "needs a read-out time above 0"),
        (
            "latency_ms: 30",
            "latency_ms: 30\nshutter: rolling\nreadout_ms: 99",
            "2 ms of exposure and 99 ms of read-out are longer than a period of 100 ms",
        ),
        ("latency_ms: 30", "latency_ms: 30\nshutter: roling", "did you mean 'rolling'?"),
        ("latency_ms: 30", "latency_ms: 30\nstamp_delay_ms: 9", "counts for stamp arrival only"),
        ("latency_ms: 30", "latency_ms: 30\nstamp_jitter_ms: [1, 2]", "counts for stamp arrival only"),
        ("mid_exposure", "arrival", "has no image before it is read out, 1 ms after mid-exposure"),
        ("mid_exposure", "arrival\nstamp_delay_ms: [0.9, 5]", "has no image before it is read out, 1 ms"),
        ("mid_exposure", "arrival\nstamp_delay_ms: 2000", "more than 1000 ms"),
        ("mid_exposure", "middle", "end_of_readout"),
        (
            "lidar_angle\nexposure_ms: 2\nstamp: mid_exposure",
            "free_run\nexposure_ms: 2\nstamp: trigger",
            "no trigger",
        ),
        ("fov_deg: 40", "fov_deg: 200", "must be < 170, is 200"),
        ("fov_deg: 40", "fov_deg: 40\nmotion_blur_samples: 4", "must be odd"),
        ("exposure_ms: 2", "exposure_ms: 0\nmotion_blur_samples: 3", "needs an exposure_ms above 0"),
        ("fov_deg: 40", "fov_deg: 40\njpeg_quality: 0", "must be >= 1"),
        ("fov_deg: 40", "fov_deg: 40\nnoise: {full_well_e: 0, read_noise_e: 1}", "must be > 0"),
        ("fov_deg: 40", "fov_deg: 40\nnoise: {full_well_e: 9, read_noise: 1}", "read_noise_e"),
        ("width_px: 960", "width_px: 960.0", "must be a whole number"),
        ("source: judgement\n", "", "'source' is missing"),
    ],
)
def test_a_sensor_that_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in CAMERA
    (tmp_path / "sensors").mkdir()
    (tmp_path / "sensors" / "my-cam.yaml").write_text(CAMERA.replace(old, new, 1))
    error = refused(tmp_path, with_rig(tmp_path, RIG.replace("camera-40deg", "my-cam")))
    assert says in str(error) and error.line is not None and error.file is not None


@pytest.mark.parametrize(
    ("sensor", "old", "new", "says"),
    [
        ("gnss-rtk", "phase_ms: [0, 200]", "phase_ms: [0, 201]", "more than a period of 200 ms"),
        ("gnss-rtk", "phase_ms: [0, 200]", "phase_ms: [7, 5]", "must be low, high with low <= high"),
        ("imu-mems", "phase_ms: [0, 10]", "phase_ms: 11", "more than a period of 10 ms"),
        ("imu-mems", "odometer_phase_ms: [0, 20]", "odometer_phase_ms: 21", "more than a period of 20 ms"),
        ("imu-mems", "odometer_rate_hz: 50", "odometer_rate_hz: 0", "must be > 0"),
        ("imu-mems", "accel_bias_mps2: 0.05", "accel_bias_mps2: -1", "must not be negative"),
        ("imu-mems", "accel_bias_mps2: 0.05\n", "", "'accel_bias_mps2' is missing"),
    ],
)
def test_a_gnss_or_imu_that_does_not_fit_is_refused(
    tmp_path: Path, sensor: str, old: str, new: str, says: str
) -> None:
    shipped = (PACKAGE / "sensors" / f"{sensor}.yaml").read_text()
    assert f"\n{old}" in shipped
    (tmp_path / "sensors").mkdir()
    (tmp_path / "sensors" / "mine.yaml").write_text(shipped.replace(f"\n{old}", f"\n{new}", 1))
    rig = RIG.replace("pulse_deg: 0", "  more: {sensor: mine, pose: {xyz_m: [0, 0, 1]}}\npulse_deg: 0")
    error = refused(tmp_path, with_rig(tmp_path, rig))
    assert says in str(error) and error.line is not None and error.file is not None


def test_a_rig_known_twice_is_refused(tmp_path: Path) -> None:
    text = with_rig(tmp_path, RIG.replace("name: mine", "name: wearable-back"), "wearable-back")
    assert "known twice" in str(refused(tmp_path, text))


def test_a_link_out_of_the_files_folder_is_refused(tmp_path: Path) -> None:
    home, away = tmp_path / "home", tmp_path / "away"
    (home / "rigs").mkdir(parents=True)
    away.mkdir()
    (away / "mine.yaml").write_text(RIG)
    (home / "rigs" / "mine.yaml").symlink_to(away / "mine.yaml")
    error = refused(home, GOOD.replace("rig: car-six-cameras", "rig: mine"))
    assert "a link that leaves the folder" in str(error) and error.line == 9


# -- the error itself ---------------------------------------------------------------------------------------


def test_an_error_keeps_its_attributes_between_processes() -> None:
    error = BadInput("wrong", file="f", line=3, field="a.b", allowed="x", hint="y")
    copy = pickle.loads(pickle.dumps(error))
    assert vars(copy) == vars(error) and str(copy) == str(error)


def test_the_sentence_has_place_problem_allowed_and_hint_in_this_order() -> None:
    error = BadInput("unknown key 'x'", file="f.yaml", line=3, field="a.b", allowed="y, z", hint="y")
    assert str(error) == "f.yaml, line 3, a.b: unknown key 'x' (allowed: y, z); did you mean 'y'?"
    assert str(BadInput("wrong")) == "wrong."


def test_the_line_of_a_path_is_that_of_the_nearest_thing_around_it() -> None:
    where = Where(file="f", lines={(): 1, ("a",): 2, ("a", "b"): 3}).at("a")
    assert (where.line(("b",)), where.line(("b", 4)), where.line(("c",)), where.line()) == (3, 3, 2, 2)
    assert where.error("wrong", ("b", 4)).field == "a.b[4]"
    assert dotted(("a", 1, 2, "b")) == "a[1][2].b"


@given(word=st.text(max_size=30))
def test_the_nearest_word_is_one_of_the_known_or_none(word: str) -> None:
    assert nearest(word, ["duration_s", "ego"]) in (None, "duration_s", "ego")
    assert nearest("Duration-S", ["duration_s", "ego"]) == "duration_s"


@given(data=st.data())
def test_a_file_with_any_line_replaced_loads_or_is_refused_and_nothing_else(data: st.DataObject) -> None:
    import tempfile

    lines = GOOD.splitlines()
    index = data.draw(st.integers(0, len(lines) - 1))
    key = re.match(r"\s*(- \{)?[\w.]+:", lines[index])
    start = key.group(0) if key else ""
    word = st.sampled_from(
        ["{}", "[]", "null", "-1", "1e12", "x", "{choice: [1]}", "[[[]]]", "true", "{uniform: 1}"]
    )
    lines[index] = f"{start} {data.draw(word)}"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text("\n".join(lines))
        try:
            load_scenario(str(path))
        except BadInput as error:
            assert error.line is not None and "\n" not in str(error)
