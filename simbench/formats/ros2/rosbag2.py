"""The `metadata.yaml` of a bag, version 5: what Humble writes, and all later ones read."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping

LATCHED = """\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false"""
"""Quality of service of a topic that is told once: reliable, and kept for whoever subscribes later."""


def metadata_yaml(
    file: str, counts: Mapping[str, int], kinds: Mapping[str, str], first_ns: int, last_ns: int,
    latched: Collection[str],
) -> str:  # fmt: skip
    """The text. file: the MCAP file's name; kinds: types by topic; times are log times as written."""
    total, span = sum(counts.values()), f"nanoseconds: {last_ns - first_ns}"
    start = f"nanoseconds_since_epoch: {first_ns}"
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 5",
        "  storage_identifier: mcap",
        f"  duration:\n    {span}",
        f"  starting_time:\n    {start}",
        f"  message_count: {total}",
        "  topics_with_message_count:",
    ]
    for topic, count in counts.items():
        lines += [
            "    - topic_metadata:",
            f"        name: {json.dumps(topic)}",
            f"        type: {kinds[topic]}",
            "        serialization_format: cdr",
            f"        offered_qos_profiles: {json.dumps(LATCHED if topic in latched else '')}",
            f"      message_count: {count}",
        ]
    lines += [
        '  compression_format: ""',
        '  compression_mode: ""',
        f"  relative_file_paths:\n    - {json.dumps(file)}",
        f"  files:\n    - path: {json.dumps(file)}",
        f"      starting_time:\n        {start}",
        f"      duration:\n        {span}",
        f"      message_count: {total}",
    ]
    return "\n".join(lines) + "\n"
