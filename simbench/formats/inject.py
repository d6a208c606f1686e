"""What `--faults` makes of recorded data: drawn once per recording, each fault from a stream of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import readonly
from fusion.messages import BoxPx, Calibration
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from scenarios.faults import EdgeError, StaleFrames
from scenarios.faults.lidar import BeamLoss
from simbench.faults import detector as detector_fault
from simbench.faults.points_lost import lost_rings
from simbench.faults.tell import tell
from simbench.faults.telling import Place, Telling
from simbench.formats.calibration import CAMERA, LIDAR
from simbench.truth import ObjectInfo

SMALLEST_PX = 1.0  # along a side of a delivered box


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnOnRecording:
    """What this seed drew. `lost_rings`: sorted, out of `rings` (0: not asked for); `edge_errors`: [frames 4]
    by object, in units of the side.
    """

    told: Calibration
    tellings: tuple[Telling, ...]
    stale_frames: int
    rings: int
    lost_rings: Int64[np.ndarray, " r"]
    edge_errors: Mapping[int, Float64[np.ndarray, "f 4"]]

    @property
    def lost_percent(self) -> float:
        """Of the rings."""
        return 100.0 * len(self.lost_rings) / self.rings if self.rings else 0.0


def check_faults(faults: FaultSet, frames: int, what: str) -> None:
    """BadInput: a recording of so many frames, called `what`, is too short for a fault."""
    stale = faults.get(StaleFrames)
    if stale is not None and stale.frames >= frames:
        raise BadInput(
            f"{what} has {frames} frame{'s' * (frames != 1)}; {StaleFrames.name}={stale.frames} delivers "
            "what was seen before, and needs more (in the object layout no frame has another before it)"
        )


def draw_on_recording(
    faults: FaultSet,
    true: Calibration,
    objects: Sequence[ObjectInfo],
    *,
    frames: int,
    rings: int,
    period_s: float,
    seed: int,
) -> DrawnOnRecording:
    """frames, rings: how many the recording has (rings: 0 where they were not looked for)."""
    told, tellings = tell(faults, Place(true=true, lidar_name=LIDAR, seed=seed))
    edges: dict[int, Float64[np.ndarray, "f 4"]] = {}
    if (error := faults.get(EdgeError)) is not None:
        edges = detector_fault.edge_errors(error, CAMERA, objects, frames, period_s, seed)
    stale, loss = faults.get(StaleFrames), faults.get(BeamLoss)
    return DrawnOnRecording(
        told=told,
        tellings=tellings,
        stale_frames=0 if stale is None else stale.frames,
        rings=rings,
        lost_rings=lost_rings(loss, rings, seed) if loss is not None and rings else _NONE,
        edge_errors=edges,
    )


_NONE = readonly(np.empty(0), np.int64)


def moved_box(
    box: BoxPx, error: Float64[np.ndarray, "4"] | None, width_px: int, height_px: int
) -> BoxPx | None:
    """A box with its edges moved (in units of its side), cut at the image's border; None: nothing is left."""
    x0, y0, x1, y1 = box
    if error is not None:
        w, h = x1 - x0, y1 - y0
        x0, y0, x1, y1 = x0 + error[0] * w, y0 + error[1] * h, x1 + error[2] * w, y1 + error[3] * h
    x0, x1 = (float(min(max(x, 0.0), width_px)) for x in (x0, x1))
    y0, y1 = (float(min(max(y, 0.0), height_px)) for y in (y0, y1))
    return (x0, y0, x1, y1) if x1 - x0 >= SMALLEST_PX and y1 - y0 >= SMALLEST_PX else None
