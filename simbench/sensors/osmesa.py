"""OSMesa, Mesa's way of drawing without a display or a device: its library found, its contexts for MuJoCo.

By ctypes and not by PyOpenGL (as `mujoco.osmesa` does), because PyOpenGL loads libOSMesa by its plain file
name, which the library inside the wheel `lavavu-osmesa` does not have.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

WHEEL = "lavavu-osmesa"

_GL_UNSIGNED_BYTE, _OSMESA_RGBA = 0x1401, 0x1908


def load_system() -> ctypes.CDLL:
    """The system's libOSMesa, its symbols visible to MuJoCo. Raises OSError where there is none."""
    for file in ("libOSMesa.so.8", "libOSMesa.so.6"):
        try:
            return ctypes.CDLL(file, mode=ctypes.RTLD_GLOBAL)
        except OSError as error:
            reason = error
    raise reason


def load_wheel() -> ctypes.CDLL:
    """The libOSMesa inside the wheel, its symbols visible to MuJoCo. Raises OSError where there is none.

    The wheel's libraries name each other but not their folder, so each is loaded after those that it needs.
    """
    try:
        folder = Path(str(importlib.metadata.distribution(WHEEL).locate_file("lavavu_osmesa.libs")))
    except importlib.metadata.PackageNotFoundError:
        raise OSError(f"the Python package {WHEEL} is not installed") from None
    waiting, loaded = sorted(folder.glob("*.so*")), dict[str, ctypes.CDLL]()
    while waiting:
        stuck: list[Path] = []
        for path in waiting:
            try:
                loaded[path.name.split("-")[0]] = ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
            except OSError as error:
                stuck, reason = [*stuck, path], error
        if len(stuck) == len(waiting):
            raise reason
        waiting = stuck
    if "libOSMesa" not in loaded:
        raise OSError(f"the Python package {WHEEL} holds no libOSMesa")
    return loaded["libOSMesa"]


_current = threading.local()


def current() -> Context | None:
    """The context that this thread draws to, if it was not freed since."""
    context: Context | None = getattr(_current, "context", None)
    return context


class Context:
    """One drawing context, with the methods that `mujoco.Renderer` asks of a `GLContext`."""

    library: ctypes.CDLL
    _opengl_loaded = False

    def __init__(self, max_width: int, max_height: int) -> None:
        create = self.library.OSMesaCreateContextExt
        create.argtypes = [ctypes.c_uint, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_void_p]
        create.restype = ctypes.c_void_p
        self._context: int | None = create(_OSMESA_RGBA, 24, 8, 0, None)
        if not self._context:
            raise RuntimeError("OSMesa made no OpenGL context")
        self._size = (max_width, max_height)
        self._buffer = ctypes.create_string_buffer(4 * max_width * max_height)

    def make_current(self) -> None:
        if self._context is None:
            raise RuntimeError("this OpenGL context was freed")
        self._bind(self._context, self._buffer, *self._size)
        _current.context = self
        if not Context._opengl_loaded:
            Context._opengl_loaded = True
            _load_opengl()

    @contextmanager
    def as_current(self) -> Iterator[None]:
        """Current inside the block; afterwards the one that was. A freed context changes nothing."""
        before = current()
        if self._context is not None:
            self.make_current()
        try:
            yield
        finally:
            if before is not None and before is not self:
                before.make_current()

    def free(self) -> None:
        if self._context is not None:
            if current() is self:
                self._bind(None, None, 0, 0)
                _current.context = None
            self.library.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
            self.library.OSMesaDestroyContext(self._context)
            self._context = None

    def __del__(self) -> None:
        if getattr(self, "_context", None) is not None:
            self.free()

    def _bind(self, context: int | None, buffer: Any, width: int, height: int) -> None:
        bind = self.library.OSMesaMakeCurrent
        bind.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
        bind.restype = ctypes.c_ubyte
        if not bind(context, buffer, _GL_UNSIGNED_BYTE, width, height):
            raise RuntimeError("OSMesa did not make the OpenGL context current")


@contextmanager
def mujoco_gl(value: str) -> Iterator[None]:
    """MUJOCO_GL has this value inside the block, and the one it had (or none) after it."""
    before = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = before


def _load_opengl() -> None:
    """MuJoCo loads OpenGL's functions once, at its first drawing context, and asks MUJOCO_GL where from."""
    import mujoco

    with mujoco_gl("osmesa"):
        model = mujoco.MjModel.from_xml_string("<mujoco/>")
        mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50).free()
