"""The messages of a recording as ROS messages. Times have the file's epoch added; lengths are in metres.

Two conventions differ. Pixels: the bench counts from the outer corner of the first pixel, a `CameraInfo` from
its centre, so half a pixel is taken off cx and cy. Boxes: a `BoundingBox2D` is a centre and a size, from
which corners come back to 1e-12 px only; they are written a second time, as they are. Boxes count from the
outer corner, as detectors do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from simbench.formats.ros2.cdr import Message
from simbench.formats.ros2.names import EGO, S_TO_NS
from simbench.formats.ros2.rotation import quaternions_of

HALF_PX = 0.5
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "ring"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2"],
        "offsets": [0, 4, 8, 12, 16, 20],
        "itemsize": 24,
    }
)
_FIELDS = [
    # the last: the type, by sensor_msgs/PointField
    {"name": name, "offset": offset, "datatype": datatype, "count": 1}
    for name, offset, datatype in (
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("t", 16, 6), ("ring", 20, 4),
    )
]  # fmt: skip


def stamp(t_ns: int) -> Message:
    """A time as builtin_interfaces/Time."""
    return {"sec": t_ns // S_TO_NS, "nanosec": t_ns % S_TO_NS}


def header(t_ns: int, frame: str) -> Message:
    return {"stamp": stamp(t_ns), "frame_id": frame}


def cloud(scan: LidarScan, epoch_ns: int) -> Message:
    """A sweep as sensor_msgs/PointCloud2: one row, in firing order. A ring of -1 (unknown) is 65535."""
    points = np.zeros(len(scan.xyz_m), dtype=POINT)
    points["x"], points["y"], points["z"] = scan.xyz_m.T
    points["intensity"] = scan.intensity
    points["t"] = scan.offset_ns.view(np.uint32)
    points["ring"] = scan.ring.view(np.uint16)
    return {
        "header": header(scan.stamp_ns + epoch_ns, scan.sensor),
        "height": 1, "width": len(points), "fields": _FIELDS, "point_step": POINT.itemsize,
        "row_step": points.nbytes, "data": points.tobytes(), "is_dense": True,
    }  # fmt: skip


def picture(image: CameraImage, epoch_ns: int) -> Message:
    """An image as sensor_msgs/CompressedImage: PNG, without loss."""
    import cv2

    done, data = cv2.imencode(".png", image.rgb[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return {
        "header": header(image.stamp_ns + epoch_ns, image.sensor), "format": "png", "data": data.tobytes()
    }  # fmt: skip


def camera_info(camera: PinholeCamera, t_ns: int, frame: str) -> Message:
    """Intrinsics as sensor_msgs/CameraInfo. t_ns: with the epoch."""
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px - HALF_PX, camera.cy_px - HALF_PX
    return {
        "header": header(t_ns, frame),
        "height": camera.height_px, "width": camera.width_px,
        "distortion_model": "plumb_bob", "d": camera.distortion,
        "k": (fx, 0, cx, 0, fy, cy, 0, 0, 1),
        "r": np.eye(3).ravel(),
        "p": (fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0),
    }  # fmt: skip


def detections(found: Detections, epoch_ns: int) -> Message:
    """Boxes as vision_msgs/Detection2DArray; the track's number is the detection's id."""
    head = header(found.stamp_ns + epoch_ns, found.sensor)
    boxes = []
    for box in found.boxes:
        x0, y0, x1, y1 = box.box_px
        centre = {"position": {"x": 0.5 * (x0 + x1), "y": 0.5 * (y0 + y1)}}
        hypothesis = {"class_id": box.category, "score": box.confidence}
        boxes.append({
            "header": head, "id": str(box.track_id),
            "results": [{"hypothesis": hypothesis, "pose": {"pose": {"orientation": {"w": 1.0}}}}],
            "bbox": {"center": centre, "size_x": x1 - x0, "size_y": y1 - y0},
        })  # fmt: skip
    return {"header": head, "detections": boxes}


def corners(found: Detections) -> Message:
    """The corners of the same boxes, exactly, as std_msgs/Float64MultiArray [n 4]: x0, y0, x1, y1."""
    flat = np.array([box.box_px for box in found.boxes], dtype=np.float64).ravel()
    rows: list[Message] = [
        {"label": "box", "size": len(found.boxes), "stride": len(flat)},
        {"label": "x0 y0 x1 y1", "size": 4, "stride": 4},
    ]
    return {"layout": {"dim": rows}, "data": flat}


def imu(motion: EgoMotion, epoch_ns: int) -> Message:
    """Gyro and accelerometer as sensor_msgs/Imu in the ego's axes; there is no orientation (-1)."""
    return {
        "header": header(motion.stamp_ns + epoch_ns, EGO),
        "orientation": {"w": 1.0},
        "orientation_covariance": (-1, 0, 0, 0, 0, 0, 0, 0, 0),
        "angular_velocity": vector(motion.rate_radps),
        "linear_acceleration": vector(motion.specific_force_mps2),
    }


def velocity(motion: EgoMotion, epoch_ns: int) -> Message:
    """The odometer as geometry_msgs/TwistStamped in the ego's axes."""
    return {
        "header": header(motion.stamp_ns + epoch_ns, EGO),
        "twist": {"linear": vector(motion.velocity_mps)},
    }


def transform(T_parent_child: Transform, t_ns: int, parent: str, child: str) -> Message:
    """A pose as geometry_msgs/TransformStamped. t_ns: with the epoch."""
    quaternion = quaternions_of(T_parent_child.rotation[None])[0]
    return placed(T_parent_child.translation_m, quaternion, t_ns, parent, child)


def placed(xyz_m: Any, quaternion: Any, t_ns: int, parent: str, child: str) -> Message:
    """The same of a translation [3] and a quaternion [4]."""
    return {
        "header": header(t_ns, parent),
        "child_frame_id": child,
        "transform": {"translation": vector(xyz_m), "rotation": rotation(quaternion)},
    }


def rotation(quaternion: Any) -> Message:
    """A quaternion [4] as geometry_msgs/Quaternion."""
    x, y, z, w = quaternion
    return {"x": x, "y": y, "z": z, "w": w}


def vector(xyz: Any) -> Message:
    """Three numbers as geometry_msgs/Vector3 or Point."""
    x, y, z = xyz
    return {"x": x, "y": y, "z": z}
