"""Writes a recording as a ROS 2 bag: a folder that `ros2 bag` plays and Foxglove opens.

    write_bag(recording, Path("drive"))       drive/drive.mcap, drive/metadata.yaml, drive/foxglove.json
    ros2 bag info drive
    ros2 bag play drive                       everything
    ros2 bag play drive --exclude-regex '/truth/.*'      (Jazzy and later) without the truth
    ros2 bag play drive --topics /lidar/points /cam_front/detections /tf_static ...   (any version)
    ros2 bag play drive --remap /truth/tf:=/tf           where the ego is in the world, for tf2 and RViz

Log time is the arrival, publish time and header the claimed stamp, both with the file's epoch added
(`names.py`). Messages that arrive at the same time lie in the order of the recording.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan, Measurement
from simbench.files import prepare_folder, write_text, writing
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2 import encode, names
from simbench.formats.ros2.cdr import Message
from simbench.formats.ros2.cdr import encode as as_cdr
from simbench.formats.ros2.foxglove import write_layout
from simbench.formats.ros2.rosbag2 import LATCHED, metadata_yaml
from simbench.formats.ros2.truth import instants_ns, truth_messages
from simbench.recording import Recording

if TYPE_CHECKING:
    from mcap.writer import Writer

LIBRARY = "simbench"
ONCE = frozenset({names.TF_STATIC, names.TRUTH_TF_STATIC})  # told once, to whoever comes later too


@dataclass(frozen=True, kw_only=True)
class Out:
    """One message to be written; `make` encodes it when its turn comes. Times are on the bench's clock."""

    log_ns: int
    publish_ns: int
    topic: str
    kind: str
    seq: int
    make: Callable[[], Message]


@dataclass(kw_only=True)
class Written:
    """What a file holds: messages and type by topic, its first and last log time with the epoch."""

    counts: dict[str, int] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    first_ns: int = 0
    last_ns: int = 0


def write_bag(recording: Recording, folder: Path) -> dict[str, int]:
    """Write a bag into a folder, which is made; messages by topic. BadInput: it cannot be written, or a
    sensor's name or the times have no place in ROS."""
    prepare_folder(folder)
    path = folder / f"{folder.resolve().name or 'bag'}.mcap"
    written = _write(recording, path)
    write_layout(recording, folder / "foxglove.json")
    write_text(folder / "metadata.yaml", metadata_yaml(path.name, written.counts, written.kinds,
               written.first_ns, written.last_ns, ONCE))  # fmt: skip
    return written.counts


def write_ros2(recording: Recording, path: Path) -> dict[str, int]:
    """Write the MCAP file alone; messages by topic. BadInput as above."""
    return _write(recording, path).counts


def epoch_of(recording: Recording) -> int:
    """Seconds that a recording's bag adds to all times. BadInput: no ROS time can tell them."""
    times = [t for m in recording.messages for t in (m.stamp_ns, m.arrival_ns)]
    times += instants_ns(recording.truth).tolist()
    if recording.truth.reference is not None:
        times += [
            *recording.truth.reference.fix_ns.tolist(),
            *recording.truth.reference.available_ns.tolist(),
        ]
    return names.epoch_s(times)


def _write(recording: Recording, path: Path) -> Written:
    messages = recording.messages
    sensors = {*recording.calibration.T_ego_sensor, *(m.sensor for m in messages)}
    names.check_sensors(sorted(sensors))
    epoch_s = epoch_of(recording)
    start_ns = messages[0].arrival_ns if messages else 0
    outs = sorted(_outs(recording, start_ns, epoch_s * names.S_TO_NS), key=lambda out: out.log_ns)
    with writing(path) as file:
        return _write_all(file, outs, epoch_s, _about(recording, epoch_s, outs))


def _about(recording: Recording, epoch_s: int, outs: list[Out]) -> dict[str, str]:
    """The file's metadata record: what ROS has no message for."""
    by_kind = {
        kind.__name__: sorted({m.sensor for m in recording.messages if isinstance(m, kind)})
        for kind in (LidarScan, EgoMotion)
    }
    return {
        "schema": names.SCHEMA,
        "epoch_s": str(epoch_s),
        "categories": json.dumps({name: asdict(size) for name, size in recording.categories.items()}),
        "lidars": json.dumps(by_kind["LidarScan"]),
        "cameras": json.dumps(list(recording.calibration.cameras)),
        "imus": json.dumps(by_kind["EgoMotion"]),
        "topics": json.dumps(sorted({out.topic for out in outs})),
        "placed": json.dumps(list(recording.calibration.T_ego_sensor)),
    }


