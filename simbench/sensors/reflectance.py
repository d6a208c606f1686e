"""How much of a LiDAR's light a surface sends back, by the angle under which it is hit.

A LiDAR looks along its own light, so the angle of incidence is the angle of view too. A smooth matt surface
sends back rho cos(theta) (Lambert). A rough one is brighter at grazing incidence, because the facets that
face the sensor are both lit and seen. Oren and Nayar's model for that geometry (their eq. 30 with equal
angles and no azimuth between them) is

    f(theta) = rho (cos theta + g sin^2 theta),  g = B / A,
    A = 1 - 0.5 s^2 / (s^2 + 0.33),  B = 0.45 s^2 / (s^2 + 0.09),

s: standard deviation of the facets' slope angle in radians. It is divided by A here, so that rho is what a
spectrometer reads that looks straight down, as in `materials.yaml`.

Sources: M. Oren, S. K. Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994. That it fits
LiDAR intensity on rough natural and built surfaces: D. Carrea et al., ISPRS J. 113, 2016; K. Tan, X. Cheng,
Opt. Express 24, 2016.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float64


def roughness_gain(slope_rad: Float64[np.ndarray, " g"]) -> Float64[np.ndarray, " g"]:
    """g of the formula above by surface, from the spread of its facets' slopes; 0 is Lambert's law."""
    square = slope_rad**2
    return np.asarray((0.45 * square / (square + 0.09)) / (1.0 - 0.5 * square / (square + 0.33)))


def sent_back(
    reflectivity: Float[np.ndarray, "..."], gain: Float[np.ndarray, "..."], cosine: Float[np.ndarray, "..."]
) -> Float[np.ndarray, "..."]:
    """f: the reflectivity of the upright matt surface that would send back as much."""
    return np.asarray(reflectivity * (cosine + gain * (1.0 - cosine * cosine)))
