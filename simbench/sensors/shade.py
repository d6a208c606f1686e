"""From what each pixel's ray hit to linear colour: one pass over the pixels of a picture.

Per pixel: normal from the geom's shape and the point hit, the sun (where its shadow ray got through) and an
ambient light that is bluer from above, a highlight and the sky's mirror image on what shines, haze by range;
the sky itself by elevation; the ground with grain that fades where a pixel covers more than it, and paint by
the share of the pixel that it covers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from fusion.geometry import readonly
from simbench.looks import Looks
from simbench.sensors import light
from simbench.sensors.compiled import jit, jit_no_alias
from simbench.sensors.rays import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from simbench.sensors.rows import Exposure
from simbench.world import SUN_DIRECTION

FINE_M, MIDDLE_M, PATCH_M = 0.012, 0.075, 0.35  # sizes of a texel of the ground's three textures
MASK = light.TILE - 1
STEP = 4  # pixels between two looks at the softer textures
BLOCK = 32  # pixels whose paint is looked for together


@dataclass(frozen=True, kw_only=True, eq=False)
class Palette:
    """A world's looks in linear light, ready for the kernel."""

    looks: Looks

    @cached_property
    def albedo(self) -> Float64[np.ndarray, "g 3"]:
        """Diffuse colour per geom."""
        return readonly(light.to_linear(self.looks.colour))

    @cached_property
    def exponent(self) -> Float64[np.ndarray, " g"]:
        """Of the highlight: MuJoCo's shininess 0..1 stands for 0..128."""
        return readonly(np.maximum(128.0 * self.looks.shininess, 1.0))

    @cached_property
    def strips(self) -> Float64[np.ndarray, "p 10"]:
        """The paint: x0, y0, x1, y1, period, dash, grass, linear red, green, blue."""
        paint = self.looks.paint
        tail = [paint.period_m, paint.dash_m, paint.grass.astype(np.float64)]
        return readonly(np.column_stack([paint.extent_m, *tail, light.to_linear(paint.colour)]))

    @cached_property
    def ground(self) -> Float64[np.ndarray, " 3"]:
        """Bare ground."""
        return readonly(light.to_linear(self.looks.paint.ground_colour))


def toward_sun() -> Float64[np.ndarray, " 3"]:
    """Unit vector to the sun, world frame."""
    direction = -np.array(SUN_DIRECTION)
    toward: np.ndarray = direction / np.linalg.norm(direction)
    return toward


def shade(
    exposure: Exposure,
    palette: Palette,
    direction: Float64[np.ndarray, "h 3 w"],
    pixel_rad: float,
    range_m: Float64[np.ndarray, "h w"],
    geom: Int32[np.ndarray, "h w"],
    lit: Bool[np.ndarray, "h w"],
) -> Float32[np.ndarray, "h w 3"]:
    """Linear RGB of a picture whose rays have been cast; above 1 where it is brighter than white.

    `direction`: unit vectors in the optical frame. `pixel_rad`: the angle that a pixel covers. `geom` is -1
    where a ray hit nothing; `lit` says which hits the sun reaches.
    """
    out = np.empty((*range_m.shape, 3), dtype=np.float32)
    placed, looks = exposure.placed, palette.looks
    _shade(
        placed.geoms.kind, placed.geoms.size_m, placed.row, placed.still, placed.keys, exposure.key,
        exposure.weight, exposure.R_world_camera, exposure.origin_m, palette.albedo, looks.specular,
        palette.exponent, palette.strips, palette.ground, direction, pixel_rad, range_m, geom, lit,
        toward_sun(), np.array(light.SUN_RGB), np.array(light.SKY_RGB), np.array(light.BOUNCE_RGB),
        light.sky_table(), light.HAZE_M, light.grain_tile(), light.patch_tile(), out,
    )  # fmt: skip
    return out


