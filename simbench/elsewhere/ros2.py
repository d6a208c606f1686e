"""Positions in a ROS 2 bag: what a stack published as vision_msgs/msg/Detection3DArray, recorded as MCAP.

    header.stamp            of the detection, of the array where that is zero; on the clock of the bag that
                            `simbench generate --format mcap` wrote, whose epoch is taken off again
    header.frame_id         `ego`, or empty
    bbox.center.position    [m]; the poses of hypotheses are not looked at
    id                      the track; empty: none
    results                 class and score of the likeliest hypothesis; none: '' and 1

One topic is of that type; all others, whatever they are, are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scenarios.errors import BadInput, printable
from simbench.elsewhere.positions import Position
from simbench.formats.mcap_records import Found, read_records
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.bag import epoch_of
from simbench.formats.ros2.cdr import Message, MessageError
from simbench.formats.ros2.cdr import decode as from_cdr
from simbench.formats.ros2.decode import likeliest, stamp_ns, vector
from simbench.formats.ros2.names import EGO, S_TO_NS
from simbench.formats.ros2.read import mcap_of
from simbench.formats.ros2.taken import MOST_CHUNK_BYTES, MOST_SMALL_BYTES, kind_of, refused
from simbench.recording import Recording

MOST_BYTES = 2**28  # of all results together
MOST_POSITIONS = 1_000_000
BYTES_A_MESSAGE = 500  # that a message takes in memory beside its own
LONGEST_NAME = 200
LONGEST_LIST = 400  # characters, of topics in a sentence


def read_detections3d(path: Path, recording: Recording) -> tuple[Position, ...]:
    """The positions of a bag (an MCAP file, or a folder that holds one), in the order of the file. BadInput
    with topic and message: it holds no results or several, or one cannot be."""
    file = mcap_of(path)
    topic, messages = _results(file)
    epoch_ns = epoch_of(recording) * S_TO_NS
    known: dict[tuple[str, bytes], str | None] = {}
    positions: list[Position] = []
    for number, found in enumerate(messages):
        try:
            kind_of(found, (ros.DETECTIONS_3D,), known)
            if len(found.data) > MOST_SMALL_BYTES:
                raise MessageError(f"it has {len(found.data)} bytes, more than {MOST_SMALL_BYTES}")
            message = from_cdr(ros.DETECTIONS_3D, found.data)
            positions += _positions(message, f"{printable(topic[:100])}, message {number}", epoch_ns)
        except MessageError as error:
            raise refused(topic, number, str(error), str(file)) from None
        if len(positions) > MOST_POSITIONS:
            raise BadInput(f"holds more than {MOST_POSITIONS} detections", file=str(file))
    return tuple(positions)


def _results(file: Path) -> tuple[str, Sequence[Found]]:
    """The one topic of results, and its messages."""
    results: dict[str, list[Found]] = {}
    others: dict[str, str] = {}
    kept = 0
    for found in read_records(file, checked=False, most_chunk_bytes=MOST_CHUNK_BYTES):
        if not isinstance(found, Found):
            continue
        kind = "" if found.schema is None else found.schema.name
        if kind != ros.DETECTIONS_3D:
            others.setdefault(found.channel.topic, kind)
            continue
        results.setdefault(found.channel.topic, []).append(found)
        kept += len(found.data) + BYTES_A_MESSAGE
        if kept > MOST_BYTES:
            raise BadInput(f"holds more than {MOST_BYTES >> 20} MB of results", file=str(file))
    if not results:
        there = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(others.items())) or "none"
        raise BadInput(
            f"there is no message of type {ros.DETECTIONS_3D}", file=str(file),
            allowed=f"one topic of it; there are: {printable(there[:LONGEST_LIST])}",
        )  # fmt: skip
    if len(results) > 1:
        topics = printable(", ".join(sorted(results))[:LONGEST_LIST])
        raise BadInput(
            f"{len(results)} topics are {ros.DETECTIONS_3D}: {topics}", file=str(file), allowed="one of them"
        )
    ((topic, messages),) = results.items()
    return topic, messages


def _positions(message: Message, where: str, epoch_ns: int) -> list[Position]:
    """The positions of an array. where: its topic and number."""
    array_ns = _stamp_ns(message["header"])
    found = []
    for i, one in enumerate(message["detections"]):
        try:
            found.append(_position(one, array_ns, f"{where}, detection {i}", epoch_ns))
        except MessageError as error:
            raise MessageError(f"detection {i}: {error}") from None
    return found


def _position(told: Message, array_ns: int, where: str, epoch_ns: int) -> Position:
    file_ns = _stamp_ns(told["header"]) or array_ns
    if file_ns == 0:
        raise MessageError("neither it nor its array has a stamp")
    x, y, z = vector(told["bbox"]["center"]["position"], "position").tolist()
    best = likeliest(told["results"])
    return Position(
        where=f"{where} of {file_ns // S_TO_NS}.{file_ns % S_TO_NS:09d} s",
        stamp_ns=file_ns - epoch_ns, position_ego_m=(x, y, z), track=_name(told["id"], "id") or None,
        category="" if best is None else _name(best["class_id"], "class_id"),
        confidence=1.0 if best is None else float(best["score"]),
    )  # fmt: skip


def _stamp_ns(header: Message) -> int:
    """A header's time in the file, 0 where there is none. MessageError: it is none, or in another frame."""
    if header["frame_id"] not in (EGO, ""):
        raise MessageError(f"its frame is '{header['frame_id'][:60]}', but results are wanted in '{EGO}'")
    return stamp_ns(header)


def _name(text: str, field: str) -> str:
    if len(text) > LONGEST_NAME:
        raise MessageError(f"its {field} has {len(text)} characters, more than {LONGEST_NAME}")
    return text
