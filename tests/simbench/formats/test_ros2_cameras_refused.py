"""Images, intrinsics and boxes that cannot be are told in one sentence."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.errors import BadInput
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.read import read_ros2
from tests.simbench.formats.ros2_foreign import (
    PIXELS,
    START,
    TREE,
    boxes,
    info,
    looking,
    packed,
    raw,
    seen,
    write_foreign,
)


def png_of(width: int, height: int) -> np.ndarray:
    """A PNG that says it is of this size, and ends there."""
    body = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + struct.pack(">II", width, height)
    return np.frombuffer(body + b"\x08\x02\x00\x00\x00" + bytes(40), dtype=np.uint8)


@pytest.mark.parametrize(
    ("kind", "sent", "says"),
    [
        (ros.IMAGE, raw("bayer_rggb8", PIXELS[..., 0]), "its encoding is 'bayer_rggb8', not one of rgb8"),
        (ros.IMAGE, replace(raw("rgb8", PIXELS), width=2**31), "pixels are not between 1 and"),
        (ros.IMAGE, replace(raw("rgb8", PIXELS), step=100), "do not fit"),
        (ros.IMAGE, raw("rgb8", PIXELS[:16]), "it has 48x16 pixels, its CameraInfo says 48x32"),
        (ros.COMPRESSED_IMAGE, packed(".png", data=png_of(10**6, 10**6)), "1000000x1000000 pixels are not"),
        (ros.COMPRESSED_IMAGE, packed(".png", data=png_of(48, 32)), "its image is damaged"),
        (ros.COMPRESSED_IMAGE, packed(".bmp"), "its image is neither PNG nor JPEG"),
        (ros.COMPRESSED_IMAGE, packed(".png", data=np.zeros(0, np.uint8)), "neither PNG nor JPEG"),
        (ros.COMPRESSED_IMAGE, packed(".jpg", data=np.frombuffer(b"\xff\xd8\xff\xe0\xff\xff", np.uint8)),
         "a JPEG without a size"),
        (ros.COMPRESSED_IMAGE, packed(".png", format="32FC1; compressedDepth png"), "is a depth image"),
    ],
)  # fmt: skip
def test_images_that_cannot_be_are_refused(tmp_path: Path, kind: str, sent: Any, says: str) -> None:
    with pytest.raises(BadInput, match=f"/i, message 0: {says}|{says}"):
        seen(tmp_path, looking(image="/i"), ("/i", kind, START, sent))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"k": np.zeros(9)}, "its camera is not calibrated"),
        ({"k": np.array([1.0, 0.5, 0, 0, 1, 0, 0, 0, 1])}, "its camera is not calibrated"),
        ({"distortion_model": "equidistant"}, "its distortion is 'equidistant' of 4 numbers"),
        ({"d": [0, 0, 0, 0, 0, 0.1, 0, 0], "distortion_model": "rational_polynomial"}, "more than the five"),
        ({"binning_x": 2}, "its image is binned"),
        ({"roi": {"width": 10, "height": 10}}, r"is a part of the sensor's \(roi\)"),
    ],
)
def test_cameras_that_are_not_ours_are_refused(tmp_path: Path, changes: Any, says: str) -> None:
    sent = [TREE, ("/front/info", ros.CAMERA_INFO, START, info(**changes))]
    with pytest.raises(BadInput, match=f"/front/info, message 0: .*{says}"):
        read_ros2(write_foreign(tmp_path / "bag", sent), looking())


def test_a_calibration_that_changes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="/front/info, message 1: the camera's calibration changes"):
        seen(tmp_path, looking(), ("/front/info", ros.CAMERA_INFO, START, info(d=[])))


@pytest.mark.parametrize(
    ("sent", "says"),
    [
        (boxes(START, ("car", "1", 1.5)), "a box has a score of 1.5, not 0 to 1"),
        (boxes(START, ("car", "1", 0.5), box={"size_x": -1.0, "size_y": 1.0}), "a box of -1 x 1 px"),
        (boxes(START, ("car", "1", 0.5), box={"size_x": np.inf, "size_y": 1.0}), "a box is not finite"),
        (boxes(START, ("car", "1", 0.5), box={"center": {"theta": 0.1}}), "a box is turned by 0.1 rad"),
    ],
)
def test_boxes_that_cannot_be_are_refused(tmp_path: Path, sent: Any, says: str) -> None:
    with pytest.raises(BadInput, match=f"/d, message 0: {says}"):
        seen(tmp_path, looking(detections="/d"), ("/d", ros.DETECTIONS, START, sent))