@jit
def _normal(kind, size, p, n):  # type: ignore[no-untyped-def]
    """Outward unit normal n of a primitive at its surface point p, both in the geom's frame."""
    if kind == BOX:
        # The face that the point lies on is the one that it is least inside of.
        axis, best = 0, abs(p[0]) - size[0]
        for i in range(1, 3):
            if abs(p[i]) - size[i] > best:
                axis, best = i, abs(p[i]) - size[i]
        n[0], n[1], n[2] = 0.0, 0.0, 0.0
        n[axis] = 1.0 if p[axis] > 0.0 else -1.0
        return
    if kind == PLANE:
        n[0], n[1], n[2] = 0.0, 0.0, 1.0
        return
    if kind == CYLINDER:
        radius = np.sqrt(p[0] * p[0] + p[1] * p[1])
        if abs(p[2]) - size[1] > radius - size[0]:
            n[0], n[1], n[2] = 0.0, 0.0, 1.0 if p[2] > 0.0 else -1.0
        else:
            n[0], n[1], n[2] = p[0] / radius, p[1] / radius, 0.0
        return
    if kind == CAPSULE:
        n[0], n[1], n[2] = p[0], p[1], p[2] - min(max(p[2], -size[1]), size[1])
    else:  # sphere, ellipsoid: the gradient of its equation
        sx = size[0]
        sy, sz = (size[0], size[0]) if kind == SPHERE else (size[1], size[2])
        n[0], n[1], n[2] = p[0] / (sx * sx), p[1] / (sy * sy), p[2] / (sz * sz)
    inverse = 1.0 / np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    n[0] *= inverse
    n[1] *= inverse
    n[2] *= inverse


@jit
def _texel(tile, x, y, per_m):  # type: ignore[no-untyped-def]
    return tile[int(np.floor(x * per_m)) & MASK, int(np.floor(y * per_m)) & MASK]


@jit
def _smooth(tile, x, y, per_m):  # type: ignore[no-untyped-def]
    """The tile between its texels."""
    x, y = x * per_m, y * per_m
    fx, fy = np.floor(x), np.floor(y)
    a, b = x - fx, y - fy
    i, j = int(fx), int(fy)
    i0, i1, j0, j1 = i & MASK, (i + 1) & MASK, j & MASK, (j + 1) & MASK
    low = tile[i0, j0] + b * (tile[i0, j1] - tile[i0, j0])
    high = tile[i1, j0] + b * (tile[i1, j1] - tile[i1, j0])
    return low + a * (high - low)


@jit
def _veil(far, haze_m):  # type: ignore[no-untyped-def]
    """Share of an object's light that haze lets through: near exp(-far / haze), and cheaper."""
    gone = 1.0 / (1.0 + 0.5 * far / haze_m)
    return gone * gone


@jit_no_alias
def _sky_run(R, direction, start, stop, sky, out):  # type: ignore[no-untyped-def]
    levels = sky.shape[0] - 1
    for col in range(start, stop):
        up = R[2, 0] * direction[0, col] + R[2, 1] * direction[1, col] + R[2, 2] * direction[2, col]
        i = int(min(max(up, 0.0), 1.0) * levels + 0.5)
        out[col, 0], out[col, 1], out[col, 2] = sky[i, 0], sky[i, 1], sky[i, 2]


@jit_no_alias
def _spot(R, o, direction, range_m, pixel, start, stop, x, y, wide_x, wide_y):  # type: ignore[no-untyped-def]
    """Where a run of pixels meets the ground, and how many metres each covers there along x and y."""
    for i in range(stop - start):
        col = start + i
        ex, ey, ez = direction[0, col], direction[1, col], direction[2, col]
        dx = R[0, 0] * ex + R[0, 1] * ey + R[0, 2] * ez
        dy = R[1, 0] * ex + R[1, 1] * ey + R[1, 2] * ez
        dz = R[2, 0] * ex + R[2, 1] * ey + R[2, 2] * ez
        far = range_m[col]
        flat = 1.0 / np.sqrt(dx * dx + dy * dy + 1e-18)
        across = far * pixel
        along = across / (abs(dz) + 1e-9)
        cx, cy = abs(dx) * flat, abs(dy) * flat
        x[i], y[i] = o[0] + far * dx, o[1] + far * dy
        wide_x[i], wide_y[i] = cx * along + cy * across, cy * along + cx * across


