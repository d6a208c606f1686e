"""The compiled part of `cones.py`: which cones about the rays of fans need a closer look, and rays in them.

`_edges` casts the middle rays a second time, four fans side by side, at geoms grown by the cones' radius, and
notes what each one meets. `_cast_cones` takes the cones that this leaves one by one and casts their rays at
no more than what was noted.
"""

# mypy: no-check-untyped-defs
from __future__ import annotations

import numpy as np

from simbench.sensors import ray_kernel
from simbench.sensors.compiled import jit_inline, jit_no_alias, jit_with
from simbench.sensors.ray_kernel import (
    BLOCK,
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    LANES,
    PLANE,
    SUPERBLOCK,
    _cull,
    _fans_plane,
    _fans_solid,
    _finish,
    _frames_of,
    _hit,
    _inside,
    _lane_from_inside,
    _lanes,
    _lanes_of_still,
    _reached,
)

BITS = 63  # geoms in one word of a set


@jit_no_alias
def _note(begin, end, i, bit, t, own, limit, nearest, met, near):  # type: ignore[no-untyped-def]
    """What rays met a geom at t: into the set of all, and of those nearer than a limit; and the nearest of
    others than the rays' own."""
    for j in range(begin, end):
        for lane in range(LANES):
            at = t[j, lane]
            met[j, lane] |= bit if at < np.inf else 0
            near[j, lane] |= bit if at < limit[j, lane] else 0
            other = (at < nearest[j, lane]) & (own[j, lane] != i)
            nearest[j, lane] = at if other else nearest[j, lane]


@jit_inline
def _shrunk(kind, size, by, out):  # type: ignore[no-untyped-def]
    """A geom's size made smaller by at least `by` on all sides; False where nothing is left."""
    least = size[0]
    if kind == CYLINDER:
        least = min(least, size[1])
    elif kind == BOX or kind == ELLIPSOID:
        least = min(least, size[1], size[2])
    if kind == PLANE or least <= by * (1.0 + 1e-9) + 1e-9:
        return False
    for r in range(3):
        out[r] = size[r] * (1.0 - by / least) if kind == ELLIPSOID else size[r] - by
    if kind == CAPSULE:
        out[1] = size[1]
    return True


@jit_inline
def _fills(kind, size, M, o, lane, s, x, by, limit, small, work):  # type: ignore[no-untyped-def]
    """Whether a geom made smaller by `by` is met by the ray (s, x) of a fan, not beyond a limit."""
    if not _shrunk(kind, size, by, small):
        return False
    for r in range(3):
        work[0, r] = o[r, lane]
        work[1, r] = M[3 * r, lane] + s * M[3 * r + 1, lane] + x * M[3 * r + 2, lane]
    return _hit(kind, small, work[0], work[1], work[2]) <= limit


