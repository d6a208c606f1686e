"""Pictures, ids and depth by MuJoCo's OpenGL renderer, without a display."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from simbench.axes import mujoco_camera, vertical_fov_deg
from simbench.motion import Motion
from simbench.sensors import gl
from simbench.world import EXTENT_M, SUN_DIRECTION, World

MAX_GEOMS = 4000


class Renderer:
    """One OpenGL context for one world. Raises `gl.RenderingUnavailable` where nothing can draw.

    Use as a context manager; it must be closed in the thread that made it.
    """

    def __init__(self, world: World, fine: bool = False) -> None:
        """`fine`: round things rounder and shadows sharper, at three times the cost (stills, comparisons)."""
        found = gl.provision()
        gl.use(found.name)  # another choice may have been made in this process since
        import mujoco

        self._mujoco = mujoco
        self.world = world
        self.model = world.model
        self.data = mujoco.MjData(self.model)
        quality = self.model.vis.quality
        quality.shadowsize = 4096 if fine else 1024
        quality.numslices, quality.numstacks = (48, 32) if fine else (12, 8)
        self._context_gl = mujoco.GLContext(16, 16)
        self._context_gl.make_current()
        try:
            self._context = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            self._context_gl.free()
            raise gl.RenderingUnavailable(
                f"MuJoCo cannot draw with {found.name} in this process: {error}; let rays take the pictures "
                "(--images raycast)"
            ) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self.model, MAX_GEOMS)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 1
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = 0
        self._object_of_geom = np.full(self.model.ngeom + 1, -1, dtype=np.int32)
        self._object_of_geom[world.geom_model_id + 1] = world.geom_object

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.free()
        self._context_gl.free()

    def _pose(self, motion: Motion, t_ns: int, T_world_camera: Transform, camera: PinholeCamera) -> Any:
        mujoco, model, data = self._mujoco, self.model, self.data
        place(data, motion, t_ns)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        # The sun shines on what the camera looks at: its shadow map covers EXTENT_M around that point.
        ahead = T_world_camera.translation_m + 0.45 * EXTENT_M * T_world_camera.rotation[:, 2]
        data.light_xpos[0] = ahead - 80.0 * np.array(SUN_DIRECTION)
        model.cam_fovy[0] = vertical_fov_deg(camera)
        data.cam_xpos[0], data.cam_xmat[0] = mujoco_camera(T_world_camera)
        mujoco.mjv_updateScene(
            model, data, self._option, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        return mujoco.MjrRect(0, 0, camera.width_px, camera.height_px)

    def rgb(
        self, motion: Motion, t_ns: int, T_world_camera: Transform, camera: PinholeCamera
    ) -> UInt8[np.ndarray, "h w 3"]:
        """The picture at true time t_ns from an optical pose; an undistorted pinhole, global shutter."""
        rect = self._pose(motion, t_ns, T_world_camera, camera)
        self._scene.flags[self._mujoco.mjtRndFlag.mjRND_SHADOW] = 1
        self._scene.flags[self._mujoco.mjtRndFlag.mjRND_SKYBOX] = 1
        self._mujoco.mjr_render(rect, self._scene, self._context)
        picture = np.empty((camera.height_px, camera.width_px, 3), dtype=np.uint8)
        self._mujoco.mjr_readPixels(picture, None, rect, self._context)
        return picture[::-1]

    def ids_and_depth(
        self, motion: Motion, t_ns: int, T_world_camera: Transform, camera: PinholeCamera
    ) -> tuple[Int32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
        """Object id per pixel (-1: ground or nothing) and depth along the optical axis in metres (inf:
        sky)."""
        mujoco = self._mujoco
        rect = self._pose(motion, t_ns, T_world_camera, camera)
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT], flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1, 1
        flags[mujoco.mjtRndFlag.mjRND_SHADOW], flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0, 0
        try:
            mujoco.mjr_render(rect, self._scene, self._context)
            code = np.empty((camera.height_px, camera.width_px, 3), dtype=np.uint8)
            buffer = np.empty((camera.height_px, camera.width_px), dtype=np.float32)
            mujoco.mjr_readPixels(code, buffer, rect, self._context)
        finally:
            flags[mujoco.mjtRndFlag.mjRND_SEGMENT], flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0, 0
        number = code[::-1].astype(np.int32) @ np.array([1, 256, 65536], dtype=np.int32)
        geom_of = np.full(self._scene.ngeom + 1, 0, dtype=np.int32)
        for i in range(self._scene.ngeom):
            geom = self._scene.geoms[i]
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geom_of[geom.segid + 1] = geom.objid + 1
        extent = self.model.stat.extent
        near, far = self.model.vis.map.znear * extent, self.model.vis.map.zfar * extent
        reverse = buffer[::-1]
        with np.errstate(divide="ignore"):
            depth = _metres(reverse, near, far)
        return self._object_of_geom[geom_of[number]], depth


def _metres(buffer: np.ndarray, near_m: float, far_m: float) -> Float32[np.ndarray, "h w"]:
    """MuJoCo's depth buffer (as mjr_readPixels gives it, 0 near to 1 far) as metres; inf at the far plane."""
    z = buffer.astype(np.float64)
    depth = near_m / (1.0 - z * (1.0 - near_m / far_m))
    return np.where(z >= 1.0 - 1e-7, np.inf, depth).astype(np.float32)


def place(data: Any, motion: Motion, t_ns: int) -> None:
    """Set MuJoCo's mocap bodies and joints to the motion's state at one instant."""
    import mujoco

    t = np.array([t_ns], dtype=np.int64)
    rotation, position = motion.poses(t)
    for actor in motion.world.actors:
        data.mocap_pos[actor.mocap] = position[0, actor.body]
        mujoco.mju_mat2Quat(data.mocap_quat[actor.mocap], rotation[0, actor.body].reshape(9))
    for row, body in enumerate(motion.world.bodies):
        angle = motion.joint_angle_rad(row, t)
        if angle is not None and body.qpos >= 0:
            data.qpos[body.qpos] = angle[0]