@jit
def _texture(x, y, wide_x, wide_y, n, grain, patch, grit, broad):  # type: ignore[no-untyped-def]
    """Fine and broad changes of the ground's brightness, mean 0, each fading where a pixel covers more.

    The two softer textures are looked up at every fourth pixel, and even in between.
    """
    grit_0, broad_0 = 0.0, 0.0
    for node in range(0, n + STEP - 1, STEP):
        at = min(node, n - 1)
        area = wide_x[at] * wide_y[at]
        grit_1, broad_1 = 0.0, 0.0
        if area < 100.0 * MIDDLE_M * MIDDLE_M:
            fade = MIDDLE_M * MIDDLE_M / (MIDDLE_M * MIDDLE_M + 0.5 * area)
            grit_1 = 0.07 * fade * _smooth(grain, x[at], y[at], 1.0 / MIDDLE_M)
        if area < 2500.0:
            broad_1 = _smooth(patch, x[at], y[at], 1.0 / PATCH_M) / (1.0 + 0.02 * area)
        if node == 0:
            grit[0], broad[0] = grit_1, broad_1
        else:
            first = node - STEP
            for i in range(first + 1, at + 1):
                share = (i - first) / (at - first)
                grit[i] = grit_0 + share * (grit_1 - grit_0)
                broad[i] = broad_0 + share * (broad_1 - broad_0)
        grit_0, broad_0 = grit_1, broad_1
    for i in range(n):
        area = wide_x[i] * wide_y[i]
        if area < 50.0 * FINE_M * FINE_M:
            fade = FINE_M * FINE_M / (FINE_M * FINE_M + area)
            grit[i] += 0.20 * fade * _texel(grain, x[i], y[i], 1.0 / FINE_M)


@jit_no_alias
def _covered(strip, x, y, wide_x, wide_y, first, last, share):  # type: ignore[no-untyped-def]
    """Share of each pixel's rectangle on the ground that a strip covers; False when it covers none."""
    any_share = 0.0
    for i in range(first, last):
        inside_y = min(strip[3], y[i] + 0.5 * wide_y[i]) - max(strip[1], y[i] - 0.5 * wide_y[i])
        inside_x = min(strip[2], x[i] + 0.5 * wide_x[i]) - max(strip[0], x[i] - 0.5 * wide_x[i])
        share[i] = max(inside_y, 0.0) * max(inside_x, 0.0) / (wide_x[i] * wide_y[i])
        any_share = max(any_share, share[i])
    period, dash = strip[4], strip[5]
    if period > 0.0 and any_share > 0.0:
        for i in range(first, last):
            # Painted length up to either end of the pixel: whole periods, and what is left of the last.
            a, b = x[i] - 0.5 * wide_x[i] - strip[0], x[i] + 0.5 * wide_x[i] - strip[0]
            whole_a, whole_b = np.floor(a / period), np.floor(b / period)
            painted_a = whole_a * dash + min(a - whole_a * period, dash)
            painted_b = whole_b * dash + min(b - whole_b * period, dash)
            share[i] *= (painted_b - painted_a) / wide_x[i]
    return any_share > 0.0


