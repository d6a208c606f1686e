"""Points that the LiDAR puts in the wrong place: too near or far along the ray, or turned about its axis.

lidar.range_noise_cm, lidar.range_bias_cm: xyz * (r + e) / r, e = sd * N(0, 1) per firing, or the bias.
lidar.azimuth_error_deg: turned by offset + eccentricity * sin(azimuth - phase). The truth stays what it was.
Receipts: each point's range less its true range, and its azimuth, after against before.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from scenarios.faults.lidar import AzimuthError, RangeBias, RangeNoise
from scenarios.seeding import stream
from simbench.faults.compared import Compared, compared
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import each, firing_of, moved, normal
from simbench.faults.receipt import Receipt, judge, untouched

NEAREST_M = 0.01
FAR_SD = 6.0  # a ray of so many SD of the noise is never cut short
RANGE_SD_CM = 1e-4  # of a mean or RMS over points: single precision at 100 m is 4e-4 cm a point
TURN_SD_DEG = 1e-4  # single precision is 3e-6 deg a point
POINT_RANGE_SD_CM = 1e-3
POINT_TURN_SD_DEG = 1e-3
FEWEST = 100
RANGE_NOTE = "range less true range, after against before"
TURN_NOTE = "azimuths after against before, weighted by planar range"


def _longer(sweep: Sweep, by_m: Float64[np.ndarray, " n"]) -> Sweep:
    """Every ray longer by so much, but never shorter than 1 cm."""
    xyz_m = sweep.scan.xyz_m.astype(np.float64)
    range_m = np.linalg.norm(xyz_m, axis=1)
    return moved(sweep, xyz_m * (np.maximum(range_m + by_m, NEAREST_M) / range_m)[:, None])


# -- lidar.range_noise_cm ---------------------------------------------------------------------------------


def add_noise(spec: RangeNoise, delivery: Delivery, site: Site) -> Acted:
    """Independent of the sensor's own noise."""
    drawn: list[Float64[np.ndarray, " _"]] = []

    def change(sweep: Sweep) -> Sweep:
        e_m = 0.01 * spec.sd_cm * normal(site, spec.name, sweep.scan.seq)[firing_of(sweep, site.rig.lidar)]
        range_m = np.linalg.norm(sweep.scan.xyz_m.astype(np.float64), axis=1)
        drawn.append(e_m[range_m > FAR_SD * 0.01 * spec.sd_cm])
        return _longer(sweep, e_m)

    after = each(delivery, change)
    e_m = np.concatenate(drawn) if drawn else np.zeros(0)
    rms_cm = 100.0 * float(np.sqrt(np.mean(e_m**2))) if len(e_m) else spec.sd_cm
    return Acted(delivery=after, realised={"rms_cm": rms_cm})


def noise_receipts(spec: RangeNoise, step: Step, site: Site) -> tuple[Receipt, ...]:
    """RMS of what ranges changed by, of rays that are too long to be cut short at 1 cm."""
    both = compared(step)
    change_cm = _range_change_cm(both, beyond_m=FAR_SD * 0.01 * spec.sd_cm)
    enough = len(change_cm) >= FEWEST
    return (
        judge(
            fault=spec.name, quantity="range noise (RMS)", unit="cm", requested=spec.sd_cm,
            realised=step.realised["rms_cm"],
            measured=float(np.sqrt(np.mean(change_cm**2))) if enough else None,
            systematic=5.0 * RANGE_SD_CM,
            allowed=5.0 * spec.sd_cm / np.sqrt(2.0 * max(len(change_cm), 1)),
            note=RANGE_NOTE if enough else f"only {len(change_cm)} points",
        ),
        *_same_points(spec.name, both),
        *_untouched_turn(spec.name, both),
    )  # fmt: skip


# -- lidar.range_bias_cm ----------------------------------------------------------------------------------


def add_bias(spec: RangeBias, delivery: Delivery, site: Site) -> Acted:
    """The same for every point."""
    bias_m = 0.01 * spec.bias_cm
    after = each(delivery, lambda sweep: _longer(sweep, np.full(len(sweep.scan.ring), bias_m)))
    return Acted(delivery=after, realised={"bias_cm": spec.bias_cm})


