"""From an MCAP file to what its mapped topics say, message by message, each checked by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from scenarios.errors import BadInput, printable
from simbench.formats.mcap_records import Found, read_records
from simbench.formats.ros2 import decode, pictures
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.cdr import Message, MessageError
from simbench.formats.ros2.cdr import decode as from_cdr
from simbench.formats.ros2.clouds import cloud_of
from simbench.formats.ros2.frames import FrameTree
from simbench.formats.ros2.topics import LidarTopics, TopicMap

Kind = Literal["points", "image", "info", "detections", "corners", "imu", "velocity", "transforms"]
MOST_CHUNK_BYTES = 256 * 2**20
MOST_BYTES = 4 * 2**30  # of all that is kept
MOST_SMALL_BYTES = 4 * 2**20  # of a message that is neither points nor an image
TYPES: dict[Kind, tuple[str, ...]] = {
    "points": (ros.CLOUD,), "image": (ros.COMPRESSED_IMAGE, ros.IMAGE), "info": (ros.CAMERA_INFO,),
    "detections": (ros.DETECTIONS,), "corners": (ros.NUMBERS,), "imu": (ros.IMU,),
    "velocity": (ros.TWIST, ros.ODOMETRY), "transforms": (ros.TF,),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Role:
    """What a topic is for. sensor: "" for transforms."""

    kind: Kind
    sensor: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Item:
    """One message of a mapped topic, number `number` of it (from 0). Times are the file's own; `content` is
    by kind: Cloud, pixels, PinholeCamera, boxes, corners, (rate, force), velocity. frame: of the content."""

    topic: str
    number: int
    role: Role
    log_ns: int
    sequence: int
    stamp_ns: int
    frame: str
    content: Any


def roles_of(topics: TopicMap) -> dict[str, Role]:
    """Topics that are read, and what for."""
    found = {topic: Role(kind="transforms", sensor="") for topic in topics.transforms}
    found |= {lidar.points: Role(kind="points", sensor=name) for name, lidar in topics.lidars.items()}
    for name, camera in topics.cameras.items():
        given: dict[Kind, str | None] = {
            "info": camera.info, "image": camera.image, "detections": camera.detections,
            "corners": camera.corners,
        }  # fmt: skip
        found |= {topic: Role(kind=kind, sensor=name) for kind, topic in given.items() if topic is not None}
    for name, imu in topics.imus.items():
        found |= {
            imu.imu: Role(kind="imu", sensor=name),
            imu.velocity: Role(kind="velocity", sensor=name),
        }
    return found


def refused(topic: str, number: int, problem: str, file: str) -> BadInput:
    """The one sentence about a message."""
    return BadInput(f"{printable(topic[:100])}, message {number}: {printable(problem)}", file=file)


def take(path: Path, topics: TopicMap, tree: FrameTree) -> Iterator[Item]:
    """All messages of mapped topics in the order of the file; transforms go to the tree. BadInput: one cannot
    be, or a mapped topic is not there."""
    roles, name = roles_of(topics), str(path)
    counts: dict[str, int] = {}
    others: dict[str, None] = {}
    known: dict[tuple[str, bytes], str | None] = {}
    kept = 0
    for found in read_records(path, checked=False, most_chunk_bytes=MOST_CHUNK_BYTES):
        if not isinstance(found, Found):
            continue
        topic = found.channel.topic
        role = roles.get(topic)
        if role is None:
            others.setdefault(topic)
            continue
        number = counts.get(topic, 0)
        counts[topic] = number + 1
        try:
            item = _item(found, role, number, topics, tree, known)
        except MessageError as error:
            raise refused(topic, number, str(error), name) from None
        if item is None:
            continue
        kept += _bytes_of(item.content)
        if kept > MOST_BYTES:
            raise BadInput(
                f"holds more than {MOST_BYTES >> 30} GB of mapped messages: cut it first", file=name
            )
        yield item
    missing = [topic for topic in roles if topic not in counts]
    if missing:
        there = ", ".join(sorted([*others, *counts])) or "none"
        raise BadInput(
            f"there is no message on {missing[0]}", file=name, allowed=f"its topics: {printable(there)[:400]}"
        )


def _item(
    found: Found, role: Role, number: int, topics: TopicMap, tree: FrameTree,
    known: dict[tuple[str, bytes], str | None],
) -> Item | None:  # fmt: skip
    kind = kind_of(found, TYPES[role.kind], known)
    if found.log_ns >= 2**63:
        raise MessageError(f"its log time is {found.log_ns} ns")
    if len(found.data) > MOST_SMALL_BYTES and role.kind not in ("points", "image"):
        raise MessageError(f"it has {len(found.data)} bytes, more than {MOST_SMALL_BYTES}")
    message = from_cdr(kind, found.data)
    if role.kind == "transforms":
        tree.add(message)
        return None
    head = message.get("header")
    stamp_ns = found.log_ns if head is None else decode.stamp_ns(head)
    frame = "" if head is None else head["frame_id"]
    if kind == ros.ODOMETRY:
        frame = message["child_frame_id"]
    content = _content(kind, message, role, topics, stamp_ns)
    return Item(
        topic=found.channel.topic, number=number, role=role, log_ns=found.log_ns, sequence=found.sequence,
        stamp_ns=stamp_ns, frame=frame, content=content,
    )  # fmt: skip


def kind_of(found: Found, allowed: Sequence[str], known: dict[tuple[str, bytes], str | None]) -> str:
    """The message's type. known: what is wrong with the definitions that were met, for the next message.
    MessageError: it is none of those allowed, or is defined in another way."""
    if found.channel.message_encoding != "cdr":
        raise MessageError(f"it is encoded as '{found.channel.message_encoding[:40]}', not as cdr")
    schema = found.schema
    if schema is None or schema.name not in allowed:
        name = "nothing" if schema is None else schema.name[:80]
        raise MessageError(f"it is {name}, not {' or '.join(allowed)}")
    if schema.encoding == "ros2msg":
        key = (schema.name, schema.data)
        if key not in known:
            known[key] = _odd(schema.name, schema.data)
        if (problem := known[key]) is not None:
            raise MessageError(problem)
    return schema.name


def _odd(name: str, text: bytes) -> str | None:
    """What is wrong with a schema's definition; None: nothing."""
    try:
        if ros.same_layout(name, text.decode("utf-8", errors="replace")):
            return None
    except ros.DefinitionError as error:
        return str(error)
    return f"this {name} is defined in another way than the one that is known (of ROS 2 Humble and later)"


def _content(kind: str, message: Message, role: Role, topics: TopicMap, stamp_ns: int) -> Any:
    match kind:
        case ros.CLOUD:
            lidar: LidarTopics = topics.lidars[role.sensor]
            return cloud_of(message, stamp_ns, lidar)
        case ros.IMAGE:
            return pictures.raw_image(message)
        case ros.COMPRESSED_IMAGE:
            return pictures.compressed_image(message)
        case ros.CAMERA_INFO:
            return decode.camera(message, rectified=topics.cameras[role.sensor].rectified)
        case ros.DETECTIONS:
            return decode.boxes(message)
        case ros.NUMBERS:
            return decode.corners(message)
        case ros.IMU:
            return decode.imu(message)
        case ros.TWIST:
            return decode.vector(message["twist"]["linear"], "velocity")
        case _:
            return decode.vector(message["twist"]["twist"]["linear"], "velocity")


def _bytes_of(content: Any) -> int:
    if isinstance(content, np.ndarray):
        return content.nbytes
    points = getattr(content, "xyz_m", None)
    return 200 if points is None else 2 * points.nbytes
