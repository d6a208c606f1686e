"""The compiled part of `rays.py`: analytic hits on MuJoCo's primitive geoms, for groups of rays and for fans.

All helpers of these kernels live in this file: numba's cache does not notice a change in another file.

`_cast`: groups of any rays that share an origin and an instant, one ray after the other.
`_cast_fans`: fans, four at a time, each with its own pose and instant. A fan is a set of rays
e + s u + x n (frame e, u, n; slopes s ascending; skews x near 0). Fans of one plane sweep let each geom's
extent be bounded by an interval of slopes, so that only the rays inside it are tested, by loops over four
lanes that the compiler turns into vector instructions.
"""

# mypy: no-check-untyped-defs
from __future__ import annotations

import numpy as np

from simbench.sensors.compiled import jit, jit_inline, jit_no_alias

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6  # as mujoco.mjtGeom
LANES = 4  # fans that are cast together
NOWHERE = -(2**62)  # where the rays of padding go
RUN, RUN_CELLS = 64, 16  # pixels, and cells of the sun's grid, that are shaded together at most
SUNK_M = 1e-3  # how deep in the ground a thing may stand and still count as standing on it
BLOCK, SUPERBLOCK = 16, 64  # fans whose geoms are culled together, before those of LANES fans are


@jit
def _first_positive(a: float, b: float, c: float) -> tuple[float, float]:
    """Roots of a t^2 + 2 b t + c, ascending; inf, inf where there is none."""
    disc = b * b - a * c
    if disc < 0.0 or a < 1e-300:
        return np.inf, np.inf
    root = np.sqrt(disc)
    return (-b - root) / a, (-b + root) / a


@jit
def _hit_ellipsoid(o, d, sx, sy, sz, n):  # type: ignore[no-untyped-def]
    ox, oy, oz = o[0] / sx, o[1] / sy, o[2] / sz
    dx, dy, dz = d[0] / sx, d[1] / sy, d[2] / sz
    near, far = _first_positive(
        dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0
    )
    t = near if near >= 0.0 else far
    if not (0.0 <= t < np.inf):
        return np.inf
    n[0], n[1], n[2] = (ox + t * dx) / sx, (oy + t * dy) / sy, (oz + t * dz) / sz
    return t


@jit
def _hit_box(o, d, size, n):  # type: ignore[no-untyped-def]
    near, far = -np.inf, np.inf
    near_axis, far_axis = 0, 0
    for i in range(3):
        if d[i] == 0.0:
            if abs(o[i]) > size[i]:
                return np.inf
            continue
        inv = 1.0 / d[i]
        half = abs(inv) * size[i]
        middle = -o[i] * inv
        if middle - half > near:
            near, near_axis = middle - half, i
        if middle + half < far:
            far, far_axis = middle + half, i
    if near > far or far < 0.0:
        return np.inf
    n[0], n[1], n[2] = 0.0, 0.0, 0.0
    if near >= 0.0:
        n[near_axis] = -1.0 if d[near_axis] > 0 else 1.0
        return near
    n[far_axis] = 1.0 if d[far_axis] > 0 else -1.0
    return far


@jit
def _hit_cylinder(o, d, radius, half, capped, n):  # type: ignore[no-untyped-def]
    """The tube of a cylinder or capsule, with flat ends where `capped`."""
    best = np.inf
    t0, t1 = _first_positive(
        d[0] * d[0] + d[1] * d[1],
        o[0] * d[0] + o[1] * d[1],
        o[0] * o[0] + o[1] * o[1] - radius * radius,
    )
    for t in (t0, t1):
        if 0.0 <= t < best and abs(o[2] + t * d[2]) <= half:
            best = t
            n[0], n[1], n[2] = (o[0] + t * d[0]) / radius, (o[1] + t * d[1]) / radius, 0.0
    if capped and d[2] != 0.0:
        for side in (-1.0, 1.0):
            t = (side * half - o[2]) / d[2]
            if 0.0 <= t < best:
                x, y = o[0] + t * d[0], o[1] + t * d[1]
                if x * x + y * y <= radius * radius:
                    best = t
                    n[0], n[1], n[2] = 0.0, 0.0, side
    return best


@jit
def _hit_capsule(o, d, radius, half, n):  # type: ignore[no-untyped-def]
    best = _hit_cylinder(o, d, radius, half, False, n)
    for side in (-1.0, 1.0):
        oz = o[2] - side * half
        t0, t1 = _first_positive(
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
            o[0] * d[0] + o[1] * d[1] + oz * d[2],
            o[0] * o[0] + o[1] * o[1] + oz * oz - radius * radius,
        )
        for t in (t0, t1):
            z = oz + t * d[2]
            if 0.0 <= t < best and z * side >= 0.0:
                best = t
                n[0], n[1], n[2] = (o[0] + t * d[0]) / radius, (o[1] + t * d[1]) / radius, z / radius
    return best


@jit
def _hit_plane(o, d, size, n):  # type: ignore[no-untyped-def]
    if d[2] > -1e-15:
        return np.inf
    t = -o[2] / d[2]
    if t < 0.0:
        return np.inf
    if size[0] > 0.0 and abs(o[0] + t * d[0]) > size[0]:
        return np.inf
    if size[1] > 0.0 and abs(o[1] + t * d[1]) > size[1]:
        return np.inf
    n[0], n[1], n[2] = 0.0, 0.0, 1.0
    return t


@jit
def _hit(kind, size, o, d, n):  # type: ignore[no-untyped-def]
    if kind == BOX:
        return _hit_box(o, d, size, n)
    if kind == CAPSULE:
        return _hit_capsule(o, d, size[0], size[1], n)
    if kind == CYLINDER:
        return _hit_cylinder(o, d, size[0], size[1], True, n)
    if kind == ELLIPSOID:
        return _hit_ellipsoid(o, d, size[0], size[1], size[2], n)
    if kind == SPHERE:
        return _hit_ellipsoid(o, d, size[0], size[0], size[0], n)
    return _hit_plane(o, d, size, n)


@jit
def _half_height(kind, size, up):  # type: ignore[no-untyped-def]
    """Half the extent of a geom along the world's z, given the z row of its rotation; a little generous."""
    x, y, z = abs(up[0]), abs(up[1]), abs(up[2])
    if kind == BOX:
        half = x * size[0] + y * size[1] + z * size[2]
    elif kind == ELLIPSOID:
        half = np.sqrt((x * size[0]) ** 2 + (y * size[1]) ** 2 + (z * size[2]) ** 2)
    elif kind == CAPSULE:
        half = z * size[1] + size[0]
    elif kind == CYLINDER:
        half = z * size[1] + np.sqrt(max(1.0 - z * z, 0.0)) * size[0]
    elif kind == SPHERE:
        half = size[0]
    else:
        return np.inf
    return half * (1.0 + 1e-9) + 1e-9


@jit
def _bounds(direction, axis, side):  # type: ignore[no-untyped-def]
    """Mean direction of a group, a sideways axis, and the cosine and sine that bound its rays."""
    k = direction.shape[0]
    axis[:] = 0.0
    for j in range(k):
        for i in range(3):
            axis[i] += direction[j, i]
    norm = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    if norm < 1e-9:
        return -1.0, 1.0
    for i in range(3):
        axis[i] /= norm
    # The rays of a column spread along first-to-last; sideways is across that.
    ux, uy, uz = (
        direction[k - 1, 0] - direction[0, 0],
        direction[k - 1, 1] - direction[0, 1],
        direction[k - 1, 2] - direction[0, 2],
    )
    side[0] = axis[1] * uz - axis[2] * uy
    side[1] = axis[2] * ux - axis[0] * uz
    side[2] = axis[0] * uy - axis[1] * ux
    norm = np.sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    cosine, sine = 1.0, 0.0
    for j in range(k):
        c = direction[j, 0] * axis[0] + direction[j, 1] * axis[1] + direction[j, 2] * axis[2]
        cosine = min(cosine, c)
        if norm > 1e-9:
            s = abs(direction[j, 0] * side[0] + direction[j, 1] * side[1] + direction[j, 2] * side[2]) / norm
            sine = max(sine, s)
    if norm > 1e-9:
        for i in range(3):
            side[i] /= norm
    else:
        sine = 1.0
    return cosine, sine


