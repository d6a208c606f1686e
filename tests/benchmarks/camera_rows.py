"""Six cameras at one instant: our rays against MuJoCo's OpenGL renderer, the same poses, one core."""

from __future__ import annotations

from contextlib import closing

import mujoco
import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from simbench.motion import Motion, at
from simbench.sensors.camera import Frame
from simbench.sensors.gl import RenderingUnavailable, provision
from simbench.sensors.render import Renderer
from tests.benchmarks import frames
from tests.benchmarks.clock import duel, milliseconds, one_core
from tests.benchmarks.size import Size
from tests.benchmarks.table import Measured, WrongAnswerError

FRAME = 26  # 2.6 s into the drive
SAME_IDS = 0.98  # OpenGL draws round things with 12 slices here, so edges differ


class RawRenderer(Renderer):
    """The renderer's drawing and reading without what Python makes of it."""

    def raw(
        self, motion: Motion, t_ns: int, pose: Transform, camera: PinholeCamera
    ) -> tuple[np.ndarray, ...]:
        """Drawn twice, lit and as ids: bytes [h w 3] of both and the depth buffer [h w] of the second, as
        they come (bottom row first, ids as colours, depth not in metres)."""
        rect = self._pose(motion, t_ns, pose, camera)
        flags, shape = self._scene.flags, (camera.height_px, camera.width_px)
        rgb, code = np.empty((*shape, 3), dtype=np.uint8), np.empty((*shape, 3), dtype=np.uint8)
        depth = np.empty(shape, dtype=np.float32)
        lit = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_SKYBOX)
        coded = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
        for flag in (*lit, *coded):
            flags[flag] = flag in lit
        mujoco.mjr_render(rect, self._scene, self._context)
        mujoco.mjr_readPixels(rgb, None, rect, self._context)
        for flag in (*lit, *coded):
            flags[flag] = flag in coded
        mujoco.mjr_render(rect, self._scene, self._context)
        mujoco.mjr_readPixels(code, depth, rect, self._context)
        for flag in coded:
            flags[flag] = 0
        return rgb, code, depth


def cameras_vs_gl(size: Size) -> Measured:
    """Time of OpenGL / ours. Raises WrongAnswerError where the two do not show the same objects."""
    session = frames.set_up(effects=False, image_px=size.image_px)
    with one_core():
        try:
            device = provision()
        except RenderingUnavailable as error:
            return Measured(value=None, notes=(f"cameras_vs_gl: {error}",))
        with closing(RawRenderer(session.motion.world)) as renderer:
            same = agreement(session, renderer)
            if min(same.values()) < SAME_IDS and size.image_px is None:
                worst = min(same, key=lambda name: same[name])
                raise WrongAnswerError(
                    f"{worst}: object ids of OpenGL and of ours agree on {same[worst]:.2%} only"
                )
            times = duel(lambda: six_ours(session), lambda: six_gl(session, renderer), size.turns)
    return Measured(
        value=times.ratio,
        ours=milliseconds(times.first_s),
        rival=milliseconds(times.second_s),
        notes=(
            f"OpenGL: {device.gl} by {device.how}; drawing and reading only, ids and depth not decoded; its "
            f"ids are ours on {min(same.values()):.2%} or more of the pixels of each camera",
        ),
    )


def six_ours(session: frames.Session) -> dict[str, Frame]:
    """All six by rays."""
    return {name: frames.picture(session, name, FRAME) for name in session.cameras}


def six_gl(session: frames.Session, renderer: RawRenderer) -> list[tuple[np.ndarray, ...]]:
    """All six by OpenGL."""
    views = []
    for name, pinhole in session.pinholes.items():
        t_ns, pose = _when_and_where(session, name)
        views.append(renderer.raw(session.motion, t_ns, pose, pinhole))
    return views


def _when_and_where(session: frames.Session, name: str) -> tuple[int, Transform]:
    t_ns = session.timing[name].mid_ns[FRAME : FRAME + 1]
    return int(t_ns[0]), at(session.motion.sensor(name, t_ns))


def agreement(session: frames.Session, renderer: Renderer) -> dict[str, float]:
    """By camera, the share of pixels to which OpenGL and our rays give the same object id."""
    shares = {}
    for name, frame in six_ours(session).items():
        t_ns, pose = _when_and_where(session, name)
        ids, _ = renderer.ids_and_depth(session.motion, t_ns, pose, session.pinholes[name])
        shares[name] = float(np.mean(frame.object_id == ids))
    return shares
