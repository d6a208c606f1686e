"""Bags as another stack writes them, by rosbags: its own writer, serializer and definitions."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.read import Imported, import_ros2
from simbench.formats.ros2.topics import TopicMap


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """Another project's message definitions; vision_msgs, which it lacks, from the text of our files."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    known = get_types_from_msg(ros.schema_text(ros.DETECTIONS), ros.DETECTIONS)
    store.register({name: spec for name, spec in known.items() if name not in store.types})
    return store


def message(kind: str, **fields: Any) -> Any:
    """A message of rosbags; what is not given is 0 or empty. A dict is a message, a list of them a list."""
    store = typestore()
    given = {}
    for name, (node, what) in store.get_msgdef(kind).fields:
        value = fields.get(name)
        if node.name == "NAME":
            given[name] = (
                value if value is not None and not isinstance(value, dict) else message(what, **(value or {}))
            )
        elif node.name == "BASE":
            given[name] = value if value is not None else "" if what[0] == "string" else 0
        else:
            given[name] = _listed(node.name, what, value)
    return store.types[kind](**given)


def _listed(node: str, what: Any, value: Any) -> Any:
    (inner, element), count = what
    if inner.name == "NAME":
        return [one if not isinstance(one, dict) else message(element, **one) for one in value or ()]
    dtype = np.dtype(element[0])
    return np.zeros(count if node == "ARRAY" else 0, dtype) if value is None else np.asarray(value, dtype)


def stamped(t_ns: int, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}, "frame_id": frame}


Written = tuple[str, str, int, Any]  # topic, type, log time, message of rosbags or bytes


def write_foreign(folder: Path, messages: list[Written]) -> Path:
    """A bag by rosbags' own writer and serializer: no checksums, no sequence numbers."""
    store = typestore()
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics: dict[str, Any] = {}
        for topic, kind, log_ns, content in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            data = content if isinstance(content, bytes) else store.serialize_cdr(content, kind)
            writer.write(topics[topic], log_ns, data)
    return folder


def write_bytes(path: Path, messages: list[Written], **options: Any) -> Path:
    """A file of any bytes whose checksums are right, by the library of mcap."""
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2", library="test")
        channels: dict[str, int] = {}
        for topic, kind, log_ns, content in messages:
            data = content if isinstance(content, bytes) else typestore().serialize_cdr(content, kind)
            if topic not in channels:
                text = ros.schema_text(kind).encode()
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=text)
                channels[topic] = writer.register_channel(
                    topic=topic, message_encoding="cdr", schema_id=schema
                )
            writer.add_message(channels[topic], log_time=log_ns, publish_time=log_ns, data=bytes(data))
        writer.finish()
    return path


START_S = 1_753_000_000
START = START_S * 10**9 + 250_000_000
TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
XYZ = np.array([[10.0, 1.0, 0.5], [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0], [5.0, -2.0, 0.25]], dtype=np.float32)


def cloud(t_ns: int = START, *, frame: str = "os_lidar", big: bool = False, rows: int = 1, gap: int = 0,
          **columns: np.ndarray) -> Any:  # fmt: skip
    """A PointCloud2 of the columns in their own dtypes; gap: bytes after each row."""
    order = ">" if big else "<"
    dtype = np.dtype([(name, order + values.dtype.str[1:]) for name, values in columns.items()])
    points = np.zeros(len(next(iter(columns.values()))), dtype=dtype)
    for name, values in columns.items():
        points[name] = values
    lines = points.reshape(rows, -1)
    data = b"".join(line.tobytes() + b"\xaa" * gap for line in lines)
    fields = [
        {"name": name, "offset": dtype.fields[name][1], "datatype": TYPES[dtype[name].str[1:]], "count": 1}  # type: ignore[index]
        for name in columns
    ]
    return message(
        ros.CLOUD, header=stamped(t_ns, frame), height=rows, width=lines.shape[1], fields=fields,
        is_bigendian=big, point_step=dtype.itemsize, row_step=lines.shape[1] * dtype.itemsize + gap,
        data=np.frombuffer(data, np.uint8), is_dense=False,
    )  # fmt: skip


def xyz(values: np.ndarray = XYZ, dtype: str = "f4") -> dict[str, np.ndarray]:
    return {name: values[:, i].astype(dtype) for i, name in enumerate("xyz")}


def edge(parent: str, child: str, x: float = 0.0, yaw_deg: float = 0.0) -> dict[str, Any]:
    half = np.deg2rad(yaw_deg) / 2
    return {
        "header": stamped(START, parent), "child_frame_id": child,
        "transform": {"translation": {"x": x, "y": 0.0, "z": 0.0},
                      "rotation": {"x": 0.0, "y": 0.0, "z": float(np.sin(half)), "w": float(np.cos(half))}},
    }  # fmt: skip


