"""What the pictures lose.

All act on pictures and need some: `--images raycast` and a pipeline that reads them. Boxes do not depend on
pictures here; what bad pictures do to a detector is modelled by the faults of the detector.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from scenarios.faults.spec import Cameras, FaultSpec, Severity
from scenarios.scenario import broken


class MotionBlur(FaultSpec):
    """Cameras expose longer, and what moves leaves a streak: exposure = exposure + longer_ms.

    The picture is the mean of linear light at `samples` instants spread evenly over the exposure (odd: one is
    its middle). Gain or aperture keep the brightness (that is camera.exposure_ev). The exposure starts when
    it did, so its middle moves by longer_ms / 2, boxes and truth with it; the stamp keeps its meaning: that
    of the trigger or of the start stays, and is wrong by so much more. All that follows is longer_ms later.
    Without pictures the times move all the same; pictures by OpenGL cannot show it and are refused.
    Unit: milliseconds. Source: judgement; 1 to 10 ms by day, 20 to 40 at dusk (half to a whole video frame).
    """

    name: ClassVar[str] = "camera.motion_blur_ms"
    strength: ClassVar[str] = "longer_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("longer_ms",)
    unit: ClassVar[str] = "ms"

    longer_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    samples: Annotated[int, Field(ge=3, le=33)] = 9
    sensors: Cameras = "cameras"

    @model_validator(mode="after")
    def _one_is_the_middle(self) -> MotionBlur:
        if self.samples % 2 == 0:
            raise broken("must be odd: one of them is the middle of the exposure", "samples")
        return self


SPECS: tuple[type[FaultSpec], ...] = (MotionBlur,)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=MotionBlur.name,
        values=(2.0, 5.0, 10.0, 20.0, 40.0),
        source="judgement: from a dull day to dusk",
    ),
)
