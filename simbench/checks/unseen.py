"""What no sensor sees changes nothing.

An actor: a drive with one more pedestrian, 2 km behind, where no sensor reaches. First the bench is asked:
all messages of the two drives must be equal to the last byte, but for track ids, which are drawn at random in
each run and are numbered here by first appearance; else nothing can be said of the pipeline. Then two
instances of the pipeline hear the two drives in turns, message by message, as two vehicles would in one
process, and must answer the same to the last byte: what one instance hears may not reach the other, nor may
the clock on the wall.

A camera: looks straight up from the ego's origin on the ground and reports a box of a track of its own, with
and right before every message of the first camera of the rig. No point of any scan is in its picture
(`cannot be said` otherwise), so the other tracks must be what they were: whoever takes boxes or cameras by
their place in a list, or lets boxes of one camera act in another, is found. Tolerance: rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fusion.camera import PinholeCamera
from fusion.check import digest
from fusion.geometry import Transform
from fusion.messages import (
    Calibration,
    CategorySize,
    Detection,
    Detections,
    FusionOutput,
    LidarScan,
    Measurement,
    Trajectory,
)
from simbench.checks.compare import compare
from simbench.checks.finding import NOTHING, Finding, Story, ask, raised, said_nothing
from simbench.drive import Driven, drive
from simbench.plugins import Factory
from simbench.stage import CATEGORIES

BLIND = "blind"
UPWARDS = Transform(  # optical x to the ego's right, y forward, z up
    rotation=np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), translation_m=np.zeros(3)
)
LENS = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=100.0, cy_px=100.0, width_px=200, height_px=200)
BOX_PX = (50.0, 50.0, 150.0, 150.0)


def find_actor(factory: Factory, plain: Story, with_unseen: Story) -> Finding:
    """The answers to a drive, and at the same time to one with an actor that no sensor sees."""
    a, b = renumbered(plain.messages), renumbered(with_unseen.messages)
    if (moved := first_other(a, b)) is not None:
        return Finding(verdict="cannot be said", why=f"the bench's own messages are others: {moved}")
    one, other = in_turns(factory, plain.calibration, a, b)
    if said_nothing((one, other)):
        return NOTHING
    for first, second in zip(one.outputs, other.outputs, strict=False):
        if digest(first) != digest(second):
            why = f"another answer for scan {first.scan_seq}, from the same messages"
            return Finding(verdict="does not hold", why=why)
    if len(one.outputs) != len(other.outputs) or digest(one.trajectories) != digest(other.trajectories):
        return Finding(verdict="does not hold", why="other scans answered, or other trajectories")
    return Finding(verdict="holds", why=f"{len(one.outputs)} answers, equal to the last byte")


def renumbered(messages: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """The same with track ids from 1 on, in order of first appearance."""
    number: dict[int, int] = {}

    def boxes(message: Detections) -> tuple[Detection, ...]:
        return tuple(
            replace(box, track_id=number.setdefault(box.track_id, len(number) + 1)) for box in message.boxes
        )

    return tuple(replace(m, boxes=boxes(m)) if isinstance(m, Detections) else m for m in messages)


def first_other(a: Sequence[Measurement], b: Sequence[Measurement]) -> str | None:
    """The first message that is not the same in both, in words; None where all are."""
    for one, other in zip(a, b, strict=False):
        if digest(one) != digest(other):
            return f"{type(one).__name__} {one.seq} of {one.sensor}"
    return None if len(a) == len(b) else f"{len(a)} and {len(b)} of them"


class _Beside:
    """Two instances of a pipeline that are driven as one: the second hears messages of its own."""

    def __init__(self, factory: Factory, heard: Sequence[Measurement]) -> None:
        self.first, self.second = factory(), factory()
        self._heard = iter(heard)
        self._said: list[FusionOutput] = []

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.first.reset(calibration, categories)
        self.second.reset(calibration, categories)

    def update(self, measurement: Measurement) -> FusionOutput | None:
        said = self.second.update(next(self._heard))
        if said is not None:
            self._said.append(said)
        return self.first.update(measurement)

    def trajectories(self) -> tuple[Trajectory, ...]:
        self.paths = tuple(self.second.trajectories())
        return self.first.trajectories()

    def of_second(self) -> Driven:
        """What the second one said."""
        return Driven(outputs=tuple(self._said), trajectories=self.paths, scan_ms=(), step_ns={})


def in_turns(
    factory: Factory, calibration: Calibration, a: Sequence[Measurement], b: Sequence[Measurement]
) -> tuple[Driven, Driven]:
    """What two instances say that hear two drives of equal length message by message in turns."""
    try:
        both = _Beside(factory, b)
        one = drive(both, calibration, CATEGORIES, a)
        return one, both.of_second()
    except Exception as error:  # foreign code may raise anything
        raise raised(error) from error


def find_camera(factory: Factory, story: Story) -> Finding:
    """The answers to a story, and to the one with a camera that sees nothing of any scan."""
    watched = with_blind_camera(story)
    if shown := points_shown(watched):
        return Finding(verdict="cannot be said", why=f"the blind camera sees {shown} points")
    retold = ask(factory, watched)
    others = [
        replace(output, objects=tuple(thing for thing in output.objects if thing.sensor != BLIND))
        for output in retold.outputs
    ]
    tracks = {box.track_id for m in story.messages if isinstance(m, Detections) for box in m.boxes}
    paths = tuple(path for path in retold.trajectories if path.track_id in tracks)
    return compare(ask(factory, story), replace(retold, outputs=tuple(others), trajectories=paths))


def with_blind_camera(story: Story) -> Story:
    """The story with a camera that looks at the sky."""
    told, seen = story.calibration, [m for m in story.messages if isinstance(m, Detections)]
    track_id = 1 + max((box.track_id for message in seen for box in message.boxes), default=0)
    box = Detection(track_id=track_id, category="pedestrian", box_px=BOX_PX, confidence=0.9)
    first = min(told.cameras, default=None)
    messages: list[Measurement] = []
    for message in story.messages:
        if isinstance(message, Detections) and message.sensor == first:
            messages.append(replace(message, sensor=BLIND, boxes=(box,)))
        messages.append(message)
    calibration = Calibration(
        T_ego_sensor={**told.T_ego_sensor, BLIND: UPWARDS}, cameras={**told.cameras, BLIND: LENS}
    )
    return Story(calibration=calibration, messages=tuple(messages))


def points_shown(story: Story) -> int:
    """How many points of all scans are in the blind camera's picture."""
    count = 0
    for message in story.messages:
        if isinstance(message, LidarScan):
            T_camera_lidar = story.calibration.T_camera_lidar(BLIND, message.sensor)
            u, v = LENS.project(T_camera_lidar.apply(message.xyz_m.astype(np.float64))).T
            with np.errstate(invalid="ignore"):  # NaN: behind the camera
                count += int(np.sum((u >= 0.0) & (u < LENS.width_px) & (v >= 0.0) & (v < LENS.height_px)))
    return count
