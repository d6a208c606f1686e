"""How the body turns against its path, or a bracket against the body: roll, pitch and yaw over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64

from scenarios.faults import FaultSpec, Flex, Knock
from simbench.capture import Captured
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, drive_of

CAMERA = "cam-front"
AXES = ("roll", "pitch", "yaw")
COLOURS = (palette.METHOD, palette.RAW, palette.RIGHT)
SAMPLES = 240
FLEX_S = 0.5  # a bracket bends at tens of hertz


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the bracket where the fault acts there, else of the body."""
    bracket = isinstance(spec, Flex | Knock)
    whose = f"{CAMERA} against the body" if bracket else "body against its path"
    was, now = drive_of(before[0]), drive_of(after[0])
    end_s = FLEX_S if isinstance(spec, Flex) else now.site.duration_s
    t_s = np.linspace(0.0, end_s, SAMPLES)
    one, two = _turn_deg(was, t_s, bracket), _turn_deg(now, t_s, bracket)

    def paint(figure: Any) -> None:
        axes = figure.subplots()
        for name, colour, column in zip(AXES, COLOURS, two.T, strict=True):
            axes.plot(t_s, column, color=colour, linewidth=1.3, label=f"{name}, with")
        for column in one.T:
            axes.plot(t_s, column, color=palette.CLEAN, linewidth=1.3, linestyle=(0, (4, 3)))
        axes.plot([], [], color=palette.CLEAN, linewidth=1.3, linestyle=(0, (4, 3)), label="all, without")
        axes.set_xlim(0.0, end_s)
        axes.set_xlabel("true time (s)")
        axes.set_ylabel(f"{whose}\n(deg)", fontsize=9)
        axes.grid(visible=True, axis="y")
        axes.tick_params(length=0)
        axes.legend(ncols=4, loc="lower left", bbox_to_anchor=(-0.02, 0.98), fontsize=8.5, handlelength=1.4,
                    columnspacing=1.2)  # fmt: skip

    return Sketch(before={"turn": one}, after={"turn": two}, paint=paint, height=190.0)


def _turn_deg(drive: Captured, t_s: Float64[np.ndarray, " n"], bracket: bool) -> Float64[np.ndarray, "n 3"]:
    """Roll, pitch and yaw about the ego's axes."""
    from scipy.spatial.transform import Rotation

    motion, t_ns = drive.motion, np.round(1e9 * t_s).astype(np.int64)
    body, _ = motion.shaken_ego(t_ns)
    if bracket:
        camera, _ = motion.sensor(CAMERA, t_ns)
        turned = np.swapaxes(body, 1, 2) @ camera @ motion.T_ego_sensor[CAMERA].rotation.T
    else:
        path, _ = motion.ego(t_ns)
        turned = np.swapaxes(path, 1, 2) @ body
    angles: np.ndarray = Rotation.from_matrix(turned).as_euler("ZYX", degrees=True)[:, ::-1]
    return np.round(angles, 6)  # below what the arithmetic of two platforms agrees on
