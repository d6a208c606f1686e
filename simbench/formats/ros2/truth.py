"""The truth of a recording as ROS messages, for looking at; everything under `/truth/`.

At the first true firing of every scan: where the ego and all objects are (`/truth/tf`), and a box around each
object (`/truth/markers`, in the ego frame). Once: where the sensors really are (`/truth/tf_static`, frames
`truth/SENSOR`). The 5 Hz reference (`/truth/reference`) is a point in the ego frame and no NavSatFix: it is
the target *relative to the ego*, the difference of two receivers in the ego's measured heading; a latitude
would need a place on earth, and an attitude, that the recording does not have.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Int64

from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2 import encode
from simbench.formats.ros2.cdr import Message
from simbench.formats.ros2.names import (
    EGO,
    TRUTH_MARKERS,
    TRUTH_REFERENCE,
    TRUTH_TF,
    TRUTH_TF_STATIC,
    WORLD,
)
from simbench.formats.ros2.rotation import quaternions_of
from simbench.truth import ObjectInfo, Truth

CUBE = 1
ALPHA = 0.35
COLOURS: Mapping[str, tuple[float, float, float]] = {
    "car": (0.12, 0.47, 0.71), "rider": (1.0, 0.5, 0.05), "pedestrian": (0.84, 0.15, 0.16),
    "board": (0.58, 0.4, 0.74), "tree": (0.17, 0.63, 0.17), "post": (0.5, 0.5, 0.5),
    "building": (0.55, 0.34, 0.29),
}  # fmt: skip
OTHER = (0.74, 0.74, 0.13)
Timed = tuple[int, str, str, Message]  # time on the bench's clock, topic, type, message


def truth_messages(truth: Truth, start_ns: int, epoch_ns: int) -> Iterator[Timed]:
    """All of it. start_ns: when what is always so is told."""
    fixed = [
        encode.transform(pose, start_ns + epoch_ns, EGO, f"truth/{sensor}")
        for sensor, pose in truth.calibration.T_ego_sensor.items()
    ]
    yield start_ns, TRUTH_TF_STATIC, ros.TF, {"transforms": fixed}
    t_ns = instants_ns(truth)
    ego = _listed(*truth.poses.ego(t_ns))
    world, near = dict[ObjectInfo, Listed](), dict[ObjectInfo, Listed]()
    for info in truth.objects:
        world[info] = _listed(*truth.poses.object_centre(info.object_id, t_ns))
        near[info] = _listed(*truth.box_in_ego(info.object_id, t_ns))
    for i, t in enumerate(t_ns.tolist()):
        moved = [encode.placed(*ego[i], t + epoch_ns, WORLD, EGO)]
        moved += [encode.placed(*at[i], t + epoch_ns, WORLD, frame_of(info)) for info, at in world.items()]
        yield t, TRUTH_TF, ros.TF, {"transforms": moved}
        boxes = [_box(info, *at[i], t + epoch_ns) for info, at in near.items()]
        yield t, TRUTH_MARKERS, ros.MARKERS, {"markers": boxes}
    reference = truth.reference
    if reference is not None:
        for fix, known, place in zip(
            reference.fix_ns.tolist(), reference.available_ns.tolist(), reference.position_ego_m, strict=True
        ):
            point = {"header": encode.header(fix + epoch_ns, EGO), "point": encode.vector(place)}
            yield known, TRUTH_REFERENCE, ros.POINT, point


def instants_ns(truth: Truth) -> Int64[np.ndarray, " n"]:
    """True times of the first firing of every scan that has points, and the last firing of all."""
    fired = [scan.fire_ns for scan in truth.scans if len(scan.fire_ns)]
    times = [int(fire.min()) for fire in fired] + ([max(int(f.max()) for f in fired)] if fired else [])
    return np.unique(np.array(times, dtype=np.int64))


def frame_of(info: ObjectInfo) -> str:
    """The frame of an object's box."""
    return f"truth/{info.object_id}/{info.name}"


Listed = list[tuple[list[float], list[float]]]  # translation and quaternion at every instant


def _listed(rotation: np.ndarray, translation_m: np.ndarray) -> Listed:
    return list(zip(translation_m.tolist(), quaternions_of(rotation).tolist(), strict=True))


def _box(info: ObjectInfo, xyz_m: list[float], quaternion: list[float], t_ns: int) -> Message:
    red, green, blue = COLOURS.get(info.category, OTHER)
    return {
        "header": encode.header(t_ns, EGO), "ns": info.category, "id": info.object_id, "type": CUBE,
        "pose": {
            "position": encode.vector(xyz_m),
            "orientation": encode.rotation(quaternion),
        },
        "scale": encode.vector(info.size_m),
        "color": {"r": red, "g": green, "b": blue, "a": ALPHA},
        "text": info.name,
    }  # fmt: skip
