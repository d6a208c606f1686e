"""A recording as a ROS 2 bag, looked at with two readers of other projects: rosbags and mcap_ros2."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from fusion.geometry import Transform, rotation_rpy
from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from scenarios.errors import BadInput
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.bag import write_bag, write_ros2
from simbench.formats.ros2.foxglove import layout
from simbench.formats.ros2.names import EPOCH_S
from simbench.formats.ros2.truth import truth_messages
from simbench.recording import Recording
from simbench.truth import PoseSource, Truth
from tests.simbench.formats.ros2_drives import SIZE_PX, drive, shifted
from tests.simbench.formats.ros2_foreign import typestore

EPOCH_NS = EPOCH_S * 10**9
Read = dict[str, list[tuple[int, Any]]]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ros2") / "a-drive"
    write_bag(drive(), folder)
    return folder


@pytest.fixture(scope="module")
def read(bag: Path) -> Read:
    """Everything, by rosbags: log time and message by topic."""
    found = defaultdict(list)
    with AnyReader([bag], default_typestore=typestore()) as reader:
        for connection, log_ns, raw in reader.messages():
            found[connection.topic].append((log_ns, reader.deserialize(raw, connection.msgtype)))
    return found


def of(kind: type, sensor: str | None = None) -> list[Any]:
    return [m for m in drive().messages if isinstance(m, kind) and sensor in (None, m.sensor)]


def time_ns(header: Any) -> int:
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def test_all_messages_are_there_and_counted(bag: Path, read: Read) -> None:
    counts = write_bag(drive(), bag)
    assert {topic: len(messages) for topic, messages in read.items()} == counts
    sent = Counter(type(m).__name__ for m in drive().messages)
    got = Counter[str]()
    for topic, messages in read.items():
        got[messages[0][1].__msgtype__] += len(messages) if not topic.startswith("/truth") else 0
    assert got[ros.CLOUD] == sent["LidarScan"] == 4
    assert got[ros.COMPRESSED_IMAGE] == sent["CameraImage"] == got[ros.DETECTIONS] == sent["Detections"]
    assert got[ros.IMU] == got[ros.TWIST] == sent["EgoMotion"]
    assert got[ros.CAMERA_INFO] == sent["CameraImage"] + 6  # one at the start, one beside every image


def test_clouds_are_equal_bit_by_bit(read: Read) -> None:
    scans = of(LidarScan)
    assert sum(len(scan.xyz_m) for scan in scans) > 100
    for scan, (log_ns, cloud) in zip(scans, read["/lidar/points"], strict=True):
        assert (time_ns(cloud.header), log_ns) == (scan.stamp_ns + EPOCH_NS, scan.arrival_ns + EPOCH_NS)
        assert cloud.header.frame_id == "lidar" and cloud.is_dense and not cloud.is_bigendian
        assert (cloud.height, cloud.width, cloud.row_step) == (1, len(scan.xyz_m), len(cloud.data))
        rows = cloud.data.reshape(-1, cloud.point_step)
        columns = {
            f.name: np.ascontiguousarray(rows[:, f.offset : f.offset + size]).view(dtype)[:, 0]
            for f in cloud.fields
            for dtype, size in [{7: ("<f4", 4), 6: ("<u4", 4), 4: ("<u2", 2)}[f.datatype]]
        }
        assert np.stack([columns[k] for k in "xyz"], axis=1).tobytes() == scan.xyz_m.tobytes()
        assert columns["intensity"].tobytes() == scan.intensity.tobytes()
        assert np.array_equal(columns["t"], scan.offset_ns) and np.array_equal(columns["ring"], scan.ring)


def test_images_are_equal_pixel_by_pixel(read: Read) -> None:
    for camera in drive().calibration.cameras:
        topic = f"/{camera.replace('-', '_')}/image/compressed"
        for image, (log_ns, told) in zip(of(CameraImage, camera), read[topic], strict=True):
            bgr = cv2.imdecode(told.data, cv2.IMREAD_UNCHANGED)
            assert told.format == "png" and np.array_equal(bgr[..., ::-1], image.rgb)
            assert (time_ns(told.header), log_ns) == (image.stamp_ns + EPOCH_NS, image.arrival_ns + EPOCH_NS)


def test_boxes_are_equal_to_rounding_and_their_corners_exactly(read: Read) -> None:
    seen = 0
    for camera in drive().calibration.cameras:
        topic = f"/{camera.replace('-', '_')}/detections"
        told = zip(of(Detections, camera), read[topic], read[f"{topic}/corners"], strict=True)
        for sent, (_, message), (_, corners) in told:
            assert time_ns(message.header) == sent.stamp_ns + EPOCH_NS
            exact = corners.data.reshape(-1, 4)
            for box, one, corner in zip(sent.boxes, message.detections, exact, strict=True):
                x, y = one.bbox.center.position.x, one.bbox.center.position.y
                w, h = one.bbox.size_x, one.bbox.size_y
                rounded = (x - w / 2, y - h / 2, x + w / 2, y + h / 2)
                assert rounded == pytest.approx(box.box_px, abs=1e-12)
                assert tuple(corner) == box.box_px
                assert (one.id, one.results[0].hypothesis.class_id) == (str(box.track_id), box.category)
                assert one.results[0].hypothesis.score == box.confidence
                seen += 1
    assert seen > 20


def test_the_imu_and_the_odometer_are_equal_bit_by_bit(read: Read) -> None:
    told = zip(of(EgoMotion), read["/ego/imu"], read["/ego/imu/odometry_velocity"], strict=True)
    for sent, (_, imu), (_, twist) in told:
        w, a, v = imu.angular_velocity, imu.linear_acceleration, twist.twist.linear
        assert [w.x, w.y, w.z] == sent.rate_radps.tolist()
        assert [a.x, a.y, a.z] == sent.specific_force_mps2.tolist()
        assert [v.x, v.y, v.z] == sent.velocity_mps.tolist()
        assert imu.header.frame_id == twist.header.frame_id == "ego"
        assert imu.orientation_covariance[0] == -1.0  # there is no orientation


def test_camera_info_counts_pixels_from_the_centre_of_the_first(read: Read) -> None:
    camera = drive().calibration.cameras["cam-front"]
    info = read["/cam_front/camera_info"][0][1]
    assert (info.width, info.height) == SIZE_PX == (camera.width_px, camera.height_px)
    assert info.k[2] == camera.cx_px - 0.5 == 23.5  # the middle of 48 columns, counted 0 to 47
    assert np.array_equal(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3))
    assert info.distortion_model == "plumb_bob" and len(info.d) == 5
    # a point straight ahead of the 11th pixel's centre lands there, by OpenCV's own convention
    xyz = np.array([[(10 - info.k[2]) / info.k[0], (4 - info.k[5]) / info.k[4], 1.0]])
    uv, _ = cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), info.k.reshape(3, 3), info.d)
    assert uv[0, 0] == pytest.approx([10.0, 4.0])
    assert camera.project(xyz)[0] == pytest.approx([10.5, 4.5])


def matrix(T: Any) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    r, t = T.rotation, T.translation
    found = np.eye(4)
    found[:3, :3] = Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix()
    found[:3, 3] = [t.x, t.y, t.z]
    return found


def as_matrix(T: Transform) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = T.rotation, T.translation_m
    return found


def test_tf_static_is_the_calibration_as_told_and_the_true_one_is_truth(read: Read) -> None:
    told = {t.child_frame_id: t for t in read["/tf_static"][0][1].transforms}
    true = {t.child_frame_id: t for t in read["/truth/tf_static"][0][1].transforms}
    recording = drive()
    for sensor, T in recording.calibration.T_ego_sensor.items():
        assert told[sensor].header.frame_id == "ego"
        assert matrix(told[sensor].transform) == pytest.approx(as_matrix(T), abs=1e-12)
        really = recording.truth.calibration.T_ego_sensor[sensor]
        assert matrix(true[f"truth/{sensor}"].transform) == pytest.approx(as_matrix(really), abs=1e-12)
    apart = [np.abs(matrix(told[s].transform) - matrix(true[f"truth/{s}"].transform)).max() for s in told]
    assert max(apart) > 0.01  # two degrees: they are not the same


def test_true_boxes_stand_where_the_objects_are_when_a_scan_begins(read: Read) -> None:
    truth = drive().truth
    begins = [int(scan.fire_ns.min()) for scan in truth.scans]
    assert [log_ns - EPOCH_NS for log_ns, _ in read["/truth/markers"]][:-1] == begins
    log_ns, markers = read["/truth/markers"][2]
    moved = {t.child_frame_id: matrix(t.transform) for t in read["/truth/tf"][2][1].transforms}
    assert len(markers.markers) == len(truth.objects) == len(moved) - 1
    t_ns = np.array([log_ns - EPOCH_NS])
    for info, cube in zip(truth.objects, markers.markers, strict=True):
        assert (cube.id, cube.ns, cube.type, cube.action) == (info.object_id, info.category, 1, 0)
        assert (cube.scale.x, cube.scale.y, cube.scale.z) == info.size_m
        assert time_ns(cube.header) == log_ns and cube.header.frame_id == "ego"
        world = moved[f"truth/{info.object_id}/{info.name}"]
        rotation, centre = truth.poses.object_centre(info.object_id, t_ns)
        assert world[:3, :3] == pytest.approx(rotation[0], abs=1e-12)
        assert world[:3, 3] == pytest.approx(centre[0], abs=1e-9)
        p = cube.pose.position
        in_world = moved["ego"] @ [p.x, p.y, p.z, 1.0]
        assert in_world[:3] == pytest.approx(centre[0], abs=1e-9)
    target = truth.target_centre_ego_m(t_ns)[0]
    p = markers.markers[truth.target_id].pose.position
    assert [p.x, p.y, p.z] == pytest.approx(target, abs=1e-9)


@dataclass(frozen=True)
class Turned:
    """The same world, turned and moved as a whole."""

    poses: PoseSource
    rotation: np.ndarray

    def _turned(self, pose: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        return self.rotation @ pose[0], pose[1] @ self.rotation.T + [5.0, -3.0, 1.0]

    def ego(self, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._turned(self.poses.ego(t_ns))

    def object_centre(self, object_id: int, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._turned(self.poses.object_centre(object_id, t_ns))

    def sensor(self, sensor: str, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._turned(self.poses.sensor(sensor, t_ns))


def test_turning_the_whole_world_changes_no_box_in_the_ego_frame() -> None:
    truth = drive().truth
    turned = replace(truth, poses=Turned(truth.poses, rotation_rpy(0.1, -0.2, 2.0)))

    def boxes(of: Truth) -> list[list[float]]:
        told = [m["markers"] for _, topic, _, m in truth_messages(of, 0, 0) if topic == "/truth/markers"]
        poses = [cube["pose"] for markers in told for cube in markers]
        return [[*p["position"].values(), *p["orientation"].values()] for p in poses]

    one, other = np.array(boxes(truth)), np.array(boxes(turned))
    signs = np.sign(np.einsum("ni,ni->n", one[:, 3:], other[:, 3:]))  # q and -q are the same rotation
    assert other[:, :3] == pytest.approx(one[:, :3], abs=1e-9)
    assert signs[:, None] * other[:, 3:] == pytest.approx(one[:, 3:], abs=1e-9)


def test_the_reference_is_a_point_of_the_ego_frame(read: Read) -> None:
    reference = drive().truth.reference
    assert reference is not None
    told = read["/truth/reference"]
    for (log_ns, at), fix, known, place in zip(
        told, reference.fix_ns, reference.available_ns, reference.position_ego_m, strict=True
    ):
        assert (time_ns(at.header), log_ns) == (fix + EPOCH_NS, known + EPOCH_NS)
        assert [at.point.x, at.point.y, at.point.z] == place.tolist()


def test_rosbags_serializes_every_message_to_the_same_bytes(bag: Path) -> None:
    """The whole encoding: alignment, strings, lists, nested messages, empty ones."""
    kinds = set()
    with AnyReader([bag], default_typestore=typestore()) as reader:
        for connection, _, raw in reader.messages():
            again = typestore().serialize_cdr(reader.deserialize(raw, connection.msgtype), connection.msgtype)
            assert bytes(again) == bytes(raw), connection.topic
            kinds.add(connection.msgtype)
    assert len(kinds) == 10


def test_mcap_ros2_reads_every_message_too(bag: Path, read: Read) -> None:
    counts = Counter[str]()
    with (bag / "a-drive.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None and schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
            theirs = read[channel.topic][counts[channel.topic]]
            assert message.log_time == theirs[0]
            if schema.name == ros.CLOUD:
                assert bytes(decoded.data) == theirs[1].data.tobytes()
            if schema.name == ros.DETECTIONS:
                assert [d.id for d in decoded.detections] == [d.id for d in theirs[1].detections]
                assert [d.bbox.size_y for d in decoded.detections] == [
                    d.bbox.size_y for d in theirs[1].detections
                ]
            counts[channel.topic] += 1
        assert reader.get_header().profile == "ros2"
    assert counts == {topic: len(messages) for topic, messages in read.items()}


def test_metadata_yaml_says_what_ros2_bag_wants_to_know(bag: Path, read: Read) -> None:
    text = yaml.safe_load((bag / "metadata.yaml").read_text(encoding="utf-8"))
    said = text["rosbag2_bagfile_information"]
    assert (said["version"], said["storage_identifier"]) == (5, "mcap")
    assert said["relative_file_paths"] == ["a-drive.mcap"]
    counted = {t["topic_metadata"]["name"]: t["message_count"] for t in said["topics_with_message_count"]}
    assert counted == {topic: len(messages) for topic, messages in read.items()}
    times = [log_ns for messages in read.values() for log_ns, _ in messages]
    assert said["starting_time"]["nanoseconds_since_epoch"] == min(times)
    assert said["duration"]["nanoseconds"] == max(times) - min(times)
    with AnyReader([bag], default_typestore=typestore()) as reader:
        for connection in reader.connections:
            latched = [q.durability for q in connection.ext.offered_qos_profiles]  # type: ignore[union-attr]
            wanted = [QosDurability.TRANSIENT_LOCAL] if connection.topic.endswith("tf_static") else []
            assert latched == wanted


def test_topics_are_names_that_ros_allows_and_truth_keeps_to_itself(bag: Path, read: Read) -> None:
    import re

    assert all(re.fullmatch(r"(/[A-Za-z]\w*)+", topic, flags=re.ASCII) for topic in read)
    recording = drive()
    other = replace(
        recording,
        truth=replace(recording.truth, objects=(), target_id=None, reference=None, scans=(),
                      calibration=recording.calibration),
    )  # fmt: skip
    write_bag(other, bag.parent / "other")

    def told(folder: Path) -> list[tuple[str, int, bytes]]:
        with AnyReader([folder], default_typestore=typestore()) as reader:
            every = [(c.topic, t, bytes(raw)) for c, t, raw in reader.messages()]
        return [one for one in every if not one[0].startswith("/truth/")]

    assert sorted(told(bag)) == sorted(told(bag.parent / "other"))


@pytest.mark.parametrize("by_s", [-3, 1_400_000_000])
def test_times_before_0_and_times_since_1970_have_a_place(tmp_path: Path, by_s: int) -> None:
    """Before 0: moved by the epoch. Since 1970: left as they are."""
    recording = shifted(drive(), by_s * 10**9)
    if by_s > 0:
        none = replace(recording.truth, scans=(), reference=None)
        recording = replace(recording, truth=none)
    write_ros2(recording, tmp_path / "a.mcap")
    epoch_s = EPOCH_S if by_s < 0 else 0
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file)
        about = {m.name: m.metadata for m in reader.iter_metadata()}["simbench"]
        times = [m.log_time for _, c, m in reader.iter_messages() if c.topic == "/ego/imu"]
    assert int(about["epoch_s"]) == epoch_s
    assert times == [m.arrival_ns + epoch_s * 10**9 for m in recording.messages if isinstance(m, EgoMotion)]
    assert json.loads(about["categories"])["car"]["mean_m"] == list(drive().categories["car"].mean_m)


def renamed(recording: Recording, old: str, new: str) -> Recording:
    told = recording.calibration
    poses = {new if name == old else name: T for name, T in told.T_ego_sensor.items()}
    cameras = {new if name == old else name: camera for name, camera in told.cameras.items()}
    messages = tuple(replace(m, sensor=new) if m.sensor == old else m for m in recording.messages)
    return replace(
        recording, messages=messages, calibration=replace(told, T_ego_sensor=poses, cameras=cameras)
    )


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("cam_front-left", "would have the same ROS topics"),
        ("front camera", "cannot have a ROS topic"),
        ("truth", "cannot have a ROS topic"),
        ("2nd", "cannot have a ROS topic"),
        ("kåmera", "cannot have a ROS topic"),
    ],
)
def test_sensors_that_have_no_topic_are_refused(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        write_ros2(renamed(drive(), "cam-front", name), tmp_path / "a.mcap")
    assert not list(tmp_path.iterdir())


def test_times_that_ros_cannot_tell_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="do not fit into a ROS time"):
        write_ros2(shifted(drive(), 3 * 10**18), tmp_path / "a.mcap")


def leaves(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else leaves(tree["first"]) + leaves(tree["second"])


def test_the_layout_shows_the_scene_and_every_camera(bag: Path, read: Read) -> None:
    told = json.loads((bag / "foxglove.json").read_text(encoding="utf-8"))
    assert told == json.loads(json.dumps(layout(drive())))
    panels = told["configById"]
    assert sorted(leaves(told["layout"])) == sorted(panels) and len(panels) == 7
    assert {panel.split("!")[0] for panel in panels} == {"3D", "Image"}
    for panel in panels.values():
        assert set(panel["topics"]) <= set(read) and all(t["visible"] for t in panel["topics"].values())
        image = panel["imageMode"]
        assert set(image.values()) <= set(read)
        if image:
            assert image["imageTopic"].split("/")[1] == image["calibrationTopic"].split("/")[1]
    assert {"globalVariables", "userNodes", "playbackConfig"} < set(told)


def test_without_images_the_layout_is_the_scene_alone() -> None:
    recording = drive()
    blind = replace(
        recording, messages=tuple(m for m in recording.messages if not isinstance(m, CameraImage))
    )
    assert layout(blind)["layout"] == "3D!scene"