@jit
def _cast_group(  # type: ignore[no-untyped-def]
    kind, size, body, rotation, position, bound, body_R, body_p, origin, direction,
    centre, index, nearest, frame, span, work, out_range, out_geom, out_cosine,
):  # fmt: skip
    """One group: rays `direction` [k 3] from `origin`, bodies at body_R [b 3 3], body_p [b 3].

    centre, index, nearest, frame, span, work: scratch. out_*: rows of k.
    """
    axis, side, o, d, n = work[0], work[1], work[2], work[3], work[4]
    cosine, sine = _bounds(direction, axis, side)
    cone_sine = np.sqrt(max(1.0 - cosine * cosine, 0.0))
    count = 0
    for i in range(kind.shape[0]):
        b = body[i]
        for r in range(3):
            centre[i, r] = (
                body_p[b, r]
                + body_R[b, r, 0] * position[i, 0]
                + body_R[b, r, 1] * position[i, 1]
                + body_R[b, r, 2] * position[i, 2]
            )
        cx, cy, cz = centre[i, 0] - origin[0], centre[i, 1] - origin[1], centre[i, 2] - origin[2]
        distance = np.sqrt(cx * cx + cy * cy + cz * cz)
        radius = bound[i]
        near = 0.0
        if radius < distance:
            lateral = abs(cx * side[0] + cy * side[1] + cz * side[2])
            if sine < 1.0 and lateral > (distance + radius) * sine + radius:
                continue
            # Distance of the centre from the cone's surface, in the plane through its axis.
            along = cx * axis[0] + cy * axis[1] + cz * axis[2]
            across = np.sqrt(max(distance * distance - along * along, 0.0))
            if cosine > 0.0 and across * cosine - along * cone_sine > radius * (1.0 + 1e-9) + 1e-9:
                continue
            near = distance - radius
        # World orientation of the survivors only, kept in order of distance.
        for r in range(3):
            for c in range(3):
                frame[i, r, c] = (
                    body_R[b, r, 0] * rotation[i, 0, c]
                    + body_R[b, r, 1] * rotation[i, 1, c]
                    + body_R[b, r, 2] * rotation[i, 2, c]
                )
        # What the geom spans in height, and how far it reaches: a ray outside that span is not tested.
        half_height = _half_height(kind[i], size[i], frame[i, 2])
        span[i, 0], span[i, 1] = cz - half_height, cz + half_height
        span[i, 2], span[i, 3] = near, distance + radius
        place = count
        while place > 0 and nearest[place - 1] > near:
            nearest[place] = nearest[place - 1]
            index[place] = index[place - 1]
            place -= 1
        nearest[place] = near
        index[place] = i
        count += 1
    for k in range(direction.shape[0]):
        best = np.inf
        best_geom = -1
        best_cosine = 0.0
        dx, dy, dz = direction[k, 0], direction[k, 1], direction[k, 2]
        for m in range(count):
            if nearest[m] > best:
                break
            i = index[m]
            low, high = dz * span[i, 2], dz * span[i, 3]
            if min(low, high) > span[i, 1] or max(low, high) < span[i, 0]:
                continue
            cx, cy, cz = origin[0] - centre[i, 0], origin[1] - centre[i, 1], origin[2] - centre[i, 2]
            along = -(cx * dx + cy * dy + cz * dz)
            radius = bound[i]
            if radius < np.inf:
                if along < -radius or along - radius > best:
                    continue
                if cx * cx + cy * cy + cz * cz - along * along > radius * radius * (1.0 + 1e-9) + 1e-12:
                    continue
            for r in range(3):
                o[r] = frame[i, 0, r] * cx + frame[i, 1, r] * cy + frame[i, 2, r] * cz
                d[r] = frame[i, 0, r] * dx + frame[i, 1, r] * dy + frame[i, 2, r] * dz
            hit = _hit(kind[i], size[i], o, d, n)
            if hit < best or (hit == best and hit < np.inf and i < best_geom):
                best = hit
                best_geom = i
                norm = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
                best_cosine = abs(n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / norm
        out_range[k] = best
        out_geom[k] = best_geom
        out_cosine[k] = best_cosine


@jit
def _cast(  # type: ignore[no-untyped-def]
    kind, size, body, rotation, position, bound, body_R, body_p, time_index, origin, direction,
    out_range, out_geom, out_cosine,
):  # fmt: skip
    n = kind.shape[0]
    centre, index, nearest = np.empty((n, 3)), np.empty(n, np.int64), np.empty(n)
    frame, span, work = np.empty((n, 3, 3)), np.empty((n, 4)), np.empty((5, 3))
    for g in range(direction.shape[0]):
        t = time_index[g]
        _cast_group(
            kind, size, body, rotation, position, bound, body_R[t], body_p[t], origin[g], direction[g],
            centre, index, nearest, frame, span, work, out_range[g], out_geom[g], out_cosine[g],
        )  # fmt: skip


@jit
def _place(body, rotation, position, bound, body_R, body_p, moving, out, path):  # type: ignore[no-untyped-def]
    """World frames of the geoms `moving` [m] at every key: out [t m 12] is R row by row, then the centre.

    path [t m]: how far any point of each geom came since the first key, at most.
    """
    for t in range(out.shape[0]):
        for m in range(moving.shape[0]):
            i = moving[m]
            b = body[i]
            for r in range(3):
                for c in range(3):
                    out[t, m, 3 * r + c] = (
                        body_R[t, b, r, 0] * rotation[i, 0, c]
                        + body_R[t, b, r, 1] * rotation[i, 1, c]
                        + body_R[t, b, r, 2] * rotation[i, 2, c]
                    )
                out[t, m, 9 + r] = (
                    body_p[t, b, r]
                    + body_R[t, b, r, 0] * position[i, 0]
                    + body_R[t, b, r, 1] * position[i, 1]
                    + body_R[t, b, r, 2] * position[i, 2]
                )
            path[t, m] = 0.0
            if t > 0:
                step, turn = 0.0, 0.0
                for r in range(9):
                    turn += (out[t, m, r] - out[t - 1, m, r]) ** 2
                for r in range(9, 12):
                    step += (out[t, m, r] - out[t - 1, m, r]) ** 2
                path[t, m] = path[t - 1, m] + np.sqrt(step) + bound[i] * np.sqrt(turn)


@jit
def _bins(slope, low, width, first, last):  # type: ignore[no-untyped-def]
    """Per fan of slopes [f k] and edge low + b width: the first step at or above it, and the first beyond."""
    for f in range(slope.shape[0]):
        up, over = 0, 0
        for b in range(first.shape[1]):
            edge = low + b * width
            while up < slope.shape[1] and slope[f, up] < edge - 1e-12:
                up += 1
            while over < slope.shape[1] and slope[f, over] <= edge + 1e-12:
                over += 1
            first[f, b], last[f, b] = up, over
        first[f, 0], last[f, first.shape[1] - 1] = 0, slope.shape[1]


@jit_inline
def _support(kind, size, x, y, z):  # type: ignore[no-untyped-def]
    """Half the extent of a geom along an axis whose absolute coordinates in its frame are given; a little
    generous."""
    if kind == BOX:
        half = x * size[0] + y * size[1] + z * size[2]
    elif kind == ELLIPSOID:
        half = np.sqrt((x * size[0]) ** 2 + (y * size[1]) ** 2 + (z * size[2]) ** 2)
    elif kind == CAPSULE:
        half = z * size[1] + size[0]
    elif kind == CYLINDER:
        half = z * size[1] + np.sqrt(max(1.0 - z * z, 0.0)) * size[0]
    else:
        half = size[0]
    return half * (1.0 + 1e-9) + 1e-9


@jit
def _hiders(kind, size, frame, mask, eye, axes, slopes, out):  # type: ignore[no-untyped-def]
    """Which geoms, others than those in `mask`, may stand before one of these, into `out`; returns how many.

    frame [g 12]: rotation row by row, then centre. eye [3]; axes [3 3]: columns right, down, ahead of the
    view; slopes (x0, y0, x1, y1): the part of the view. Left out is what lies beside the pyramid of that
    part, what lies behind all of those in `mask` as seen from the eye, and what lies below a level that the
    eye and all of those in `mask` are above: a line of sight crosses none of these before it ends.
    """
    normal = np.empty((6, 3))
    for r in range(3):
        x, y, z = axes[r, 0], axes[r, 1], axes[r, 2]
        normal[0, r], normal[1, r] = slopes[0] * z - x, x - slopes[2] * z
        normal[2, r], normal[3, r] = slopes[1] * z - y, y - slopes[3] * z
        normal[4, r], normal[5, r] = -z, 0.0
    for i in range(kind.shape[0]):
        if mask[i]:
            for r in range(3):
                normal[5, r] += frame[i, 9 + r] - eye[r]
    for n in range(6):
        length = np.sqrt(normal[n, 0] ** 2 + normal[n, 1] ** 2 + normal[n, 2] ** 2)
        for r in range(3):
            normal[n, r] /= max(length, 1e-12)
    limit = np.zeros(6)  # beyond it along the normal: out of the way
    lowest = np.inf
    for i in range(kind.shape[0]):
        if mask[i]:
            limit[5] = max(limit[5], _reach(kind[i], size[i], frame[i], eye, normal[5], 1.0))
            lowest = min(lowest, frame[i, 11] - _along(kind[i], size[i], frame[i], 0.0, 0.0, 1.0))
    found = 0
    for i in range(kind.shape[0]):
        if mask[i]:
            continue
        hides = True
        if kind[i] == PLANE:
            top = 0.0
            for r in range(3):
                top = max(top, abs(frame[i, 3 * r + 2] - (1.0 if r == 2 else 0.0)))
            top = frame[i, 11] if top < 1e-9 else np.inf  # a level one
        else:
            for n in range(6):
                if _reach(kind[i], size[i], frame[i], eye, normal[n], -1.0) > limit[n]:
                    hides = False
                    break
            if not hides:
                continue
            top = frame[i, 11] + _along(kind[i], size[i], frame[i], 0.0, 0.0, 1.0)
        if hides and not (eye[2] > top and lowest > top - SUNK_M):
            out[found] = i
            found += 1
    return found


@jit_inline
def _along(kind, size, frame, x, y, z):  # type: ignore[no-untyped-def]
    """Half the extent of a geom along a direction of the world."""
    return _support(
        kind,
        size,
        abs(frame[0] * x + frame[3] * y + frame[6] * z),
        abs(frame[1] * x + frame[4] * y + frame[7] * z),
        abs(frame[2] * x + frame[5] * y + frame[8] * z),
    )


@jit_inline
def _reach(kind, size, frame, eye, n, side):  # type: ignore[no-untyped-def]
    """How far a geom reaches along the unit vector n from the eye, at most (side 1) or at least (side -1)."""
    middle = (frame[9] - eye[0]) * n[0] + (frame[10] - eye[1]) * n[1] + (frame[11] - eye[2]) * n[2]
    return middle + side * _along(kind, size, frame, n[0], n[1], n[2])


@jit_inline
def _cull(  # type: ignore[no-untyped-def]
    start, stop, kind, size, bound, row, still, table, path, key, weight, origin, pose_of, W,
    low, high, skew, candidate, count, plane, out,
):  # fmt: skip
    """Which of the first `count` candidates the fans [start, stop) can meet, into `out`; returns how many.

    Every geom is held against the five planes around all rays of the fans (of the middle fan, opened by what
    the others turn): first its bounding sphere, then its extent across the plane. plane [5 3]: scratch.
    """
    middle = (start + stop) // 2
    p = pose_of[middle]
    turn, reach = 0.0, 0.0
    first_key, last_key = key[p], key[p]
    for f in range(start, stop):
        square = 0.0
        for r in range(9):
            square += (W[f, r] - W[middle, r]) ** 2
        turn = max(turn, square)
        q = pose_of[f]
        square = 0.0
        for r in range(3):
            square += (origin[q, r] - origin[p, r]) ** 2
        reach = max(reach, square)
        first_key, last_key = min(first_key, key[q]), max(last_key, key[q])
    reach = np.sqrt(reach)
    # |W_f d - W d| <= 2 sin(angle / 2) |d|, and the Frobenius norm of W_f - W is sqrt(2) times that factor.
    off = np.sqrt(0.5 * turn) * np.sqrt(1.0 + max(low * low, high * high) + skew * skew)
    planes = 5
    if off >= 0.9:
        planes, off = 0, 0.0
    side = (skew + off) / (1.0 - off)
    down = (low - off) / (1.0 - off if low < off else 1.0 + off)
    up = (high + off) / (1.0 - off if high > -off else 1.0 + off)
    for r in range(3):
        e, u, n = W[middle, 3 * r], W[middle, 3 * r + 1], W[middle, 3 * r + 2]
        plane[0, r] = (n - side * e) / np.sqrt(1.0 + side * side)
        plane[1, r] = (-n - side * e) / np.sqrt(1.0 + side * side)
        plane[2, r] = (u - up * e) / np.sqrt(1.0 + up * up)
        plane[3, r] = (down * e - u) / np.sqrt(1.0 + down * down)
        plane[4, r] = -e
    k, w = key[p], weight[p]
    n_key = min(k + 1, table.shape[0] - 1)
    last_key = min(last_key + 1, table.shape[0] - 1)
    kept = 0
    for m in range(count):
        i = candidate[m]
        a = row[i]
        move = reach
        if a < 0:
            cx, cy, cz = still[i, 9] - origin[p, 0], still[i, 10] - origin[p, 1], still[i, 11] - origin[p, 2]
        else:
            cx = table[k, a, 9] + w * (table[n_key, a, 9] - table[k, a, 9]) - origin[p, 0]
            cy = table[k, a, 10] + w * (table[n_key, a, 10] - table[k, a, 10]) - origin[p, 1]
            cz = table[k, a, 11] + w * (table[n_key, a, 11] - table[k, a, 11]) - origin[p, 2]
            move += path[last_key, a] - path[first_key, a]
        seen = True
        for s in range(planes):
            x, y, z = plane[s, 0], plane[s, 1], plane[s, 2]
            beyond = (cx * x + cy * y + cz * z - move) * (1.0 - 1e-9) - 1e-9
            if beyond <= 0.0:
                continue
            if beyond > bound[i]:
                seen = False
                break
            if a < 0:
                lx = still[i, 0] * x + still[i, 3] * y + still[i, 6] * z
                ly = still[i, 1] * x + still[i, 4] * y + still[i, 7] * z
                lz = still[i, 2] * x + still[i, 5] * y + still[i, 8] * z
            else:
                lx = table[k, a, 0] * x + table[k, a, 3] * y + table[k, a, 6] * z
                ly = table[k, a, 1] * x + table[k, a, 4] * y + table[k, a, 7] * z
                lz = table[k, a, 2] * x + table[k, a, 5] * y + table[k, a, 8] * z
            if beyond > _support(kind[i], size[i], abs(lx), abs(ly), abs(lz)):
                seen = False
                break
        if seen:
            out[kept] = i
            kept += 1
    return kept


@jit_inline
def _inside(kind, size, x, y, z):  # type: ignore[no-untyped-def]
    """Whether a point of the geom's own frame lies in it, a hair's breadth around it included."""
    if kind == BOX:
        return abs(x) <= size[0] + 1e-9 and abs(y) <= size[1] + 1e-9 and abs(z) <= size[2] + 1e-9
    if kind == ELLIPSOID:
        return (x / size[0]) ** 2 + (y / size[1]) ** 2 + (z / size[2]) ** 2 <= 1.0 + 1e-9
    if kind == SPHERE:
        return x * x + y * y + z * z <= size[0] ** 2 * (1.0 + 1e-9)
    if kind == CYLINDER:
        return x * x + y * y <= size[0] ** 2 * (1.0 + 1e-9) and abs(z) <= size[1] + 1e-9
    beyond = max(abs(z) - size[1], 0.0)
    return x * x + y * y + beyond * beyond <= size[0] ** 2 * (1.0 + 1e-9)


@jit_no_alias
def _fans_plane(size, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    wide = size[0] if size[0] > 0.0 else np.inf
    long = size[1] if size[1] > 0.0 else np.inf
    for j in range(start, stop):
        for lane in range(LANES):
            dx = M[0, lane] + slope[j, lane] * M[1, lane] + skew[j, lane] * M[2, lane]
            dy = M[3, lane] + slope[j, lane] * M[4, lane] + skew[j, lane] * M[5, lane]
            dz = M[6, lane] + slope[j, lane] * M[7, lane] + skew[j, lane] * M[8, lane]
            t = -o[2, lane] / dz
            hit = (dz < -1e-15) & (t >= 0.0) & (t < best[j, lane])
            hit = hit & (abs(o[0, lane] + t * dx) <= wide) & (abs(o[1, lane] + t * dy) <= long)
            best[j, lane] = t if hit else best[j, lane]
            who[j, lane] = i if hit else who[j, lane]
            facing[j, lane] = -dz if hit else facing[j, lane]


@jit_no_alias
def _fans_box(size, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    sx, sy, sz = size[0], size[1], size[2]
    for j in range(start, stop):
        for lane in range(LANES):
            dx = M[0, lane] + slope[j, lane] * M[1, lane] + skew[j, lane] * M[2, lane]
            dy = M[3, lane] + slope[j, lane] * M[4, lane] + skew[j, lane] * M[5, lane]
            dz = M[6, lane] + slope[j, lane] * M[7, lane] + skew[j, lane] * M[8, lane]
            dx = dx if dx != 0.0 else 1e-200
            dy = dy if dy != 0.0 else 1e-200
            dz = dz if dz != 0.0 else 1e-200
            ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
            hx, hy, hz = abs(ix) * sx, abs(iy) * sy, abs(iz) * sz
            mx, my, mz = -o[0, lane] * ix, -o[1, lane] * iy, -o[2, lane] * iz
            near = mx - hx
            cosine = abs(dx)
            cosine = abs(dy) if my - hy > near else cosine
            near = my - hy if my - hy > near else near
            cosine = abs(dz) if mz - hz > near else cosine
            near = mz - hz if mz - hz > near else near
            far = mx + hx if mx + hx < my + hy else my + hy
            far = far if far < mz + hz else mz + hz
            hit = (near >= 0.0) & (near <= far) & (near < best[j, lane])
            best[j, lane] = near if hit else best[j, lane]
            who[j, lane] = i if hit else who[j, lane]
            facing[j, lane] = cosine if hit else facing[j, lane]


@jit_no_alias
def _fans_ellipsoid(sx, sy, sz, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    """Scaled to a unit sphere: x' = x / s. |n . d| = |x' . d'| / |x' / s|."""
    ax, ay, az = 1.0 / sx, 1.0 / sy, 1.0 / sz
    for j in range(start, stop):
        for lane in range(LANES):
            ox, oy, oz = o[0, lane] * ax, o[1, lane] * ay, o[2, lane] * az
            dx = ax * (M[0, lane] + slope[j, lane] * M[1, lane] + skew[j, lane] * M[2, lane])
            dy = ay * (M[3, lane] + slope[j, lane] * M[4, lane] + skew[j, lane] * M[5, lane])
            dz = az * (M[6, lane] + slope[j, lane] * M[7, lane] + skew[j, lane] * M[8, lane])
            a = dx * dx + dy * dy + dz * dz
            b = ox * dx + oy * dy + oz * dz
            root = np.sqrt(b * b - a * (ox * ox + oy * oy + oz * oz - 1.0))
            t = (-b - root) / a
            hit = (t >= 0.0) & (t < best[j, lane])
            nx, ny, nz = (ox + t * dx) * ax, (oy + t * dy) * ay, (oz + t * dz) * az
            cosine = root / np.sqrt(nx * nx + ny * ny + nz * nz)
            best[j, lane] = t if hit else best[j, lane]
            who[j, lane] = i if hit else who[j, lane]
            facing[j, lane] = cosine if hit else facing[j, lane]


@jit_no_alias
def _fans_cylinder(size, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    """The tube's interval cut with that between the ends."""
    radius, half = size[0], size[1]
    for j in range(start, stop):
        for lane in range(LANES):
            dx = M[0, lane] + slope[j, lane] * M[1, lane] + skew[j, lane] * M[2, lane]
            dy = M[3, lane] + slope[j, lane] * M[4, lane] + skew[j, lane] * M[5, lane]
            dz = M[6, lane] + slope[j, lane] * M[7, lane] + skew[j, lane] * M[8, lane]
            dz = dz if dz != 0.0 else 1e-200
            a = dx * dx + dy * dy
            a = a if a > 1e-200 else 1e-200
            b = o[0, lane] * dx + o[1, lane] * dy
            root = np.sqrt(b * b - a * (o[0, lane] * o[0, lane] + o[1, lane] * o[1, lane] - radius * radius))
            iz = 1.0 / dz
            middle, spread = -o[2, lane] * iz, abs(iz) * half
            near, far = (-b - root) / a, (-b + root) / a
            end = middle - spread > near
            cosine = abs(dz) if end else root / radius
            near = middle - spread if end else near
            far = middle + spread if middle + spread < far else far
            hit = (near >= 0.0) & (near <= far) & (near < best[j, lane])
            best[j, lane] = near if hit else best[j, lane]
            who[j, lane] = i if hit else who[j, lane]
            facing[j, lane] = cosine if hit else facing[j, lane]


@jit_no_alias
def _fans_capsule(size, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    """Where the ray enters the endless tube beyond an end, it can enter the capsule through that end only."""
    radius, half = size[0], size[1]
    for j in range(start, stop):
        for lane in range(LANES):
            dx = M[0, lane] + slope[j, lane] * M[1, lane] + skew[j, lane] * M[2, lane]
            dy = M[3, lane] + slope[j, lane] * M[4, lane] + skew[j, lane] * M[5, lane]
            dz = M[6, lane] + slope[j, lane] * M[7, lane] + skew[j, lane] * M[8, lane]
            a = dx * dx + dy * dy
            a = a if a > 1e-200 else 1e-200
            b = o[0, lane] * dx + o[1, lane] * dy
            c = o[0, lane] * o[0, lane] + o[1, lane] * o[1, lane] - radius * radius
            root = np.sqrt(b * b - a * c)
            tube = (-b - root) / a
            z = o[2, lane] + tube * dz
            oz = o[2, lane] - half if z > 0.0 else o[2, lane] + half
            a_end, b_end = a + dz * dz, b + oz * dz
            root_end = np.sqrt(b_end * b_end - a_end * (c + oz * oz))
            on_tube = abs(z) <= half
            t = tube if on_tube else (-b_end - root_end) / a_end
            cosine = (root if on_tube else root_end) / radius
            hit = (t >= 0.0) & (t < best[j, lane])
            best[j, lane] = t if hit else best[j, lane]
            who[j, lane] = i if hit else who[j, lane]
            facing[j, lane] = cosine if hit else facing[j, lane]


@jit_inline
def _fans_solid(kind, size, M, o, slope, skew, start, stop, i, best, who, facing):  # type: ignore[no-untyped-def]
    if kind == BOX:
        _fans_box(size, M, o, slope, skew, start, stop, i, best, who, facing)
    elif kind == CAPSULE:
        _fans_capsule(size, M, o, slope, skew, start, stop, i, best, who, facing)
    elif kind == CYLINDER:
        _fans_cylinder(size, M, o, slope, skew, start, stop, i, best, who, facing)
    elif kind == ELLIPSOID:
        _fans_ellipsoid(size[0], size[1], size[2], M, o, slope, skew, start, stop, i, best, who, facing)
    else:
        _fans_ellipsoid(size[0], size[0], size[0], M, o, slope, skew, start, stop, i, best, who, facing)


@jit
def _lane_from_inside(kind, size, M, o, slope, skew, lane, begin, end, i, best, who, facing, work):  # type: ignore[no-untyped-def]
    """A sensor inside a geom sees its far side: one ray after the other."""
    for r in range(3):
        work[0, r] = o[r, lane]
    for j in range(begin, end):
        for r in range(3):
            work[1, r] = (
                M[3 * r, lane] + slope[j, lane] * M[3 * r + 1, lane] + skew[j, lane] * M[3 * r + 2, lane]
            )
        t = _hit(kind, size, work[0], work[1], work[2])
        if t < best[j, lane]:
            n, d = work[2], work[1]
            best[j, lane], who[j, lane] = t, i
            facing[j, lane] = abs(n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / np.sqrt(
                n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
            )


@jit_no_alias
def _lanes(G, C, P, W, M, o, X):  # type: ignore[no-untyped-def]
    """A geom (frames G [9 4], centres C [3 4]) in the frames of four fans (W [9 4], origins P [3 4]).

    M [9 4]: the fans' axes in the geom's frame; o [3 4]: their origins there; X [3 4]: its centre in theirs.
    """
    for lane in range(LANES):
        x, y, z = C[0, lane] - P[0, lane], C[1, lane] - P[1, lane], C[2, lane] - P[2, lane]
        for c in range(3):
            o[c, lane] = -(G[c, lane] * x + G[3 + c, lane] * y + G[6 + c, lane] * z)
            X[c, lane] = W[c, lane] * x + W[3 + c, lane] * y + W[6 + c, lane] * z
            for r in range(3):
                M[3 * c + r, lane] = (
                    G[c, lane] * W[r, lane]
                    + G[3 + c, lane] * W[3 + r, lane]
                    + G[6 + c, lane] * W[6 + r, lane]
                )


@jit_no_alias
def _lanes_of_still(frame, P, W, M, o, X):  # type: ignore[no-untyped-def]
    """The same for a geom that stands: `frame` is its rotation row by row, then its centre."""
    for lane in range(LANES):
        x, y, z = frame[9] - P[0, lane], frame[10] - P[1, lane], frame[11] - P[2, lane]
        for c in range(3):
            o[c, lane] = -(frame[c] * x + frame[3 + c] * y + frame[6 + c] * z)
            X[c, lane] = W[c, lane] * x + W[3 + c, lane] * y + W[6 + c, lane] * z
            for r in range(3):
                M[3 * c + r, lane] = (
                    frame[c] * W[r, lane] + frame[3 + c] * W[3 + r, lane] + frame[6 + c] * W[6 + r, lane]
                )


@jit_no_alias
def _frames_between(first, second, weight, G, C):  # type: ignore[no-untyped-def]
    """Frames [12] at two keys, mixed by the weights of four fans."""
    for lane in range(LANES):
        w = weight[lane]
        for r in range(9):
            G[r, lane] = first[r] + w * (second[r] - first[r])
        for r in range(3):
            C[r, lane] = first[9 + r] + w * (second[9 + r] - first[9 + r])


@jit_no_alias
def _scaled(slope, scale, begin, end, out):  # type: ignore[no-untyped-def]
    for j in range(begin, end):
        for lane in range(LANES):
            out[j, lane] = slope[j, lane] * scale[lane]


@jit_no_alias
def _finish(slope, skew, begin, end, best, facing):  # type: ignore[no-untyped-def]
    """From lengths along e + s u + x n to metres and cosines."""
    for j in range(begin, end):
        for lane in range(LANES):
            norm = np.sqrt(1.0 + slope[j, lane] * slope[j, lane] + skew[j, lane] * skew[j, lane])
            best[j, lane] *= norm
            facing[j, lane] /= norm


@jit_inline
def _frames_of(a, table, key, weight, G, C):  # type: ignore[no-untyped-def]
    """World frames of a moving geom (row a of the table) between the keys of four fans."""
    last = table.shape[0] - 1
    if key[0] == key[1] and key[0] == key[2] and key[0] == key[3]:
        _frames_between(table[key[0], a], table[min(key[0] + 1, last), a], weight, G, C)
        return
    for lane in range(LANES):
        k, w = key[lane], weight[lane]
        n = min(k + 1, last)
        for r in range(9):
            G[r, lane] = table[k, a, r] + w * (table[n, a, r] - table[k, a, r])
        for r in range(3):
            C[r, lane] = table[k, a, 9 + r] + w * (table[n, a, 9 + r] - table[k, a, 9 + r])


@jit_no_alias
def _extent_of_box(size, M, extent):  # type: ignore[no-untyped-def]
    """Half the extents [3 4] of a geom along the axes of four fans, whose axes in its frame are M."""
    for a in range(3):
        for lane in range(LANES):
            x, y, z = abs(M[a, lane]), abs(M[3 + a, lane]), abs(M[6 + a, lane])
            extent[a, lane] = x * size[0] + y * size[1] + z * size[2]


@jit_no_alias
def _extent_of_ellipsoid(size, M, extent):  # type: ignore[no-untyped-def]
    for a in range(3):
        for lane in range(LANES):
            x, y, z = M[a, lane] * size[0], M[3 + a, lane] * size[1], M[6 + a, lane] * size[2]
            extent[a, lane] = np.sqrt(x * x + y * y + z * z)


@jit_no_alias
def _extent_of_tube(size, ball, M, extent):  # type: ignore[no-untyped-def]
    """A capsule (ball: 1), a cylinder (0)."""
    for a in range(3):
        for lane in range(LANES):
            z = abs(M[6 + a, lane])
            flat = 1.0 - z * z
            flat = np.sqrt(flat if flat > 0.0 else 0.0)
            extent[a, lane] = z * size[1] + size[0] * (ball + (1.0 - ball) * flat)


@jit_no_alias
def _slopes_of(X, extent, stretch, skew, low, high):  # type: ignore[no-untyped-def]
    """Intervals of slopes [4] at which boxes X +- extent of the fans can be met; (inf, -inf): none."""
    for lane in range(LANES):
        e, u = stretch * extent[0, lane] + 1e-9, stretch * extent[1, lane] + 1e-9
        n = stretch * extent[2, lane] + 1e-9
        near, far = X[0, lane] - e, X[0, lane] + e
        missed = (far <= 0.0) | (abs(X[2, lane]) - n > skew * far)
        bottom, top = X[1, lane] - u, X[1, lane] + u
        ahead = near > 1e-6
        lowest = bottom / near if ahead else -np.inf
        lowest = lowest if bottom < 0.0 else bottom / far
        highest = top / near if ahead else np.inf
        highest = highest if top > 0.0 else top / far
        low[lane] = np.inf if missed else lowest
        high[lane] = -np.inf if missed else highest


@jit_inline
def _steps_down(M, slope, skew, begin, end):  # type: ignore[no-untyped-def]
    """Between which steps of four fans any ray may look down on a plane, whose axes M are given."""
    first, last = end, begin
    for lane in range(LANES):
        a, b, off = M[6, lane], M[7, lane], skew * abs(M[8, lane]) + 1e-12
        if a + slope[begin, lane] * b < off:
            first = begin
        if a + slope[end - 1, lane] * b < off:
            last = end
    if first == begin and last == end:
        return begin, end
    if first == begin:  # down at the start only: up to where the last lane levels out
        while last < end:
            down = False
            for lane in range(LANES):
                off = skew * abs(M[8, lane]) + 1e-12
                down = down or M[6, lane] + slope[last, lane] * M[7, lane] < off
            if not down:
                break
            last += 1
    elif last == end:
        while first > begin:
            down = False
            for lane in range(LANES):
                off = skew * abs(M[8, lane]) + 1e-12
                down = down or M[6, lane] + slope[first - 1, lane] * M[7, lane] < off
            if not down:
                break
            first -= 1
    return first, last


@jit_inline
def _nothing(out_at, begin, end, stride, out_range, out_geom, out_cosine):  # type: ignore[no-untyped-def]
    for lane in range(LANES):
        if out_at[lane] != NOWHERE:
            for j in range(begin, end):
                at = out_at[lane] + j * stride
                out_range[at], out_geom[at], out_cosine[at] = np.inf, -1, 0.0


@jit_inline
def _reached(  # type: ignore[no-untyped-def]
    kind, size, M, X, stretch, skew, slack, narrowest, widest, low, bins_per_slope, first_step, last_step,
    begin, end, extent, lowest, highest,
):  # fmt: skip
    """From which step of four fans to which a geom may be met, its axes and centre in theirs given.

    extent [3 4], lowest, highest [4]: scratch.
    """
    if kind == BOX:
        _extent_of_box(size, M, extent)
    elif kind == ELLIPSOID:
        _extent_of_ellipsoid(size, M, extent)
    elif kind == SPHERE:
        extent[:] = size[0]
    else:
        _extent_of_tube(size, 1.0 if kind == CAPSULE else 0.0, M, extent)
    _slopes_of(X, extent, stretch, skew, lowest, highest)
    bottom = min(lowest[0], lowest[1], lowest[2], lowest[3]) - slack
    top = max(highest[0], highest[1], highest[2], highest[3]) + slack
    if bottom > top:
        return begin, begin
    bottom, top = min(bottom / narrowest, bottom / widest), max(top / narrowest, top / widest)
    bins = first_step.shape[0]
    b0 = (bottom - low) * bins_per_slope
    b1 = (top - low) * bins_per_slope + 1.0
    if b0 > bins - 1 or b1 < 0.0:
        return begin, begin
    return max(first_step[int(max(b0, 0.0))], begin), min(last_step[int(min(b1, bins - 1.0))], end)


@jit
def _cast_fans(  # type: ignore[no-untyped-def]
    kind, size, bound, row, still, table, path, key, weight, R, origin, pose_of, frame, slope, skew,
    scale, first_step, last_step, low, bins_per_slope, slack, skew_max, out_at, out_stride, start, stop,
    begin, end, out_range, out_geom, out_cosine,
):  # fmt: skip
    """Rays [begin, end) of the fans [start, stop), four fans at a time; start and stop are multiples of four.

    out_* are flat: ray j of fan f goes to out_at[f] + j * out_stride, that of padding (NOWHERE) is left out.
    """
    geoms = kind.shape[0]
    alike = slope.shape[0] == 1  # all fans have the same slopes but for their scale
    least, most = np.inf, -np.inf
    for f in range(start, stop):
        group, lane = 0 if alike else f // LANES, f % LANES
        least = min(least, scale[f] * slope[group, begin, lane])
        most = max(most, scale[f] * slope[group, end - 1, lane])
    s, x, ones = np.empty((end, LANES)), np.zeros((end, LANES)), np.ones(LANES)
    W = np.empty((pose_of.shape[0], 9))
    near, close, here = np.empty(geoms, np.int64), np.empty(geoms, np.int64), np.empty(geoms, np.int64)
    everything, planes, count, flat = np.empty(geoms, np.int64), np.empty(geoms, np.int64), 0, 0
    for i in range(geoms):
        if kind[i] == PLANE:
            planes[flat] = i
            flat += 1
        else:
            everything[count] = i
            count += 1
    for f in range(start, min(stop, pose_of.shape[0])):
        p = pose_of[f]
        for r in range(3):
            for c in range(3):
                W[f, 3 * r + c] = (
                    R[p, r, 0] * frame[f, 0, c] + R[p, r, 1] * frame[f, 1, c] + R[p, r, 2] * frame[f, 2, c]
                )
    best, facing = np.empty((end, LANES)), np.empty((end, LANES))
    who = np.empty((end, LANES), np.int32)
    G, C, M, o, X = (
        np.empty((9, LANES)), np.empty((3, LANES)), np.empty((9, LANES)), np.empty((3, LANES)),
        np.empty((3, LANES)),
    )  # fmt: skip
    W4, P4, work, plane = np.empty((9, LANES)), np.empty((3, LANES)), np.empty((3, 3)), np.empty((5, 3))
    key4, weight4 = np.empty(LANES, np.int64), np.empty(LANES)
    extent, lowest, highest = np.empty((3, LANES)), np.empty(LANES), np.empty(LANES)
    for superblock in range(start, stop, SUPERBLOCK):
        superstop = min(superblock + SUPERBLOCK, stop)
        many = _cull(
            superblock, superstop, kind, size, bound, row, still, table, path, key, weight, origin, pose_of,
            W, least - slack, most + slack, skew_max + slack, everything, count, plane, near,
        )  # fmt: skip
        for block in range(superblock, superstop, BLOCK):
            blockstop = min(block + BLOCK, superstop)
            some = _cull(
                block, blockstop, kind, size, bound, row, still, table, path, key, weight, origin, pose_of, W,
                least - slack, most + slack, skew_max + slack, near, many, plane, close,
            )  # fmt: skip
            for fan in range(block, blockstop, LANES):
                group = fan // LANES
                few = _cull(
                    fan, fan + LANES, kind, size, bound, row, still, table, path, key, weight, origin,
                    pose_of, W, least - slack, most + slack, skew_max + slack, close, some, plane, here,
                )  # fmt: skip
                if few + flat == 0:
                    _nothing(
                        out_at[fan : fan + LANES], begin, end, out_stride, out_range, out_geom, out_cosine
                    )
                    continue
                table_of = 0 if alike else group
                narrowest = min(scale[fan], scale[fan + 1], scale[fan + 2], scale[fan + 3])
                widest = max(scale[fan], scale[fan + 1], scale[fan + 2], scale[fan + 3])
                _scaled(slope[table_of], scale[fan : fan + LANES], begin, end, s)
                _scaled(skew[table_of], ones, begin, end, x)
                for lane in range(LANES):
                    key4[lane], weight4[lane] = key[pose_of[fan + lane]], weight[pose_of[fan + lane]]
                    for r in range(9):
                        W4[r, lane] = W[fan + lane, r]
                    for r in range(3):
                        P4[r, lane] = origin[pose_of[fan + lane], r]
                for j in range(begin, end):
                    for lane in range(LANES):
                        best[j, lane], who[j, lane], facing[j, lane] = np.inf, -1, 0.0
                for m in range(flat):
                    i = planes[m]
                    if row[i] < 0:
                        _lanes_of_still(still[i], P4, W4, M, o, X)
                    else:
                        _frames_of(row[i], table, key4, weight4, G, C)
                        _lanes(G, C, P4, W4, M, o, X)
                    j0, j1 = _steps_down(M, s, skew_max + slack, begin, end)
                    _fans_plane(size[i], M, o, s, x, j0, j1, i, best, who, facing)
                for m in range(few):
                    i = here[m]
                    if row[i] < 0:
                        _lanes_of_still(still[i], P4, W4, M, o, X)
                    else:
                        _frames_of(row[i], table, key4, weight4, G, C)
                        _lanes(G, C, P4, W4, M, o, X)
                    stretch = 1.0 if row[i] < 0 else 1.01  # a frame between two keys is not quite rigid
                    j0, j1 = _reached(
                        kind[i], size[i], M, X, stretch, skew_max + slack, slack, narrowest, widest, low,
                        bins_per_slope, first_step[table_of], last_step[table_of], begin, end, extent, lowest,
                        highest,
                    )  # fmt: skip
                    if j0 >= j1:
                        continue
                    for lane in range(LANES):
                        x0, y0, z0 = o[0, lane], o[1, lane], o[2, lane]
                        if x0 * x0 + y0 * y0 + z0 * z0 > 1.01 * bound[i] * bound[i] + 1e-6:
                            continue
                        if _inside(kind[i], size[i], x0, y0, z0):
                            _lane_from_inside(
                                kind[i], size[i], M, o, s, x, lane, begin, end, i, best, who, facing, work
                            )
                    _fans_solid(kind[i], size[i], M, o, s, x, j0, j1, i, best, who, facing)
                _finish(s, x, begin, end, best, facing)
                for lane in range(LANES):
                    at = out_at[fan + lane]
                    if at == NOWHERE:
                        continue
                    at += begin * out_stride
                    for j in range(begin, end):
                        out_range[at] = best[j, lane]
                        out_geom[at] = who[j, lane]
                        out_cosine[at] = facing[j, lane]
                        at += out_stride


@jit
def _sun_footprints(kind, size, bound, row, still, table, path, axes, out):  # type: ignore[no-untyped-def]
    """What each geom covers as the sun sees it: out [g 8] = (a, b, half a, half b, radius, top, 0, 0).

    axes [3 3]: rows a, b across the sun's direction and c towards it. Moving geoms cover all of their way.
    """
    for i in range(kind.shape[0]):
        m = row[i]
        move = path[path.shape[0] - 1, m] if m >= 0 else 0.0
        frame = table[0, m] if m >= 0 else still[i]
        for k in range(3):
            x, y, z = axes[k, 0], axes[k, 1], axes[k, 2]
            lx = abs(frame[0] * x + frame[3] * y + frame[6] * z)
            ly = abs(frame[1] * x + frame[4] * y + frame[7] * z)
            lz = abs(frame[2] * x + frame[5] * y + frame[8] * z)
            half = _support(kind[i], size[i], lx, ly, lz) + move
            at = frame[9] * x + frame[10] * y + frame[11] * z
            if k < 2:
                out[i, k], out[i, 2 + k] = at, half
            else:
                out[i, 5] = at + half
        out[i, 4] = bound[i] + move


@jit
def _sun_cells(kind, footprint, low, cells_per_m, first, member):  # type: ignore[no-untyped-def]
    """Sort geoms into the cells [n n] that they cover: those of cell c are member[first[c] : first[c + 1]].

    Returns how many entries there are; with an empty `member` it only counts.
    """
    n = np.int64(np.sqrt(first.shape[0] - 1))
    fill = np.zeros(first.shape[0], np.int64)
    for i in range(kind.shape[0]):
        if kind[i] == PLANE:
            continue
        a0 = max(int((footprint[i, 0] - footprint[i, 2] - low[0]) * cells_per_m[0]), 0)
        a1 = min(int((footprint[i, 0] + footprint[i, 2] - low[0]) * cells_per_m[0]), n - 1)
        b0 = max(int((footprint[i, 1] - footprint[i, 3] - low[1]) * cells_per_m[1]), 0)
        b1 = min(int((footprint[i, 1] + footprint[i, 3] - low[1]) * cells_per_m[1]), n - 1)
        for a in range(a0, a1 + 1):
            for b in range(b0, b1 + 1):
                c = a * n + b
                if member.shape[0] > 0:
                    member[first[c] + fill[c]] = i
                fill[c] += 1
    if member.shape[0] == 0:
        first[0] = 0
        for c in range(first.shape[0] - 1):
            first[c + 1] = first[c] + fill[c]
    return first[first.shape[0] - 1]


@jit_no_alias
def _run_points(W, origin, axes, slope, skew, range_m, point, across):  # type: ignore[no-untyped-def]
    """Points [3 n] that a run of rays hit, and their coordinates [3 n] along `axes`."""
    for j in range(range_m.shape[0]):
        s, x = slope[j], skew[j]
        t = range_m[j] / np.sqrt(1.0 + s * s + x * x)
        px = origin[0] + t * (W[0] + s * W[1] + x * W[2])
        py = origin[1] + t * (W[3] + s * W[4] + x * W[5])
        pz = origin[2] + t * (W[6] + s * W[7] + x * W[8])
        point[0, j], point[1, j], point[2, j] = px, py, pz
        for k in range(3):
            across[k, j] = px * axes[k, 0] + py * axes[k, 1] + pz * axes[k, 2]


@jit_no_alias
def _shade_by_box(size, frame, d, point, shaded):  # type: ignore[no-untyped-def]
    dx = d[0] if d[0] != 0.0 else 1e-200
    dy = d[1] if d[1] != 0.0 else 1e-200
    dz = d[2] if d[2] != 0.0 else 1e-200
    ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
    hx, hy, hz = abs(ix) * size[0], abs(iy) * size[1], abs(iz) * size[2]
    for j in range(shaded.shape[0]):
        x, y, z = point[0, j] - frame[9], point[1, j] - frame[10], point[2, j] - frame[11]
        mx = -ix * (frame[0] * x + frame[3] * y + frame[6] * z)
        my = -iy * (frame[1] * x + frame[4] * y + frame[7] * z)
        mz = -iz * (frame[2] * x + frame[5] * y + frame[8] * z)
        near = mx - hx if mx - hx > my - hy else my - hy
        near = near if near > mz - hz else mz - hz
        far = mx + hx if mx + hx < my + hy else my + hy
        far = far if far < mz + hz else mz + hz
        shaded[j] = shaded[j] | ((near <= far) & (far > 1e-9))


@jit_no_alias
def _shade_by_ellipsoid(sx, sy, sz, frame, d, point, shaded):  # type: ignore[no-untyped-def]
    ax, ay, az = 1.0 / sx, 1.0 / sy, 1.0 / sz
    dx, dy, dz = d[0] * ax, d[1] * ay, d[2] * az
    a = dx * dx + dy * dy + dz * dz
    for j in range(shaded.shape[0]):
        x, y, z = point[0, j] - frame[9], point[1, j] - frame[10], point[2, j] - frame[11]
        ox = ax * (frame[0] * x + frame[3] * y + frame[6] * z)
        oy = ay * (frame[1] * x + frame[4] * y + frame[7] * z)
        oz = az * (frame[2] * x + frame[5] * y + frame[8] * z)
        b = ox * dx + oy * dy + oz * dz
        root = np.sqrt(b * b - a * (ox * ox + oy * oy + oz * oz - 1.0))
        shaded[j] = shaded[j] | (root - b > 1e-9)


@jit_no_alias
def _shade_by_tube(radius, half, ends, frame, d, point, shaded):  # type: ignore[no-untyped-def]
    """A cylinder, or with `ends` a capsule (two balls beside the tube)."""
    a = d[0] * d[0] + d[1] * d[1]
    a = a if a > 1e-200 else 1e-200
    whole = a + d[2] * d[2]
    dz = d[2] if d[2] != 0.0 else 1e-200
    ia, iz = 1.0 / a, 1.0 / dz
    spread = abs(iz) * half
    for j in range(shaded.shape[0]):
        x, y, z = point[0, j] - frame[9], point[1, j] - frame[10], point[2, j] - frame[11]
        ox = frame[0] * x + frame[3] * y + frame[6] * z
        oy = frame[1] * x + frame[4] * y + frame[7] * z
        oz = frame[2] * x + frame[5] * y + frame[8] * z
        b = ox * d[0] + oy * d[1]
        c = ox * ox + oy * oy - radius * radius
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) * ia, (-b + root) * ia
        middle = -oz * iz
        near = middle - spread if middle - spread > near else near  # stays nan where the ray misses
        far = middle + spread if middle + spread < far else far
        hit = (near <= far) & (far > 1e-9)
        for side in range(2):
            e = oz - half if side == 0 else oz + half
            be = b + e * d[2]
            hit = hit | (ends & (np.sqrt(be * be - whole * (c + e * e)) - be > 1e-9))
        shaded[j] = shaded[j] | hit


@jit
def _sunlit(  # type: ignore[no-untyped-def]
    kind, size, row, still, table, key, weight, R, origin, pose_of, frame, slope, skew, scale, out_at,
    out_stride, axes, footprint, low, cells_per_m, first, member, range_m, geom, lit,
):  # fmt: skip
    """Whether the sun reaches what each ray hit. A geom, being convex, does not shade itself here: what of it
    faces the sun is lit unless another stands before it.

    Rays go in runs: neighbours in a fan that hit the same geom, few enough to lie in few cells. A geom is
    held against a whole run.
    """
    n = np.int64(np.sqrt(first.shape[0] - 1))
    steps = slope.shape[1]
    W, moved, sun = np.empty(9), np.empty(12), np.empty(3)
    s_row, x_row, r_row = np.empty(steps), np.empty(steps), np.empty(steps)
    point, across, shaded = np.empty((3, steps)), np.empty((3, steps)), np.empty(steps, np.bool_)
    seen = np.full(kind.shape[0], -1, np.int64)
    run = 0
    for f in range(pose_of.shape[0]):
        at = out_at[f]
        if at == NOWHERE:
            continue
        p = pose_of[f]
        for r in range(3):
            for c in range(3):
                W[3 * r + c] = (
                    R[p, r, 0] * frame[f, 0, c] + R[p, r, 1] * frame[f, 1, c] + R[p, r, 2] * frame[f, 2, c]
                )
        group, lane = 0 if slope.shape[0] == 1 else f // LANES, f % LANES
        for j in range(steps):
            s_row[j], x_row[j] = scale[f] * slope[group, j, lane], skew[group, j, lane]
            r_row[j] = range_m[at + j * out_stride] if geom[at + j * out_stride] >= 0 else 0.0
            shaded[j] = False
        _run_points(W, origin[p], axes, s_row, x_row, r_row, point, across)
        j = 0
        while j < steps:
            g = geom[at + j * out_stride]
            stop = j + 1
            while stop < steps and stop - j < RUN and geom[at + stop * out_stride] == g:
                stop += 1
            if g < 0:
                j = stop
                continue
            while True:
                a0, b0, a1, b1, top = np.inf, np.inf, -np.inf, -np.inf, np.inf
                for q in range(j, stop):
                    a0, a1 = min(a0, across[0, q]), max(a1, across[0, q])
                    b0, b1 = min(b0, across[1, q]), max(b1, across[1, q])
                    top = min(top, across[2, q])
                u0 = min(max(int((a0 - low[0]) * cells_per_m[0]), 0), n - 1)
                u1 = min(max(int((a1 - low[0]) * cells_per_m[0]), 0), n - 1)
                v0 = min(max(int((b0 - low[1]) * cells_per_m[1]), 0), n - 1)
                v1 = min(max(int((b1 - low[1]) * cells_per_m[1]), 0), n - 1)
                if (u1 - u0 + 1) * (v1 - v0 + 1) <= RUN_CELLS or stop - j <= 4:
                    break
                stop = j + (stop - j) // 2
            run += 1
            for u in range(u0, u1 + 1):
                for v in range(v0, v1 + 1):
                    cell = u * n + v
                    for q in range(first[cell], first[cell + 1]):
                        i = member[q]
                        if seen[i] == run or i == g:
                            continue
                        seen[i] = run
                        if (
                            top > footprint[i, 5]
                            or a0 > footprint[i, 0] + footprint[i, 2]
                            or a1 < footprint[i, 0] - footprint[i, 2]
                            or b0 > footprint[i, 1] + footprint[i, 3]
                            or b1 < footprint[i, 1] - footprint[i, 3]
                        ):
                            continue
                        m = row[i]
                        if m < 0:
                            for r in range(12):
                                moved[r] = still[i, r]
                        else:
                            k, w = key[p], weight[p]
                            last = min(k + 1, table.shape[0] - 1)
                            for r in range(12):
                                moved[r] = table[k, m, r] + w * (table[last, m, r] - table[k, m, r])
                        for r in range(3):
                            sun[r] = (
                                moved[r] * axes[2, 0] + moved[3 + r] * axes[2, 1] + moved[6 + r] * axes[2, 2]
                            )
                        here, dark = point[:, j:stop], shaded[j:stop]
                        if kind[i] == BOX:
                            _shade_by_box(size[i], moved, sun, here, dark)
                        elif kind[i] == ELLIPSOID:
                            _shade_by_ellipsoid(size[i, 0], size[i, 1], size[i, 2], moved, sun, here, dark)
                        elif kind[i] == SPHERE:
                            _shade_by_ellipsoid(size[i, 0], size[i, 0], size[i, 0], moved, sun, here, dark)
                        else:
                            _shade_by_tube(size[i, 0], size[i, 1], kind[i] == CAPSULE, moved, sun, here, dark)
            j = stop
        for j in range(steps):
            lit[at + j * out_stride] = not shaded[j]
