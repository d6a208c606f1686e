"""When cameras expose, what they claim and when the host has it; when steady sensors tick."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.load import load_sensor
from scenarios.scenario import CameraSensor
from simbench.sensors.clock import CameraTiming, camera_timing, drawn_ns, newest_tick_ns, ticks_ns

MS = 1_000_000
S = 1_000_000_000


def declared(name: str = "camera-78deg-usb", **changes: object) -> CameraSensor:
    sensor = load_sensor(name)
    assert isinstance(sensor, CameraSensor)
    return CameraSensor.model_validate({**sensor.model_dump(), **changes})


def timed(sensor: CameraSensor, frames: int = 50, seed: int = 0, first_ns: int = 7 * MS) -> CameraTiming:
    return camera_timing(sensor, first_ns, 100 * MS, frames, np.random.default_rng(seed))


@st.composite
def cameras(draw: st.DrawFn) -> CameraSensor:
    exposure_ms, readout_ms = draw(st.floats(0.1, 40.0)), draw(st.floats(0.001, 50.0))
    rolling = draw(st.booleans())
    changes: dict[str, Any] = {
        "exposure_ms": exposure_ms,
        "shutter": "rolling" if rolling else "global",
        "readout_ms": readout_ms if rolling else 0.0,
        "stamp": draw(st.sampled_from(["exposure_start", "mid_exposure", "end_of_readout", "arrival"])),
        "stamp_delay_ms": 0.0,
        "stamp_jitter_ms": 0.0,
    }
    if changes["stamp"] == "arrival":
        least = 0.5 * (exposure_ms + readout_ms) + draw(st.floats(0.0, 60.0))
        changes["stamp_delay_ms"] = (least, least + draw(st.floats(0.0, 60.0)))
        changes["stamp_jitter_ms"] = draw(st.floats(0.0, 40.0))
    return declared(**changes)


@given(sensor=cameras(), seed=st.integers(0, 1000))
def test_a_frame_is_exposed_then_read_out_then_at_the_host_then_delivered(
    sensor: CameraSensor, seed: int
) -> None:
    t = timed(sensor, frames=12, seed=seed)
    rows = np.array([t.row_mid_ns(f, sensor.height_px) for f in range(12)])
    half = 0.5 * t.exposure_ns
    np.testing.assert_allclose(rows[:, 0] - half, t.start_ns, atol=2.0)
    last_ends = rows[:, -1] + half
    assert (t.host_ns >= last_ends - 2.0).all()
    assert (t.arrival_ns - t.host_ns == round(sensor.latency_ms * 1e6)).all()
    assert (np.diff(t.host_ns) > 0).all() and (np.diff(t.arrival_ns) > 0).all()
    assert (np.diff(t.stamp_ns) > 0).all()
    assert (np.diff(t.mid_ns) == 100 * MS).all()
    np.testing.assert_allclose(rows.mean(axis=1), t.mid_ns, atol=1.0)


@given(sensor=cameras(), seed=st.integers(0, 1000), frames=st.integers(1, 20))
def test_a_longer_run_begins_as_a_shorter_one(sensor: CameraSensor, seed: int, frames: int) -> None:
    short, long = timed(sensor, frames, seed), timed(sensor, frames + 5, seed)
    for name in ("mid_ns", "start_ns", "stamp_ns", "host_ns", "arrival_ns"):
        assert np.array_equal(getattr(short, name), getattr(long, name)[:frames])


def test_a_rolling_shutters_rows_are_evenly_spaced_from_top_to_bottom() -> None:
    t = timed(declared(height_px=601, readout_ms=20.0, exposure_ms=4.0))
    rows = t.row_mid_ns(0, 601)
    # Opens at 7 ms: the top row's middle is at 9, the bottom row's 20 later, the middle row's at 19.
    np.testing.assert_allclose(rows[[0, 300, 600]], [9 * MS, 19 * MS, 29 * MS], atol=1.0)
    assert t.mid_ns[0] == 19 * MS and t.start_ns[0] == 7 * MS
    assert t.line_delay_ns == pytest.approx(20 * MS / 600)


def test_a_global_shutter_exposes_all_rows_at_once() -> None:
    t = timed(declared(shutter="global", readout_ms=0.0))
    assert t.line_delay_ns == 0.0
    assert set(t.row_mid_ns(3, 600)) == {float(t.mid_ns[3])}


def test_the_hosts_delay_is_drawn_once_a_run_and_its_jitter_every_frame() -> None:
    means, spreads = [], []
    for seed in range(40):
        late = timed(declared(stamp_jitter_ms=10.0), frames=400, seed=seed)
        late_ms = (late.stamp_ns - late.mid_ns) / MS
        means.append(late_ms.min())
        spreads.append(late_ms.std())
        assert np.array_equal(late.stamp_ns, late.host_ns)
    assert 20.0 <= min(means) < 32.0 and 88.0 < max(means) <= 101.0
    assert np.mean(spreads) == pytest.approx(10.0, rel=0.05)


def test_an_image_that_waits_holds_up_the_next_ones() -> None:
    sensor = declared(stamp_jitter_ms=300.0)
    t = timed(sensor, frames=400)
    assert (np.diff(t.host_ns) > 0).all()
    together = (np.diff(t.host_ns) == 1_000).sum()  # handed over in one burst
    assert together > 50
    assert ((t.host_ns - t.mid_ns) >= 20 * MS).all()


@given(
    rate_hz=st.sampled_from([1.0, 5.0, 30.0, 100.0]),
    phase_ns=st.integers(0, S),
    t=st.lists(st.integers(-S, 5 * S), min_size=1, max_size=20),
)
def test_the_newest_tick_is_a_tick_and_the_last_not_after(
    rate_hz: float, phase_ns: int, t: list[int]
) -> None:
    t_ns, period = np.array(t, dtype=np.int64), round(1e9 / rate_hz)
    newest = newest_tick_ns(rate_hz, phase_ns, t_ns)
    assert ((newest - phase_ns) % period == 0).all()
    assert ((newest <= t_ns) & (t_ns < newest + period)).all()


def test_ticks_begin_at_the_phase_and_end_with_the_run() -> None:
    assert ticks_ns(5.0, 30 * MS, 430 * MS).tolist() == [30 * MS, 230 * MS, 430 * MS]
    assert ticks_ns(5.0, 30 * MS, 429 * MS).tolist() == [30 * MS, 230 * MS]


def test_a_number_stays_and_a_range_is_drawn_within_its_ends() -> None:
    rng = np.random.default_rng(0)
    assert drawn_ns(12.5, rng) == 12_500_000
    drawn = [drawn_ns((2.0, 4.0), rng) for _ in range(300)]
    assert 2 * MS <= min(drawn) < 2.1 * MS and 3.9 * MS < max(drawn) <= 4 * MS
