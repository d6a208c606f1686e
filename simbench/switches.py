"""What the bench itself does to a recording and can leave out, each with its own "off".

| name | on: as on a vehicle | off |
|---|---|---|
| `bench.rolling_scan` | a sweep's beams fire one after the other while the LiDAR turns | all fire in the middle of the turn, at one instant (1 ns from firing to firing, 30 µs at most) |
| `bench.spin_phase` | a camera is exposed when its trigger or its own clock says | the middle of its exposure is when the scan fires along its axis, once a turn |
| `bench.reference_rate` | the GNSS fix of up to 200 ms ago holds | every fix is carried to the instant asked for by the true motion since; its noise, bias, lever arm and heading stay |

A frozen scan says so in its points' firing times, and is delivered when the turn ends, as a turning one is. With
the scan frozen, `bench.spin_phase` off exposes every camera at that instant. The last one touches no message: only
what is scored against the reference (`.gnss` metrics, the budget's `reference_lag`) moves. What is switched off
draws nothing from a stream that something else draws from, so no other number moves.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scenarios.errors import Where
from simbench.recording import Recording
from simbench.sensors.rig import SensorRig

ROLLING_SCAN, SPIN_PHASE, REFERENCE_RATE = (
    "bench.rolling_scan",
    "bench.spin_phase",
    "bench.reference_rate",
)
SWITCHES = (ROLLING_SCAN, SPIN_PHASE, REFERENCE_RATE)


def check_switches(off: Sequence[str]) -> None:
    """BadInput: one of the names is no switch."""
    for name in off:
        if name not in SWITCHES:
            raise Where(file="--off").unknown("part of the bench", name, SWITCHES)


def switched(rig: SensorRig, off: Sequence[str]) -> SensorRig:
    """The same rig without rolling scan or spin phase, where `off` names them."""
    if ROLLING_SCAN in off:
        rig = replace(rig, lidar=rig.lidar.model_copy(update={"rolling": False}))
    return replace(rig, in_phase=True) if SPIN_PHASE in off else rig


def scored_without(recording: Recording, off: Sequence[str]) -> Recording:
    """The same messages with a reference that needs not hold, where `off` names its rate."""
    reference = recording.truth.reference
    if REFERENCE_RATE not in off or reference is None:
        return recording
    truth = replace(recording.truth, reference=replace(reference, held=False))
    return replace(recording, truth=truth)
