"""A Foxglove layout for a recording: the scene from behind the ego, and every camera's image with the points
and true boxes drawn over it.

In Foxglove: open the `.mcap` file, then Layouts, "Import from file...". It is what Foxglove exports: the
settings of each panel by its id (`TYPE!id`), and a tree that cuts the window in two again and again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusion.messages import CameraImage, LidarScan
from simbench.files import write_text
from simbench.formats.ros2.names import (
    EGO,
    TRUTH_MARKERS,
    TRUTH_REFERENCE,
    image_topic,
    info_topic,
    points_topic,
)
from simbench.recording import Recording

SCENE = "3D!scene"


def layout(recording: Recording) -> dict[str, Any]:
    """The layout as plain JSON values. Image panels are there for cameras that delivered images."""
    lidars = sorted({m.sensor for m in recording.messages if isinstance(m, LidarScan)})
    pictured = {m.sensor for m in recording.messages if isinstance(m, CameraImage)}
    cameras = [name for name in recording.calibration.cameras if name in pictured]
    shown: dict[str, Any] = {points_topic(name): _cloud() for name in lidars}
    shown[TRUTH_MARKERS] = {"visible": True}
    panels: dict[str, Any] = {SCENE: _scene(shown | {TRUTH_REFERENCE: {"visible": True}})}
    panels |= {f"Image!{name}": _image(name, shown) for name in cameras}
    images = [name for name in panels if name != SCENE]
    whole: Any = SCENE
    if images:
        whole = _split("row", SCENE, _stack("column", images), 60)
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": whole,
    }


def write_layout(recording: Recording, path: Path) -> None:
    """Write the layout as a file. BadInput where the place cannot be written."""
    write_text(path, json.dumps(layout(recording), indent=1) + "\n")


def _scene(topics: dict[str, Any]) -> dict[str, Any]:
    return {
        "cameraState": {
            "perspective": True, "distance": 40, "phi": 60, "thetaOffset": 90, "targetOffset": [8, 0, 0],
            "target": [0, 0, 0], "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.5, "far": 5000,
        },
        "followMode": "follow-pose",
        "followTf": EGO,
        "scene": {},
        "transforms": {},
        "topics": topics,
        "layers": {
            "grid": {
                "visible": True, "frameLocked": True, "label": "Grid", "instanceId": "grid",
                "layerId": "foxglove.Grid", "size": 60, "divisions": 12, "lineWidth": 1, "color": "#248eff80",
                "position": [0, 0, 0], "rotation": [0, 0, 0], "order": 1, "frameId": EGO,
            }
        },
        "imageMode": {},
    }  # fmt: skip


def _image(camera: str, topics: dict[str, Any]) -> dict[str, Any]:
    return {
        "cameraState": {},
        "followMode": "follow-pose",
        "scene": {},
        "transforms": {},
        "topics": topics,
        "layers": {},
        "imageMode": {"imageTopic": image_topic(camera), "calibrationTopic": info_topic(camera)},
        "foxglovePanelTitle": camera,
    }


def _cloud() -> dict[str, Any]:
    return {
        "visible": True, "colorField": "intensity", "colorMode": "colormap", "colorMap": "turbo",
        "pointSize": 2, "decayTime": 0,
    }  # fmt: skip


def _stack(direction: str, panels: Sequence[str]) -> Any:
    """All panels with the same share of the room."""
    if len(panels) == 1:
        return panels[0]
    rest = _stack(direction, panels[1:])
    return _split(direction, panels[0], rest, round(100 / len(panels), 1))


def _split(direction: str, first: Any, second: Any, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
