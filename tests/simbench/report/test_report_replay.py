"""What the report makes again from a job is what the job had: pictures, scans, and the method's choice."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from fusion.messages import CameraImage, LidarScan
from simbench.case import Images, Job, JobResult
from simbench.report.page import write_report
from simbench.report.pictures import FOR_THE_READER, Replay, explain_view, take_pictures
from simbench.report.video import encode, find_video, shown_views, write_video
from simbench.run import run_job
from simbench.sensors.gl import RenderingUnavailable
from simbench.stage import pictures, record, stage

PIPELINES = ("static_projection", "probabilistic")
SHORT = """
name: short
description: A car behind a rider for four tenths of a second
road: {kind: lot, width_m: 40, lanes_m: [[-1.7, 1.7]]}
systems:
  car:
    duration_s: 0.4
    ego: car
    target: rider
    rig: car-six-cameras
    actors:
      car: {part: car, category: car, path: {waypoints_m: [[0, 0]], heading_deg: 0, speed_mps: 12}}
      rider:
        part: escooter_rider
        category: rider
        path: {waypoints_m: [[14, -3]], heading_deg: 0, speed_mps: 7}
background:
  - {part: car, category: car, count: 1, area_m: [20, 6, 40, 9], align_deg: 0}
"""


@contextmanager
def drawing() -> Iterator[None]:
    try:
        yield
    except RenderingUnavailable as why:
        pytest.skip(str(why))


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Job:
    path = tmp_path_factory.mktemp("scenario") / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    faults = ("timing.trigger_offset_ms=30", "calibration.rotation_deg=1.5")
    return Job(
        scenario=str(path), system="car", seed=3, pipelines=PIPELINES, faults=faults, size_px=(480, 300)
    )


@pytest.fixture(scope="module")
def shaken(job: Job) -> Job:
    return replace(job, faults=(*job.faults, "motion.vibration_deg=1", "motion.flex_deg=0.5"))


@pytest.fixture(scope="module")
def result(job: Job) -> JobResult:
    found = run_job(job)
    assert found.views
    return found


def test_scans_are_made_again_bit_by_bit(shaken: Job) -> None:
    replay = Replay(shaken)
    scans = [m for m in record(shaken, stage(shaken)).recording.messages if isinstance(m, LidarScan)]
    for scan in scans[:2]:
        again = replay.scan(scan.seq)
        np.testing.assert_array_equal(again.xyz_m, scan.xyz_m)
        np.testing.assert_array_equal(again.offset_ns, scan.offset_ns)


@pytest.mark.parametrize("images", ["raycast", "gl"])
def test_pictures_are_made_again_bit_by_bit(shaken: Job, images: Images) -> None:
    """As the camera took them, but for what is left out for the reader: here the sensor has none of it."""
    with drawing():
        staged = stage(shaken)
        cameras = {n: c.model_copy(update=FOR_THE_READER) for n, c in staged.rig.cameras.items()}
        plain = replace(staged, rig=replace(staged.rig, cameras=cameras))
        asked = replace(shaken, images=images, pipelines=("tests.simbench.report.make:Watcher",))
        with pictures(asked, plain) as picture:
            recording = record(shaken, plain, picture).recording
        taken = {(m.sensor, m.seq): m.rgb for m in recording.messages if isinstance(m, CameraImage)}
        true = next(t for t in recording.truth.images if t.sensor == "cam-front" and t.seq == 2)
        key = ("cam-front", true.capture_ns)
        again = take_pictures(Replay(shaken), [key], images)[key]
    assert again.std() > 5
    np.testing.assert_array_equal(again, taken["cam-front", 2])


def test_the_explained_choice_is_what_the_method_mapped(job: Job, result: JobResult) -> None:
    replay = Replay(job)
    compared = 0
    for view in result.views:
        found = explain_view(replay, view, "probabilistic")
        if found is None:
            assert view.box_px is None
            continue
        chosen = np.empty(0) if found.chosen is None else found.candidates[found.chosen].distance_m
        mapped = view.distance_m[view.mapped["probabilistic"]]
        np.testing.assert_allclose(np.sort(chosen), np.sort(mapped), rtol=1e-6)
        compared += len(chosen) > 0
    assert compared


def test_a_pipeline_without_six_steps_is_not_explained(job: Job, result: JobResult) -> None:
    assert explain_view(Replay(job), result.views[0], "static_projection") is None


def test_without_pictures_the_page_shows_points_on_a_plain_ground(result: JobResult, tmp_path: Path) -> None:
    path = write_report([result], tmp_path, command="x", images="none", environment={})
    text = path.read_text(encoding="utf-8")
    assert text.count('<svg class="crop"') >= 2 and 'class="outline"' in text
    assert "<image" not in text and "Pictures are finer" not in text
    assert "Step 3: modes of the distance" in text and "S*" in text


@pytest.mark.parametrize("images", ["raycast", "gl"])
def test_with_pictures_the_page_holds_them_and_stays_small(
    result: JobResult, tmp_path: Path, images: Images
) -> None:
    with drawing():
        path = write_report([result], tmp_path, command="x", images=images, environment={})
    text = path.read_text(encoding="utf-8")
    assert text.count('<image href="data:image/jpeg;base64,') == text.count('<svg class="crop"') >= 2
    assert text.count("Pictures are finer than the camera&#39;s, in colour") == 1
    assert ("without noise, blur, JPEG" in text) == (images == "raycast")
    assert len(text) < 5_000_000


def test_the_video_has_a_frame_per_scan_and_plays_four_times_slower(
    result: JobResult, tmp_path: Path
) -> None:
    av = pytest.importorskip("av")
    path = write_video(result, tmp_path)
    assert find_video(tmp_path, "short", "car", 3) == path
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "vp9"
        assert stream.average_rate == Fraction(5, 2)
        decoded = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(decoded) == len(shown_views(result.views))
    assert decoded[0].shape[0] % 2 == decoded[0].shape[1] % 2 == 0
    assert decoded[0].std() > 20
    first = path.read_bytes()
    assert write_video(result, tmp_path).read_bytes() == first


def test_what_is_encoded_is_decoded(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    shades = [40, 120, 200]
    path = tmp_path / "x.webm"
    encode(iter([np.full((64, 96, 3), s, dtype=np.uint8) for s in shades]), path, Fraction(5, 2))
    with av.open(str(path)) as container:
        decoded = [frame.to_ndarray(format="rgb24").mean() for frame in container.decode(video=0)]
    np.testing.assert_allclose(decoded, shades, atol=4)
    with pytest.raises(ValueError, match="at least one picture"):
        encode(iter(()), path, Fraction(5, 2))


def test_a_video_needs_a_target_in_view(result: JobResult, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="target in view"):
        write_video(replace(result, views=()), tmp_path)
