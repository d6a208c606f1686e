"""When things are measured, stamped and delivered."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from scenarios.faults.spec import Cameras, FaultSpec, Sensors, Severity
from scenarios.scenario import broken

Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]


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


class TriggerAngle(FaultSpec):
    """Cameras are fired when the beam points elsewhere than where they look: a wrong spin phase.

    Cameras that the LiDAR triggers expose when the beam is at their angle + angle_deg (counter-clockwise),
    and their stamps say so. The scan still passes their axis when it did, so that what was synchronised by
    hardware is angle_deg / 360 of a turn apart. Freely running cameras have no such angle.
    Unit: degrees of the beam; 10 are 2.8 ms at 10 Hz. Source: judgement.
    """

    name: ClassVar[str] = "timing.trigger_angle_deg"
    strength: ClassVar[str] = "angle_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("angle_deg",)
    unit: ClassVar[str] = "deg"

    angle_deg: Annotated[float, Field(ge=-179, le=179, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class ClockOffset(FaultSpec):
    """A sensor's clock is off: only the stamp moves, by a constant.

    stamp' = stamp + offset_ms. What is measured, and when it arrives, stays.
    Unit: milliseconds. Source: judgement (NTP 1-10 ms; clocks set by hand far more).
    """

    name: ClassVar[str] = "timing.clock_offset_ms"
    strength: ClassVar[str] = "offset_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("offset_ms",)
    unit: ClassVar[str] = "ms"

    offset_ms: Annotated[float, Field(ge=-10000, le=10000, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"


class ClockDrift(FaultSpec):
    """A sensor's clock runs fast or slow: the error of its stamps grows with time.

    stamp' = stamp + rate_ppm * 1e-6 * (stamp + since_s), since_s being the time from the last synchronisation
    to time 0. A negative rate runs slow.
    Unit: parts per million. Source: data sheet of quartz oscillators (10-100 ppm); since_s judgement.
    """

    name: ClassVar[str] = "timing.clock_drift_ppm"
    strength: ClassVar[str] = "rate_ppm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rate_ppm",)
    unit: ClassVar[str] = "ppm"

    rate_ppm: Annotated[float, Field(ge=-10000, le=10000, allow_inf_nan=False)] = 0.0
    since_s: Annotated[float, Field(ge=0, le=86400, allow_inf_nan=False)] = 600.0
    sensors: Sensors = "cameras"


class StampJitter(FaultSpec):
    """Stamps scatter about what they should say, each on its own.

    stamp' = stamp + sd_ms * n, n of SD 1: gaussian, uniform, or heavy_tailed (Student's t with 3 degrees of
    freedom, over sqrt(3)). Stamps may then not ascend.
    Unit: milliseconds (1 SD). Source: judgement (host stamps jitter by 5-15 ms).
    """

    name: ClassVar[str] = "timing.stamp_jitter_ms"
    strength: ClassVar[str] = "sd_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("sd_ms",)
    unit: ClassVar[str] = "ms"

    sd_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    distribution: Literal["gaussian", "uniform", "heavy_tailed"] = "gaussian"
    sensors: Sensors = "cameras"


class StampOnSave(FaultSpec):
    """The stamp is made when the data is saved, not when it is measured: the paper's own cause.

    stamp' = t + delay_ms + w, t being the true middle of the exposure or the true first firing, and w an
    exponentially distributed wait of mean jitter_ms. What the stamp said before is lost. One file is saved
    after the other: stamps ascend. A delay_ms of 0 is off.
    Unit: milliseconds. Source: judgement (20-100 ms late, jitter 5-15 ms).
    """

    name: ClassVar[str] = "timing.stamp_on_save_ms"
    strength: ClassVar[str] = "delay_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("delay_ms",)
    unit: ClassVar[str] = "ms"

    delay_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    jitter_ms: Annotated[float, Field(ge=0, le=40, allow_inf_nan=False)] = 10.0
    sensors: Sensors = "cameras"


class StampMeaning(FaultSpec):
    """The stamp tells another instant of the exposure or of the sweep than the sensor file says.

    stamp' = stamp + share * T, T being the time from the start of the first row's exposure to the end of the
    last row's, or a turn of the LiDAR. 0.5 is the middle for the start, 1 the end for the start, -0.5 the
    start for the middle. The fusion still takes a sweep's stamp for its first firing.
    Unit: share of the exposure or of the sweep. Source: computed from the sensor files.
    """

    name: ClassVar[str] = "timing.stamp_meaning_share"
    strength: ClassVar[str] = "share"
    zero_when_off: ClassVar[tuple[str, ...]] = ("share",)
    unit: ClassVar[str] = "share of the exposure"

    share: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"


class StampStep(FaultSpec):
    """A sensor's clock is set during the run: from then on its stamps are off.

    stamp' = stamp + step_ms where stamp >= at_s, else stamp. A negative step sets the clock back.
    Unit: milliseconds. Source: judgement (a first synchronisation, a leap second of 1000 ms).
    """

    name: ClassVar[str] = "timing.stamp_step_ms"
    strength: ClassVar[str] = "step_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("step_ms",)
    unit: ClassVar[str] = "ms"

    step_ms: Annotated[float, Field(ge=-10000, le=10000, allow_inf_nan=False)] = 0.0
    at_s: Annotated[float, Field(ge=0, le=86400, allow_inf_nan=False)] = 1.0
    sensors: Sensors = "cameras"


class StampQuantum(FaultSpec):
    """Stamps are rounded down to a coarse grid, as by a file name or a log of few digits.

    stamp' = quantum_ms * floor(stamp / quantum_ms).
    Unit: milliseconds. Source: judgement (file names in ms, kernel ticks of 4-10 ms, logs in 0.1 s).
    """

    name: ClassVar[str] = "timing.stamp_quantum_ms"
    strength: ClassVar[str] = "quantum_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("quantum_ms",)
    unit: ClassVar[str] = "ms"

    quantum_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"


class StaleFrames(FaultSpec):
    """The camera delivers, under each image's stamp, the image and the boxes of `frames` frames before.

    The first `frames` images have nothing before them and are not delivered. In recorded data: needs a
    sequence.
    Unit: frames. Source: judgement (one frame late: pairing by count, a pipe that holds one frame).
    """

    name: ClassVar[str] = "timing.stale_frames"
    strength: ClassVar[str] = "frames"
    zero_when_off: ClassVar[tuple[str, ...]] = ("frames",)
    unit: ClassVar[str] = "frames"

    frames: Annotated[int, Field(ge=0, le=100)] = 0
    sensors: Cameras = "cameras"


class Frozen(FaultSpec):
    """The camera now and then delivers the frame before once more, image and boxes, under the new stamp.

    Each frame but a camera's first is frozen with chance percent / 100, on its own; frozen frames in a row
    all show the last one that was not.
    Unit: per cent of the frames. Source: judgement.
    """

    name: ClassVar[str] = "timing.frozen_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0
    sensors: Cameras = "cameras"


class Dropped(FaultSpec):
    """Messages are lost, one by one or in bursts.

    Each is lost with chance p = percent / 100. burst_frames 0: on its own. Else a chain of two states
    (Gilbert-Elliott): a burst lasts burst_frames on average, and one begins with chance
    p / (burst_frames (1 - p)) after a message that came through.
    Unit: per cent of the messages. Source: judgement.
    """

    name: ClassVar[str] = "timing.dropped_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0
    burst_frames: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"

    @model_validator(mode="after")
    def _bursts_fit(self) -> Dropped:
        if self.burst_frames == 0.0:
            return self
        if self.burst_frames < 1.0:
            raise broken("must be at least 1 frame, or 0 for losses one by one", "burst_frames")
        if self.percent / 100.0 > self.burst_frames * (1.0 - self.percent / 100.0):
            raise broken(f"is too short for a loss of {self.percent:g} %", "burst_frames")
        return self


class Duplicated(FaultSpec):
    """Messages arrive twice: the copy `after_ms` later, with the same stamp and content.

    Each is repeated with chance percent / 100, on its own.
    Unit: per cent of the messages. Source: judgement.
    """

    name: ClassVar[str] = "timing.duplicated_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Percent = 0.0
    after_ms: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 5.0
    sensors: Sensors = "cameras"


class Latency(FaultSpec):
    """Messages arrive later than they would; their stamps stay.

    arrival' = arrival + latency_ms + w, w an exponentially distributed wait of mean jitter_ms. Messages of
    one sensor do not overtake each other.
    Unit: milliseconds. Source: judgement (10-200 ms over networks and queues).
    """

    name: ClassVar[str] = "timing.latency_ms"
    strength: ClassVar[str] = "latency_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("latency_ms", "jitter_ms")
    unit: ClassVar[str] = "ms"

    latency_ms: Annotated[float, Field(ge=0, le=10000, allow_inf_nan=False)] = 0.0
    jitter_ms: Annotated[float, Field(ge=0, le=40, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"


class Reordered(FaultSpec):
    """Messages arrive after their successor.

    A message is held back until 1 ms after the next one of its sensor, percent / 100 of all; never two in a
    row, so at most half of them.
    Unit: per cent of the messages. Source: judgement.
    """

    name: ClassVar[str] = "timing.reordered_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Annotated[float, Field(ge=0, le=50, allow_inf_nan=False)] = 0.0
    sensors: Sensors = "cameras"


SPECS: tuple[type[FaultSpec], ...] = (
    TriggerAngle,
    TriggerOffset,
    ClockOffset,
    ClockDrift,
    StampJitter,
    StampOnSave,
    StampMeaning,
    StampStep,
    StampQuantum,
    StaleFrames,
    Frozen,
    Dropped,
    Duplicated,
    Latency,
    Reordered,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=TriggerOffset.name,
        values=(2.0, 10.0, 30.0, 50.0, 100.0),
        source="field reports of 2 to 150 ms",
    ),
    Severity(fault=TriggerAngle.name, values=(1.0, 3.0, 10.0, 30.0, 90.0), source="judgement"),
    Severity(fault=ClockOffset.name, values=(2.0, 10.0, 30.0, 50.0, 100.0), source="as the trigger offset"),
    Severity(
        fault=ClockDrift.name,
        values=(5.0, 20.0, 50.0, 100.0, 200.0),
        source="data sheet of quartz oscillators; ten minutes after synchronisation 3 to 120 ms",
    ),
    Severity(
        fault=StampJitter.name, values=(1.0, 3.0, 5.0, 10.0, 15.0), source="judgement: hosts 5 to 15 ms"
    ),
    Severity(
        fault=StampOnSave.name, values=(20.0, 40.0, 60.0, 80.0, 100.0), source="judgement: 20 to 100 ms"
    ),
    Severity(fault=StampMeaning.name, values=(0.1, 0.25, 0.5, 0.75, 1.0), source="start to end, computed"),
    Severity(fault=StampStep.name, values=(10.0, 30.0, 50.0, 100.0, 1000.0), source="judgement; leap second"),
    Severity(
        fault=StampQuantum.name, values=(1.0, 4.0, 10.0, 33.0, 100.0), source="judgement: ticks and logs"
    ),
    Severity(fault=StaleFrames.name, values=(1, 2, 3, 4, 5), source="judgement"),
    Severity(fault=Frozen.name, values=(1.0, 5.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=Dropped.name, values=(1.0, 5.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=Duplicated.name, values=(1.0, 5.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=Latency.name, values=(10.0, 30.0, 50.0, 100.0, 200.0), source="judgement"),
    Severity(fault=Reordered.name, values=(1.0, 5.0, 10.0, 20.0, 40.0), source="judgement"),
)
