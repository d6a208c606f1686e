"""The file that says which topic is what."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarios.errors import BadInput
from simbench.formats.ros2.topics import default_map, load_topics
from tests.simbench.formats.ros2_foreign import (
    TREE,
    write_foreign,
)

EXAMPLE = """\
ego_frame: base_link
lidars:
  top:
    points: /os/points
    time: {field: t, unit: ns}
    intensity: {field: intensity, full: 255}
class_ids: {"2": car, person: pedestrian}
epoch_s: 0
"""


def test_a_topic_map_of_yaml_is_the_same(tmp_path: Path) -> None:
    (tmp_path / "topics.yaml").write_text(EXAMPLE, encoding="utf-8")
    told = load_topics(tmp_path / "topics.yaml")
    assert told.lidars["top"].time is not None and told.lidars["top"].time.unit == "ns"
    assert told.categories_by_id() == {"2": "car", "person": "pedestrian"} and told.epoch_s == 0
    assert told.transforms == ("/tf_static",)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("unit: ns", "unit: ms", r"line 5, lidars.top.time.unit: unknown value 'ms' \(allowed: s, us, ns\)"),
        ("points:", "point:", r"line 4, lidars.top.point: unknown key 'point'.*did you mean 'points'"),
        ("full: 255", "full: 0", "must be > 0"),
        ("person: pedestrian", "person: human", "line 7, class_ids.person: the category 'human' has no size"),
        ("epoch_s: 0", "epoch_s: -5", "must not be negative"),
        ("ego_frame: base_link\n", "", "'ego_frame' is missing"),
        ("epoch_s: 0", "transforms: [/os/points]", "the topic '/os/points' is named twice"),
        ("epoch_s: 0", "placed: {top: roof}", "two sensors are called 'top'"),
        (EXAMPLE, "ego_frame: base_link", "names no sensor"),
        (EXAMPLE, "- 1", "must be a mapping"),
    ],
)
def test_a_wrong_topic_map_is_told_with_its_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    (tmp_path / "topics.yaml").write_text(EXAMPLE.replace(old, new), encoding="utf-8")
    with pytest.raises(BadInput, match=says) as told:
        load_topics(tmp_path / "topics.yaml")
    assert "\n" not in str(told.value)


def test_a_bag_of_somebody_else_needs_a_topic_map(tmp_path: Path) -> None:
    bag = write_foreign(tmp_path / "bag", [TREE])
    with pytest.raises(BadInput, match="was not written by simbench"):
        default_map(bag / "bag.mcap")
