"""The paper's figure of distances: how far every object is, by the boxes of each camera that sees it.

A curve is what one pipeline says of one object by one camera's boxes, one value a scan. Where two cameras see
one object in one scan their curves should join; `disagreements` says how far they are apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import readonly
from fusion.messages import FusionOutput
from simbench.recording import Recording
from simbench.score.frames import Frame
from simbench.score.identity import identify
from simbench.score.pairs import frames_and_pairs, planar_range_m


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """`object_name` by the boxes of `camera`. Distances are planar, from the LiDAR, at `t_ns` (the answer's
    stamps), by scan in order."""

    pipeline: str
    object_name: str
    camera: str
    scan_seq: Int64[np.ndarray, " n"]
    t_ns: Int64[np.ndarray, " n"]
    distance_m: Float64[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueCurve:
    """Where the centre of an object's box truly is, at the scans' first firings; planar, from the LiDAR."""

    object_name: str
    t_ns: Int64[np.ndarray, " n"]
    distance_m: Float64[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Distances:
    """All curves of a run: the true ones in the order of the objects that were asked for."""

    true: tuple[TrueCurve, ...] = ()
    curves: tuple[Curve, ...] = ()

    def of(self, pipeline: str) -> tuple[Curve, ...]:
        return tuple(curve for curve in self.curves if curve.pipeline == pipeline)


@dataclass(frozen=True, kw_only=True, eq=False)
class Disagreement:
    """|difference| of two cameras that see one object in one scan [n], by scan."""

    object_name: str
    t_ns: Int64[np.ndarray, " n"]
    apart_m: Float64[np.ndarray, " n"]


def distances(
    recording: Recording, outputs: Mapping[str, Sequence[FusionOutput]], names: Sequence[str]
) -> Distances:
    """The curves of the named objects, of every pipeline. ValueError for a name that is not there."""
    frames, _ = frames_and_pairs(recording.by_target[0])
    known = {info.name: info.object_id for info in recording.truth.objects}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"no object {unknown[0]!r}; there are: {', '.join(known)}")
    if not frames:
        return Distances()
    stamps = np.array([frame.scan.stamp_ns for frame in frames], dtype=np.int64)
    true = tuple(
        TrueCurve(
            object_name=name,
            t_ns=readonly(stamps),
            distance_m=readonly(_true_m(recording, known[name], frames[0].scan.sensor, stamps)),
        )
        for name in names
    )
    wanted = {known[name]: name for name in names}
    return Distances(
        true=true,
        curves=tuple(
            curve
            for pipeline, answers in outputs.items()
            for curve in _curves(pipeline, frames, answers, wanted)
        ),
    )


def _true_m(
    recording: Recording, object_id: int, lidar: str, t_ns: Int64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """Planar distance of the box's centre from the LiDAR's rest position, ego frame."""
    truth = recording.truth
    _, centre = truth.box_in_ego(object_id, t_ns)
    return planar_range_m(centre - truth.calibration.T_ego_sensor[lidar].translation_m)


def _curves(
    pipeline: str, frames: Sequence[Frame], answers: Sequence[FusionOutput], wanted: Mapping[int, str]
) -> tuple[Curve, ...]:
    """One curve per wanted object and camera."""
    by_scan = {(o.scan_sensor, o.scan_seq): o for o in answers}
    found: dict[tuple[int, str], dict[int, tuple[int, float]]] = {}
    for frame in frames:
        for one in identify(frame, by_scan.get(frame.key)):
            if one.object_id in wanted:
                curve = found.setdefault((one.object_id, one.found.sensor), {})
                curve.setdefault(frame.scan.seq, (one.found.stamp_ns, one.found.distance_m))
    order = {object_id: place for place, object_id in enumerate(wanted)}
    return tuple(
        Curve(
            pipeline=pipeline,
            object_name=wanted[object_id],
            camera=camera,
            scan_seq=readonly(np.array(list(values), dtype=np.int64)),
            t_ns=readonly(np.array([t for t, _ in values.values()], dtype=np.int64)),
            distance_m=readonly(np.array([d for _, d in values.values()], dtype=np.float64)),
        )
        for (object_id, camera), values in sorted(found.items(), key=lambda i: (order[i[0][0]], i[0][1]))
    )


def disagreements(curves: Sequence[Curve]) -> tuple[Disagreement, ...]:
    """One for every object of one pipeline's curves: a value for every two cameras in every scan that both
    see it in. Empty arrays for what no two cameras see at once."""
    by_object: dict[str, list[Curve]] = {}
    for curve in curves:
        by_object.setdefault(curve.object_name, []).append(curve)
    return tuple(_apart(name, members) for name, members in by_object.items())


def _apart(name: str, members: Sequence[Curve]) -> Disagreement:
    t_ns, apart_m = [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for a, b in combinations(members, 2):
        _, in_a, in_b = np.intersect1d(a.scan_seq, b.scan_seq, assume_unique=True, return_indices=True)
        t_ns.append(a.t_ns[in_a])
        apart_m.append(np.abs(a.distance_m[in_a] - b.distance_m[in_b]))
    times, apart = np.concatenate(t_ns), np.concatenate(apart_m)
    order = np.argsort(times, kind="stable")
    return Disagreement(object_name=name, t_ns=readonly(times[order]), apart_m=readonly(apart[order]))
