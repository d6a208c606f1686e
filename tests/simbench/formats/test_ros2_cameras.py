"""Images, intrinsics and boxes of other stacks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from fusion.messages import CameraImage, Detections
from simbench.formats.ros2 import definitions as ros
from tests.simbench.formats.ros2_foreign import (
    PIXELS,
    START,
    Written,
    boxes,
    looking,
    packed,
    raw,
    seen,
)


@pytest.mark.parametrize(
    ("sent", "kind", "wanted"),
    [
        (raw("rgb8", PIXELS), ros.IMAGE, PIXELS),
        (raw("bgr8", PIXELS, gap=3), ros.IMAGE, PIXELS[..., ::-1]),
        (raw("mono8", PIXELS[..., 0]), ros.IMAGE, np.repeat(PIXELS[..., :1], 3, axis=2)),
        (raw("bgra8", np.concatenate([PIXELS, PIXELS[..., :1]], axis=2)), ros.IMAGE, PIXELS[..., ::-1]),
        (packed(".png"), ros.COMPRESSED_IMAGE, PIXELS),
    ],
)
def test_pixels_come_as_they_were(tmp_path: Path, sent: Any, kind: str, wanted: np.ndarray) -> None:
    found = seen(tmp_path, looking(image="/front/image"), ("/front/image", kind, START + 10**7, sent))
    (image,) = found.log.messages
    assert isinstance(image, CameraImage) and np.array_equal(image.rgb, wanted)


def test_a_jpeg_comes_as_opencv_reads_it(tmp_path: Path) -> None:
    sent = packed(".jpg")
    found = seen(tmp_path, looking(image="/i"), ("/i", ros.COMPRESSED_IMAGE, START + 10**7, sent))
    (image,) = found.log.messages
    wanted = cv2.imdecode(np.asarray(sent.data), cv2.IMREAD_COLOR)
    assert (
        isinstance(image, CameraImage) and wanted is not None and np.array_equal(image.rgb, wanted[..., ::-1])
    )


def test_camera_info_becomes_the_camera(tmp_path: Path) -> None:
    topics = looking(image="/i"), looking(image="/i", rectified=True)
    for i, one in enumerate(topics):
        found = seen(tmp_path / str(i), one, ("/i", ros.IMAGE, START, raw("rgb8", PIXELS)))
        camera = found.log.calibration.cameras["front"]
        if one.cameras["front"].rectified:
            assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == (90.0, 95.0, 20.5, 14.5)
            assert not any(camera.distortion)
        else:
            assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == (100.0, 110.0, 24.0, 16.0)
            assert camera.distortion == (0.1, 0.2, 0.01, 0.02, 0.0)
        assert found.log.calibration.T_ego_sensor["front"].translation_m == pytest.approx([1.0, 0.5, 0.0])


def test_boxes_are_paired_with_their_image_by_the_stamp(tmp_path: Path) -> None:
    sent: list[Written] = []
    for i in range(4):
        t_ns = START + i * 10**8
        if i != 1:  # one image was lost
            sent.append(("/i", ros.IMAGE, t_ns + 10**6, raw("rgb8", PIXELS, t_ns)))
        sent.append(("/d", ros.DETECTIONS, t_ns + 10**7, boxes(t_ns, ("car", "3", 0.5))))
    found = seen(tmp_path, looking(image="/i", detections="/d"), *sent).log.messages
    images = {m.stamp_ns: m.seq for m in found if isinstance(m, CameraImage)}
    boxed = {m.stamp_ns: m.seq for m in found if isinstance(m, Detections)}
    assert len(images) == 3 and len(boxed) == 4
    assert all(boxed[stamp] == seq for stamp, seq in images.items())
    assert sorted(boxed.values()) == [0, 1, 2, 3]


def test_classes_and_tracks_of_others_become_ours(tmp_path: Path) -> None:
    first = boxes(
        START,
        ("person", "7", 0.9),
        ("2", "track-a", 0.8),
        ("bus", "9", 0.7),
        ("", "1", 0.0),
        ("car", "", 0.6),
    )
    second = boxes(START + 10**8, ("car", "track-a", 0.8), ("0", "007", 0.5), ("car", "-1", 0.5))
    found = seen(
        tmp_path, looking(detections="/d"), ("/d", ros.DETECTIONS, START, first),
        ("/d", ros.DETECTIONS, START + 10**8, second),
    )  # fmt: skip
    one, two = (m.boxes for m in found.log.messages if isinstance(m, Detections))
    assert [(b.category, b.confidence) for b in one] == [("pedestrian", 0.9), ("car", 0.8), ("car", 0.6)]
    assert one[0].track_id == 7 and one[0].box_px == (8.0, 9.0, 12.0, 15.0)
    assert one[1].track_id == two[0].track_id  # the same text
    ids = [b.track_id for b in (*one, *two)]
    assert len(set(ids)) == 5 and all(i < 0 for i in set(ids) - {7})
    assert found.notes == (
        "1 boxes of the class 'bus' were left out: it is none of the categories",
        "1 boxes of front have no class and were left out",
        "1 boxes of front have no track and got one each",
    )