def _outs(recording: Recording, start_ns: int, epoch_ns: int) -> Iterator[Out]:
    told = recording.calibration
    for topic, kind, make in _at_start(recording, start_ns + epoch_ns):
        yield Out(log_ns=start_ns, publish_ns=start_ns, topic=topic, kind=kind, seq=0, make=make)
    for message in recording.messages:
        for topic, kind, make in _of(message, epoch_ns):
            yield Out(log_ns=message.arrival_ns, publish_ns=message.stamp_ns, topic=topic, kind=kind,
                      seq=message.seq, make=make)  # fmt: skip
        if isinstance(message, CameraImage) and message.sensor in told.cameras:
            yield Out(
                log_ns=message.arrival_ns, publish_ns=message.stamp_ns,
                topic=names.info_topic(message.sensor), kind=ros.CAMERA_INFO, seq=message.seq,
                make=_info(recording, message.sensor, message.stamp_ns + epoch_ns),
            )  # fmt: skip
    for count, (t_ns, topic, kind, content) in enumerate(truth_messages(recording.truth, start_ns, epoch_ns)):
        yield Out(
            log_ns=t_ns, publish_ns=t_ns, topic=topic, kind=kind, seq=count, make=partial(dict, content)
        )


Made = tuple[str, str, Callable[[], Message]]  # topic, type, and what makes the message


def _at_start(recording: Recording, t_ns: int) -> Iterator[Made]:
    placed = [
        encode.transform(pose, t_ns, names.EGO, sensor)
        for sensor, pose in recording.calibration.T_ego_sensor.items()
    ]
    yield names.TF_STATIC, ros.TF, lambda: {"transforms": placed}
    for camera in recording.calibration.cameras:
        yield names.info_topic(camera), ros.CAMERA_INFO, _info(recording, camera, t_ns)


def _info(recording: Recording, camera: str, t_ns: int) -> Callable[[], Message]:
    return lambda: encode.camera_info(recording.calibration.cameras[camera], t_ns, camera)


def _of(message: Measurement, epoch_ns: int) -> tuple[Made, ...]:
    """What a measurement becomes. Corners and velocity come before the message that they belong to."""
    name = message.sensor
    match message:
        case LidarScan():
            return ((names.points_topic(name), ros.CLOUD, lambda: encode.cloud(message, epoch_ns)),)
        case CameraImage():
            image = (names.image_topic(name), ros.COMPRESSED_IMAGE, lambda: encode.picture(message, epoch_ns))
            return (image,)
        case Detections():
            return (
                (names.corners_topic(name), ros.NUMBERS, lambda: encode.corners(message)),
                (names.detections_topic(name), ros.DETECTIONS, lambda: encode.detections(message, epoch_ns)),
            )
        case EgoMotion():
            return (
                (names.velocity_topic(name), ros.TWIST, lambda: encode.velocity(message, epoch_ns)),
                (names.imu_topic(name), ros.IMU, lambda: encode.imu(message, epoch_ns)),
            )


def _write_all(file: BinaryIO, outs: list[Out], epoch_s: int, about: dict[str, str]) -> Written:
    from mcap.writer import CompressionType, Writer

    writer = Writer(file, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
    writer.start(profile="ros2", library=LIBRARY)
    writer.add_metadata(names.METADATA, about)
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    epoch_ns = epoch_s * names.S_TO_NS
    written = Written()
    for out in outs:
        if out.topic not in channels:
            channels[out.topic] = _channel(writer, schemas, out)
            written.kinds[out.topic] = out.kind
        writer.add_message(
            channel_id=channels[out.topic], log_time=out.log_ns + epoch_ns, sequence=out.seq,
            publish_time=out.publish_ns + epoch_ns, data=as_cdr(out.kind, out.make()),
        )  # fmt: skip
        written.counts[out.topic] = written.counts.get(out.topic, 0) + 1
    if outs:
        written.first_ns, written.last_ns = outs[0].log_ns + epoch_ns, outs[-1].log_ns + epoch_ns
    writer.finish()  # type: ignore[no-untyped-call]
    return written


def _channel(writer: Writer, schemas: dict[str, int], out: Out) -> int:
    if out.kind not in schemas:
        schemas[out.kind] = writer.register_schema(
            name=out.kind, encoding="ros2msg", data=ros.schema_text(out.kind).encode("utf-8")
        )
    return writer.register_channel(
        topic=out.topic, message_encoding="cdr", schema_id=schemas[out.kind],
        metadata={"offered_qos_profiles": LATCHED if out.topic in ONCE else ""},
    )  # fmt: skip
