"""The ROS 2 messages that are written and read, as `.msg` text.

The text is what stands in the file as the schema, and what the codec (`cdr.py`) goes by: there is no second
place where a layout is told. Versions: sensor_msgs and others of Humble to Kilted, vision_msgs 4.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

RULE = "=" * 80
LONGEST_TEXT = 100_000
MOST_VALUES = 1000
_GIVEN = ("builtin_interfaces/Time", "builtin_interfaces/Duration")  # which a schema may leave out

CLOUD = "sensor_msgs/msg/PointCloud2"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
IMAGE = "sensor_msgs/msg/Image"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
IMU = "sensor_msgs/msg/Imu"
TWIST = "geometry_msgs/msg/TwistStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
POINT = "geometry_msgs/msg/PointStamped"
TF = "tf2_msgs/msg/TFMessage"
DETECTIONS = "vision_msgs/msg/Detection2DArray"
DETECTIONS_3D = "vision_msgs/msg/Detection3DArray"
MARKERS = "visualization_msgs/msg/MarkerArray"
NUMBERS = "std_msgs/msg/Float64MultiArray"

TEXTS: Mapping[str, str] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/PointStamped": "std_msgs/Header header\ngeometry_msgs/Point point",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped":
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Odometry":
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist",
    "sensor_msgs/PointField":
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n"
        "uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count",
    "sensor_msgs/PointCloud2":
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
        "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "sensor_msgs/Image":
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
        "uint32 step\nuint8[] data",
    "sensor_msgs/RegionOfInterest":
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify",
    "sensor_msgs/CameraInfo":
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
        "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
        "sensor_msgs/RegionOfInterest roi",
    "sensor_msgs/Imu":
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    "vision_msgs/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/ObjectHypothesisWithPose":
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "vision_msgs/Detection2D":
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id",
    "vision_msgs/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "vision_msgs/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "vision_msgs/Detection3D":
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox3D bbox\nstring id",
    "vision_msgs/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data",
    "visualization_msgs/Marker":
        "int32 CUBE=1\nint32 ADD=0\nstd_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n"
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n"
        "builtin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n"
        "std_msgs/ColorRGBA[] colors\nstring texture_resource\nsensor_msgs/CompressedImage texture\n"
        "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n"
        "visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials",
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
}  # fmt: skip

PRIMITIVES: Mapping[str, str] = {
    # letters of `struct`; a string has a length and a zero at its end
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d", "string": "s",
}  # fmt: skip
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)(\s+.*)?$")


class DefinitionError(ValueError):
    """Text that defines no message; one sentence."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """One field. kind: a word of PRIMITIVES or the name of a type. count: None for one value, -1 for a list
    of any length, else of that length."""

    name: str
    kind: str
    count: int | None


@cache
def fields_of(name: str) -> tuple[Field, ...]:
    """The fields of one of `TEXTS`, called with or without `/msg/`."""
    return _parse(short(name), TEXTS[short(name)])


def short(name: str) -> str:
    """`package/Type` of `package/msg/Type`."""
    return name.replace("/msg/", "/")


@cache
def schema_text(name: str) -> str:
    """The text of a message and of all that it holds, as a file's schema tells it."""
    order = [short(name)]
    for one in order:
        order += [f.kind for f in fields_of(one) if f.kind not in PRIMITIVES and f.kind not in order]
    return f"\n{RULE}\n".join([TEXTS[order[0]], *(f"MSG: {one}\n{TEXTS[one]}" for one in order[1:])]) + "\n"


def same_layout(name: str, text: str) -> bool:
    """Whether a schema's text lays a message out as ours does, whatever it calls its fields. DefinitionError:
    it is none."""
    if len(text) > LONGEST_TEXT:
        raise DefinitionError(f"its definition has {len(text)} characters")
    known: dict[str, tuple[Field, ...]] = {}
    for number, part in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        head = re.search(r"^MSG:\s*(\S+)\s*$", part, flags=re.MULTILINE)
        if number and not head:
            raise DefinitionError("its definition has a part without a name")
        own = short(head.group(1)) if head and number else short(name)
        known[own] = _parse(own, part[head.end() :] if head and number else part)
    given = {one: fields_of(one) for one in _GIVEN}
    ours = {one: fields_of(one) for one in TEXTS}
    return _layout(short(name), {**given, **known}, {}) == _layout(short(name), ours, {})


def _layout(
    name: str, known: Mapping[str, Sequence[Field]], done: dict[str, list[object] | None]
) -> list[object]:
    """Letters of all values in their order; lists as (count, layout). done: those of types that are known."""
    if name not in known or (name in done and done[name] is None):
        raise DefinitionError(f"its definition does not say what a {name[:60]} is")
    if (earlier := done.get(name)) is not None:
        return earlier
    done[name] = None
    found: list[object] = []
    for field in known[name]:
        kind = PRIMITIVES.get(field.kind)
        inner: list[object] = [kind] if kind else _layout(field.kind, known, done)
        found += inner if field.count is None else [(field.count, inner)]
        if len(found) > MOST_VALUES:
            raise DefinitionError(f"its definition has more than {MOST_VALUES} values")
    done[name] = found
    return found


def _parse(name: str, text: str) -> tuple[Field, ...]:
    fields = []
    for line in text.splitlines():
        words = line.split("#")[0].strip()
        if not words or re.match(r"^[\w/<=\[\]]+\s+[A-Z][A-Z0-9_]*\s*=", words):  # empty, or a constant
            continue
        match = _FIELD.match(words)
        if not match:
            raise DefinitionError(f"its definition has the line {words[:60]!r}")
        kind, upper, length, field, _ = match.groups()
        listed = "[" in words.split()[0]
        count = None if not listed else -1 if upper or not length else int(length)
        fields.append(Field(name=field, kind=_full(kind, name), count=count))
    return tuple(fields)


def _full(kind: str, within: str) -> str:
    """A type's name with its package."""
    if kind in PRIMITIVES:
        return kind
    if kind == "Header":
        return "std_msgs/Header"
    return short(kind) if "/" in kind else f"{within.split('/')[0]}/{kind}"
