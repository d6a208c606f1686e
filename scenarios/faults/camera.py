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


class WrongExposure(FaultSpec):
    """Pictures are too bright or too dark: light = min(1, light * 2^stops), linear, 1 being white.

    It acts on the 8 bits that the camera delivers: what was clipped to white stays clipped however dark the
    picture gets (grey instead of white), and shadows that are lifted show steps. Noise grows with the light.
    Unit: stops (EV; 1 doubles the light). Source: judgement (automatic exposure errs by 2 at a tunnel's end).
    """

    name: ClassVar[str] = "camera.exposure_ev"
    strength: ClassVar[str] = "stops"
    zero_when_off: ClassVar[tuple[str, ...]] = ("stops",)
    unit: ClassVar[str] = "EV"

    stops: Annotated[float, Field(ge=-8, le=8, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class LowLight(FaultSpec):
    """There is less light, and gain makes up for it: as bright as before, but with more noise.

    Light falls to k = 2^-stops of daylight. Of the e electrons of a pixel, Binomial(e, k) are left, so shot
    noise is that of k e electrons; read noise of SD r * sqrt(1 - k^2) brings it back to r; all times 1 / k.
    e and r by the sensor file (10,000 and 3 electrons where it names none). White pixels stay white.
    Unit: stops (1 halves the light). Source: Poisson noise as in EMVA 1288; levels judgement: of a clear
    afternoon, 3 stops are an overcast sky, 6 to 8 dusk; street lamps would be 12.
    """

    name: ClassVar[str] = "camera.low_light_stops"
    strength: ClassVar[str] = "stops"
    zero_when_off: ClassVar[tuple[str, ...]] = ("stops",)
    unit: ClassVar[str] = "stops"

    stops: Annotated[float, Field(ge=0, le=12, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class ExtraNoise(FaultSpec):
    """The sensor reads noisier than its data sheet says: light = light + read_e / white_e * N(0, 1).

    Per pixel and channel, in linear light, anew in every picture; white_e are the electrons of white by the
    sensor file (full well over gain; 10,000 where it names none). White pixels stay white.
    Unit: electrons (1 SD). Source: read noise as in EMVA 1288; data sheets say 2 to 10, heat and old
    sensors give more (judgement).
    """

    name: ClassVar[str] = "camera.noise_e"
    strength: ClassVar[str] = "read_e"
    zero_when_off: ClassVar[tuple[str, ...]] = ("read_e",)
    unit: ClassVar[str] = "electrons"

    read_e: Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class Defocus(FaultSpec):
    """The lens is out of focus: each pixel's light falls evenly on a disc of radius radius_px.

    In linear light, every pixel getting the share of the disc that lies on it: up to half a pixel changes
    nothing. All distances alike (the circle of confusion of a lens that is set too near: focal length f,
    f-number N, set to the distance s, c = f^2 / (2 N s) in radius, for all that is far). A light that was
    clipped to white spreads no more than white.
    Unit: pixels of the delivered picture (radius). Source: thin lens; levels judgement.
    """

    name: ClassVar[str] = "camera.defocus_px"
    strength: ClassVar[str] = "radius_px"
    zero_when_off: ClassVar[tuple[str, ...]] = ("radius_px",)
    unit: ClassVar[str] = "px"

    radius_px: Annotated[float, Field(ge=0, le=50, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class Dirt(FaultSpec):
    """Dirt on the lens: blobs that stay in place for the whole run take light away.

    light = light * (1 - opacity * a), a from 0 to 1 with soft edges, as dirt sits far out of focus; a is 0.5
    and more on `percent` of the picture. Drawn for each camera and run; more of it are the same blobs grown.
    Dirt adds no light of its own, and a sky that was clipped to white behind it darkens more than it would.
    Unit: per cent of the picture. Source: judgement.
    """

    name: ClassVar[str] = "camera.dirt_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] = 0.0
    opacity: Annotated[float, Field(ge=0.05, le=1, allow_inf_nan=False)] = 0.9
    sensors: Cameras = "cameras"


class JpegLoss(FaultSpec):
    """Pictures go through a coarse JPEG: quality = 100 - loss, of libjpeg's scale.

    Steps of the DCT are those of the standard's table times (200 - 2 quality) / 100 from quality 50 up, and
    times 50 / quality below; colour at half the resolution. On top of a JPEG of the sensor's own.
    Unit: libjpeg quality lost. Source: ITU-T T.81, Annex K; levels judgement (video links send 30 to 80).
    """

    name: ClassVar[str] = "camera.jpeg_loss"
    strength: ClassVar[str] = "loss"
    zero_when_off: ClassVar[tuple[str, ...]] = ("loss",)
    unit: ClassVar[str] = "quality lost"

    loss: Annotated[int, Field(ge=0, le=99)] = 0
    sensors: Cameras = "cameras"


SPECS: tuple[type[FaultSpec], ...] = (
    MotionBlur,
    Dirt,
    Defocus,
    WrongExposure,
    LowLight,
    ExtraNoise,
    JpegLoss,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=MotionBlur.name,
        values=(2.0, 5.0, 10.0, 20.0, 40.0),
        source="judgement: from a dull day to dusk",
    ),
    Severity(fault=Dirt.name, values=(1.0, 3.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=Defocus.name, values=(1.0, 2.0, 3.0, 5.0, 8.0), source="judgement"),
    Severity(fault=WrongExposure.name, values=(0.5, 1.0, 1.5, 2.0, 3.0), source="judgement: too bright"),
    Severity(
        fault=LowLight.name, values=(2.0, 4.0, 5.0, 6.0, 8.0), source="judgement: from a dull day to dusk"
    ),
    Severity(fault=ExtraNoise.name, values=(20.0, 50.0, 100.0, 200.0, 500.0), source="judgement"),
    Severity(fault=JpegLoss.name, values=(20, 50, 70, 85, 95), source="judgement: quality 80 to 5"),
)
