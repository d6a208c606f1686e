"""What the GNSS reference says of where the target is: the paper's "ground truth" as a sensor."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from scenarios.faults.spec import FaultSpec, Severity
from scenarios.scenario import broken

Arm = Annotated[float, Field(ge=-20, le=20, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]


class ReferenceLever(FaultSpec):
    """An antenna sits elsewhere than the evaluation thinks.

    The uncorrected arm a = (forward_m, left_m, up_m), in the axes of whose antenna it is, adds to what is
    measured: + R_target a of the target's, - R_ego a of the ego's (shake included).
    Unit: metres. Source: judgement (antennas are 1-2 m from what they stand for).
    """

    name: ClassVar[str] = "reference.lever_arm_m"
    strength: ClassVar[str] = "forward_m"
    zero_when_off: ClassVar[tuple[str, ...]] = ("forward_m", "left_m", "up_m")
    unit: ClassVar[str] = "m"

    forward_m: Arm = 0.0
    left_m: Arm = 0.0
    up_m: Arm = 0.0
    of: Literal["target", "ego"] = "target"


class ReferenceBias(FaultSpec):
    """The reference is off by the same amount for the whole pass.

    A vector of length bias_cm in the horizontal plane, its direction in the world drawn once a run, adds to
    the difference of the two receivers.
    Unit: centimetres. Source: judgement (1-2 cm in RTK fix; more with a base station at a wrong place).
    """

    name: ClassVar[str] = "reference.bias_cm"
    strength: ClassVar[str] = "bias_cm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("bias_cm",)
    unit: ClassVar[str] = "cm"

    bias_cm: Annotated[float, Field(ge=0, le=10000, allow_inf_nan=False)] = 0.0


class ReferenceNoise(FaultSpec):
    """Each fix of the reference is off by a little, anew.

    White noise of SD noise_cm per axis adds to the difference of the two receivers.
    Unit: centimetres, 1 SD per axis. Source: judgement (0.5 cm in RTK fix, tens of cm without).
    """

    name: ClassVar[str] = "reference.noise_cm"
    strength: ClassVar[str] = "noise_cm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("noise_cm",)
    unit: ClassVar[str] = "cm"

    noise_cm: Annotated[float, Field(ge=0, le=10000, allow_inf_nan=False)] = 0.0


class ReferenceFloat(FaultSpec):
    """The receivers lose their integer fix for a while and float.

    Fixes from at_s on, for duration_s, are off by a vector in the horizontal plane: its length is uniform
    from least_m to most_m, its direction in the world random; both drawn once a run.
    Unit: seconds. Source: judgement (0.2-1 m while floating).
    """

    name: ClassVar[str] = "reference.float_s"
    strength: ClassVar[str] = "duration_s"
    zero_when_off: ClassVar[tuple[str, ...]] = ("duration_s",)
    unit: ClassVar[str] = "s"

    duration_s: Seconds = 0.0
    at_s: Seconds = 0.0
    least_m: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = 0.2
    most_m: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = 1.0

    @model_validator(mode="after")
    def _range_ascends(self) -> ReferenceFloat:
        if self.most_m < self.least_m:
            raise broken("must not be below least_m", "most_m")
        return self


class ReferenceHeading(FaultSpec):
    """The heading that turns the reference into the ego frame is wrong.

    A heading that is too large by heading_deg turns the position clockwise by as much: 1 degree moves a
    target at 20 m by 0.35 m.
    Unit: degrees. Source: data sheet (0.2 degrees with two antennas), judgement (5 by course over ground).
    """

    name: ClassVar[str] = "reference.heading_deg"
    strength: ClassVar[str] = "heading_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("heading_deg",)
    unit: ClassVar[str] = "deg"

    heading_deg: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)] = 0.0


class ReferencePeriod(FaultSpec):
    """Fixes of the reference come less often.

    Of all fixes those are kept that are the first at or after a multiple of period_s, counted from the first
    fix. A period that is shorter than the receivers' own changes nothing.
    Unit: seconds. Source: the receivers' usual rates of 10, 5 and 1 Hz (data sheet), less by judgement.
    """

    name: ClassVar[str] = "reference.period_s"
    strength: ClassVar[str] = "period_s"
    zero_when_off: ClassVar[tuple[str, ...]] = ("period_s",)
    unit: ClassVar[str] = "s"

    period_s: Seconds = 0.0


class ReferenceOutage(FaultSpec):
    """The reference gives no fix for a while; the last one holds.

    Fixes from at_s on, for duration_s, are missing.
    Unit: seconds. Source: judgement (a bridge to a tunnel).
    """

    name: ClassVar[str] = "reference.outage_s"
    strength: ClassVar[str] = "duration_s"
    zero_when_off: ClassVar[tuple[str, ...]] = ("duration_s",)
    unit: ClassVar[str] = "s"

    duration_s: Seconds = 0.0
    at_s: Seconds = 1.0


class ReferenceLag(FaultSpec):
    """Each fix of the reference is known later; the one before holds for longer.

    available = available + lag_ms; position and instant of the fix stay.
    Unit: milliseconds. Source: data sheet (20 ms alone, above 100 ms where receivers are synchronised).
    """

    name: ClassVar[str] = "reference.lag_ms"
    strength: ClassVar[str] = "lag_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("lag_ms",)
    unit: ClassVar[str] = "ms"

    lag_ms: Annotated[float, Field(ge=0, le=10000, allow_inf_nan=False)] = 0.0


SPECS: tuple[type[FaultSpec], ...] = (
    ReferenceLever,
    ReferenceBias,
    ReferenceNoise,
    ReferenceFloat,
    ReferenceHeading,
    ReferencePeriod,
    ReferenceOutage,
    ReferenceLag,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(fault=ReferenceLever.name, values=(0.1, 0.25, 0.5, 1.0, 2.0), source="judgement"),
    Severity(fault=ReferenceBias.name, values=(1.0, 2.0, 5.0, 20.0, 100.0), source="judgement"),
    Severity(fault=ReferenceNoise.name, values=(0.5, 1.0, 2.0, 5.0, 20.0), source="judgement"),
    Severity(fault=ReferenceFloat.name, values=(1.0, 2.0, 5.0, 10.0, 20.0), source="judgement"),
    Severity(
        fault=ReferenceHeading.name,
        values=(0.2, 0.5, 1.0, 2.0, 5.0),
        source="data sheet of 0.2 degrees, judgement up to 5",
    ),
    Severity(fault=ReferencePeriod.name, values=(0.4, 0.6, 1.0, 2.0, 5.0), source="data sheet, judgement"),
    Severity(fault=ReferenceOutage.name, values=(0.5, 1.0, 2.0, 5.0, 10.0), source="judgement"),
    Severity(
        fault=ReferenceLag.name,
        values=(20.0, 50.0, 100.0, 200.0, 500.0),
        source="data sheet of 20 to above 100 ms",
    ),
)
