"""What is read from KITTI's layouts is what was written, by KITTI's own formulas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusion.camera import project_points
from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from scenarios.fault_set import FaultSet
from scenarios.recorded import ON_RECORDINGS
from simbench.formats.folder import Folder, Line
from simbench.formats.kitti import listed, open_kitti
from simbench.formats.kitti_raw import timestamps_ns
from simbench.formats.labels import (
    CATEGORY,
    OUTSIDE_SHARE,
    SIZES,
    VISIBLE_SHARE,
    object_labels,
    tracking_labels,
)
from simbench.formats.recorded import Player, Recorded
from simbench.recording import Recording
from tests.simbench.formats import mini_kitti as mini

FRAMES = 7


def play(root: Path, number: int = 0, **options: object) -> Recorded:
    drive = open_kitti(f"kitti:{root}").drive(number, options.pop("span", None))  # type: ignore[arg-type]
    images = bool(options.pop("images", False))
    return Player(drive, FaultSet(), **options).play(images=images)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitti")
    mini.write_object(root / "object", {4: mini.SCENE, 9: (mini.RIDER,)})
    mini.write_tracking(root / "tracking", mini.drive(FRAMES))
    mini.write_raw(root / "raw", mini.drive(FRAMES))
    return root


LAYOUTS = [("object", 4), ("tracking", 0), ("raw", 5)]


@pytest.fixture(scope="module", params=LAYOUTS, ids=lambda p: p[0])
def read(request: pytest.FixtureRequest, data: Path) -> tuple[str, Recorded]:
    layout, number = request.param
    return layout, play(data / layout, number)


def scans(recording: Recording) -> list[LidarScan]:
    return [m for m in recording.messages if isinstance(m, LidarScan)]


def detections(recording: Recording) -> list[Detections]:
    return [m for m in recording.messages if isinstance(m, Detections)]


# -- geometry ---------------------------------------------------------------------------------------------


def test_a_point_appears_where_the_data_sets_own_formula_puts_it(read: tuple[str, Recorded]) -> None:
    told = read[1].recording.calibration
    points = np.random.default_rng(1).uniform((4, -3, -1.7), (40, 3, 1), (200, 3))
    uv = project_points(points, told.T_camera_lidar("cam-2", "lidar"), told.cameras["cam-2"])
    np.testing.assert_allclose(uv - 0.5, mini.project(points), atol=1e-5)  # our pixels start at the corner


def test_objects_stand_where_they_were_put(read: tuple[str, Recorded]) -> None:
    layout, found = read
    truth = found.recording.truth
    boxes = mini.SCENE if layout == "object" else mini.drive(FRAMES)[0]
    assert len(truth.objects) == 2
    for info, box in zip(truth.objects, boxes, strict=True):
        assert info.category == box.category
        assert info.size_m == pytest.approx(box.size_m, abs=1e-5)
        rotation, centre = truth.poses.object_centre(info.object_id, np.array([0]))
        wanted = np.add(box.xyz_m, (0.0, 0.0, 0.5 * box.size_m[2] + mini.HEIGHT_M))
        np.testing.assert_allclose(centre[0], wanted, atol=0.02)  # the camera's frame is tilted by a degree
        heading = np.arctan2(rotation[0, 1, 0], rotation[0, 0, 0])
        assert heading == pytest.approx(box.heading_rad, abs=2e-3)
        assert rotation[0, 2, 2] > np.cos(np.deg2rad(1.5))
        np.testing.assert_allclose(rotation[0] @ rotation[0].T, np.eye(3), atol=1e-12)


def test_points_belong_to_the_box_that_holds_them(read: tuple[str, Recorded]) -> None:
    layout, found = read
    boxes = [mini.SCENE] if layout == "object" else mini.drive(FRAMES)
    truth = found.recording.truth
    name = {o.object_id: o.category for o in truth.objects}
    for scan, labels, here in zip(scans(found.recording), truth.scans, boxes, strict=True):
        points, track = mini.sweep(here)
        np.testing.assert_array_equal(scan.xyz_m, points[:, :3])
        np.testing.assert_array_equal(scan.intensity, points[:, 3])
        category = {box.track: box.category for box in here}
        ours = np.array([name.get(i, "") for i in labels.object_id])
        real = np.array([category.get(t, "") for t in track])
        for kind in category.values():
            assert np.mean(ours[real == kind] == kind) > 0.97
            at_the_foot = (ours == kind) & (real != kind)
            assert (points[at_the_foot, 2] < 0.05 - mini.HEIGHT_M).all()


def test_a_point_in_two_boxes_belongs_to_the_smaller_one(tmp_path: Path) -> None:
    van = mini.Box(
        track=1, category="van", size_m=(6.0, 3.0, 2.4), heading_rad=0.0, xyz_m=(9.0, -2.5, -mini.HEIGHT_M)
    )  # fmt: skip
    owner = []
    for number, boxes in enumerate(((van, mini.RIDER), (mini.RIDER, van))):
        root = mini.write_object(tmp_path / str(number), {0: boxes})
        mini.sweep((mini.RIDER,))[0].tofile(root / "velodyne/000000.bin")  # the rider is what reflects
        truth = play(root).recording.truth
        name = {o.object_id: o.category for o in truth.objects}
        owner.append([name.get(i, "") for i in truth.scans[0].object_id])
    assert owner[0] == owner[1]
    assert owner[0].count("rider") > 50
    assert "van" in owner[0]  # the ground beside the rider


def test_what_the_labellers_left_out_is_neither_detected_nor_eligible(tmp_path: Path) -> None:
    ignored = replace(mini.CAR, truncated=2)
    root = mini.write_tracking(tmp_path, [(ignored, mini.RIDER)] * 2)
    recording = play(root).recording
    assert all([b.category for b in d.boxes] == ["rider"] for d in detections(recording))
    (shown, _) = recording.truth.images[0].boxes
    assert (shown.visible_px, shown.visible_fraction) == (None, 0.0)


def test_labels_are_the_detections(read: tuple[str, Recorded]) -> None:
    layout, found = read
    boxes = [mini.SCENE] if layout == "object" else mini.drive(FRAMES)
    truth = found.recording.truth
    for message, image, here in zip(detections(found.recording), truth.images, boxes, strict=True):
        assert [d.category for d in message.boxes] == [box.category for box in here]
        for detection, box in zip(message.boxes, here, strict=True):
            np.testing.assert_allclose(np.array(detection.box_px) - 0.5, box.box_px, atol=0.6)
            assert detection.confidence == 1.0
        behind = [truth.objects[i].category for i in image.detection_object_id]
        assert behind == [box.category for box in here]
        for shown in image.boxes:
            assert shown.visible_fraction == 1.0


def test_track_ids_tell_nothing_and_stay_with_their_object(data: Path) -> None:
    recording = play(data / "tracking").recording
    by_object: dict[int, set[int]] = {}
    for message, image in zip(detections(recording), recording.truth.images, strict=True):
        for box, object_id in zip(message.boxes, image.detection_object_id, strict=True):
            by_object.setdefault(object_id, set()).add(box.track_id)
    assert all(len(ids) == 1 for ids in by_object.values())
    assert {3, 7}.isdisjoint(set().union(*by_object.values()))


def test_rings_are_found_and_times_are_not_made_up(read: tuple[str, Recorded]) -> None:
    for scan in scans(read[1].recording):
        x, y, z = scan.xyz_m.astype(float).T
        elevation_deg = np.rad2deg(np.arctan2(z, np.hypot(x, y)))
        beam = np.argmin(np.abs(elevation_deg[:, None] - np.array(mini.RINGS)), axis=1)
        np.testing.assert_array_equal(scan.ring, np.unique(beam, return_inverse=True)[1])
        assert not scan.offset_ns.any()
    for labels, scan in zip(read[1].recording.truth.scans, scans(read[1].recording), strict=True):
        assert (labels.fire_ns == scan.stamp_ns).all()
        assert np.isnan(labels.incidence_rad).all()
        np.testing.assert_allclose(labels.true_range_m, np.linalg.norm(scan.xyz_m.astype(float), axis=1))


# -- layouts ----------------------------------------------------------------------------------------------


def test_every_frame_of_the_object_layout_is_a_recording_of_its_own(data: Path) -> None:
    folder = open_kitti(f"kitti:{data / 'object'}")
    assert folder.layout == "object"
    assert list(folder.names) == [4, 9]
    found = play(data / "object", 9)
    assert found.scene.name == "kitti-object"
    assert [o.name for o in found.scene.objects] == ["000009-rider-0"]
    assert len(scans(found.recording)) == len(detections(found.recording)) == 1


def test_a_sequence_turns_ten_times_a_second(data: Path) -> None:
    recording = play(data / "tracking").recording
    assert [s.stamp_ns for s in scans(recording)] == [100_000_000 * f for f in range(FRAMES)]
    assert [d.stamp_ns for d in detections(recording)] == [100_000_000 * f for f in range(FRAMES)]
    assert recording.truth.period_ns == 100_000_000


def test_a_drive_has_the_times_that_were_recorded(data: Path) -> None:
    recording = play(data / "raw", 5).recording
    period_ns = round(mini.RAW_PERIOD_S * 1e9)
    assert [s.stamp_ns for s in scans(recording)] == [period_ns * f for f in range(FRAMES)]
    assert [d.stamp_ns for d in detections(recording)] == [period_ns * f - 2_000_000 for f in range(FRAMES)]
    assert recording.truth.period_ns == period_ns
    ego = [m for m in recording.messages if isinstance(m, EgoMotion)]
    assert [m.stamp_ns for m in ego] == [period_ns * f + 1_000_000 for f in range(FRAMES)]


def test_between_labels_objects_move_evenly_and_beyond_them_they_stay(data: Path) -> None:
    truth = play(data / "tracking").recording.truth
    rider = next(o.object_id for o in truth.objects if o.category == "rider")
    t = np.array([-50, 0, 50, 100, 100 * (FRAMES - 1), 100 * FRAMES]) * 1_000_000
    _, centre = truth.poses.object_centre(rider, t)
    x = centre[:, 0] - centre[1, 0]
    np.testing.assert_allclose(x, [0, 0, 0.175, 0.35, 0.35 * (FRAMES - 1), 0.35 * (FRAMES - 1)], atol=2e-3)


def test_an_object_that_left_is_in_no_box_and_owns_no_point(data: Path) -> None:
    truth = play(data / "tracking").recording.truth
    car = next(o.object_id for o in truth.objects if o.category == "car")
    assert all(any(b.object_id == car for b in image.boxes) for image in truth.images[:-1])
    assert not any(b.object_id == car for b in truth.images[-1].boxes)
    assert not (truth.scans[-1].object_id == car).any()
    assert (truth.scans[-2].object_id == car).any()


def test_the_cars_own_motion_is_turned_into_its_axes(data: Path) -> None:
    for layout, number in LAYOUTS[1:]:
        recording = play(data / layout, number).recording
        ego = [m for m in recording.messages if isinstance(m, EgoMotion)]
        assert len(ego) == FRAMES
        for frame, message in enumerate(ego):
            np.testing.assert_allclose(message.velocity_mps, mini.IMU_R @ [5.0 + frame, 0.1, 0.0], atol=1e-6)
            np.testing.assert_allclose(message.rate_radps, mini.IMU_R @ [0.01, 0.02, 0.1], atol=1e-6)
            np.testing.assert_allclose(message.specific_force_mps2, mini.IMU_R @ [0.2, 0.3, 9.81], atol=1e-6)


def test_a_sequence_without_oxts_has_no_ego_motion(tmp_path: Path) -> None:
    root = mini.write_tracking(tmp_path, mini.drive(2), oxts=False)
    assert not [m for m in play(root).recording.messages if isinstance(m, EgoMotion)]


def test_frames_pick_a_part_of_a_sequence(data: Path) -> None:
    found = play(data / "tracking", span=(2, 4))
    assert found.scene.frames == (2, 4)
    assert [s.stamp_ns for s in scans(found.recording)] == [0, 100_000_000, 200_000_000]
    np.testing.assert_array_equal(
        scans(found.recording)[0].xyz_m, mini.sweep(mini.drive(FRAMES)[2])[0][:, :3]
    )


def test_a_frame_without_a_sweep_is_left_out(data: Path, tmp_path: Path) -> None:
    root = mini.write_tracking(tmp_path, mini.drive(4))
    (root / "velodyne/0000/000001.bin").unlink()
    stamps = [s.stamp_ns for s in scans(play(root).recording)]
    assert stamps == [0, 200_000_000, 300_000_000]


@pytest.mark.parametrize(("layout", "number"), LAYOUTS)
def test_images_come_with_their_boxes_where_a_pipeline_wants_them(
    data: Path, layout: str, number: int
) -> None:
    recording = play(data / layout, number, images=True).recording
    images = [m for m in recording.messages if isinstance(m, CameraImage)]
    assert [i.stamp_ns for i in images] == [d.stamp_ns for d in detections(recording)]
    first = 4 if layout == "object" else 0
    np.testing.assert_array_equal(images[0].rgb, mini.image(first))


def test_what_belongs_together_arrives_before_the_sweep_that_waits_for_it(read: tuple[str, Recorded]) -> None:
    kinds = [type(m).__name__ for m in read[1].recording.messages if not isinstance(m, EgoMotion)]
    assert kinds == ["Detections", "LidarScan"] * (len(kinds) // 2)


def test_reading_twice_gives_the_same_and_the_hash_tells_a_change(data: Path, tmp_path: Path) -> None:
    a, b = (play(data / "tracking").scene for _ in range(2))
    assert a == b
    assert len(a.sha256) == 64
    root = mini.write_tracking(tmp_path, mini.drive(FRAMES, step_m=0.36))
    assert play(root).scene.sha256 != a.sha256


# -- the detector model -----------------------------------------------------------------------------------


def test_the_detector_model_misses_and_invents(tmp_path: Path) -> None:
    crowd = tuple(
        mini.Box(
            track=i, category="pedestrian", size_m=(0.8, 0.6, 1.7), heading_rad=0.0,
            xyz_m=(22.0 + 4 * i, -8.0 + 1.5 * i, -mini.HEIGHT_M),
        )
        for i in range(12)
    )  # fmt: skip
    root = mini.write_tracking(tmp_path, [crowd] * 12, oxts=False)
    by_label, by_model = (play(root, boxes=boxes).recording for boxes in ("labels", "model"))
    assert all(len(d.boxes) == 12 for d in detections(by_label))
    found = [len(d.boxes) for d in detections(by_model)]
    assert 0 < sum(found) < 12 * 12
    confidence = [b.confidence for d in detections(by_model) for b in d.boxes]
    assert 0.5 <= min(confidence) < max(confidence) <= 1.0
    again = play(root, boxes="model").recording
    assert [d.boxes for d in detections(again)] == [d.boxes for d in detections(by_model)]
    other = play(root, boxes="model", seed=5).recording
    assert [d.boxes for d in detections(other)] != [d.boxes for d in detections(by_model)]


# -- labels, by hand --------------------------------------------------------------------------------------


def lines(*texts: str) -> list[Line]:
    return [Line(file="x.txt", number=i, words=tuple(t.split())) for i, t in enumerate(texts, 1)]


CAR = "Car {t} {o} 1.85 387.63 181.54 423.81 203.12 1.67 1.87 3.69 -16.53 2.39 58.49 1.57"


def test_a_label_line_by_hand() -> None:
    (label,) = object_labels(lines(CAR.format(t="0.00", o="0")), 1)
    assert (label.category, label.track, label.visible_fraction) == ("car", 0, 1.0)
    assert label.box_px == (387.63, 181.54, 423.81, 203.12)
    assert label.size_m == (3.69, 1.87, 1.67)  # the file says height, width, length
    assert label.bottom_m == (-16.53, 2.39, 58.49)
    assert label.yaw_rad == 1.57


@pytest.mark.parametrize(
    ("occluded", "truncated", "share"),
    [("0", "0.00", 1.0), ("1", "0.00", 0.6), ("2", "0.00", 0.3), ("3", "0.00", 1.0), ("1", "0.50", 0.3)],
)
def test_the_visible_share_follows_from_occlusion_and_truncation(
    occluded: str, truncated: str, share: float
) -> None:
    (label,) = object_labels(lines(CAR.format(t=truncated, o=occluded)), 0)
    assert label.visible_fraction == pytest.approx(share)
    assert label.occlusion_known == (occluded != "3")


@pytest.mark.parametrize(("truncated", "share"), [("0", 1.0), ("1", 0.5), ("2", 0.0)])
def test_the_tracking_layout_has_levels_of_truncation(truncated: str, share: float) -> None:
    (label,) = tracking_labels(lines("12 5 " + CAR.format(t=truncated, o="0")))
    assert (label.frame, label.track) == (12, 5)
    assert label.visible_fraction == pytest.approx(share)


def test_dont_care_is_no_object_and_a_score_is_ignored() -> None:
    found = object_labels(lines(mini.DONT_CARE, CAR.format(t="0", o="0") + " 0.93"), 0)
    assert [label.category for label in found] == ["car"]
    assert found[0].track == 1  # its number in the file


def test_every_category_has_a_size() -> None:
    assert set(CATEGORY.values()) == set(SIZES)


def test_numbers_are_listed_as_ranges() -> None:
    assert listed((0, 1, 2, 5)) == "0-2, 5"
    assert listed(tuple(range(0, 40, 2))).endswith("14, ...")


# -- the document -----------------------------------------------------------------------------------------


def test_the_document_names_every_fault_field_category_and_layout() -> None:
    text = (Path(__file__).parents[3] / "docs" / "kitti.md").read_text(encoding="utf-8")
    for name, spec in ON_RECORDINGS.items():
        (row,) = (line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
        for field in spec.model_fields:
            assert f"`{field}`" in row, f"{name}: {field}"
    for word in ("Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc"):
        assert word in text and word in CATEGORY
    for share in (*VISIBLE_SHARE, *OUTSIDE_SHARE):
        assert f"{share:g}" in text


def test_a_time_has_as_many_digits_as_it_likes(tmp_path: Path) -> None:
    texts = ("2011-09-26 13:02:25.000000007", "2011-09-26 13:02:25.5", "2011-09-27 00:00:00")
    (tmp_path / "t.txt").write_text("\n".join(texts))
    first, second, third = timestamps_ns(Folder.open(str(tmp_path)), "t.txt")
    assert second - first == 499_999_993
    assert third - second == (11 * 3600 - 2 * 60 - 25) * 10**9 - 500_000_000
