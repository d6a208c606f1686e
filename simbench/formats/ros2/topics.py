"""Which topic of a bag is which sensor: a YAML file that the user writes, or what our own bags say of
themselves. `docs/formats.md` has an example."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from scenarios.categories import CATEGORY_SIZES, SIZE_SPREAD
from scenarios.errors import BadInput, Where
from scenarios.scenario import Spec, broken
from scenarios.validate import validate
from scenarios.yaml_source import read_yaml
from simbench.formats.mcap_records import Found, read_records
from simbench.formats.ros2 import names

COCO: Mapping[str, str] = MappingProxyType(
    {
        "person": "pedestrian", "bicycle": "rider", "car": "car", "motorcycle": "rider",
        "0": "pedestrian", "1": "rider", "2": "car", "3": "rider",
    }  # trucks and buses are none of our categories: their size is another
)  # fmt: skip
Name = str
Topic = str
Metres = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class PointTime(Spec):
    """Where a point's firing time stands. counts_from: the message's stamp, or 1970 (absolute)."""

    field: str
    unit: Literal["s", "us", "ns"]
    counts_from: Literal["stamp", "1970"] = "stamp"


class PointIntensity(Spec):
    """full: the number that means 1."""

    field: str
    full: float = Field(default=1.0, gt=0.0, allow_inf_nan=False)


class LidarTopics(Spec):
    """frame: default: what the messages say. time: default: all points at the stamp."""

    points: Topic
    frame: Name | None = None
    time: PointTime | None = None
    ring: str | None = None
    intensity: PointIntensity | None = None


class CameraTopics(Spec):
    """rectified: images and boxes are those after rectification, so that P holds and there is no distortion.
    corners: exact boxes, in our own bags."""

    info: Topic
    image: Topic | None = None
    detections: Topic | None = None
    corners: Topic | None = None
    frame: Name | None = None
    rectified: bool = False


class ImuTopics(Spec):
    """velocity: a TwistStamped or an Odometry; every IMU message gets the newest one before it."""

    imu: Topic
    velocity: Topic


class MeanSize(Spec):
    """Length, width, height of a category, and the relative spread (1 SD) of each."""

    mean_m: tuple[Metres, Metres, Metres]
    spread: float = Field(default=SIZE_SPREAD, ge=0.0, allow_inf_nan=False)


class TopicMap(Spec):
    """Sensors by the name that pipelines are told.

    ego_frame: the TF frame on the ground below the LiDAR, x forward. placed: frames of other sensors whose
    place pipelines are told. class_ids: our category for each `class_id`; those of others are left out.
    sizes: of all categories (default: ours). sequence: number messages as they come (their stamps must
    rise), or as the file numbers them. epoch_s: what the bench's clock calls 0, in seconds of the file.
    """

    ego_frame: Name
    lidars: dict[Name, LidarTopics] = Field(default_factory=dict)
    cameras: dict[Name, CameraTopics] = Field(default_factory=dict)
    imus: dict[Name, ImuTopics] = Field(default_factory=dict)
    placed: dict[Name, Name] = Field(default_factory=dict)
    transforms: tuple[Topic, ...] = (names.TF_STATIC,)
    class_ids: Literal["ours", "coco"] | dict[str, str] = "ours"
    sizes: dict[str, MeanSize] = Field(
        default_factory=lambda: {name: MeanSize(mean_m=size) for name, size in CATEGORY_SIZES.items()}
    )
    sequence: Literal["count", "file"] = "count"
    epoch_s: Annotated[int, Field(ge=0, le=names.LAST_S)] | Literal["first"] = "first"

    @model_validator(mode="after")
    def _makes_sense(self) -> TopicMap:
        if not (self.lidars or self.cameras or self.imus):
            raise broken("names no sensor", "lidars")
        seen: set[str] = set()
        for group in (self.lidars, self.cameras, self.imus, self.placed):
            for name in group:
                if name in seen:
                    raise broken(f"two sensors are called '{name}'", "lidars")
                seen.add(name)
        topics = [topic for _, topic in self.topics()] + list(self.transforms)
        for topic in topics:
            if topics.count(topic) > 1:
                raise broken(f"the topic '{topic}' is named twice", "lidars")
        for class_id, category in self.categories_by_id().items():
            if category not in self.sizes:
                raise broken(f"the category '{category}' has no size", "class_ids", class_id)
        return self

    def topics(self) -> Iterator[tuple[str, Topic]]:
        """Sensor and topic of all that the map names but transforms."""
        for name, lidar in self.lidars.items():
            yield name, lidar.points
        for name, camera in self.cameras.items():
            given = (camera.info, camera.image, camera.detections, camera.corners)
            yield from ((name, topic) for topic in given if topic is not None)
        for name, imu in self.imus.items():
            yield from ((name, imu.imu), (name, imu.velocity))

    def categories_by_id(self) -> Mapping[str, str]:
        """Our category for every class id that is known."""
        if isinstance(self.class_ids, dict):
            return self.class_ids
        if self.class_ids == "coco":
            return {word: name for word, name in COCO.items() if name in self.sizes}
        return {name: name for name in self.sizes}


def load_topics(path: Path) -> TopicMap:
    """The topic map of a YAML file. BadInput: file, line and field of what is wrong."""
    document = read_yaml(path)
    return validate(TopicMap, document.data, document.where)


def default_map(path: Path) -> TopicMap:
    """The topic map of a bag that we wrote. BadInput: somebody else did, or what it says is malformed."""
    about = _about(path)
    where = Where(file=str(path))
    if about is None or about.get("schema") != names.SCHEMA:
        raise BadInput("was not written by simbench: say which topic is what in a topic map", file=str(path))
    try:
        said = {key: json.loads(about[key]) for key in ("categories", "lidars", "cameras", "imus", "placed")}
        there, epoch_s = set(json.loads(about["topics"])), int(about["epoch_s"])
        tree = _tree(said, there) | {"epoch_s": epoch_s}
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError):
        raise BadInput("what it says of itself is malformed (metadata 'simbench')", file=str(path)) from None
    return validate(TopicMap, tree, where)


def _about(path: Path) -> dict[str, str] | None:
    """The metadata record, which stands before all messages."""
    for record in read_records(path, checked=False):
        if isinstance(record, Found):
            return None
        if record.name == names.METADATA:
            return dict(record.metadata)
    return None


def _tree(said: Mapping[str, Any], there: set[str]) -> dict[str, Any]:
    """A topic map as plain data."""
    others = set(said["placed"]) - {*said["lidars"], *said["cameras"]}
    return {
        "ego_frame": names.EGO,
        "lidars": {name: _lidar(name) for name in said["lidars"]},
        "cameras": {name: _camera(name, there) for name in said["cameras"]},
        "imus": {
            name: {"imu": names.imu_topic(name), "velocity": names.velocity_topic(name)}
            for name in said["imus"]
        },
        "placed": {name: name for name in said["placed"] if name in others},
        "sizes": said["categories"],
        "sequence": "file",
    }


def _lidar(name: str) -> dict[str, Any]:
    return {
        "points": names.points_topic(name), "frame": name, "ring": "ring",
        "time": {"field": "t", "unit": "ns"}, "intensity": {"field": "intensity"},
    }  # fmt: skip


def _camera(name: str, there: set[str]) -> dict[str, Any]:
    given = {
        "image": names.image_topic(name), "detections": names.detections_topic(name),
        "corners": names.corners_topic(name),
    }  # fmt: skip
    topics = {key: topic for key, topic in given.items() if topic in there}
    return {"info": names.info_topic(name), "frame": name, **topics}
