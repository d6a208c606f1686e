"""The parts of the ROS 2 formats by themselves: the codec, quaternions, frames, sizes of images."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion.geometry import Transform, rotation_exp
from scenarios.errors import BadInput
from simbench.formats.picture_size import picture_size
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2 import names
from simbench.formats.ros2.cdr import MessageError, decode, encode
from simbench.formats.ros2.decode import camera
from simbench.formats.ros2.encode import camera_info, transform
from simbench.formats.ros2.frames import FrameTree
from simbench.formats.ros2.rotation import matrix_of, quaternions_of
from tests.simbench.formats.ros2_foreign import message, typestore

QUICK = settings(max_examples=60, deadline=None)
VECTORS = st.tuples(*[st.floats(-3.2, 3.2)] * 3).map(np.array)
WORDS = st.text(alphabet="abcä/_ ", max_size=9)
NUMBERS = st.floats(width=64)


def points(name: str, of: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({axis: of for axis in name})


MARKER = st.fixed_dictionaries({
    "ns": WORDS, "id": st.integers(-(2**31), 2**31 - 1), "frame_locked": st.booleans(), "text": WORDS,
    "pose": st.fixed_dictionaries(
        {"position": points("xyz", NUMBERS), "orientation": points("xyzw", NUMBERS)}
    ),
    "color": points("rgba", st.floats(width=32)), "points": st.lists(points("xyz", NUMBERS), max_size=3),
    "mesh_file": st.fixed_dictionaries({"filename": WORDS, "data": st.binary(max_size=9)}),
})  # fmt: skip


def plain(value: Any) -> Any:
    """Bytes as rosbags wants them."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    return np.frombuffer(value, np.uint8) if isinstance(value, bytes) else value


@QUICK
@given(st.lists(MARKER, max_size=3))
def test_the_codec_writes_what_rosbags_writes_and_reads_it_back(markers: list[dict[str, Any]]) -> None:
    ours = encode(ros.MARKERS, {"markers": markers})
    theirs = typestore().serialize_cdr(message(ros.MARKERS, markers=plain(markers)), ros.MARKERS)
    assert ours == bytes(theirs)
    again = decode(ros.MARKERS, ours)
    assert encode(ros.MARKERS, again) == ours
    given = message(ros.MARKERS, markers=plain(markers))
    big = bytes(typestore().serialize_cdr(given, ros.MARKERS, little_endian=False))
    assert big[:2] == b"\x00\x00" and encode(ros.MARKERS, decode(ros.MARKERS, big)) == ours


@QUICK
@given(
    st.sampled_from(sorted(n for n in ros.TEXTS if n not in ("std_msgs/Header",))), st.binary(max_size=300)
)
def test_any_bytes_are_a_message_or_refused(name: str, noise: bytes) -> None:
    for data in (noise, b"\x00\x01\x00\x00" + noise, b"\x00\x00\x00\x00" + noise):
        try:
            again = encode(name, decode(name, data))
        except MessageError as error:
            assert "\n" not in str(error)
        else:
            assert len(again) <= len(data) + 8  # a text without its zero gets one


def test_bytes_behind_a_message_are_padding_or_too_many() -> None:
    whole = encode(ros.POINT, {"point": {"x": 1.0}})
    assert decode(ros.POINT, whole + bytes(3))["point"]["x"] == 1.0
    with pytest.raises(MessageError, match="4 bytes are left over"):
        decode(ros.POINT, whole + bytes(4))


@pytest.mark.parametrize(
    "kind", [ros.CLOUD, ros.COMPRESSED_IMAGE, ros.IMAGE, ros.CAMERA_INFO, ros.IMU, ros.TWIST, ros.ODOMETRY,
             ros.POINT, ros.TF, ros.MARKERS, ros.NUMBERS]
)  # fmt: skip
def test_definitions_are_those_of_ros_as_rosbags_knows_them(kind: str) -> None:
    text, _ = typestore().generate_msgdef(kind, ros_version=2)
    assert ros.same_layout(kind, text)
    assert ros.same_layout(kind, ros.schema_text(kind))
    other = text.replace("float64", "float32") if "float64" in text else text.replace("uint32", "uint64")
    assert not ros.same_layout(kind, other)