def bias_receipts(spec: RangeBias, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Median of what ranges changed by, and that none changed by anything else: of rays that are too long to
    be cut short at 1 cm.
    """
    both = compared(step)
    change_cm = _range_change_cm(both, beyond_m=0.02 - 0.01 * spec.bias_cm)
    enough = len(change_cm) >= FEWEST
    note = RANGE_NOTE if enough else f"only {len(change_cm)} points"
    middle = float(np.median(change_cm)) if enough else None
    spread = float(np.std(change_cm)) if enough else 0.0
    return (
        judge(
            fault=spec.name, quantity="range bias", unit="cm", requested=spec.bias_cm,
            realised=step.realised["bias_cm"], measured=middle, systematic=5.0 * POINT_RANGE_SD_CM,
            allowed=0.01 * abs(spec.bias_cm), note=note,
        ),
        *untouched(
            fault=spec.name, quantity="spread of the bias", unit="cm", found=[(spread, POINT_RANGE_SD_CM)],
            note=note,
        ),
        *_same_points(spec.name, both),
        *_untouched_turn(spec.name, both),
    )  # fmt: skip


# -- lidar.azimuth_error_deg ------------------------------------------------------------------------------


def turn(spec: AzimuthError, delivery: Delivery, site: Site) -> Acted:
    """About the sensor's z axis; the seed draws where the eccentricity is greatest."""
    phase_rad = float(stream(site.seed, "fault", spec.name, site.rig.lidar_name).uniform(0.0, 2.0 * np.pi))

    def change(sweep: Sweep) -> Sweep:
        x, y, z = sweep.scan.xyz_m.astype(np.float64).T
        by_deg = spec.offset_deg + spec.eccentricity_deg * np.sin(np.arctan2(y, x) - phase_rad)
        c, s = np.cos(np.deg2rad(by_deg)), np.sin(np.deg2rad(by_deg))
        return moved(sweep, np.stack([c * x - s * y, s * x + c * y, z], axis=1))

    realised = {
        "offset_deg": spec.offset_deg,
        "eccentricity_deg": spec.eccentricity_deg,
        "phase_rad": phase_rad,
    }
    return Acted(delivery=each(delivery, change), realised=realised)


def turn_receipts(spec: AzimuthError, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Least squares of the turn over 1, sin and cos of the azimuth before; of the eccentricity the part along
    the drawn phase. Ranges stay.
    """
    both = compared(step)
    was, now = both.before.xyz_m[both.stays], both.after.xyz_m[both.known]
    fit = None
    if len(was) == len(now) and len(was) >= FEWEST:
        azimuth, weight = np.arctan2(was[:, 1], was[:, 0]), np.hypot(was[:, 0], was[:, 1])
        basis = np.stack([np.ones_like(azimuth), np.sin(azimuth), np.cos(azimuth)], axis=1)
        if spec.eccentricity_deg == 0.0:
            basis = basis[:, :1]
        fit, *_ = np.linalg.lstsq(basis * weight[:, None], _turned_deg(was, now) * weight, rcond=None)
    note = TURN_NOTE if fit is not None else f"only {len(was)} points"
    result = [
        judge(
            fault=spec.name, quantity="azimuth offset", unit="deg", requested=spec.offset_deg,
            realised=step.realised["offset_deg"], measured=None if fit is None else float(fit[0]),
            systematic=5.0 * TURN_SD_DEG, allowed=0.01 * abs(spec.offset_deg), note=note,
        )
    ]  # fmt: skip
    if spec.eccentricity_deg > 0.0:
        phase = step.realised["phase_rad"]
        along = None if fit is None else float(fit[1] * np.cos(phase) - fit[2] * np.sin(phase))
        result.append(
            judge(
                fault=spec.name, quantity="eccentricity", unit="deg", requested=spec.eccentricity_deg,
                realised=step.realised["eccentricity_deg"], measured=along, systematic=5.0 * TURN_SD_DEG,
                allowed=0.01 * spec.eccentricity_deg, note=note,
            )
        )  # fmt: skip
    change_cm = _range_change_cm(both)
    longer = float(np.abs(change_cm).max()) if len(change_cm) else 0.0
    result += untouched(
        fault=spec.name, quantity="change of range", unit="cm", found=[(longer, POINT_RANGE_SD_CM)], note=note
    )
    return (*result, *_same_points(spec.name, both))


# -- estimators -------------------------------------------------------------------------------------------


def _range_change_cm(both: Compared, beyond_m: float = 0.0) -> Float64[np.ndarray, " k"]:
    """Range less true range, after less before, of every point that is in both and was farther than that."""
    before = (both.before.range_m - both.before.true_range_m)[both.stays]
    after = (both.after.range_m - both.after.true_range_m)[both.known]
    if len(after) != len(before):
        return np.zeros(0)
    far = both.before.range_m[both.stays] > beyond_m
    return np.asarray(100.0 * (after - before)[far])


def _turned_deg(
    was: Float64[np.ndarray, "k 3"], now: Float64[np.ndarray, "k 3"]
) -> Float64[np.ndarray, " k"]:
    """To the left, about z."""
    across = was[:, 0] * now[:, 1] - was[:, 1] * now[:, 0]
    along = was[:, 0] * now[:, 0] + was[:, 1] * now[:, 1]
    return np.asarray(np.rad2deg(np.arctan2(across, along)))


def _untouched_turn(fault: str, both: Compared) -> tuple[Receipt, ...]:
    """That no ray points elsewhere than before."""
    was, now = both.before.xyz_m[both.stays], both.after.xyz_m[both.known]
    if len(was) != len(now) or not len(was):
        return ()
    aside = np.linalg.norm(np.cross(was, now), axis=1) / np.maximum(np.sum(was * now, axis=1), 1e-9)
    found = [(float(np.rad2deg(np.arctan(aside)).max()), POINT_TURN_SD_DEG)]
    return untouched(
        fault=fault, quantity="turn of the rays", unit="deg", found=found, note="directions after and before"
    )


def _same_points(fault: str, both: Compared) -> tuple[Receipt, ...]:
    """That none is lost and none invented, and that each keeps its intensity."""
    changed = int(np.count_nonzero(both.lost) + np.count_nonzero(~both.known))
    if not changed:
        changed = int(np.count_nonzero(both.before.intensity != both.after.intensity))
    return untouched(
        fault=fault, quantity="points lost, invented or dimmed", unit="points", found=[(float(changed), 0.1)],
        note="points before and after",
    )  # fmt: skip


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=RangeNoise, act=add_noise, receipts=noise_receipts),
    DeliveryFault(spec=RangeBias, act=add_bias, receipts=bias_receipts),
    DeliveryFault(spec=AzimuthError, act=turn, receipts=turn_receipts),
)
