"""KITTI folders: which recordings they hold and which files make one.

    object      velodyne/000000.bin  image_2/000000.png  calib/000000.txt  label_2/000000.txt
    tracking    velodyne/0000/000000.bin  image_02/0000/000000.png  calib/0000.txt  label_02/0000.txt
                oxts/0000.txt (where there)
    raw         one day: calib_cam_to_cam.txt  calib_velo_to_cam.txt  calib_imu_to_velo.txt and drives,
                2011_09_26_drive_0001_sync: {velodyne_points, image_02, oxts}/data/0000000000.*,
                {velodyne_points, image_02, oxts}/timestamps.txt, tracklet_labels.xml

A recording is one frame of the object layout (its frames are independent of each other), one sequence or one
drive. It is called by its number. The frames of a recording are those that have a sweep.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from scenarios.errors import BadInput
from simbench.formats.calibration import KittiCalibration, parse_calibration
from simbench.formats.folder import Folder, Line
from simbench.formats.labels import Label, object_labels, tracking_labels
from simbench.formats.targets import KITTI

Layout = Literal["object", "tracking", "raw"]
Span = tuple[int, int]  # first and last frame
PERIOD_NS = 100_000_000  # the LiDAR turns ten times a second; only the raw layout says exactly when
IMAGE_KINDS = (".png", ".jpg", ".jpeg")
OXTS_FIELDS = 30
MAX_SWEEPS_BYTES = 1_200_000_000  # about 600 full sweeps
GROWTH = 5  # memory of a played recording over the size of its files, with what is made on the way


@dataclass(frozen=True, kw_only=True, eq=False)
class Oxts:
    """What the GNSS/INS box measured in its own axes (forward, left, up): velocity, rates, specific force."""

    stamp_ns: int
    velocity_mps: Float64[np.ndarray, "3"]
    rate_radps: Float64[np.ndarray, "3"]
    specific_force_mps2: Float64[np.ndarray, "3"]


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """One frame. `points`, `image`: names of files below the folder. Stamps in ns since the first frame."""

    frame: int
    stamp_ns: int
    image_ns: int
    points: str
    image: str
    labels: tuple[Label, ...]
    oxts: Oxts | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """One recording as its text files tell it: sweeps and images are still to be read."""

    layout: Layout
    number: int
    name: str
    folder: Folder
    calibration: KittiCalibration
    snapshots: tuple[Snapshot, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class KittiFolder:
    """A folder and its layout. `names`: of its recordings, by number."""

    layout: Layout
    folder: Folder
    names: dict[int, str]

    def drive(self, number: int, span: Span | None = None) -> Drive:
        """The recording of this number, or the frames first to last of it. BadInput: there is none, a file is
        missing or malformed.
        """
        if number not in self.names:
            raise BadInput(
                f"there is no {WORDS[self.layout]} {number}",
                file=self.folder.shown,
                allowed=listed(tuple(self.names)),
            )
        if span is not None and self.layout == "object":
            raise BadInput(
                "--frames picks frames of a sequence; frames of the object layout are independent, "
                "--seeds picks some"
            )
        folder = self.folder.fresh()
        drive = READERS[self.layout](folder, self.names[number], number, span)
        if not drive.snapshots:
            asked = "" if span is None else f" from {span[0]} to {span[1]}"
            where = folder.name_of(drive.name)
            raise BadInput(f"{WORDS[self.layout]} {number} has no frame{asked} with a sweep", file=where)
        total = sum(folder.check_points(snapshot.points) for snapshot in drive.snapshots)
        if total > MAX_SWEEPS_BYTES:
            raise BadInput(
                f"{len(drive.snapshots)} sweeps of {1e-9 * total:.1f} GB would take about "
                f"{GROWTH * 1e-9 * total:.0f} GB of memory; --frames FIRST-LAST picks some",
                file=folder.name_of(drive.name),
                allowed=f"{1e-9 * MAX_SWEEPS_BYTES:g} GB of sweeps at a time",
            )
        return drive


def open_kitti(target: str) -> KittiFolder:
    """The folder of `kitti:PATH`. BadInput: it is not there, or has none of the layouts."""
    folder = Folder.open(target.removeprefix(KITTI))
    if folder.has("calib_cam_to_cam.txt"):
        return _folder(folder, "raw", "", re.compile(r"\d{4}_\d\d_\d\d_drive_(\d{4})_(?:sync|extract)"))
    if folder.has("label_02") or folder.has("image_02"):
        return _folder(folder, "tracking", "velodyne", re.compile(r"(\d{4})"))
    if folder.has("label_2") or folder.has("image_2"):
        return _folder(folder, "object", "velodyne", re.compile(r"(\d{6})\.bin"))
    inner = next((part for part in ("training", "testing") if folder.has(part)), None)
    raise BadInput(
        "no KITTI layout is here",
        file=folder.shown,
        allowed="a folder with image_2 (object), image_02 (tracking) or calib_cam_to_cam.txt (raw, one day)",
        hint=None if inner is None else KITTI + folder.name_of(inner),
    )


def _folder(folder: Folder, layout: Layout, part: str, pattern: re.Pattern[str]) -> KittiFolder:
    found = [(int(m[1]), name) for name in folder.entries(part) if (m := pattern.fullmatch(name))]
    if not found:
        raise BadInput(f"no {WORDS[layout]} with sweeps is here", file=folder.name_of(part))
    return KittiFolder(layout=layout, folder=folder, names=dict(sorted(found)))


WORDS: dict[Layout, str] = {"object": "frame", "tracking": "sequence", "raw": "drive"}


def listed(numbers: Sequence[int]) -> str:
    """'0-2, 5': ascending numbers as ranges, cut where there are many."""
    spans: list[list[int]] = []
    for n in sorted(numbers):
        if spans and n == spans[-1][1] + 1:
            spans[-1][1] = n
        else:
            spans.append([n, n])
    words = [str(a) if a == b else f"{a}-{b}" for a, b in spans]
    return ", ".join(words[:8]) + (", ..." if len(words) > 8 else "")


# -- layouts ----------------------------------------------------------------------------------------------


def _object(folder: Folder, name: str, number: int, span: Span | None) -> Drive:
    stem = f"{number:06d}"
    calib, label = f"calib/{stem}.txt", f"label_2/{stem}.txt"
    if not folder.has("label_2"):
        raise BadInput(
            "no labels: without them there is no truth to score by", file=folder.name_of("label_2")
        )
    snapshot = Snapshot(
        frame=number,
        stamp_ns=0,
        image_ns=0,
        points=f"velodyne/{name}",
        image=image_named(folder, f"image_2/{stem}"),
        labels=object_labels(folder.lines(label), number),
        oxts=None,
    )
    return Drive(
        layout="object",
        number=number,
        name=stem,
        folder=folder,
        calibration=parse_calibration(folder.lines(calib), folder.name_of(calib)),
        snapshots=(snapshot,),
    )


def _tracking(folder: Folder, name: str, number: int, span: Span | None) -> Drive:
    calib, label, oxts = f"calib/{name}.txt", f"label_02/{name}.txt", f"oxts/{name}.txt"
    frames = sweeps(folder, f"velodyne/{name}", re.compile(r"(\d{6})\.bin"), span)
    motion = folder.lines(oxts) if folder.has(oxts) else None
    labels = tracking_labels(folder.lines(label))
    first = frames[0][0] if frames else 0
    snapshots = [
        Snapshot(
            frame=frame,
            stamp_ns=(frame - first) * PERIOD_NS,
            image_ns=(frame - first) * PERIOD_NS,
            points=f"velodyne/{name}/{file}",
            image=image_named(folder, f"image_02/{name}/{frame:06d}"),
            labels=tuple(label for label in labels if label.frame == frame),
            oxts=None
            if motion is None
            else _oxts_of(motion, frame, (frame - first) * PERIOD_NS, folder, oxts),
        )
        for frame, file in frames
    ]
    return Drive(
        layout="tracking",
        number=number,
        name=name,
        folder=folder,
        calibration=parse_calibration(folder.lines(calib), folder.name_of(calib)),
        snapshots=tuple(snapshots),
    )


def _raw(folder: Folder, name: str, number: int, span: Span | None) -> Drive:
    from simbench.formats.kitti_raw import read_raw

    return read_raw(folder, name, number, span)


READERS: dict[Layout, Callable[[Folder, str, int, Span | None], Drive]] = {
    "object": _object,
    "tracking": _tracking,
    "raw": _raw,
}


def sweeps(folder: Folder, part: str, pattern: re.Pattern[str], span: Span | None) -> list[tuple[int, str]]:
    """(frame, file) of the sweeps in a folder, ascending, those in the span."""
    found = [(int(m[1]), name) for name in folder.entries(part) if (m := pattern.fullmatch(name))]
    return sorted(f for f in found if span is None or span[0] <= f[0] <= span[1])


def image_named(folder: Folder, stem: str) -> str:
    """The image file of this name, whatever its kind. BadInput: there is none."""
    found = next((stem + kind for kind in IMAGE_KINDS if folder.has(stem + kind)), None)
    if found is None:
        raise BadInput("no such file", file=folder.name_of(stem + IMAGE_KINDS[0]))
    return found


def _oxts_of(lines: Sequence[Line], frame: int, stamp_ns: int, folder: Folder, part: str) -> Oxts:
    line = next((line for line in lines if line.number == frame + 1), None)
    if line is None:
        raise BadInput(f"has no line {frame + 1} for frame {frame}", file=folder.name_of(part))
    return oxts_of(line, stamp_ns)


def oxts_of(line: Line, stamp_ns: int) -> Oxts:
    """The motion in a line of 30 numbers. BadInput: another count, or no numbers."""
    values = line.numbers(0, "oxts")
    if len(values) != OXTS_FIELDS:
        raise line.error(f"holds {len(values)} numbers, a line of oxts has {OXTS_FIELDS}")
    return Oxts(
        stamp_ns=stamp_ns,
        velocity_mps=np.array(values[8:11]),
        rate_radps=np.array(values[17:20]),
        specific_force_mps2=np.array(values[11:14]),
    )
