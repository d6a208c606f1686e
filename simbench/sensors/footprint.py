"""The width of a LiDAR's beam: returns of surfaces that share one footprint mix.

A beam is a Gaussian cone. Its footprint is sampled by 19 rays on a hexagonal grid one standard deviation
apart, each with the Gaussian's weight. A footprint that one geom fills returns like its middle ray, so all
rays are cast only for *edge beams*, whose footprint may hold two surfaces. All others pass two tests:

* The geom that the middle ray meets, being convex, **fills** the cone of the footprint somewhere: made
  smaller on all sides by the footprint's radius, it is still met. So every ray of the beam meets it.
* None **other** comes before that: against all other geoms **grown** by the footprint's radius at their
  distance, the ground left out, the middle ray meets nothing nearer. A surface that reaches into a footprint
  is met so however thin it is, also between beams.

The horizon is no edge here: the ground returns nothing from there.

The receiver gives one return: parts nearer to each other than `merge_m` are one return at their mean range
weighted by power (weight x reflectivity / range^2); of several returns the strongest is reported.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from scenarios.scenario import LidarSensor
from simbench.sensors import rays
from simbench.sensors.compiled import jit
from simbench.sensors.cones import Cones
from simbench.sensors.rays import Geoms
from simbench.sensors.returns import Echoes
from simbench.sensors.shot import Shot
from simbench.world import World

FWHM_PER_SD = 2.0 * np.sqrt(2.0 * np.log(2.0))
BETWEEN_M = 0.2  # how much farther than at start, middle and end of a sweep a geom may be in between


def _hexagonal() -> Float64[np.ndarray, "s 2"]:
    """(across, up) in standard deviations, upwards: the middle, and rings at 1, sqrt 3 and 2."""
    rings = [np.zeros((1, 2))]
    for radius, first in ((1.0, 0.0), (np.sqrt(3.0), np.pi / 6.0), (2.0, 0.0)):
        angle = first + np.arange(6) * np.pi / 3.0
        rings.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    grid = np.concatenate(rings)
    return grid[np.argsort(grid[:, 1], kind="stable")]


SAMPLES = _hexagonal()
_BELL = np.exp(-0.5 * (SAMPLES**2).sum(axis=1))
WEIGHTS = _BELL / _BELL.sum()
SPECK_M = 1e-9
RADIUS_SD = 2.0  # of the footprint: that of its outer rays
DEPTH_RATIO = 1.3  # see _depth_ratio


def beam_sd_rad(sensor: LidarSensor) -> Float64[np.ndarray, "2"]:
    """One standard deviation of the beam, across and up."""
    return np.deg2rad(np.asarray(sensor.divergence_deg)) / FWHM_PER_SD


def grown(geoms: Geoms, by_m: Float64[np.ndarray, " n"]) -> Geoms:
    """The same geoms in the same order, each grown by at least `by_m` on all sides; planes become specks."""
    kind, size_m = geoms.kind, geoms.size_m
    plane, ellipsoid = kind == rays.PLANE, kind == rays.ELLIPSOID
    scale = 1.0 + by_m / np.where(ellipsoid, size_m.min(axis=1), 1.0)
    sides = np.repeat(by_m[:, None], 3, axis=1)
    sides[kind == rays.CAPSULE, 1] = 0.0  # its caps grow with its radius
    bound_m = np.where(ellipsoid, geoms.bound_m * scale, geoms.bound_m + np.sqrt(3.0) * by_m)
    size_m = np.where(ellipsoid[:, None], size_m * scale[:, None], size_m + sides)
    return Geoms(
        kind=np.where(plane, rays.SPHERE, kind),
        size_m=np.where(plane[:, None], SPECK_M, size_m),
        body=geoms.body,
        rotation=geoms.rotation,
        position_m=geoms.position_m,
        bound_m=np.where(plane, SPECK_M, bound_m),
    )


def edge_beams(shot: Shot, hits: rays.Hits, sd_rad: Float64[np.ndarray, "2"]) -> Cones:
    """Which beams' footprints may hold more than one surface; none that does is left out."""
    widening = float(np.tan(RADIUS_SD * sd_rad.max()))
    geoms = shot.world.geoms
    return shot.edges(hits, grown(geoms, widening * _farthest_m(shot)), widening, _depth_ratio(geoms))


