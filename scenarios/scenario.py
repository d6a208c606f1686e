"""What happens: the declarations of a concrete scenario (every number fixed). SI units, angles in degrees.

Strict and frozen; unknown keys are refused at every depth. A scenario *file* may hold a distribution
wherever a number stands; `load.py` draws it by seed before these models see it.
"""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Drawn = NonNegative | tuple[NonNegative, NonNegative]  # a number, or low and high: drawn once a run
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]*$", max_length=64)]
Share = Annotated[float, Field(ge=0, le=1)]
Category = Literal["car", "rider", "pedestrian", "tree", "post", "building", "board"]
INSIDE_BEND = 0.8
"""Things on a road with a bend stay within this share of its radius from the centre line, on either side."""


class Spec(BaseModel):
    """Base of every declaration. A rule that joins several fields raises `broken`, which names the field."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        unknown = [key for key in data if key not in cls.model_fields] if isinstance(data, dict) else []
        if unknown:
            known = tuple(cls.model_fields)
            raise PydanticCustomError("unknown_key", "unknown key {key}", {"key": unknown[0], "known": known})
        return data


def broken(problem: str, *field: str | int) -> PydanticCustomError:
    """A broken rule about `field` (a path within the model), to be raised in a validator."""
    return PydanticCustomError("rule", "{problem}", {"problem": problem, "field": field})


def ends(value: float | tuple[float, float]) -> tuple[float, float]:
    """Least and largest value of a `Drawn` number."""
    return value if isinstance(value, tuple) else (value, value)


def check_drawn(value: float | tuple[float, float], field: str, most: float, what: str) -> None:
    """Broken rule: the ends do not ascend, or the larger is above `most`, which is called `what`."""
    low, high = ends(value)
    if low > high:
        raise broken("must be low, high with low <= high", field)
    if high > most:
        raise broken(f"is more than {what}", field)


def _is_absent(value: object) -> bool:
    return value is None


class Sway(Spec):
    """To and fro across a path: amplitude_m * sin(2 pi frequency_hz t + phase_deg) to its left."""

    amplitude_m: Annotated[float, Field(ge=0, le=2, allow_inf_nan=False)]
    frequency_hz: Annotated[float, Field(gt=0, le=5, allow_inf_nan=False)]
    phase_deg: Finite = 0.0


class Path(Spec):
    """A drive over waypoints (world x east, y north) at a piecewise linear speed; heading follows the path.

    Two waypoints are a straight line, more are a C2 spline through them. Past either end the path goes on
    straight. With one waypoint the path is the straight line from it along `heading_deg` (0 = east,
    counter-clockwise), which is given then only. `speed_mps` is one number or points (time s, speed m/s).
    At time 0 the actor is at the first waypoint, or beside it by its `sway`: heading and speed over ground
    are those of the swaying motion, `speed_mps` is that along the path. On a road with a bend see `Bend`.
    """

    waypoints_m: tuple[tuple[Finite, Finite], ...] = Field(min_length=1)
    speed_mps: NonNegative | tuple[tuple[NonNegative, NonNegative], ...] = 0.0
    heading_deg: Finite = 0.0
    sway: Sway | None = Field(default=None, exclude_if=_is_absent)

    @model_validator(mode="after")
    def _consistent(self) -> Path:
        points = self.waypoints_m
        for i in range(1, len(points)):
            if points[i] == points[i - 1]:
                raise broken("is the same point as the one before", "waypoints_m", i)
        if len(points) > 1 and self.heading_deg != 0.0:
            raise broken("counts for a path of one waypoint only; more give the heading", "heading_deg")
        if isinstance(self.speed_mps, tuple):
            if not self.speed_mps:
                raise broken("needs at least one (time, speed)", "speed_mps")
            for i in range(1, len(self.speed_mps)):
                if self.speed_mps[i][0] <= self.speed_mps[i - 1][0]:
                    raise broken("is not later than the time before", "speed_mps", i, 0)
        slowest = min(v for _, v in self.speed_mps) if isinstance(self.speed_mps, tuple) else self.speed_mps
        if self.sway is not None and slowest == 0.0:
            raise broken("needs a speed_mps that is above 0 at all times: who stands does not sway", "sway")
        return self


class Surface(Spec):
    """What a material is, in place of what the seed draws from `scenarios/parts/materials.yaml`.

    reflectivity: diffuse, at 850-905 nm. colour: red, green, blue, sRGB. What is left out is drawn as ever.
    """

    reflectivity: Share | None = None
    colour: tuple[Share, Share, Share] | None = None


class Actor(Spec):
    """A scripted body. `scale`: size relative to the part's own, the same on all axes (targets vary ±8 %).

    `materials`: those of its part that are not left to the seed, by name.
    """

    part: Name  # a file of scenarios/parts
    category: Category
    path: Path
    scale: Annotated[float, Field(ge=0.1, le=10, allow_inf_nan=False)] = 1.0
    materials: dict[Name, Surface] | None = Field(default=None, exclude_if=_is_absent)


class Scatter(Spec):
    """`count` things of one part, placed by seed in `area_m` (x0, y0, x1, y1): no overlaps, off the lanes."""

    part: Name
    category: Category
    count: Annotated[int, Field(ge=0, le=500)]
    area_m: tuple[Finite, Finite, Finite, Finite]
    speed_mps: NonNegative = 0.0  # walking pedestrians
    scale_spread: Annotated[float, Field(ge=0, le=0.3)] = 0.08
    align_deg: Finite | None = None  # fixed heading; None: any

    @model_validator(mode="after")
    def _area_is_not_empty(self) -> Scatter:
        x0, y0, x1, y1 = self.area_m
        if x1 <= x0 or y1 <= y0:
            raise broken("must be x0, y0, x1, y1 with x1 > x0 and y1 > y0", "area_m")
        return self


class Bend(Spec):
    """Where a road turns: its centre line, y = 0 before, has a bend from `at_m` to `at_m` + `length_m`.

    The curvature grows evenly from 0 to 1 / radius_m over the first `transition_m`, and falls back over the
    last (clothoids). On such a road all x and y of the file (paths, lanes, background areas) are distances
    along the centre line and to its left, headings are against it: a path that would be a straight line is
    parallel to the road. Speeds stay speeds over ground.
    """

    at_m: Finite
    length_m: Positive
    radius_m: Annotated[float, Field(ge=10, allow_inf_nan=False)]
    turn: Literal["left", "right"]
    transition_m: Positive = 10.0

    @model_validator(mode="after")
    def _turns_once(self) -> Bend:
        if 2.0 * self.transition_m > self.length_m:
            raise broken("is more than half of length_m", "transition_m")
        if self.length_m - self.transition_m > pi * self.radius_m:
            raise broken("turns the road by more than 180 degrees at this radius_m", "length_m")
        return self


class Road(Spec):
    """A paved strip along x. `lanes_m`: (y0, y1) of the strips that are driven, free of background.

    A road with a bend is bare pavement: no lines, no grass.
    """

    kind: Literal["lot", "road"] = "lot"
    length_m: Positive = 400.0
    width_m: Positive = 60.0
    lanes_m: tuple[tuple[Finite, Finite], ...] = ()
    bend: Bend | None = Field(default=None, exclude_if=_is_absent)

    @model_validator(mode="after")
    def _lanes_are_on_the_road(self) -> Road:
        for i, (y0, y1) in enumerate(self.lanes_m):
            if not -0.5 * self.width_m <= y0 < y1 <= 0.5 * self.width_m:
                raise broken("must be y0, y1 with y0 < y1, both on the road's width", "lanes_m", i)
        return self


class System(Spec):
    """Who senses whom, with what, for how long. Actors are by name; `target` may be null."""

    duration_s: Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
    ego: Name
    target: Name | None
    rig: Name  # a file of scenarios/rigs
    actors: dict[Name, Actor]

    @model_validator(mode="after")
    def _ego_and_target_are_actors(self) -> System:
        for field, name in (("ego", self.ego), ("target", self.target)):
            if name is not None and name not in self.actors:
                raise broken(f"'{name}' is not one of the actors ({', '.join(self.actors) or 'none'})", field)
        if self.ego == self.target:
            raise broken("the target must be another actor than the ego", "target")
        return self


class Scenario(Spec):
    """One concrete scenario. `faults` is checked by `faults.py`."""

    name: Name
    description: str
    road: Road
    systems: dict[Literal["car", "wearable"], System] = Field(min_length=1)
    background: tuple[Scatter, ...] = ()
    faults: dict[str, object] = {}

    @model_validator(mode="after")
    def _fits_into_the_bend(self) -> Scenario:
        bend = self.road.bend
        if bend is None:
            return self
        for name, system in self.systems.items():
            for actor, declared in system.actors.items():
                here = ("systems", name, "actors", actor, "path", "waypoints_m")
                if len(declared.path.waypoints_m) > 2:
                    raise broken("has more than two points, which a road with a bend has no room for", *here)
                for i, (_, y) in enumerate(declared.path.waypoints_m):
                    if abs(y) > INSIDE_BEND * bend.radius_m:
                        raise broken(f"is too near the centre of a bend of {bend.radius_m:g} m", *here, i, 1)
        for i, scatter in enumerate(self.background):
            if max(abs(scatter.area_m[1]), abs(scatter.area_m[3])) > INSIDE_BEND * bend.radius_m:
                raise broken(f"reaches too near the centre of a bend of {bend.radius_m:g} m", "background", i)
        return self

    def system(self, name: str) -> System:
        """The system of that name. KeyError: the scenario has none."""
        for key, system in self.systems.items():
            if key == name:
                return system
        raise KeyError(name)


# -- sensors and rigs -----------------------------------------------------------------------------------


class Pose(Spec):
    """Of a sensor on its rig: metres in the ego frame, then roll, pitch, yaw in degrees.

    The rotation is Rz(yaw) Ry(pitch) Rx(roll). A camera's is of its viewing direction: yaw 90 looks left,
    pitch > 0 looks down.
    """

    xyz_m: tuple[Finite, Finite, Finite]
    rpy_deg: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)


class ReturnNoise(Spec):
    """Range noise, 1 SD in metres, at high, medium and low return strength; interpolated between them.

    Strength is the signal in multiples of the weakest that is detected; low is at 1.
    """

    high_m: NonNegative
    medium_m: NonNegative
    low_m: NonNegative
    high_strength: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 16.0
    medium_strength: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 4.0

    @model_validator(mode="after")
    def _strengths_ascend(self) -> ReturnNoise:
        if self.high_strength <= self.medium_strength:
            raise broken("must be above medium_strength", "high_strength")
        return self


LidarEffect = Literal[
    "divergence", "range_law", "range_noise", "resolution", "angle_noise", "dropout", "false_positives"
]


class LidarSensor(Spec):
    """A spinning LiDAR. Azimuth offsets are of each beam against the encoder angle at its own firing.

    Every number says what its effect is when it acts; `off` switches effects off by name.
    """

    kind: Literal["lidar"]
    rate_hz: Positive
    columns: Annotated[int, Field(ge=1, le=8192)]
    clockwise: bool  # seen from above
    start_azimuth_deg: Finite  # where a sweep starts, in the LiDAR frame
    elevation_deg: tuple[Finite, ...]
    azimuth_offset_deg: tuple[Finite, ...]
    column_us: Positive | None = None  # from one column to the next; None: equal shares of the turn
    fire_delay_us: tuple[NonNegative, ...] = ()  # of each beam after its column's first; empty: all at once
    min_range_m: NonNegative
    range_at_10_percent_m: Positive  # farthest return of a 10 % reflecting target
    range_at_80_percent_m: Positive
    resolution_m: NonNegative
    noise: ReturnNoise
    angle_noise_deg: NonNegative
    false_positive_rate: Annotated[float, Field(ge=0, le=1)]
    divergence_deg: tuple[NonNegative, NonNegative] = (0.0, 0.0)  # FWHM of the beam: across, and up
    merge_m: NonNegative = 0.0  # parts of a return nearer to each other than this are one return
    dropout_rate: Annotated[float, Field(ge=0, le=1)] = 0.0  # share of returns lost whatever their strength
    latency_ms: NonNegative  # from the last firing to the delivery
    rolling: bool = True  # False: all beams fire in the middle of the turn, as no spinning LiDAR does
    off: tuple[LidarEffect, ...] = ()
    source: str

    @model_validator(mode="after")
    def _tables_fit(self) -> LidarSensor:
        beams, offsets = len(self.elevation_deg), len(self.azimuth_offset_deg)
        if beams == 0:
            raise broken("needs at least one beam", "elevation_deg")
        if beams != offsets:
            raise broken(f"has {offsets} values for {beams} beams", "azimuth_offset_deg")
        for i, elevation in enumerate(self.elevation_deg):
            if abs(elevation) >= 90.0:
                raise broken("must lie between -90 and 90", "elevation_deg", i)
        if self.range_at_80_percent_m < self.range_at_10_percent_m:
            raise broken("must not be below range_at_10_percent_m", "range_at_80_percent_m")
        if self.min_range_m >= self.range_at_10_percent_m:
            raise broken("must be below range_at_10_percent_m", "min_range_m")
        if max(self.divergence_deg) > 10.0:
            raise broken("must be at most 10 degrees", "divergence_deg")
        if max(self.divergence_deg) > 0.0 and self.merge_m == 0.0:
            raise broken("must be above 0 for a beam with divergence_deg", "merge_m")
        return self

    @model_validator(mode="after")
    def _firings_fit(self) -> LidarSensor:
        beams, delays = len(self.elevation_deg), len(self.fire_delay_us)
        turn_us = 1e6 / self.rate_hz
        column_us = turn_us / self.columns if self.column_us is None else self.column_us
        if self.columns * column_us > turn_us * (1.0 + 1e-9):
            raise broken(f"makes {self.columns} columns longer than a turn of {turn_us:g} us", "column_us")
        if delays not in (0, beams):
            raise broken(f"has {delays} values for {beams} beams", "fire_delay_us")
        if delays and min(self.fire_delay_us) > 0.0:
            raise broken("must be 0 for the beam that fires first", "fire_delay_us")
        for i, delay in enumerate(self.fire_delay_us):
            if delay >= column_us:
                raise broken(f"is not below the {column_us:g} us from column to column", "fire_delay_us", i)
        return self


class ImageNoise(Spec):
    """Shot and read noise of an image. White stands for full_well_e / gain electrons."""

    full_well_e: Positive
    read_noise_e: NonNegative
    gain: Positive = 1.0  # above 1: less light, so fewer electrons make the same brightness


class CameraSensor(Spec):
    """A camera. All of its times without faults; what its stamp means is its `stamp`.

    trigger: `lidar_angle` starts to expose `delay_ms` after the rig's pulse; `free_run` exposes on its own at
    `rate_hz`, the first time at `phase_ms` after time 0 (the first firing of the LiDAR's first sweep).
    shutter: `global` exposes all rows at once, `rolling` one after the other from the top; the last row
    starts `readout_ms` after the first.
    stamp, what the image's stamp claims: `trigger` the pulse; `exposure_start` the first row begins;
    `mid_exposure` the middle of the middle row; `end_of_readout` the last row ends; `arrival` the host has
    the image, `stamp_delay_ms` after mid-exposure, and later in every frame by an exponentially distributed
    wait of SD `stamp_jitter_ms`. Images do not overtake each other.
    latency_ms: to the delivery of the detections, from the end of the read-out, or from the host's having the
    image where the stamp is its arrival.
    """

    kind: Literal["camera"]
    rate_hz: Positive
    width_px: Annotated[int, Field(ge=16, le=8192)]
    height_px: Annotated[int, Field(ge=16, le=8192)]
    fov_deg: Annotated[float, Field(gt=1, lt=170)]  # horizontal
    distortion: tuple[Finite, Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 0.0, 0.0)
    monochrome: bool = False
    exposure: Positive = 1.0  # brightness: linear light is multiplied by it
    motion_blur_samples: Annotated[int, Field(ge=1, le=33)] = 1  # instants averaged over exposure_ms; 1: none
    noise: ImageNoise | None = None
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = None
    trigger: Literal["lidar_angle", "free_run"]
    delay_ms: NonNegative = 0.0
    phase_ms: Drawn = 0.0
    exposure_ms: NonNegative
    shutter: Literal["global", "rolling"] = "global"
    readout_ms: NonNegative = 0.0
    stamp: Literal["trigger", "exposure_start", "mid_exposure", "end_of_readout", "arrival"]
    stamp_delay_ms: Drawn = 0.0
    stamp_jitter_ms: Drawn = 0.0
    latency_ms: NonNegative
    source: str

    @model_validator(mode="after")
    def _imaging_fits(self) -> CameraSensor:
        if self.motion_blur_samples % 2 == 0:
            raise broken("must be odd: one of them is the middle of the exposure", "motion_blur_samples")
        if self.motion_blur_samples > 1 and self.exposure_ms == 0.0:
            raise broken("needs an exposure_ms above 0", "motion_blur_samples")
        return self

    @model_validator(mode="after")
    def _timing_fits(self) -> CameraSensor:
        period_ms = 1e3 / self.rate_hz
        if self.exposure_ms > period_ms:
            raise broken(f"is longer than a period of {period_ms:g} ms", "exposure_ms")
        if self.shutter == "global" and self.readout_ms != 0.0:
            raise broken("counts for a rolling shutter only", "readout_ms")
        if self.shutter == "rolling" and self.readout_ms == 0.0:
            raise broken("a rolling shutter needs a read-out time above 0", "readout_ms")
        if self.exposure_ms + self.readout_ms > period_ms:
            taken = f"{self.exposure_ms:g} ms of exposure and {self.readout_ms:g} ms of read-out"
            raise broken(f"{taken} are longer than a period of {period_ms:g} ms", "readout_ms")
        if self.trigger == "lidar_angle" and self.phase_ms != 0.0:
            raise broken("counts for trigger free_run only", "phase_ms")
        if self.trigger == "free_run" and self.delay_ms != 0.0:
            raise broken("counts for trigger lidar_angle only", "delay_ms")
        if self.delay_ms > period_ms:
            raise broken(f"is more than a period of {period_ms:g} ms", "delay_ms")
        if self.trigger == "free_run" and self.stamp == "trigger":
            raise broken("a free running camera has no trigger to stamp", "stamp")
        check_drawn(self.phase_ms, "phase_ms", period_ms, f"a period of {period_ms:g} ms")
        self._stamp_fits()
        return self

    def _stamp_fits(self) -> None:
        delay, jitter = self.stamp_delay_ms, self.stamp_jitter_ms
        for field, value in (("stamp_delay_ms", delay), ("stamp_jitter_ms", jitter)):
            check_drawn(value, field, 1000.0, "1000 ms")
            if self.stamp != "arrival" and value != 0.0:
                raise broken("counts for stamp arrival only", field)
        read_ms = 0.5 * (self.exposure_ms + self.readout_ms)
        if self.stamp == "arrival" and ends(delay)[0] < read_ms:
            raise broken(
                f"the host has no image before it is read out, {read_ms:g} ms after mid-exposure",
                "stamp_delay_ms",
            )


class GnssSensor(Spec):
    """RTK receivers on ego and target. Bias is drawn once a pass, noise each fix (both 1 SD, per axis).

    The ego's antenna is where the rig mounts this sensor. Both receivers measure together, the first time at
    `phase_ms` after time 0; a fix is stamped with that instant and known `latency_ms` later.
    """

    kind: Literal["gnss"]
    rate_hz: Positive
    phase_ms: Drawn = 0.0
    bias_m: NonNegative
    noise_m: NonNegative
    latency_ms: NonNegative
    heading_deg: NonNegative  # 1 SD of the constant heading error of a pass
    target_lever_m: tuple[Finite, Finite, Finite]  # antenna against the box centre, target's frame
    source: str

    @model_validator(mode="after")
    def _phase_fits(self) -> GnssSensor:
        period_ms = 1e3 / self.rate_hz
        check_drawn(self.phase_ms, "phase_ms", period_ms, f"a period of {period_ms:g} ms")
        return self


class ImuSensor(Spec):
    """Gyro and accelerometer on the ego's body, and the wheel odometer that comes with them.

    Both read at `rate_hz`, the first time at `phase_ms` after time 0; the message is stamped with that
    instant and delivered `latency_ms` later. Noise is white, given as a density (per square root of hertz);
    a bias is drawn once a run (1 SD, per axis) and wanders as a random walk (per square root of seconds). The
    odometer samples at its own rate and phase; a message holds its newest sample that is at least
    `odometer_latency_ms` old.
    """

    kind: Literal["imu"]
    rate_hz: Positive
    phase_ms: Drawn = 0.0
    gyro_noise_dps_rthz: NonNegative
    gyro_bias_dps: NonNegative
    gyro_walk_dps_rts: NonNegative
    accel_noise_mps2_rthz: NonNegative
    accel_bias_mps2: NonNegative
    accel_walk_mps2_rts: NonNegative
    odometer_rate_hz: Positive
    odometer_phase_ms: Drawn = 0.0
    odometer_latency_ms: NonNegative
    odometer_scale_error: NonNegative  # 1 SD, relative, constant over a run
    odometer_step_mps: NonNegative
    latency_ms: NonNegative
    source: str

    @model_validator(mode="after")
    def _phases_fit(self) -> ImuSensor:
        for field, phase_ms, rate_hz in (
            ("phase_ms", self.phase_ms, self.rate_hz),
            ("odometer_phase_ms", self.odometer_phase_ms, self.odometer_rate_hz),
        ):
            check_drawn(phase_ms, field, 1e3 / rate_hz, f"a period of {1e3 / rate_hz:g} ms")
        return self


Sensor = LidarSensor | CameraSensor | GnssSensor | ImuSensor

SENSOR_KINDS: dict[str, type[LidarSensor | CameraSensor | GnssSensor | ImuSensor]] = {
    "lidar": LidarSensor,
    "camera": CameraSensor,
    "gnss": GnssSensor,
    "imu": ImuSensor,
}


class DetectorSpec(Spec):
    """The 2-D detector. Recall is logistic in box height and visible fraction; misses come in bursts."""

    min_height_px: NonNegative = 12.0
    min_visible_fraction: Annotated[float, Field(ge=0, le=1)] = 0.2
    recall_at_best: Annotated[float, Field(gt=0, le=1)] = 0.99
    recall_at_least_visible: Annotated[float, Field(gt=0, le=1)] = 0.75  # as a share of that at best
    recall_half_height_px: Positive = 10.0
    miss_burst_frames: Annotated[float, Field(ge=1)] = 2.0  # mean length of a burst of misses
    false_boxes_per_image: NonNegative = 0.02
    categories: tuple[Category, ...] = ("car", "rider", "pedestrian", "board")


class Mount(Spec):
    """A sensor file on a rig. `trigger_deg`: a triggered camera's own spin angle, not the rig's pulse."""

    sensor: Name  # a file of scenarios/sensors
    pose: Pose
    trigger_deg: Finite | None = None


class Rig(Spec):
    """Sensors by their name on the rig; exactly one LiDAR, which stands above the ego frame's origin.

    `body` says whose shake the rig follows. `ego_origin_m`: where the ego frame's origin lies on the carrying
    part: metres forward and left of the part's own origin. `pulse_deg`: the LiDAR is master; when its spin
    passes this angle (in its frame, at the encoder), one pulse fires all triggered cameras.
    """

    name: Name
    description: str
    body: Literal["vehicle", "rider"]
    ego_origin_m: tuple[Finite, Finite] = (0.0, 0.0)
    pulse_deg: Finite | None = None
    sensors: dict[Name, Mount]
    detector: DetectorSpec = DetectorSpec()
    source: str