@jit_no_alias
def _lay_strip(strip, share, grit, broad, first, last, red, green, blue):  # type: ignore[no-untyped-def]
    """Cover the ground's colour with a strip: grass by its blades and dryness, a line by its wear."""
    if strip[6] > 0.0:
        for i in range(first, last):
            dry = min(max(0.5 + 0.35 * broad[i], 0.0), 1.0)
            blade = max(1.0 + 2.2 * grit[i], 0.3)
            red[i] += share[i] * (strip[7] * blade * (0.80 + 0.45 * dry) - red[i])
            green[i] += share[i] * (strip[8] * blade * (0.90 + 0.15 * dry) - green[i])
            blue[i] += share[i] * (strip[9] * blade * (0.75 + 0.25 * dry) - blue[i])
        return
    for i in range(first, last):
        worn = share[i] * min(max(0.93 - 0.06 * broad[i] + 0.8 * grit[i], 0.0), 1.0)
        red[i] += worn * (strip[7] - red[i])
        green[i] += worn * (strip[8] - green[i])
        blue[i] += worn * (strip[9] - blue[i])


@jit_no_alias
def _light_ground(  # type: ignore[no-untyped-def]
    red, green, blue, lit, range_m, start, n, sun_z, sun_rgb, sky_rgb, air, haze_m, out
):
    shade_0, shade_1, shade_2 = sky_rgb[0], sky_rgb[1], sky_rgb[2]
    full_0, full_1, full_2 = sun_z * sun_rgb[0], sun_z * sun_rgb[1], sun_z * sun_rgb[2]
    for i in range(n):
        direct = 1.0 if lit[start + i] else 0.0
        clear = _veil(range_m[start + i], haze_m)
        out[start + i, 0] = air[0] + clear * (red[i] * (shade_0 + direct * full_0) - air[0])
        out[start + i, 1] = air[1] + clear * (green[i] * (shade_1 + direct * full_1) - air[1])
        out[start + i, 2] = air[2] + clear * (blue[i] * (shade_2 + direct * full_2) - air[2])


@jit
def _ground_run(  # type: ignore[no-untyped-def]
    R, o, direction, range_m, lit, start, stop, pixel, strips, ground, grain, patch, sun, sun_rgb, sky_rgb,
    air, haze_m, work, out,
):  # fmt: skip
    n = stop - start
    x, y, wide_x, wide_y, grit, broad, share = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    red, green, blue = work[7], work[8], work[9]
    _spot(R, o, direction, range_m, pixel, start, stop, x, y, wide_x, wide_y)
    _texture(x, y, wide_x, wide_y, n, grain, patch, grit, broad)
    for i in range(n):
        tone = max(1.0 + grit[i] + 0.05 * broad[i], 0.2)
        red[i], green[i], blue[i] = ground[0] * tone, ground[1] * tone, ground[2] * tone
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        low, high = np.inf, -np.inf
        for i in range(first, last):
            low, high = min(low, y[i] - wide_y[i]), max(high, y[i] + wide_y[i])
        for s in range(strips.shape[0]):
            if strips[s, 1] > high or strips[s, 3] < low:
                continue
            if _covered(strips[s], x, y, wide_x, wide_y, first, last, share):
                _lay_strip(strips[s], share, grit, broad, first, last, red, green, blue)
    _light_ground(red, green, blue, lit, range_m, start, n, sun[2], sun_rgb, sky_rgb, air, haze_m, out)


