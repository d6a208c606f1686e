"""From the transforms of a bag to where its sensors sit: `T_ego_sensor` along the tree of frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from fusion.geometry import Transform
from simbench.formats.ros2.cdr import Message, MessageError
from simbench.formats.ros2.decode import vector
from simbench.formats.ros2.rotation import matrix_of

MOST_FRAMES = 10_000
SAME = 1e-9  # metres, and parts of a rotation: a transform that is told again


class FrameTree:
    """Parent and pose of every frame, as told. A frame whose pose changed is no place for a sensor."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[str, Transform]] = {}
        self._moving: set[str] = set()

    def add(self, message: Message) -> None:
        """Take the transforms of a tf2_msgs/TFMessage. MessageError: one is no transform."""
        for told in message["transforms"]:
            parent, child = told["header"]["frame_id"], told["child_frame_id"]
            pose = _transform(told["transform"], child)
            before = self._above.get(child)
            if before is None and len(self._above) >= MOST_FRAMES:
                raise MessageError(f"there are more than {MOST_FRAMES} frames")
            if before is not None and (before[0] != parent or not _same(before[1], pose)):
                self._moving.add(child)
            self._above[child] = (parent, pose)

    def between(self, ego: str, sensor: str) -> Transform:
        """`T_ego_sensor`. MessageError: no transforms lead from one to the other, or they change."""
        ups = {frame: T for frame, T in self._upwards(ego)}
        for frame, T_frame_sensor in self._upwards(sensor):
            if frame in ups:
                return ups[frame].inverse() @ T_frame_sensor
        known = ", ".join(sorted(self._above)[:20]) or "none"
        raise MessageError(f"no transforms lead from '{ego[:60]}' to '{sensor[:60]}' (frames: {known[:300]})")

    def _upwards(self, frame: str) -> Iterable[tuple[str, Transform]]:
        """The frame and all above it, each with the frame's pose in it."""
        T_here_frame, here, steps = Transform.identity(), frame, 0
        yield here, T_here_frame
        while here in self._above:
            if here in self._moving:
                return  # what is above cannot be reached by one fixed pose
            here, T_parent_here = self._above[here]
            T_here_frame = T_parent_here @ T_here_frame
            steps += 1
            if steps > len(self._above):
                raise MessageError(f"the frames above '{frame[:60]}' go round in a circle")
            yield here, T_here_frame


def _transform(told: Mapping[str, Mapping[str, float]], child: str) -> Transform:
    t, r = told["translation"], told["rotation"]
    try:
        return Transform(
            rotation=matrix_of((r["x"], r["y"], r["z"], r["w"])),
            translation_m=vector(t, "translation"),
        )
    except MessageError:
        raise
    except ValueError as error:
        raise MessageError(f"the transform of '{child[:60]}' is none: {error}") from None


def _same(one: Transform, other: Transform) -> bool:
    apart = np.abs(one.rotation - other.rotation).max(), np.abs(one.translation_m - other.translation_m).max()
    return bool(max(apart) < SAME)
