"""When things are measured, stamped and delivered."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from scenarios.faults.spec import Cameras, FaultSpec, Severity


class TriggerOffset(FaultSpec):
    """Cameras expose later than their stamp says: the paper's error, which fusion cannot know.

    Exposure i of each camera is taken at t_i + offset_ms + jitter_ms * n_i with n_i standard normal; the
    stamp stays that of the nominal t_i, the message arrives as much later as it is taken. A negative offset
    exposes earlier.
    Unit: milliseconds. Source: field reports of 2 to 150 ms; a hidden offset of half an exposure is 0.5-5 ms
    (data sheet); host stamps jitter by 5-15 ms (judgement).
    """

    name: ClassVar[str] = "timing.trigger_offset_ms"
    strength: ClassVar[str] = "offset_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("offset_ms", "jitter_ms")
    unit: ClassVar[str] = "ms"

    offset_ms: Annotated[float, Field(ge=-1000, le=1000, allow_inf_nan=False)] = 0.0
    jitter_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


SPECS: tuple[type[FaultSpec], ...] = (TriggerOffset,)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=TriggerOffset.name,
        values=(2.0, 10.0, 30.0, 50.0, 100.0),
        source="field reports of 2 to 150 ms",
    ),
)