@jit
def _geom_run(  # type: ignore[no-untyped-def]
    kind, size, frame, R, o, centre, direction, range_m, lit, start, stop, albedo, gloss, exponent, sun,
    sun_rgb, sky_rgb, bounce_rgb, sky, haze_m, work, out,
):  # fmt: skip
    """A run of pixels on one geom, in the geom's own frame."""
    eye, d, p, n, local_sun, to_local = work[0], work[1], work[2], work[3], work[4], work[5:8]
    levels = sky.shape[0] - 1
    for r in range(3):
        eye[r], local_sun[r] = 0.0, 0.0
        for c in range(3):
            eye[r] += frame[3 * c + r] * (o[c] - centre[c])
            local_sun[r] += frame[3 * c + r] * sun[c]
            to_local[r, c] = frame[r] * R[0, c] + frame[3 + r] * R[1, c] + frame[6 + r] * R[2, c]
    for col in range(start, stop):
        ex, ey, ez, far = direction[0, col], direction[1, col], direction[2, col], range_m[col]
        for r in range(3):
            d[r] = to_local[r, 0] * ex + to_local[r, 1] * ey + to_local[r, 2] * ez
            p[r] = eye[r] + far * d[r]
        _normal(kind, size, p, n)
        facing = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
        if facing < 0.0:  # seen from inside
            n[0], n[1], n[2], facing = -n[0], -n[1], -n[2], -facing
        normal_up = frame[6] * n[0] + frame[7] * n[1] + frame[8] * n[2]
        direct = n[0] * local_sun[0] + n[1] * local_sun[1] + n[2] * local_sun[2]
        if not lit[col] or direct < 0.0:
            direct = 0.0
        above = 0.5 + 0.5 * normal_up
        highlight, mirror, sharp, i = 0.0, 0.0, 0.0, 0
        if gloss > 0.05:
            grazing = 1.0 - facing
            grazing2 = grazing * grazing
            mirror = gloss * (0.04 + 0.5 * grazing2 * grazing2 * grazing)  # Schlick's Fresnel term
            if direct > 0.0:
                # Blinn-Phong: the normal against the half-way vector.
                hx, hy, hz = local_sun[0] - d[0], local_sun[1] - d[1], local_sun[2] - d[2]
                half = (n[0] * hx + n[1] * hy + n[2] * hz) / np.sqrt(hx * hx + hy * hy + hz * hz)
                if half > 0.0:
                    highlight = 0.8 * gloss * half**exponent
            up = R[2, 0] * ex + R[2, 1] * ey + R[2, 2] * ez
            reflected = up + 2.0 * facing * normal_up
            sharp = 0.12  # the ground is darker than the horizon
            if reflected > 0.0:
                i, sharp = min(int(reflected * levels), levels), 1.0
        clear = _veil(far, haze_m)
        for c in range(3):
            ambient = bounce_rgb[c] + above * (sky_rgb[c] - bounce_rgb[c])
            value = albedo[c] * (ambient + direct * sun_rgb[c])
            value += mirror * (sharp * sky[i, c] - value) + highlight * sun_rgb[c]
            out[col, c] = sky[0, c] + clear * (value - sky[0, c])


@jit
def _shade(  # type: ignore[no-untyped-def]
    kind, size, moving, still, keys, key, weight, R_camera, origin, albedo, specular, exponent, strips,
    ground, direction, pixel, range_m, geom, lit, sun, sun_rgb, sky_rgb, bounce_rgb, sky, haze_m, grain,
    patch, out,
):  # fmt: skip
    """Row by row, run by run: neighbours that show the same geom, the ground or the sky."""
    rows, columns = geom.shape
    frame, small, work = np.empty(12), np.empty((8, 3)), np.empty((10, columns))
    for row in range(rows):
        R, o, d, stop = R_camera[row], origin[row], direction[row], 0
        while stop < columns:
            start, g = stop, geom[row, stop]
            while stop < columns and geom[row, stop] == g:
                stop += 1
            if g < 0:
                _sky_run(R, d, start, stop, sky, out[row])
                continue
            if kind[g] == PLANE:
                _ground_run(
                    R, o, d, range_m[row], lit[row], start, stop, pixel, strips, ground, grain, patch, sun,
                    sun_rgb, sky_rgb, sky[0], haze_m, work, out[row],
                )  # fmt: skip
                continue
            a = moving[g]
            k, w = key[row], weight[row]
            after = min(k + 1, keys.shape[0] - 1)
            for r in range(12):
                frame[r] = still[g, r] if a < 0 else keys[k, a, r] + w * (keys[after, a, r] - keys[k, a, r])
            _geom_run(
                kind[g], size[g], frame, R, o, frame[9:], d, range_m[row], lit[row], start, stop, albedo[g],
                specular[g], exponent[g], sun, sun_rgb, sky_rgb, bounce_rgb, sky, haze_m, small, out[row],
            )  # fmt: skip
