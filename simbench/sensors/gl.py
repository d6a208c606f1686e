"""Which OpenGL draws the pictures: found once, proved by drawing in a child process, said aloud.

`provision()` tries, in this order: what the user's MUJOCO_GL names (and nothing else, if it names one); EGL;
the system's OSMesa; the Mesa inside the wheel `lavavu-osmesa`, where that is installed. Afterwards
`mujoco.Renderer` and `mujoco.GLContext` draw with the one found, whether MuJoCo was imported before or not.
The choice goes to child processes by an environment variable: they do not probe again.

MUJOCO_GL itself is left as the user set it: MuJoCo imports PyOpenGL according to it, and PyOpenGL cannot load
the wheel's Mesa by its file name, so that a worker with MUJOCO_GL=osmesa would fail at `import mujoco`.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import platform
import subprocess
import sys
import textwrap
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from simbench.sensors import osmesa
from simbench.sensors.osmesa import WHEEL, mujoco_gl

Name = Literal["egl", "osmesa", "osmesa-wheel", "glfw"]

INHERITED = "SIMBENCH_GL"  # the parent's Renderer as JSON, and the MUJOCO_GL it was found under
INSTALL = "apt-get install --no-install-recommends libegl1 libgl1"
INSTALL_WHEEL = f"pip install --no-deps {WHEEL}"  # its requirements hold Jupyter, and drawing needs none
PROBE_TIMEOUT_S = 60.0

_IMPORT_ROOT = str(Path(__file__).parents[2])
_GL_RENDERER, _GL_VERSION = 0x1F01, 0x1F02
_OSMESA = {"osmesa": osmesa.load_system, "osmesa-wheel": osmesa.load_wheel}

_AUTOMATIC = ("", "enable", "enabled", "on", "true", "1")
_OFF = ("disable", "disabled", "off", "false", "0")
_BY_REQUEST: dict[str, tuple[Name, ...]] = {
    **dict.fromkeys(_AUTOMATIC, ("egl", "osmesa", "osmesa-wheel")),
    "egl": ("egl",),
    "osmesa": ("osmesa", "osmesa-wheel"),
    "glfw": ("glfw",),
    "glx": ("glfw",),
}
_HOW: dict[Name, str] = {
    "egl": "the system's EGL",
    "osmesa": "the system's OSMesa",
    "osmesa-wheel": f"the Mesa inside the Python package {WHEEL}",
    "glfw": "a window of the display (GLFW)",
}


class RenderingUnavailable(RuntimeError):  # noqa: N818  (a state of the machine)
    """Nothing on this machine can draw. The message is one sentence that says what to install."""


@dataclass(frozen=True, kw_only=True)
class Renderer:
    """What draws. `passed_over`: a sentence for each choice that was tried before it and cannot draw."""

    name: Name
    how: str
    gl: str  # vendor, device and version, as the driver names itself
    probe_s: float  # time this process spent on finding it; 0 in a child of the process that did
    passed_over: tuple[str, ...] = ()


_found: Renderer | None = None


def provision() -> Renderer:
    """Finds what can draw and makes MuJoCo use it. The first call takes about a second, later ones nothing.

    Raises RenderingUnavailable: nothing can draw, or not what the user's MUJOCO_GL names.
    """
    global _found
    if _found is None:
        os.environ.setdefault("LP_NUM_THREADS", "0")  # llvmpipe: one thread each, the bench runs processes
        request = os.environ.get("MUJOCO_GL", "").lower().strip()
        renderer = _inherited(request) or _find(request)
        shared = {"request": request, "renderer": asdict(renderer)}
        os.environ[INHERITED] = json.dumps(shared)
        use(renderer.name)
        _found = renderer
    return _found


def _inherited(request: str) -> Renderer | None:
    """The parent process's finding, if it holds for the same MUJOCO_GL."""
    text = os.environ.get(INHERITED)
    if text is None:
        return None
    shared = json.loads(text)
    if shared["request"] != request:
        return None
    fields = shared["renderer"]
    if fields["name"] not in get_args(Name):
        raise ValueError(f"{INHERITED} names the unknown renderer {fields['name']!r}; unset it")
    return Renderer(**{**fields, "probe_s": 0.0, "passed_over": tuple(fields["passed_over"])})


