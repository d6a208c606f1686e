"""What topics, frames and the clock of a bag are called.

ROS 2 allows letters, digits and `_` in a topic: `cam-front` speaks on `/cam_front/...`; its frame keeps its
name. Everything of the truth is under `/truth/`. ROS times count from 0 upwards, the bench's clock begins
anywhere: a whole number of seconds is added to all times of a file, and said in its metadata.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from scenarios.errors import BadInput, printable

METADATA = "simbench"  # name of the MCAP metadata record
SCHEMA = "simbench-ros2/1"
EPOCH_S = 1_000_000_000  # 2001-09-09 01:46:40 UTC is the bench's 0
LAST_S = 2**31 - 1  # a ROS time's seconds
S_TO_NS = 1_000_000_000

EGO, WORLD = "ego", "world"
TF_STATIC = "/tf_static"
TRUTH = "/truth"
TRUTH_TF, TRUTH_TF_STATIC = f"{TRUTH}/tf", f"{TRUTH}/tf_static"
TRUTH_MARKERS, TRUTH_REFERENCE = f"{TRUTH}/markers", f"{TRUTH}/reference"
_TAKEN = frozenset({EGO, WORLD, "truth", "tf", "tf_static"})


def points_topic(sensor: str) -> str:
    return f"/{_word(sensor)}/points"


def image_topic(sensor: str) -> str:
    return f"/{_word(sensor)}/image/compressed"


def info_topic(sensor: str) -> str:
    return f"/{_word(sensor)}/camera_info"


def detections_topic(sensor: str) -> str:
    return f"/{_word(sensor)}/detections"


def corners_topic(sensor: str) -> str:
    return f"/{_word(sensor)}/detections/corners"


def imu_topic(sensor: str) -> str:
    return f"/ego/{_word(sensor)}"


def velocity_topic(sensor: str) -> str:
    return f"/ego/{_word(sensor)}/odometry_velocity"


def check_sensors(names: Iterable[str]) -> None:
    """BadInput: a sensor has a name that no topic can have, or two would speak on the same."""
    seen: dict[str, str] = {}
    for name in names:
        word = _word(name)
        if not re.fullmatch(r"[A-Za-z]\w*", word, flags=re.ASCII) or word in _TAKEN:
            shown = printable(name[:60])
            raise BadInput(
                f"a sensor called '{shown}' cannot have a ROS topic", allowed="letters, digits, -, _"
            )
        if seen.setdefault(word, name) != name:
            raise BadInput(f"the sensors '{seen[word]}' and '{name}' would have the same ROS topics")


def epoch_s(times_ns: Iterable[int]) -> int:
    """Seconds to add to all times of a file: `EPOCH_S`, or 0 where the times count from 1970 already.
    BadInput: no ROS time can tell them."""
    times = list(times_ns) or [0]
    first, last = min(times), max(times)
    for seconds in (EPOCH_S, 0):
        if first + seconds * S_TO_NS >= 0 and (last // S_TO_NS) + seconds < LAST_S:
            return seconds
    raise BadInput(f"times from {first} to {last} ns do not fit into a ROS time", allowed="0 to 2^31 s")


def _word(sensor: str) -> str:
    return sensor.replace("-", "_")