def test_a_definition_may_say_the_same_in_other_words() -> None:
    """Comments, constants, defaults, bounds, packages left out, and no text for a time."""
    text = (
        "# where things are\n\nTransformStamped[] transforms   # many\n" + "=" * 80
        + "\nMSG: tf2_msgs/TransformStamped\nHeader header\nstring<=20 child_frame_id \"a\"\n"
        + "geometry_msgs/msg/Transform transform\nint32 MANY=7\n" + "=" * 80
        + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80
        + "\nMSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n" + "=" * 80
        + "\nMSG: geometry_msgs/Vector3\nfloat64 x 0.0\nfloat64 y\nfloat64 z\n" + "=" * 80
        + "\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    )  # fmt: skip
    assert ros.same_layout(ros.TF, text)


@QUICK
@given(st.lists(VECTORS, min_size=1, max_size=4))
def test_quaternions_are_those_of_scipy_and_lead_back(turns: list[np.ndarray]) -> None:
    rotations = np.array([rotation_exp(turn) for turn in turns])
    found = quaternions_of(rotations)
    theirs = Rotation.from_matrix(rotations).as_quat()
    for ours, other, rotation in zip(found, theirs, rotations, strict=True):
        assert ours[3] >= 0.0 and np.linalg.norm(ours) == pytest.approx(1.0, abs=1e-15)
        assert min(np.abs(ours - other).max(), np.abs(ours + other).max()) < 1e-12
        assert matrix_of(tuple(ours.tolist())) == pytest.approx(rotation, abs=1e-12)


@pytest.mark.parametrize("half_turn", [np.diag([1, -1, -1]), np.diag([-1, 1, -1]), np.diag([-1, -1, 1])])
def test_half_turns_have_quaternions(half_turn: np.ndarray) -> None:
    (found,) = quaternions_of(half_turn[None].astype(float))
    assert sorted(np.abs(found)) == [0, 0, 0, 1]
    assert np.array_equal(matrix_of(tuple(found.tolist())), half_turn)


@pytest.mark.parametrize("wrong", [(0, 0, 0, 0), (0, 0, 0, 1.1), (np.nan, 0, 0, 1), (np.inf, 0, 0, 0)])
def test_what_is_no_rotation_is_refused(wrong: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="a quaternion of length"):
        matrix_of(wrong)


@QUICK
@given(st.lists(st.tuples(st.integers(0, 5), VECTORS, VECTORS), min_size=1, max_size=6), st.randoms())
def test_a_pose_along_the_tree_is_the_product_of_its_edges(edges: list[Any], random: Any) -> None:
    """Frame 0 is the root; frame i + 1 hangs below one that came before. Whatever order they are told in."""
    poses = [Transform.identity()]
    told = []
    for i, (above, turn, shift) in enumerate(edges):
        T = Transform(rotation=rotation_exp(turn), translation_m=shift)
        told.append(transform(T, 0, f"f{above % (i + 1)}", f"f{i + 1}"))
        poses.append(poses[above % (i + 1)] @ T)
    random.shuffle(told)
    tree = FrameTree()
    for one in told:
        tree.add({"transforms": [one]})
    a, b = random.randrange(len(poses)), random.randrange(len(poses))
    wanted = poses[a].inverse() @ poses[b]
    found = tree.between(f"f{a}", f"f{b}")
    assert found.rotation == pytest.approx(wanted.rotation, abs=1e-9)
    assert found.translation_m == pytest.approx(wanted.translation_m, abs=1e-9)


def test_a_frame_that_moves_elsewhere_does_not_matter() -> None:
    """map moves against base_link, as it does in every drive; the sensor's place does not."""
    tree = FrameTree()
    for x in (0.0, 1.0):
        moved = Transform(rotation=np.eye(3), translation_m=np.array([x, 0.0, 0.0]))
        tree.add({"transforms": [transform(moved, 0, "map", "base_link")]})
    mounted = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 2.0]))
    tree.add({"transforms": [transform(mounted, 0, "base_link", "lidar")]})
    assert tree.between("base_link", "lidar").translation_m.tolist() == [0.0, 0.0, 2.0]
    with pytest.raises(MessageError, match="no transforms lead from 'map' to 'lidar'"):
        tree.between("map", "lidar")


@QUICK
@given(fx=st.floats(1, 1e5), cx=st.floats(0, 8192), lens=st.tuples(*[st.floats(-1, 1)] * 5))
def test_a_camera_goes_through_camera_info(fx: float, cx: float, lens: Any) -> None:
    from fusion.camera import PinholeCamera

    one = PinholeCamera(
        fx_px=fx, fy_px=2 * fx, cx_px=cx, cy_px=7.25, width_px=640, height_px=480, distortion=lens
    )
    again = camera(
        decode(ros.CAMERA_INFO, encode(ros.CAMERA_INFO, camera_info(one, 0, "c"))), rectified=False
    )
    assert again.cx_px == pytest.approx(cx, abs=1e-12)
    assert (again.fx_px, again.fy_px, again.cy_px, again.distortion) == (fx, 2 * fx, 7.25, lens)


@QUICK
@given(width=st.integers(1, 200), height=st.integers(1, 200), quality=st.integers(1, 100), grey=st.booleans())
def test_the_size_of_an_image_is_known_before_it_is_unpacked(
    width: int, height: int, quality: int, grey: bool
) -> None:
    pixels = np.zeros((height, width) if grey else (height, width, 3), dtype=np.uint8)
    for extension, options in ((".png", []), (".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality]),
                               (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])):  # fmt: skip
        assert picture_size(cv2.imencode(extension, pixels, options)[1].tobytes()) == (width, height)


@given(st.integers(-(10**18), 2 * 10**18), st.integers(0, 10**9))
def test_the_epoch_gives_every_time_a_place_or_refuses(first_ns: int, span_ns: int) -> None:
    try:
        seconds = names.epoch_s([first_ns, first_ns + span_ns])
    except BadInput:
        assert first_ns < -names.EPOCH_S * 10**9 or first_ns + span_ns >= 2**31 * 10**9 - 2 * 10**9
    else:
        assert first_ns + seconds * 10**9 >= 0
        assert (first_ns + span_ns) // 10**9 + seconds < 2**31
        assert seconds == names.EPOCH_S or first_ns + span_ns > 10**18
