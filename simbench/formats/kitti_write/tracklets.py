"""tracklet_labels.xml: one tracklet for every object, from the first frame that knows it to the last.

A tracklet's boxes stand upright in the LiDAR's frame, a label's in the camera's. The two are level on all
our rigs. Where they are not, a tracklet is what our reader (`kitti_raw.py`) makes the label of: its bottom is
off the upright box's by half a height times the tilt.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from simbench.formats.kitti_raw import OCCLUDED, TRUNCATED
from simbench.formats.kitti_write.drive import WrittenDrive
from simbench.formats.kitti_write.kinds import kind_of, occlusion
from simbench.formats.kitti_write.objects import Labelled

SHARES = {level: share for level, share in OCCLUDED.items() if level >= 0}
NOT_SAID, FULLY, IN_IMAGE, PARTLY, OUTSIDE, BEHIND = -1, 2, 0, 1, 2, 99
HEAD = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<!DOCTYPE boost_serialization>
<boost_serialization signature="serialization::archive" version="9">
<tracklets class_id="0" tracking_level="0" version="0">
"""
NOT_ASKED = "".join(
    f"<{name}>-1</{name}>"
    for name in ("amt_occlusion", "amt_occlusion_kf", "amt_border_l", "amt_border_r", "amt_border_kf")
)
"""What KITTI's labellers were asked on top, and nobody here."""


def tracklets_text(drive: WrittenDrive) -> str:
    """The file's text."""
    items = [
        _item(drive, spanned)
        for info in drive.objects
        if (spanned := _span([_of(frame.labels, info.object_id) for frame in drive.frames]))
    ]
    count = f"<count>{len(items)}</count><item_version>1</item_version>\n"
    return HEAD + count + "".join(items) + "</tracklets>\n</boost_serialization>\n"


def _of(labels: tuple[Labelled, ...], object_id: int) -> Labelled | None:
    return next((label for label in labels if label.object_id == object_id), None)


def _span(labels: list[Labelled | None]) -> list[tuple[int, Labelled]]:
    """(frame, label) from the first known one to the last."""
    known = [frame for frame, label in enumerate(labels) if label is not None and label.known]
    if not known:
        return []
    return [(f, label) for f in range(known[0], known[-1] + 1) if (label := labels[f]) is not None]


def _item(drive: WrittenDrive, spanned: list[tuple[int, Labelled]]) -> str:
    first, label = spanned[0]
    kind = kind_of(label.category)
    length, width, height = label.size_m
    poses = "".join(_pose(drive, one) for _, one in spanned)
    return (
        '<item class_id="1" tracking_level="0" version="1">'
        f"<objectType>{'Person (sitting)' if kind == 'Person_sitting' else kind}</objectType>"
        f"<h>{height!r}</h><w>{width!r}</w><l>{length!r}</l><first_frame>{first}</first_frame>\n"
        f'<poses class_id="2" tracking_level="0" version="0"><count>{len(spanned)}</count>'
        f"<item_version>2</item_version>\n{poses}</poses><finished>1</finished></item>\n"
    )


def _pose(drive: WrittenDrive, label: Labelled) -> str:
    tx, ty, tz = (float(v) for v in drive.T_camera_lidar.inverse().apply(label.bottom_m))
    heading = heading_of(label.yaw_rad, drive.T_camera_lidar.rotation)
    occluded, truncated = levels(label)
    return (
        '<item class_id="3" tracking_level="0" version="2">'
        f"<tx>{tx!r}</tx><ty>{ty!r}</ty><tz>{tz!r}</tz><rx>0</rx><ry>0</ry><rz>{heading!r}</rz>"
        f"<state>2</state><occlusion>{occluded}</occlusion><occlusion_kf>0</occlusion_kf>"
        f"<truncation>{truncated}</truncation>{NOT_ASKED}</item>\n"
    )


def levels(label: Labelled) -> tuple[int, int]:
    """Occlusion and truncation of a tracklet's pose."""
    if label.box_px is None:
        return NOT_SAID, BEHIND if label.behind else OUTSIDE
    truncated = PARTLY if label.outside >= 0.5 * TRUNCATED[PARTLY] else IN_IMAGE
    if label.visible_fraction == 0.0:
        return FULLY, truncated
    return occlusion(label.visible_fraction, TRUNCATED[truncated], SHARES), truncated


def heading_of(yaw_rad: float, R_camera_lidar: Float64[np.ndarray, "3 3"]) -> float:
    """The heading about the LiDAR's z whose direction has this rotation_y in the camera's frame."""
    floor = R_camera_lidar[np.ix_((0, 2), (0, 1))]
    c, s = np.linalg.solve(floor, (np.cos(yaw_rad), -np.sin(yaw_rad)))
    return float(np.arctan2(s, c))
