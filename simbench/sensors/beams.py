"""Where every beam of a spinning LiDAR looks, and when it fires."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import readonly
from scenarios.scenario import LidarSensor
from simbench.sensors import rays


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamTable:
    """Directions of one sweep in the LiDAR frame, and when each beam fires, in ns from the sweep's start.

    order: the beams of a column in the order in which they fire. The beams of a column that fire together
    are a *group*, g = column * i + instant; `slots` lists them from the lowest slope up (a short row repeats
    its last beam), and beam b is number `place[b]` of its column's instant `instant[b]`. `fans`: one fan per
    group, for the ray kernel. base, along_azimuth, along_elevation [i k 3]: a beam's direction and its change
    per radian of either angle in its fan's frame (forward at the encoder's angle, up, left). last_offset_ns:
    when the turn ends with its last firing, also of a scan that is not rolling.
    """

    direction: Float64[np.ndarray, "c b 3"]
    fire_offset_ns: Int64[np.ndarray, "c b"]
    order: Int64[np.ndarray, " b"]
    slots: Int64[np.ndarray, "i k"]
    instant: Int64[np.ndarray, " b"]
    place: Int64[np.ndarray, " b"]
    column_offset_ns: Int64[np.ndarray, " c"]
    group_offset_ns: Int64[np.ndarray, " g"]
    last_offset_ns: int
    fans: rays.Fans
    base: Float64[np.ndarray, "i k 3"]
    along_azimuth: Float64[np.ndarray, "i k 3"]
    along_elevation: Float64[np.ndarray, "i k 3"]


def period_ns(sensor: LidarSensor) -> int:
    """Duration of one turn."""
    return round(1e9 / sensor.rate_hz)


@lru_cache(maxsize=8)
def beam_table(sensor: LidarSensor) -> BeamTable:
    """All nominal directions: the encoder starts at `start_azimuth_deg` and turns evenly; each beam looks
    where the encoder stands when it fires, plus its own offset."""
    turn = -1.0 if sensor.clockwise else 1.0
    column = np.arange(sensor.columns)
    delay_ns = np.zeros(len(sensor.elevation_deg), dtype=np.int64)
    if sensor.fire_delay_us:
        delay_ns = np.rint(np.asarray(sensor.fire_delay_us) * 1e3).astype(np.int64)
    turned: np.ndarray
    if sensor.column_us is None:
        turned = 2.0 * np.pi * column / sensor.columns
        start_ns = (column * period_ns(sensor)) // sensor.columns
    else:
        turned = 2.0 * np.pi * column * (sensor.column_us * 1e-6 * sensor.rate_hz)
        start_ns = np.round(column * (sensor.column_us * 1e3)).astype(np.int64)
    late = 2.0 * np.pi * delay_ns * 1e-9 * sensor.rate_hz  # how far the encoder turns until the beam fires
    encoder = np.deg2rad(sensor.start_azimuth_deg) + turn * (turned[:, None] + late)  # [c b]
    offset = np.deg2rad(np.asarray(sensor.azimuth_offset_deg))
    elevation = np.deg2rad(np.asarray(sensor.elevation_deg))
    ce, se = (
        np.broadcast_to(np.cos(elevation), encoder.shape),
        np.broadcast_to(np.sin(elevation), encoder.shape),
    )
    azimuth = encoder + offset

    last_ns = int(start_ns[-1] + delay_ns.max())
    if not sensor.rolling:
        start_ns, delay_ns = _at_once_ns(sensor, delay_ns)

    base, by_azimuth, by_elevation = _in_fan(offset, elevation)
    slope, skew = base[:, 1] / base[:, 0], base[:, 2] / base[:, 0]
    slots = _slots(delay_ns, slope)
    first = slots[:, 0]
    place = np.empty(len(delay_ns), dtype=np.int64)
    instant = np.empty(len(delay_ns), dtype=np.int64)
    instant[slots] = np.arange(len(slots))[:, None]
    place[slots[:, ::-1]] = np.arange(slots.shape[1])[::-1]  # of repetitions the first counts
    groups = sensor.columns * len(slots)
    forward = encoder[:, first].reshape(-1)
    c, s, zero, one = np.cos(forward), np.sin(forward), np.zeros(groups), np.ones(groups)
    frame = np.stack(
        [np.stack([c, zero, -s], -1), np.stack([s, zero, c], -1), np.stack([zero, one, zero], -1)], 1
    )
    return BeamTable(
        direction=readonly(np.stack([ce * np.cos(azimuth), ce * np.sin(azimuth), se], axis=-1)),
        fire_offset_ns=readonly(start_ns[:, None] + delay_ns, np.int64),
        order=readonly(np.argsort(delay_ns, kind="stable"), np.int64),
        slots=readonly(slots, np.int64),
        instant=readonly(instant),
        place=readonly(place),
        column_offset_ns=readonly(start_ns, np.int64),
        group_offset_ns=readonly((start_ns[:, None] + delay_ns[first]).reshape(-1), np.int64),
        last_offset_ns=last_ns,
        fans=rays.make_fans(
            frame=frame,
            slope=np.tile(slope[slots], (sensor.columns, 1)),
            skew=np.tile(skew[slots], (sensor.columns, 1)),
            pose=np.arange(groups),
            out_at=np.arange(groups) * slots.shape[1],
            out_stride=1,
        ),
        base=readonly(base[slots]),
        along_azimuth=readonly(by_azimuth[slots]),
        along_elevation=readonly(by_elevation[slots]),
    )


def _at_once_ns(
    sensor: LidarSensor, delay_ns: Int64[np.ndarray, " b"]
) -> tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " b"]]:
    """Starts of the columns and delays of the beams of a scan that does not roll: in the order of a turning
    one, 1 ns apart, around the middle of the turn."""
    instants, rank = np.unique(delay_ns, return_inverse=True)
    column = np.arange(sensor.columns, dtype=np.int64) - sensor.columns // 2
    return period_ns(sensor) // 2 + len(instants) * column, rank.astype(np.int64)


def passing_offset_ns(sensor: LidarSensor, azimuth_deg: float) -> int:
    """When, after the start of a sweep, the encoder passes an azimuth of the LiDAR frame."""
    turn = -1.0 if sensor.clockwise else 1.0
    share = (turn * (azimuth_deg - sensor.start_azimuth_deg) / 360.0) % 1.0
    return round(share * period_ns(sensor))


def _in_fan(
    offset: Float64[np.ndarray, " b"], elevation: Float64[np.ndarray, " b"]
) -> tuple[Float64[np.ndarray, "b 3"], Float64[np.ndarray, "b 3"], Float64[np.ndarray, "b 3"]]:
    """Each beam's unit vector (forward, up, left), and its derivatives by azimuth and by elevation."""
    ca, sa, ce, se = np.cos(offset), np.sin(offset), np.cos(elevation), np.sin(elevation)
    return (
        np.stack([ce * ca, se, ce * sa], axis=-1),
        np.stack([-ce * sa, np.zeros_like(ca), ce * ca], axis=-1),
        np.stack([-se * ca, ce, -se * sa], axis=-1),
    )


def _slots(delay_ns: Int64[np.ndarray, " b"], slope: Float64[np.ndarray, " b"]) -> Int64[np.ndarray, "i k"]:
    by_slope = np.argsort(slope, kind="stable")
    together = [by_slope[delay_ns[by_slope] == delay] for delay in np.unique(delay_ns)]
    widest = max(map(len, together))
    return np.array([np.pad(row, (0, widest - len(row)), mode="edge") for row in together])