def _depth_ratio(geoms: Geoms) -> Float64[np.ndarray, " n"]:
    """How deep below its surface, in radii, a geom's footprint is looked for: one is enough where it is flat
    and met head on. An ellipsoid is shrunk in proportion, so most along its longest axis."""
    longest, shortest = geoms.size_m.max(axis=1), np.maximum(geoms.size_m.min(axis=1), 1e-9)
    return DEPTH_RATIO * np.where(geoms.kind == rays.ELLIPSOID, longest / shortest, 1.0)


def _farthest_m(shot: Shot) -> Float64[np.ndarray, " n"]:
    """How far away a point of each geom may be at any time of the sweep; 0 for planes."""
    geoms, groups = shot.world.geoms, np.array([0, len(shot.key) // 2, -1])
    key = shot.key[groups][:, None]
    R, p = shot.body_rotation[key, geoms.body], shot.body_position_m[key, geoms.body]
    centre_m = np.einsum("tnij,nj->tni", R, geoms.position_m) + p
    far_m = np.linalg.norm(centre_m - shot.origin_m[groups][:, None], axis=2).max(axis=0)
    return np.where(geoms.kind == rays.PLANE, 0.0, far_m + np.minimum(geoms.bound_m, 1e6) + BETWEEN_M)


def mixed(sensor: LidarSensor, world: World, edges: Cones, hits: rays.Hits, echoes: Echoes) -> Echoes:
    """`echoes` with those of the edge beams replaced, in place, by what their whole footprints return.

    hits [n s]: of the rays `SAMPLES` of the edge beams.
    """
    # Only the true range has to be parted from the range; nobody else holds these arrays.
    result = replace(echoes, true_range_m=echoes.true_range_m.copy())
    _mix(
        hits.range_m, hits.geom, hits.cosine, WEIGHTS, world.reflectivity, world.roughness_gain,
        sensor.merge_m, edges.fan, edges.step,
        result.range_m, result.true_range_m, result.geom, result.cosine, result.reflectivity,
    )  # fmt: skip
    return result


@jit
def _mix(  # type: ignore[no-untyped-def]
    distance, geom, cosine, weight, reflectivity, gain, merge, row, column,
    out_range, out_true, out_geom, out_cosine, out_reflectivity,
):  # fmt: skip
    """Footprint n, samples s -> the strongest return, written to (row[n], column[n]) of the outputs."""
    samples = weight.shape[0]
    order, back, power = np.empty(samples, np.int64), np.empty(samples), np.empty(samples)
    near = np.empty(samples)  # in order of distance, as `order` is
    name, total_of, main_of = np.empty(samples, np.int64), np.empty(samples), np.empty(samples, np.int64)
    for n in range(row.shape[0]):
        alone = True
        for s in range(1, samples):
            if geom[n, s] != geom[n, 0]:
                alone = False
                break
        if alone:
            continue  # one geom, or nothing: the middle ray says it all
        hit = 0
        for s in range(samples):
            g = geom[n, s]
            if g < 0:
                continue
            x, far = float(cosine[n, s]), distance[n, s]
            back[s] = weight[s] * reflectivity[g] * (x + gain[g] * (1.0 - x * x))
            power[s] = back[s] / (far * far)
            place = hit
            while place > 0 and near[place - 1] > far:
                near[place], order[place] = near[place - 1], order[place - 1]
                place -= 1
            near[place], order[place] = far, s
            hit += 1
        # Along the range, a gap of `merge` ends a return. The nearest of equally strong ones wins.
        best, best_first, best_end, first = -1.0, 0, 0, 0
        total = 0.0
        for i in range(hit):
            total += power[order[i]]
            if i + 1 == hit or near[i + 1] - near[i] >= merge:
                if total > best:
                    best, best_first, best_end = total, first, i + 1
                first, total = i + 1, 0.0
        r, c = row[n], column[n]
        if best <= 0.0:  # what is hit sends nothing back
            out_geom[r, c] = -1
            continue
        mean, sent, geoms = 0.0, 0.0, 0
        for i in range(best_first, best_end):
            s = order[i]
            mean += power[s] * near[i]
            sent += back[s]
            k = 0
            while k < geoms and name[k] != geom[n, s]:
                k += 1
            if k == geoms:
                name[k], total_of[k], main_of[k] = geom[n, s], 0.0, s
                geoms += 1
            total_of[k] += power[s]
            main_of[k] = s if power[s] > power[main_of[k]] else main_of[k]
        main = 0
        for k in range(1, geoms):
            main = k if total_of[k] > total_of[main] else main
        s = main_of[main]
        out_range[r, c] = mean / best
        out_true[r, c] = distance[n, s]
        out_geom[r, c] = geom[n, s]
        out_cosine[r, c] = cosine[n, s]
        out_reflectivity[r, c] = sent