@jit_with(ray_kernel)
def _edges(  # type: ignore[no-untyped-def]
    kind, size, grown, bound, row, still, table, path, key, weight, R, origin, pose_of, frame, slope, skew,
    first_step, last_step, low, bins_per_slope, slack, skew_max, widening, depth, deepest, range_m, geom,
    cosine, out_fan, out_step, out_first, out_member,
):  # fmt: skip
    """Which rays' cones may hold more than one surface: [n] into out_fan and out_step, and with each one the
    geoms, planes left out, that any ray within it may meet: out_member[out_first[n] : out_first[n + 1]].

    size, grown: of the geoms as they are and grown, `bound` of the latter. range_m, geom, cosine [f k]: what
    the rays themselves met. Returns n, or -1 where out_member is too short.
    """
    fans, end = range_m.shape
    stop = pose_of.shape[0]
    geoms = kind.shape[0]
    least, most = slope[:, 0].min(), slope[:, end - 1].max()
    W = np.empty((stop, 9))
    for f in range(stop):
        p = pose_of[f]
        for r in range(3):
            for c in range(3):
                W[f, 3 * r + c] = (
                    R[p, r, 0] * frame[f, 0, c] + R[p, r, 1] * frame[f, 1, c] + R[p, r, 2] * frame[f, 2, c]
                )
    everything, count = np.empty(geoms, np.int64), 0
    for i in range(geoms):
        if kind[i] != PLANE:
            everything[count] = i
            count += 1
    near, close, here = np.empty(geoms, np.int64), np.empty(geoms, np.int64), np.empty(geoms, np.int64)
    words = (count + BITS - 1) // BITS
    met, within = np.zeros((words, end, LANES), np.int64), np.zeros((words, end, LANES), np.int64)
    t, facing, who = np.empty((end, LANES)), np.empty((end, LANES)), np.empty((end, LANES), np.int32)
    own, limit, nearest = np.empty((end, LANES)), np.empty((end, LANES)), np.empty((end, LANES))
    norm, filled = np.empty((end, LANES)), np.empty((end, LANES), np.bool_)
    G, C, M, o, X = (
        np.empty((9, LANES)), np.empty((3, LANES)), np.empty((9, LANES)), np.empty((3, LANES)),
        np.empty((3, LANES)),
    )  # fmt: skip
    W4, P4, work, plane = np.empty((9, LANES)), np.empty((3, LANES)), np.empty((3, 3)), np.empty((5, 3))
    key4, weight4, small = np.empty(LANES, np.int64), np.empty(LANES), np.empty(3)
    outside = np.empty(LANES, np.bool_)  # of all grown geoms
    extent, lowest, highest = np.empty((3, LANES)), np.empty(LANES), np.empty(LANES)
    # Of each geom: the last group of fans whose rays met it, between which steps, and its farthest limit.
    seen, first_j, last_j, farthest = (
        np.full(geoms, -1),
        np.empty(geoms, np.int64),
        np.empty(geoms, np.int64),
        np.empty(geoms),
    )
    found, entries = 0, 0
    out_first[0] = 0
    for superblock in range(0, stop, SUPERBLOCK):
        superstop = min(superblock + SUPERBLOCK, stop)
        many = _cull(
            superblock, superstop, kind, grown, bound, row, still, table, path, key, weight, origin, pose_of,
            W, least - slack, most + slack, skew_max + slack, everything, count, plane, near,
        )  # fmt: skip
        for block in range(superblock, superstop, BLOCK):
            blockstop = min(block + BLOCK, superstop)
            some = _cull(
                block, blockstop, kind, grown, bound, row, still, table, path, key, weight, origin, pose_of,
                W, least - slack, most + slack, skew_max + slack, near, many, plane, close,
            )  # fmt: skip
            for fan in range(block, blockstop, LANES):
                few = _cull(
                    fan, fan + LANES, kind, grown, bound, row, still, table, path, key, weight, origin,
                    pose_of, W, least - slack, most + slack, skew_max + slack, close, some, plane, here,
                )  # fmt: skip
                if few == 0:
                    continue
                s, x = slope[fan // LANES], skew[fan // LANES]
                for lane in range(LANES):
                    f = min(fan + lane, fans - 1)
                    key4[lane], weight4[lane] = key[pose_of[f]], weight[pose_of[f]]
                    for r in range(9):
                        W4[r, lane] = W[f, r]
                    for r in range(3):
                        P4[r, lane] = origin[pose_of[f], r]
                    for j in range(end):
                        i = geom[f, j]
                        norm[j, lane] = np.sqrt(1.0 + s[j, lane] * s[j, lane] + x[j, lane] * x[j, lane])
                        filled[j, lane] = True
                        if i < 0 or kind[i] == PLANE:  # ground and sky have no limit, and count as no geom
                            own[j, lane], limit[j, lane] = -1.0, np.inf
                        else:
                            deep = widening * depth[i] * range_m[f, j] / max(float(cosine[f, j]), 1e-3)
                            far = range_m[f, j] + min(deep, deepest)
                            own[j, lane], limit[j, lane], filled[j, lane] = i, far / norm[j, lane], False
                            if seen[i] != fan:
                                seen[i], first_j[i], last_j[i], farthest[i] = fan, j, j, far
                            first_j[i], last_j[i] = min(first_j[i], j), max(last_j[i], j)
                            farthest[i] = max(farthest[i], far)
                        nearest[j, lane] = limit[j, lane]
                met[: few // BITS + 1], within[: few // BITS + 1] = 0, 0
                outside[:] = True
                for m in range(few):
                    i = here[m]
                    if row[i] < 0:
                        _lanes_of_still(still[i], P4, W4, M, o, X)
                    else:
                        _frames_of(row[i], table, key4, weight4, G, C)
                        _lanes(G, C, P4, W4, M, o, X)
                    stretch = 1.0 if row[i] < 0 else 1.01  # a frame between two keys is not quite rigid
                    j0, j1 = _reached(
                        kind[i], grown[i], M, X, stretch, skew_max + slack, slack, 1.0, 1.0, low,
                        bins_per_slope, first_step[fan // LANES], last_step[fan // LANES], 0, end, extent,
                        lowest, highest,
                    )  # fmt: skip
                    if j0 >= j1:
                        continue
                    t[j0:j1] = np.inf
                    for lane in range(LANES):
                        x0, y0, z0 = o[0, lane], o[1, lane], o[2, lane]
                        if x0 * x0 + y0 * y0 + z0 * z0 > 1.01 * bound[i] * bound[i] + 1e-6:
                            continue
                        if _inside(kind[i], grown[i], x0, y0, z0):
                            outside[lane] = False
                            _lane_from_inside(
                                kind[i], grown[i], M, o, s, x, lane, j0, j1, i, t, who, facing, work
                            )
                    _fans_solid(kind[i], grown[i], M, o, s, x, j0, j1, i, t, who, facing)
                    _note(
                        j0, j1, i, 1 << (m % BITS), t, own, limit, nearest, met[m // BITS], within[m // BITS]
                    )
                    if seen[i] != fan:
                        continue
                    # The rays that have met it themselves: first all with the largest radius of any.
                    k0, k1 = first_j[i], last_j[i] + 1
                    t[k0:k1] = np.inf
                    if _shrunk(kind[i], size[i], widening * farthest[i], small):
                        _fans_solid(kind[i], small, M, o, s, x, k0, k1, i, t, who, facing)
                    for j in range(k0, k1):
                        for lane in range(LANES):
                            if own[j, lane] == i:
                                filled[j, lane] = t[j, lane] <= limit[j, lane] or _fills(
                                    kind[i], size[i], M, o, lane, s[j, lane], x[j, lane],
                                    widening * limit[j, lane] * norm[j, lane], limit[j, lane], small, work,
                                )  # fmt: skip
                if entries + few * end * LANES > out_member.shape[0]:
                    return -1
                for lane in range(min(LANES, fans - fan)):
                    for j in range(end):
                        if filled[j, lane] and nearest[j, lane] >= limit[j, lane]:
                            continue
                        for m in range(few):
                            word, bit = m // BITS, 1 << (m % BITS)
                            # Behind what fills the cone from outside, nothing of it is met.
                            over = filled[j, lane] and outside[lane]
                            held = within[word, j, lane] if over else met[word, j, lane]
                            if held & bit:
                                out_member[entries] = here[m]
                                entries += 1
                        out_fan[found], out_step[found] = fan + lane, j
                        found += 1
                        out_first[found] = entries
    return found


@jit_with(ray_kernel)
def _cast_cones(  # type: ignore[no-untyped-def]
    kind, size, bound, row, still, table, key, weight, R, origin, pose_of, frame, slope, skew, fan, step,
    first, member, up, across, samples, out_range, out_geom, out_cosine,
):  # fmt: skip
    """What rays within cones meet first: among planes, and for cone n the geoms member[first[n] :
    first[n + 1]], which ascend.

    up, across [k 4]: slopes and skews of the rays, four side by side, in a cone's frame: along its middle
    ray, up, and level to the left. out_* [n samples].
    """
    steps = up.shape[0]
    best, facing, who = np.empty((steps, LANES)), np.empty((steps, LANES)), np.empty((steps, LANES), np.int32)
    G, C, M, o, X = (
        np.empty((9, LANES)), np.empty((3, LANES)), np.empty((9, LANES)), np.empty((3, LANES)),
        np.empty((3, LANES)),
    )  # fmt: skip
    W4, P4, work = np.empty((9, LANES)), np.empty((3, LANES)), np.empty((3, 3))
    key4, weight4, beam = np.empty(LANES, np.int64), np.empty(LANES), np.empty((3, 3))
    planes, flat = np.empty(kind.shape[0], np.int64), 0
    for i in range(kind.shape[0]):
        if kind[i] == PLANE:
            planes[flat] = i
            flat += 1
    for n in range(fan.shape[0]):
        f, j = fan[n], step[n]
        p = pose_of[f]
        _cone_frame(frame[f], slope[f // LANES, j, f % LANES], skew[f // LANES, j, f % LANES], beam)
        for r in range(3):
            for c in range(3):
                W4[3 * r + c] = R[p, r, 0] * beam[0, c] + R[p, r, 1] * beam[1, c] + R[p, r, 2] * beam[2, c]
            P4[r] = origin[p, r]
        key4[:], weight4[:] = key[p], weight[p]
        best[:], who[:], facing[:] = np.inf, -1, 0.0
        for m in range(first[n] - flat, first[n + 1]):
            i = planes[m - first[n] + flat] if m < first[n] else member[m]
            if row[i] < 0:
                _lanes_of_still(still[i], P4, W4, M, o, X)
            else:
                _frames_of(row[i], table, key4, weight4, G, C)
                _lanes(G, C, P4, W4, M, o, X)
            if kind[i] == PLANE:
                _fans_plane(size[i], M, o, up, across, 0, steps, i, best, who, facing)
                continue
            x0, y0, z0 = o[0, 0], o[1, 0], o[2, 0]
            if x0 * x0 + y0 * y0 + z0 * z0 <= 1.01 * bound[i] * bound[i] + 1e-6 and _inside(
                kind[i], size[i], x0, y0, z0
            ):
                for lane in range(LANES):
                    _lane_from_inside(
                        kind[i], size[i], M, o, up, across, lane, 0, steps, i, best, who, facing, work
                    )
            _fans_solid(kind[i], size[i], M, o, up, across, 0, steps, i, best, who, facing)
        _finish(up, across, 0, steps, best, facing)
        for s in range(samples):
            out_range[n, s] = best[s // LANES, s % LANES]
            out_geom[n, s] = who[s // LANES, s % LANES]
            out_cosine[n, s] = facing[s // LANES, s % LANES]


@jit_inline
def _cone_frame(frame, s, x, out):  # type: ignore[no-untyped-def]
    """The frame of the cone about ray (s, x) of a fan, in the sensor's: columns along it, up, level left."""
    norm = np.sqrt(1.0 + s * s + x * x)
    for i in range(3):
        out[i, 0] = (frame[i, 0] + s * frame[i, 1] + x * frame[i, 2]) / norm
    d0, d1, d2 = out[0, 0], out[1, 0], out[2, 0]
    level = np.sqrt(d0 * d0 + d1 * d1)
    out[0, 1], out[1, 1], out[2, 1] = -d2 * d0 / level, -d2 * d1 / level, level
    out[0, 2], out[1, 2], out[2, 2] = -d1 / level, d0 / level, 0.0