def _find(request: str) -> Renderer:
    if request in _OFF:
        raise RenderingUnavailable(
            f"MUJOCO_GL={request} turns rendering off; unset it, or let rays take the pictures "
            "(--images raycast)."
        )
    if request not in _BY_REQUEST:
        raise RenderingUnavailable(
            f"MUJOCO_GL={request} is not one of egl, osmesa, glfw; unset it to let simbench choose."
        )
    started = time.perf_counter()
    refused: list[str] = []
    for name in _BY_REQUEST[request]:
        outcome = probe(name)
        if outcome.works:
            return Renderer(
                name=name,
                how=_HOW[name] + (f", by MUJOCO_GL={request}" if request not in _AUTOMATIC else ""),
                gl=outcome.says,
                probe_s=time.perf_counter() - started,
                passed_over=tuple(refused),
            )
        refused.append(f"{name}: {outcome.says}")
    wished = "" if request in _AUTOMATIC else f" with MUJOCO_GL={request}"
    raise RenderingUnavailable(
        f"nothing here can render{wished} ({'; '.join(refused)}): install OpenGL {_remedies(request)}, "
        "or let rays take the pictures (--images raycast)."
    )


def _remedies(request: str) -> str:
    """How to install what this MUJOCO_GL can draw with."""
    wheel_helps = "osmesa-wheel" in _BY_REQUEST[request] and platform.machine() == "x86_64"
    without_root = f" or without root with `{INSTALL_WHEEL}`" if wheel_helps else ""
    return f"as root with `{INSTALL}`{without_root}"


# -- the probe ------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of one probe: `says` is the driver's name where it works, else the reason in a few words."""

    works: bool
    says: str


def probe(name: Name) -> Outcome:
    """Draws a small scene in a child process, which a bad driver may crash, and looks at the picture."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "simbench.sensors.gl", name],
            capture_output=True,
            text=True,
            timeout=PROBE_TIMEOUT_S,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([_IMPORT_ROOT, *filter(None, sys.path)])},
        )
    except subprocess.TimeoutExpired:
        return Outcome(works=False, says=f"did not draw within {PROBE_TIMEOUT_S:.0f} s")
    if done.returncode == 0:
        return Outcome(works=True, says=done.stdout.strip().splitlines()[-1])
    if done.returncode < 0:
        return Outcome(works=False, says=f"the driver crashed (signal {-done.returncode})")
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    return Outcome(works=False, says=textwrap.shorten(last.rstrip("."), 160, placeholder=" ..."))


_SCENE = """
<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual><worldbody>
<geom type="box" size="1 1 .1" rgba="1 0 0 1"/><camera pos="0 0 3" fovy="45"/></worldbody></mujoco>
"""


def probe_here() -> None:
    """In the child: prints the driver's name, or fails unless a red plate is drawn red and 2.9 m away."""
    name = cast(Name, sys.argv[-1])
    use(name)
    import mujoco

    model = mujoco.MjModel.from_xml_string(_SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 48, 64) as renderer:
        renderer.update_scene(data, 0)
        red, green, blue = (int(c) for c in renderer.render()[24, 32])
        renderer.enable_depth_rendering()
        depth_m = float(renderer.render()[24, 32])
        if red < 200 or max(green, blue) > 20 or abs(depth_m - 2.9) > 0.01:
            raise SystemExit(f"draws a wrong picture: {red, green, blue} at {depth_m:.3f} m")
        print(_driver_name(name), flush=True)


def _driver_name(name: Name) -> str:
    """GL_RENDERER and GL_VERSION of the current context."""
    if name == "glfw":
        import glfw

        address = glfw.get_proc_address("glGetString")
    else:
        find = (
            ctypes.CDLL("libEGL.so.1").eglGetProcAddress
            if name == "egl"
            else osmesa.Context.library.OSMesaGetProcAddress
        )
        find.argtypes, find.restype = [ctypes.c_char_p], ctypes.c_void_p
        address = find(b"glGetString")
    get = ctypes.cast(address, ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint))
    return ", ".join((get(which) or b"?").decode() for which in (_GL_RENDERER, _GL_VERSION))


# -- MuJoCo ---------------------------------------------------------------------------------------------


def use(name: Name) -> None:
    """Makes `mujoco.Renderer` and `mujoco.GLContext` of this process draw with `name`.

    Raises ImportError, AttributeError or OSError where its libraries are missing. MuJoCo loads OpenGL once
    per process: a second choice after the first picture has no effect.
    """
    with mujoco_gl("disabled"):  # a first import loads neither PyOpenGL nor GLFW
        import mujoco
        from mujoco.rendering.classic import gl_context
    context: Any = osmesa.Context
    if name == "egl":
        context = importlib.import_module("mujoco.egl").GLContext
    elif name == "glfw":
        context = importlib.import_module("mujoco.glfw").GLContext
    else:
        osmesa.Context.library = _OSMESA[name]()
    gl_context.GLContext = context
    mujoco.GLContext = context


if __name__ == "__main__":
    probe_here()
