"""What the LiDAR makes of what it hits."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from scenarios.faults.spec import FaultSpec, Severity

Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class Dropout(FaultSpec):
    """The LiDAR loses points at random, whatever they are.

    Every firing loses its point with probability percent / 100, independently.
    Unit: per cent of the points. Source: judgement; data sheets promise 0.1 % and less.
    """

    name: ClassVar[str] = "lidar.dropout_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0


class WeakDropout(FaultSpec):
    """The LiDAR loses points that come back weak: dark clothing and grazing surfaces go first.

    A point of intensity I is lost with probability percent / 100 / (1 + exp((I - middle) / width)).
    Unit: per cent of the weakest points. Source: judgement.
    """

    name: ClassVar[str] = "lidar.dropout_weak"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0
    middle: Share = 0.2
    width: Annotated[float, Field(ge=0.001, le=1, allow_inf_nan=False)] = 0.05


class BeamLoss(FaultSpec):
    """The LiDAR loses whole beams: `percent` of its rings return nothing, over the whole recording.

    random draws which ones from the seed; even leaves rings that are spread evenly, as a LiDAR with fewer
    beams has them. Rounded to whole rings; at least one ring stays.
    Unit: per cent of the rings. Source: 50 and 75 % are the step from 64 to 32 and to 16 beams.
    """

    name: ClassVar[str] = "lidar.beam_loss"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Annotated[float, Field(ge=0, le=99, allow_inf_nan=False)] = 0.0
    pattern: Literal["random", "even"] = "random"


class RangeNoise(FaultSpec):
    """Ranges are noisier than the data sheet says, along the ray.

    range = range + sd_cm / 100 * N(0, 1), per firing, on top of the sensor's own noise; never below 1 cm.
    Unit: centimetres (1 SD). Source: data sheet of the OS1-64: 1.5 to 10 cm by strength.
    """

    name: ClassVar[str] = "lidar.range_noise_cm"
    strength: ClassVar[str] = "sd_cm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("sd_cm",)
    unit: ClassVar[str] = "cm"

    sd_cm: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] = 0.0


class RangeBias(FaultSpec):
    """Every range is off by the same amount, as after warming up or a changed window.

    range = range + bias_cm / 100, along the ray; never below 1 cm. Positive reads too far.
    Unit: centimetres. Source: data sheet of the OS1-64: 3 to 10 cm of accuracy; beyond that judgement.
    """

    name: ClassVar[str] = "lidar.range_bias_cm"
    strength: ClassVar[str] = "bias_cm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("bias_cm",)
    unit: ClassVar[str] = "cm"

    bias_cm: Annotated[float, Field(ge=-500, le=500, allow_inf_nan=False)] = 0.0


class AzimuthError(FaultSpec):
    """The encoder misreads the angle: by the same everywhere, and more to one side where it sits off centre.

    azimuth = azimuth + offset_deg + eccentricity_deg * sin(azimuth - phase), about the sensor's z axis; the
    seed draws one phase for the run. Positive turns to the left.
    Unit: degrees. Source: judgement; the OS1-64's data sheet gives 0.01 of noise.
    """

    name: ClassVar[str] = "lidar.azimuth_error_deg"
    strength: ClassVar[str] = "offset_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("offset_deg", "eccentricity_deg")
    unit: ClassVar[str] = "deg"

    offset_deg: Annotated[float, Field(ge=-30, le=30, allow_inf_nan=False)] = 0.0
    eccentricity_deg: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0


class DirtSector(FaultSpec):
    """A patch of dirt on the window swallows light: a sector of azimuth and elevation is dim or blind.

    The patch is width_deg wide about azimuth_deg (0 ahead, positive left) and height_deg high about
    elevation_deg. Through it passes 1 - opacity each way; a point is lost when the square of that, times its
    intensity, is too weak for the sensor at that range. Without opacity nothing passes.
    Unit: degrees of azimuth. Source: judgement.
    """

    name: ClassVar[str] = "lidar.dirt_sector"
    strength: ClassVar[str] = "width_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("width_deg",)
    unit: ClassVar[str] = "deg"

    width_deg: Annotated[float, Field(ge=0, le=360, allow_inf_nan=False)] = 0.0
    azimuth_deg: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)] = 0.0
    height_deg: Annotated[float, Field(gt=0, le=180, allow_inf_nan=False)] = 180.0
    elevation_deg: Annotated[float, Field(ge=-90, le=90, allow_inf_nan=False)] = 0.0
    opacity: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] = 1.0


class ReducedRange(FaultSpec):
    """The LiDAR sees less far, as an old laser or a fogged window does.

    What it saw to R(rho) it sees to (1 - lost_percent / 100) * R(rho), whatever the reflectivity rho; the
    intensity falls as the power does that this takes.
    Unit: per cent of the maximum range. Source: judgement.
    """

    name: ClassVar[str] = "lidar.reduced_range"
    strength: ClassVar[str] = "lost_percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("lost_percent",)
    unit: ClassVar[str] = "%"

    lost_percent: Annotated[float, Field(ge=0, le=99, allow_inf_nan=False)] = 0.0


class Ghosts(FaultSpec):
    """Pulses of other LiDARs are taken for the own echo: points where nothing is.

    percent of all firings return a ghost at a range drawn evenly from min_range to max_range_m, along the
    beam's own direction, in place of what the beam would have returned (the sensor returns one point a
    firing).
    Unit: per cent of the firings. Source: judgement; the OS1-64's data sheet gives 0.01 % of false points.
    """

    name: ClassVar[str] = "lidar.ghosts_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0
    max_range_m: Annotated[float, Field(ge=5, le=500, allow_inf_nan=False)] = 100.0


class Fog(FaultSpec):
    """Fog of a meteorological optical range weakens every echo, and sends some of its own back.

    Extinction alpha = ln(20) / mor_m = 2.996 / mor_m: the optical range is where 5 % of the light is left
    (WMO; visibility at 2 % contrast, Koschmieder's 3.912 / V, is 1.3 times as far). Power falls by
    exp(-2 alpha r); a point is lost when that, times its intensity, is too weak for the sensor at its range
    r. Each firing meets the fog itself with probability 1 - exp(-backscatter * alpha * 10 m), at an
    exponential depth of mean 3 m, and returns that if it is nearer. 0 means no fog; the less, the denser.
    Unit: metres. Source: attenuation as in Hahner et al., ICCV 2021; simplified: their fog echo is worked
    out from the pulse, here its rate and depth are judgement, and weak echoes get no noisier.
    """

    name: ClassVar[str] = "lidar.fog_mor_m"
    strength: ClassVar[str] = "mor_m"
    zero_when_off: ClassVar[tuple[str, ...]] = ("mor_m",)
    unit: ClassVar[str] = "m"

    mor_m: Annotated[float, Field(ge=0, le=100_000, allow_inf_nan=False)] = 0.0
    backscatter: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.25


class Rain(FaultSpec):
    """Rain weakens every echo, and near drops send some of their own back.

    Extinction alpha = 1.076 R^0.67 dB/km at R mm/h, that is 0.2478e-3 R^0.67 per metre. Losses and false
    echoes as for lidar.fog_mor_m.
    Unit: millimetres an hour. Source: standard (ITU-R P.1814, after Carbonneau) for alpha; that power is
    compared with the sensor's limit, as in LISA (Kilic et al., 2021); simplified: LISA draws single drops by
    size, here rate and depth of false echoes are judgement, and weak echoes get no noisier.
    """

    name: ClassVar[str] = "lidar.rain_mmph"
    strength: ClassVar[str] = "rate_mmph"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rate_mmph",)
    unit: ClassVar[str] = "mm/h"

    rate_mmph: Annotated[float, Field(ge=0, le=300, allow_inf_nan=False)] = 0.0
    backscatter: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 1.0


SPECS: tuple[type[FaultSpec], ...] = (
    AzimuthError,
    BeamLoss,
    DirtSector,
    Dropout,
    Fog,
    Ghosts,
    Rain,
    RangeBias,
    RangeNoise,
    ReducedRange,
    WeakDropout,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(fault=Dropout.name, values=(1.0, 5.0, 10.0, 25.0, 50.0), source="judgement"),
    Severity(fault=WeakDropout.name, values=(10.0, 25.0, 50.0, 75.0, 95.0), source="judgement"),
    Severity(
        fault=BeamLoss.name,
        values=(12.5, 25.0, 50.0, 75.0, 87.5),
        source="from 64 beams to 56, 48, 32, 16, 8",
    ),
    Severity(
        fault=RangeNoise.name,
        values=(1.0, 2.0, 5.0, 10.0, 20.0),
        source="data sheet of the OS1-64 (1.5, 3, 10 cm by strength), and twice its worst",
    ),
    Severity(fault=RangeBias.name, values=(1.0, 3.0, 5.0, 10.0, 20.0), source="as the noise; judgement"),
    Severity(
        fault=AzimuthError.name,
        values=(0.05, 0.1, 0.35, 1.0, 2.0),
        source="judgement; 0.35 is one column of 1024",
    ),
    Severity(fault=DirtSector.name, values=(5.0, 15.0, 30.0, 60.0, 120.0), source="judgement"),
    Severity(fault=ReducedRange.name, values=(10.0, 25.0, 50.0, 70.0, 85.0), source="judgement"),
    Severity(fault=Ghosts.name, values=(0.1, 0.5, 1.0, 5.0, 10.0), source="judgement"),
    Severity(
        fault=Fog.name,
        values=(1000.0, 500.0, 200.0, 100.0, 50.0),
        source="standard: fog begins below 1000 m (WMO); dense fog below 50 m",
    ),
    Severity(
        fault=Rain.name,
        values=(2.0, 10.0, 25.0, 50.0, 100.0),
        source="light to violent rain (WMO: heavy from 10, violent from 50 mm/h)",
    ),
)