def tf(*edges: dict[str, Any], t_ns: int = START - 10**6) -> Written:
    return ("/tf_static", ros.TF, t_ns, message(ros.TF, transforms=list(edges)))


TREE = tf(
    edge("base_link", "roof", x=1.0, yaw_deg=90.0), edge("roof", "os_lidar", x=2.0), edge("map", "base_link"),
    edge("roof", "front_optical", x=0.5), edge("base_link", "imu_link", yaw_deg=90.0),
)  # fmt: skip


def imu(t_ns: int = START, frame: str = "base_link", **changes: Any) -> Any:
    rate, force = {"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 0.5, "y": 0.0, "z": 9.8}
    given = {"angular_velocity": rate, "linear_acceleration": force, **changes}
    return message(ros.IMU, header=stamped(t_ns, frame), **given)


def odometry(t_ns: int, speed: float) -> Any:
    twist = {"twist": {"linear": {"x": speed, "y": 0.0, "z": 0.0}}}
    return message(ros.ODOMETRY, header=stamped(t_ns, "odom"), child_frame_id="base_link", twist=twist)


def info(t_ns: int = START, frame: str = "front_optical", **changes: Any) -> Any:
    k = np.array([100.0, 0, 23.5, 0, 110.0, 15.5, 0, 0, 1])
    p = np.array([90.0, 0, 20.0, 0, 0, 95.0, 14.0, 0, 0, 0, 1, 0])
    given = {"k": k, "p": p, "d": [0.1, 0.2, 0.01, 0.02], "distortion_model": "plumb_bob", **changes}
    return message(ros.CAMERA_INFO, header=stamped(t_ns, frame), width=48, height=32, **given)


PIXELS = np.random.default_rng(2).integers(0, 256, (32, 48, 3), dtype=np.uint8)


def raw(encoding: str, pixels: np.ndarray, t_ns: int = START, gap: int = 0) -> Any:
    lines = pixels.reshape(pixels.shape[0], -1)
    data = np.concatenate([lines, np.full((len(lines), gap), 9, np.uint8)], axis=1)
    return message(
        ros.IMAGE, header=stamped(t_ns, "front_optical"), height=pixels.shape[0], width=pixels.shape[1],
        encoding=encoding, step=data.shape[1], data=data.ravel(),
    )  # fmt: skip


def packed(extension: str, t_ns: int = START, **changes: Any) -> Any:
    data = cv2.imencode(extension, PIXELS[..., ::-1])[1].ravel()
    given = {"format": "bgr8; compressed", "data": data, **changes}
    return message(ros.COMPRESSED_IMAGE, header=stamped(t_ns, "front_optical"), **given)


def boxes(t_ns: int, *given: tuple[str, str, float], box: Any = None) -> Any:
    """class, track and score of each."""
    header = stamped(t_ns, "front_optical")
    place = box or {
        "center": {"position": {"x": 10.0, "y": 12.0}, "theta": 0.0},
        "size_x": 4.0,
        "size_y": 6.0,
    }
    found = [
        {"header": header, "bbox": place, "id": track,
         "results": [{"hypothesis": {"class_id": name, "score": score}},
                     {"hypothesis": {"class_id": "tree", "score": 0.1}}] if name else []}
        for name, track, score in given
    ]  # fmt: skip
    return message(ros.DETECTIONS, header=header, detections=found)


LIDAR = {"lidars": {"top": {"points": "/os/points"}}, "ego_frame": "base_link"}


def mapped(**changes: Any) -> TopicMap:
    return TopicMap.model_validate({**LIDAR, **changes})


def lidar(**fields: Any) -> dict[str, Any]:
    return {"lidars": {"top": {"points": "/os/points", **fields}}}


def driving(velocity: str = "/speed") -> TopicMap:
    return TopicMap.model_validate(
        {"ego_frame": "base_link", "imus": {"imu": {"imu": "/imu", "velocity": velocity}}}
    )


def looking(**camera: Any) -> TopicMap:
    given = {"info": "/front/info", **camera}
    return TopicMap.model_validate(
        {"ego_frame": "base_link", "cameras": {"front": given}, "class_ids": "coco"}
    )  # fmt: skip


def seen(folder: Path, topics: TopicMap, *sent: Written) -> Imported:
    told = [TREE, ("/front/info", ros.CAMERA_INFO, START - 1, info())]
    return import_ros2(write_foreign(folder / "bag", [*told, *sent]), topics)


SENT = cloud(**xyz())
BARE: Written = ("/os/points", ros.CLOUD, START, SENT)
