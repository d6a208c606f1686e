"""Reads a ROS 2 bag as a drive: what a pipeline may see, whoever recorded it.

read_ros2(path, default_map(path))                 one that we wrote: equal to the original
read_ros2(path, load_topics(Path("topics.yaml")))  anybody's
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration, CategorySize
from scenarios.errors import BadInput
from simbench.formats.ros2.assemble import Assembled, assemble
from simbench.formats.ros2.cdr import MessageError
from simbench.formats.ros2.frames import FrameTree
from simbench.formats.ros2.names import S_TO_NS
from simbench.formats.ros2.taken import Item, refused, take
from simbench.formats.ros2.topics import TopicMap
from simbench.log import Log


@dataclass(frozen=True, kw_only=True, eq=False)
class Imported:
    """A drive, and in words what of the file is not in it. epoch_s: the file's second that is 0."""

    log: Log
    notes: tuple[str, ...]
    epoch_s: int


def read_ros2(path: Path, topics: TopicMap) -> Log:
    """The drive of a bag: an MCAP file, or a folder that holds one. BadInput: what is wrong, with topic and
    message."""
    return import_ros2(path, topics).log


def import_ros2(path: Path, topics: TopicMap) -> Imported:
    """The same, and what was left out."""
    file = mcap_of(path)
    tree = FrameTree()
    items = sorted(take(file, topics, tree), key=lambda item: item.log_ns)  # stable: order of arrival
    frames = _frames(items, topics, str(file))
    cameras = _cameras(items, topics, str(file))
    poses = {name: _pose(tree, topics, name, frame, str(file)) for name, frame in frames.items()}
    calibration = Calibration(T_ego_sensor=poses, cameras=cameras)
    _check_sizes(items, cameras, str(file))
    epoch_s = _epoch_s(items, topics)
    made = assemble(items, topics, tree, epoch_s * S_TO_NS, str(file))
    categories = {
        name: CategorySize(mean_m=size.mean_m, spread=size.spread) for name, size in topics.sizes.items()
    }
    log = Log(calibration=calibration, categories=categories, messages=made.messages)
    return Imported(log=log, notes=_notes(made), epoch_s=epoch_s)


def mcap_of(path: Path) -> Path:
    """The MCAP file of a bag. BadInput: the folder has none, or several."""
    try:
        if not path.is_dir():
            return path
        found = sorted(child for child in path.iterdir() if child.suffix == ".mcap")
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror or error}", file=str(path)) from None
    if len(found) != 1:
        raise BadInput(f"holds {len(found)} MCAP files", file=str(path), allowed="one (see ros2 bag convert)")
    if found[0].is_symlink():
        raise BadInput("is a link", file=str(found[0]))
    return found[0]


def _frames(items: Sequence[Item], topics: TopicMap, file: str) -> dict[str, str]:
    """The frame of every sensor whose place is told. BadInput: its messages are in several. A message that
    names no frame is in the one that is known."""
    given = {name: lidar.frame for name, lidar in topics.lidars.items()}
    given |= {name: camera.frame for name, camera in topics.cameras.items()}
    found = {name: frame for name, frame in given.items() if frame is not None}
    for item in items:
        name = item.role.sensor
        if name not in given or not item.frame:
            continue
        if found.setdefault(name, item.frame) != item.frame:
            problem = f"its frame is '{item.frame[:60]}', that of {name} is '{found[name][:60]}'"
            raise refused(item.topic, item.number, problem, file)
    return {name: found.get(name, "") for name in given} | dict(topics.placed)


def _pose(tree: FrameTree, topics: TopicMap, name: str, frame: str, file: str) -> Transform:
    try:
        return tree.between(topics.ego_frame, frame)
    except MessageError as error:
        raise BadInput(f"where '{name}' sits is not known: {error}", file=file) from None


def _cameras(items: Iterable[Item], topics: TopicMap, file: str) -> dict[str, PinholeCamera]:
    found: dict[str, PinholeCamera] = {}
    for item in items:
        if item.role.kind == "info":
            if found.setdefault(item.role.sensor, item.content) != item.content:
                raise refused(item.topic, item.number, "the camera's calibration changes", file)
    return {name: found[name] for name in topics.cameras}


def _check_sizes(items: Iterable[Item], cameras: Mapping[str, PinholeCamera], file: str) -> None:
    for item in items:
        if item.role.kind == "image":
            camera, (height, width) = cameras[item.role.sensor], item.content.shape[:2]
            if (width, height) != (camera.width_px, camera.height_px):
                told = f"{camera.width_px}x{camera.height_px}"
                problem = f"it has {width}x{height} pixels, its CameraInfo says {told}"
                raise refused(item.topic, item.number, problem, file)


def _epoch_s(items: Sequence[Item], topics: TopicMap) -> int:
    if topics.epoch_s != "first":
        return topics.epoch_s
    return items[0].log_ns // S_TO_NS if items else 0


def _notes(made: Assembled) -> tuple[str, ...]:
    """What was left out, one sentence each."""
    words: Mapping[str, str] = {
        "misses": "points of {name} are no returns (not finite, or at the sensor's centre) and were left out",
        "cut": "intensities of {name} were below 0 or above 1 and were cut",
        "class": "boxes of the class '{name}' were left out: it is none of the categories",
        "unclassed": "boxes of {name} have no class and were left out",
        "untracked": "boxes of {name} have no track and got one each",
        "early": "messages of {name} came before the first velocity and were left out",
    }
    counts: Counter[tuple[str, str]] = made.counts
    return tuple(f"{n} {words[what].format(name=name)}" for (what, name), n in sorted(counts.items()) if n)
