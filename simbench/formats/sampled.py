"""Poses of a recorded drive: samples of everything at even times, and what lies between two of them.

Positions go evenly from sample to sample, rotations along the shortest arc (SLERP). At 1 ms apart that errs
by a dt^2 / 8: about a micrometre at 10 m/s^2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from simbench.truth import PoseSource

STEP_NS = 1_000_000
BEYOND_NS = 200_000_000  # before the first and after the last time that anything is known of
EGO = "ego"
Span = tuple[int, int]  # first and last
Poses = tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Poses of one body at rising times. At these they are exact."""

    t_ns: Int64[np.ndarray, " k"]
    rotation: Float64[np.ndarray, "k 3 3"]
    translation_m: Float64[np.ndarray, "k 3"]

    def at(self, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """ValueError: a time is before the first sample or after the last."""
        t = np.asarray(t_ns, dtype=np.int64)
        if len(t) and (t.min() < self.t_ns[0] or t.max() > self.t_ns[-1]):
            raise ValueError(f"poses are known from {self.t_ns[0]} to {self.t_ns[-1]} ns only")
        low = np.searchsorted(self.t_ns, t, side="right") - 1
        high = np.minimum(low + 1, len(self.t_ns) - 1)
        share = (t - self.t_ns[low]) / np.maximum(self.t_ns[high] - self.t_ns[low], 1)
        before, after = self.translation_m[low], self.translation_m[high]
        exact = share == 0.0  # not even the sign of a zero may change
        position = np.where(exact[:, None], before, before + share[:, None] * (after - before))
        turned = _turned(self.rotation[low], self.rotation[high], share)
        return np.where(exact[:, None, None], self.rotation[low], turned), position


class SampledPoses:
    """The `PoseSource` of a recording. bodies: `ego`, `object ID` and `sensor NAME`."""

    def __init__(self, bodies: Mapping[str, Samples]) -> None:
        self.bodies = dict(bodies)

    def ego(self, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_ego."""
        return self.bodies[EGO].at(t_ns)

    def object_centre(self, object_id: int, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_box. KeyError: no such object."""
        return self.bodies[object_name(object_id)].at(t_ns)

    def sensor(self, sensor: str, t_ns: Int64[np.ndarray, " n"]) -> Poses:
        """T_world_sensor. KeyError: no such sensor."""
        return self.bodies[sensor_name(sensor)].at(t_ns)


def sampled(
    poses: PoseSource, object_ids: Iterable[int], sensors: Iterable[str], true_ns: Span, asked_ns: Span
) -> Iterator[tuple[str, Samples]]:
    """Every body and its samples, from before the first to after the last time; what stands still has two.
    true_ns: when something was measured; asked_ns: also what stamps claim: there scores ask for ego and
    objects."""
    t_ns, t_asked_ns = _steps(true_ns), _steps(asked_ns)
    yield EGO, _kept(t_asked_ns, *poses.ego(t_asked_ns))
    for i in object_ids:
        yield object_name(i), _kept(t_asked_ns, *poses.object_centre(i, t_asked_ns))
    for name in sensors:
        yield sensor_name(name), _kept(t_ns, *poses.sensor(name, t_ns))


def _steps(span_ns: Span) -> Int64[np.ndarray, " k"]:
    return np.arange(
        span_ns[0] - BEYOND_NS, span_ns[1] + BEYOND_NS + STEP_NS, STEP_NS, dtype=np.int64
    )  # fmt: skip


def object_name(object_id: int) -> str:
    """What a body is called."""
    return f"object {object_id}"


def sensor_name(sensor: str) -> str:
    """What a sensor's body is called."""
    return f"sensor {sensor}"


def _kept(
    t_ns: Int64[np.ndarray, " k"],
    rotation: Float64[np.ndarray, "k 3 3"],
    position: Float64[np.ndarray, "k 3"],
) -> Samples:
    still = all(bool((pose[1:] == pose[:-1]).all()) for pose in (rotation, position))
    rows = np.array([0, -1]) if still else slice(None)
    return Samples(t_ns=t_ns[rows], rotation=rotation[rows], translation_m=position[rows])


def _turned(
    before: Float64[np.ndarray, "n 3 3"],
    after: Float64[np.ndarray, "n 3 3"],
    share: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, "n 3 3"]:
    from scipy.spatial.transform import Rotation  # scipy.spatial takes a while to import

    if not len(before):
        return before
    step = Rotation.from_matrix(before.transpose(0, 2, 1) @ after).as_rotvec()
    part: np.ndarray = before @ Rotation.from_rotvec(share[:, None] * step).as_matrix()
    return part
