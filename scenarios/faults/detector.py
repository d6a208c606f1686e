"""What the detector makes of what it sees."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from scenarios.faults.spec import Cameras, FaultSpec, Severity
from scenarios.scenario import broken

Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]


class EdgeError(FaultSpec):
    """The detector's box edges are off, and stay off for a while.

    Each edge moves outward by side * (bias_fraction + a_t), side being the box's width or height.
    a_t is AR(1) noise of SD sd_fraction with time constant tau_s: a_t = r a_(t-dt) + sqrt(1 - r^2) sd n_t,
    r = exp(-dt / tau_s); tau_s 0 is white noise.
    Unit: share of the box's side. Source: judgement (SD 3 %, 0.3 s): white jitter alone flatters smoothers.
    """

    name: ClassVar[str] = "detector.edge_error"
    strength: ClassVar[str] = "sd_fraction"
    zero_when_off: ClassVar[tuple[str, ...]] = ("sd_fraction", "bias_fraction")
    unit: ClassVar[str] = "fraction of the side"

    sd_fraction: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.03
    tau_s: Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)] = 0.3
    bias_fraction: Annotated[float, Field(ge=-0.5, le=1, allow_inf_nan=False)] = 0.0


class Misses(FaultSpec):
    """The detector misses objects that it would have found.

    Each box of a true object is missed with chance percent / 100, on top of the detector's own misses.
    burst_frames 0: every box by itself; else the mean length of a burst of misses L, by a Markov chain per
    object and camera that leaves a burst with chance 1 / L and enters one with chance p / ((1 - p) L).
    Unit: percent of the true boxes. Source: judgement (recall of trackers in traffic, 60 to 99 %).
    """

    name: ClassVar[str] = "detector.misses_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "% of boxes"

    percent: Percent = 0.0
    burst_frames: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"

    @model_validator(mode="after")
    def _bursts_fit(self) -> Misses:
        if self.burst_frames == 0.0:
            return self
        if self.burst_frames < 1.0:
            raise broken("must be 0 (no bursts) or at least 1", "burst_frames")
        if self.burst_frames * (100.0 - self.percent) < self.percent:
            raise broken(
                f"is too short for bursts that make up {self.percent:g} % of the time", "burst_frames"
            )
        return self


class HardMisses(FaultSpec):
    """The detector misses what is small in the image or hidden, more than it should.

    Each box of a true object is missed with chance percent / 100 * hardness, on top of the detector's own
    misses. Hardness is 0 to 1: by size 1 / (1 + (h / half_height_px)^2), h the height of its visible box; by
    visibility 1 - v, v the visible share of its outline; by either 1 - (1 - by size) (1 - by visibility).
    Unit: percent of the boxes of which nothing is left to see. Source: judgement (recall falls to half where
    a detector trained on larger objects has 30 to 50 px).
    """

    name: ClassVar[str] = "detector.misses_hard_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "% of the hardest boxes"

    percent: Percent = 0.0
    by: Literal["either", "size", "visibility"] = "either"
    half_height_px: Annotated[float, Field(gt=0, le=10000, allow_inf_nan=False)] = 40.0
    sensors: Cameras = "cameras"


class FalseBoxes(FaultSpec):
    """The detector sees things that are not there.

    Every image gets a Poisson number of false boxes with mean boxes_per_image, at random places, with a
    random category that the detector knows and an id that is no object's.
    Unit: boxes an image. Source: judgement (0.02 is the detector's own).
    """

    name: ClassVar[str] = "detector.false_boxes_per_image"
    strength: ClassVar[str] = "boxes_per_image"
    zero_when_off: ClassVar[tuple[str, ...]] = ("boxes_per_image",)
    unit: ClassVar[str] = "boxes per image"

    boxes_per_image: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class IdentitySwitches(FaultSpec):
    """The tracker confuses who is who, and stays confused.

    In each frame of a camera with chance per_s / frame rate: two tracks that it has shown before and shows
    now swap ids (mode swap), or one of them goes on under an id never used (mode fresh). No id of another
    camera moves.
    Unit: switches per second and camera. Source: judgement.
    """

    name: ClassVar[str] = "detector.identity_switches_per_s"
    strength: ClassVar[str] = "per_s"
    zero_when_off: ClassVar[tuple[str, ...]] = ("per_s",)
    unit: ClassVar[str] = "switches per s"

    per_s: Annotated[float, Field(ge=0, le=5, allow_inf_nan=False)] = 0.0
    mode: Literal["swap", "fresh"] = "swap"
    sensors: Cameras = "cameras"


class ClassConfusion(FaultSpec):
    """The detector finds the object and calls it something else.

    Each box of a true object gets, with chance percent / 100, one of the other categories that the detector
    knows, all equally likely, in each frame anew.
    Unit: percent of the true boxes. Source: judgement.
    """

    name: ClassVar[str] = "detector.class_confusion_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "% of boxes"

    percent: Percent = 0.0
    sensors: Cameras = "cameras"


class BoxLag(FaultSpec):
    """A smoothing tracker shows each box late.

    Edges are (1 - lag_frames) * this frame's + lag_frames * those of the same track in the frame before. A
    track that was not in the frame before has no lag.
    Unit: frames. Source: judgement (0 to 1 frame).
    """

    name: ClassVar[str] = "detector.lag_frames"
    strength: ClassVar[str] = "lag_frames"
    zero_when_off: ClassVar[tuple[str, ...]] = ("lag_frames",)
    unit: ClassVar[str] = "frames"

    lag_frames: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class Merged(FaultSpec):
    """Two objects side by side are found as one.

    Two boxes of an image are a pair when the gap between them is at most near_fraction of the narrower one's
    width (nearest pairs first, a box is in one pair at most). A pair becomes, with chance percent / 100, one
    box around both, which is the larger one's object, id, category and confidence.
    Unit: percent of the pairs. Source: judgement.
    """

    name: ClassVar[str] = "detector.merged_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "% of pairs"

    percent: Percent = 0.0
    near_fraction: Annotated[float, Field(ge=0, le=2, allow_inf_nan=False)] = 0.1
    sensors: Cameras = "cameras"


class Split(FaultSpec):
    """One object is found as two, side by side.

    Each box of a true object becomes, with chance percent / 100, its left half under its own id and its right
    half under an id never used. Both are the same object's: what is in them is its own.
    Unit: percent of the true boxes. Source: judgement.
    """

    name: ClassVar[str] = "detector.split_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "% of boxes"

    percent: Percent = 0.0
    sensors: Cameras = "cameras"


SPECS: tuple[type[FaultSpec], ...] = (
    EdgeError,
    Misses,
    HardMisses,
    FalseBoxes,
    IdentitySwitches,
    ClassConfusion,
    BoxLag,
    Merged,
    Split,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(fault=EdgeError.name, values=(0.01, 0.02, 0.03, 0.05, 0.1), source="judgement"),
    Severity(fault=Misses.name, values=(2.0, 5.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=HardMisses.name, values=(10.0, 20.0, 40.0, 70.0, 100.0), source="judgement"),
    Severity(fault=FalseBoxes.name, values=(0.05, 0.1, 0.3, 1.0, 3.0), source="judgement"),
    Severity(fault=IdentitySwitches.name, values=(0.05, 0.1, 0.3, 1.0, 3.0), source="judgement"),
    Severity(fault=ClassConfusion.name, values=(1.0, 3.0, 10.0, 20.0, 40.0), source="judgement"),
    Severity(fault=BoxLag.name, values=(0.1, 0.25, 0.5, 0.75, 1.0), source="judgement: 0 to 1 frame"),
    Severity(fault=Merged.name, values=(5.0, 10.0, 25.0, 50.0, 100.0), source="judgement"),
    Severity(fault=Split.name, values=(1.0, 3.0, 10.0, 20.0, 40.0), source="judgement"),
)
