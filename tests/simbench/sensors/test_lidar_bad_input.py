"""LiDAR files that do not fit are refused with one sentence and exit code 2."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from scenarios.errors import BadInput
from scenarios.library import PACKAGE
from scenarios.load import load_scenario
from simbench import world
from simbench.cli import main

SENSOR = """\
kind: lidar
rate_hz: 10
columns: 100
clockwise: true
start_azimuth_deg: 90
elevation_deg: [1, 0, -1]
azimuth_offset_deg: [0, 0, 0]
min_range_m: 0.5
range_at_10_percent_m: 40
range_at_80_percent_m: 120
resolution_m: 0
noise: {high_m: 0.01, medium_m: 0.02, low_m: 0.1}
angle_noise_deg: 0
false_positive_rate: 0
latency_ms: 1
source: a test
"""
RIG = """\
name: mine
description: A LiDAR and a camera
body: vehicle
sensors:
  lidar: {sensor: spinner, pose: {xyz_m: [0, 0, 1.8]}}
  cam: {sensor: camera-40deg, pose: {xyz_m: [0, 0, 1.6]}}
pulse_deg: 0
source: a test
"""
SCENARIO = """\
name: small
description: A car behind a rider
road: {lanes_m: [[-1.7, 1.7]]}
systems:
  car:
    duration_s: 1
    ego: car
    target: rider
    rig: mine
    actors:
      car: {part: car, category: car, path: {waypoints_m: [[0, 0]], speed_mps: 10}}
      rider: {part: escooter_rider, category: rider, path: {waypoints_m: [[20, -3]], speed_mps: 7}}
"""


def written(tmp_path: Path, sensor: str = SENSOR, scenario: str = SCENARIO) -> str:
    for folder, name, text in (("rigs", "mine", RIG), ("sensors", "spinner", sensor)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{name}.yaml").write_text(text)
    path = tmp_path / "small.yaml"
    path.write_text(scenario)
    return str(path)


def refused(path: str) -> str:
    """The one sentence of the command, which ends with code 2."""
    done = CliRunner().invoke(
        main, ["run", path, "--system", "car", "--images", "none"], prog_name="simbench"
    )
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.output
    return " ".join(done.output.split())


def test_the_files_that_the_others_break_are_good(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path)).resolve(0).name == "small"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("offset_deg: [0, 0, 0]", "offset_deg: [0, 0]", "azimuth_offset_deg: has 2 values for 3 beams"),
        ("elevation_deg: [1, 0, -1]", "elevation_deg: []", "elevation_deg: needs at least one beam"),
        ("elevation_deg: [1, 0, -1]", "elevation_deg: [1, 0, -90]", "must lie between -90 and 90"),
        ("columns: 100", "columns: 0", "columns: must be >= 1, is 0"),
        ("columns: 100", "columns: 100\ncolumn_us: 1001", "100 columns longer than a turn of 100000 us"),
        ("latency_ms: 1", "latency_ms: 1\nfire_delay_us: [0, 1]", "fire_delay_us: has 2 values for 3 beams"),
        ("latency_ms: 1", "latency_ms: 1\nfire_delay_us: [0, 1, 1000]", "not below the 1000 us from column"),
        (
            "latency_ms: 1",
            "latency_ms: 1\nfire_delay_us: [1, 2, 3]",
            "must be 0 for the beam that fires first",
        ),
        ("latency_ms: 1", "latency_ms: 1\ndivergence_deg: [0.1, 0.1]", "merge_m: must be above 0"),
        ("latency_ms: 1", "latency_ms: 1\ndivergence_deg: [11, 1]", "divergence_deg: must be at most 10"),
        ("latency_ms: 1", "latency_ms: 1\ndivergence_deg: 0.1", "divergence_deg: must be a list, is 0.1"),
        ("latency_ms: 1", "latency_ms: 1\ndropout_rate: 1.1", "dropout_rate: must be <= 1, is 1.1"),
        ("latency_ms: 1", "latency_ms: 1\noff: [drop_out]", "did you mean 'dropout'?"),
        ("low_m: 0.1}", "low_m: 0.1, high_strength: 3}", "high_strength: must be above medium_strength"),
    ],
)
def test_a_lidar_that_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in SENSOR
    output = refused(written(tmp_path, SENSOR.replace(old, new, 1)))
    assert says in output, output
    assert "spinner.yaml" in output


def test_a_part_outside_the_folder_of_parts_is_refused(tmp_path: Path) -> None:
    output = refused(written(tmp_path, scenario=SCENARIO.replace("part: car", "part: ../parts/car", 1)))
    assert "is no name" in output, output


def test_a_part_with_a_shape_that_rays_cannot_meet_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "blob.xml").write_text(
        '<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>'
        '<body name="root"><geom name="dent" type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    monkeypatch.setattr(world, "PARTS", parts)
    with pytest.raises(BadInput, match="part 'blob': geom 'dent' is a mesh; rays can meet a plane, sphere"):
        world.part_info("blob")


def test_no_shipped_part_is_a_link_out_of_the_package() -> None:
    for path in (PACKAGE / "parts").glob("*.xml"):
        assert path.resolve().is_relative_to(PACKAGE)
