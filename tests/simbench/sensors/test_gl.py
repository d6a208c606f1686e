"""The renderer is found in the given order, proved in a child, and passed on to children."""

from __future__ import annotations

import ctypes
import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from simbench.sensors import gl, osmesa

Probe = Callable[[gl.Name], gl.Outcome]


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Nothing found yet, nothing inherited, no wish of the user; this process's MuJoCo is left alone."""
    monkeypatch.setattr(gl, "_found", None)
    monkeypatch.setattr(gl, "use", lambda name: None)
    for name in ("MUJOCO_GL", "LP_NUM_THREADS", gl.INHERITED):
        monkeypatch.setenv(name, "")  # so that it is restored, also where provision() sets it
        monkeypatch.delenv(name)
    yield


def working(*names: str) -> tuple[Probe, list[str]]:
    """A probe under which only these work, and the list of those that were asked."""
    asked: list[str] = []

    def probe(name: gl.Name) -> gl.Outcome:
        asked.append(name)
        return gl.Outcome(works=name in names, says="a driver" if name in names else "no library")

    return probe, asked


@pytest.mark.parametrize(
    ("request_", "works", "chosen", "asked"),
    [
        ("", ["egl", "osmesa", "osmesa-wheel"], "egl", ["egl"]),
        ("", ["osmesa", "osmesa-wheel"], "osmesa", ["egl", "osmesa"]),
        ("", ["osmesa-wheel"], "osmesa-wheel", ["egl", "osmesa", "osmesa-wheel"]),
        ("EGL ", ["egl"], "egl", ["egl"]),
        ("osmesa", ["egl", "osmesa"], "osmesa", ["osmesa"]),
        ("osmesa", ["egl", "osmesa-wheel"], "osmesa-wheel", ["osmesa", "osmesa-wheel"]),
        ("glfw", ["egl", "glfw"], "glfw", ["glfw"]),
    ],
)
def test_the_first_that_works_in_the_documented_order_is_taken(
    monkeypatch: pytest.MonkeyPatch, request_: str, works: list[str], chosen: str, asked: list[str]
) -> None:
    probe, seen = working(*works)
    monkeypatch.setattr(gl, "probe", probe)
    monkeypatch.setenv("MUJOCO_GL", request_)
    found = gl.provision()
    assert (found.name, seen) == (chosen, asked)
    assert [text.split(":")[0] for text in found.passed_over] == asked[:-1]
    assert ("by MUJOCO_GL" in found.how) == bool(request_)
    assert os.environ["MUJOCO_GL"] == request_
    assert os.environ["LP_NUM_THREADS"] == "0"


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ("", gl.INSTALL),
        ("egl", gl.INSTALL),
        ("off", "turns rendering off"),
        ("vulkan", "is not one of egl, osmesa, glfw"),
    ],
)
def test_what_cannot_be_had_is_said_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch, request_: str, says: str
) -> None:
    probe, _ = working()
    monkeypatch.setattr(gl, "probe", probe)
    monkeypatch.setenv("MUJOCO_GL", request_)
    with pytest.raises(gl.RenderingUnavailable) as caught:
        gl.provision()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("request_", "machine", "named"),
    [
        ("", "x86_64", True),
        ("osmesa", "x86_64", True),
        ("egl", "x86_64", False),
        ("", "aarch64", False),
    ],
)
def test_the_wheel_is_offered_where_it_exists_and_would_be_used(
    monkeypatch: pytest.MonkeyPatch, request_: str, machine: str, named: bool
) -> None:
    monkeypatch.setattr(gl, "probe", working()[0])
    monkeypatch.setattr(gl.platform, "machine", lambda: machine)
    monkeypatch.setenv("MUJOCO_GL", request_)
    with pytest.raises(gl.RenderingUnavailable) as caught:
        gl.provision()
    assert (gl.INSTALL_WHEEL in str(caught.value)) == named
    assert gl.INSTALL in str(caught.value)


def test_the_document_names_the_same_two_commands() -> None:
    text = (Path(gl._IMPORT_ROOT) / "docs" / "install.md").read_text(encoding="utf-8")
    assert f"`{gl.INSTALL}`" in text and f"`{gl.INSTALL_WHEEL}`" in text


def test_a_missing_wheel_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(osmesa, "WHEEL", "no-such-wheel")
    with pytest.raises(OSError, match="the Python package no-such-wheel is not installed"):
        osmesa.load_wheel()


def test_it_is_looked_for_once_per_process_and_not_again_in_children(monkeypatch: pytest.MonkeyPatch) -> None:
    probe, asked = working("osmesa")
    monkeypatch.setattr(gl, "probe", probe)
    found = gl.provision()
    assert gl.provision() is found
    monkeypatch.setattr(gl, "_found", None)  # as in a child: only the environment is left
    assert gl.provision() == dataclasses.replace(found, probe_s=0.0)
    assert asked == ["egl", "osmesa"]


def test_a_child_with_another_mujoco_gl_looks_for_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "probe", working("osmesa", "egl")[0])
    assert gl.provision().name == "egl"
    monkeypatch.setattr(gl, "_found", None)
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert gl.provision().name == "osmesa"


def test_the_users_number_of_llvmpipe_threads_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "probe", working("egl")[0])
    monkeypatch.setenv("LP_NUM_THREADS", "2")
    gl.provision()
    assert os.environ["LP_NUM_THREADS"] == "2"


@pytest.mark.parametrize(
    ("child", "works", "says"),
    [
        ("import os; os.kill(os.getpid(), 11)", False, "crashed (signal 11)"),
        ("raise SystemExit('draws a wrong picture')", False, "draws a wrong picture"),
        ("import time; time.sleep(60)", False, "did not draw within"),
        ("print('noise'); print('a driver')", True, "a driver"),
    ],
)
def test_a_driver_that_crashes_hangs_or_draws_wrong_is_reported(
    monkeypatch: pytest.MonkeyPatch, child: str, works: bool, says: str
) -> None:
    run = subprocess.run

    def instead(command: list[str], **options: object) -> object:
        return run([sys.executable, "-c", child], **options)  # type: ignore[call-overload]

    monkeypatch.setattr(gl, "PROBE_TIMEOUT_S", 5.0)
    monkeypatch.setattr(gl.subprocess, "run", instead)
    outcome = gl.probe("egl")
    assert outcome.works == works
    assert says in outcome.says


_PICTURE = """
import sys
if sys.argv[1] == "late": import mujoco
from simbench.sensors import gl
found = gl.provision()
import mujoco, numpy
model = mujoco.MjModel.from_xml_string('''<mujoco><worldbody><light pos="0 0 4"/>
  <geom type="plane" size="9 9 1" rgba=".3 .5 .4 1"/>
  <geom type="capsule" size=".3 .5" pos="0 0 1" euler="40 0 0"/>
  <camera pos="0 -4 2" xyaxes="1 0 0 0 .4 1"/></worldbody></mujoco>''')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 120, 160) as first, mujoco.Renderer(model, 120, 160) as renderer:
    first.update_scene(data, 0)
    renderer.update_scene(data, 0)
    picture = renderer.render().copy()
    assert (picture == first.render()).all() and picture.std() > 5
    renderer.enable_segmentation_rendering()
    ids = renderer.render()
numpy.savez(sys.argv[2], picture=picture, ids=ids, name=found.name)
"""


def draw(name: gl.Name, order: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Picture and ids that a fresh process draws, which imports MuJoCo first or late."""
    known = gl.Renderer(name=name, how="", gl="", probe_s=0)
    shared = json.dumps({"request": "", "renderer": dataclasses.asdict(known)})
    variables = {k: v for k, v in os.environ.items() if k not in ("PYOPENGL_PLATFORM", "MUJOCO_GL")}
    command = [sys.executable, "-c", _PICTURE, order, str(path)]
    variables |= {gl.INHERITED: shared, "PYTHONPATH": gl._IMPORT_ROOT}
    done = subprocess.run(command, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with np.load(path) as file:
        assert file["name"] == name
        return file["picture"].astype(int), file["ids"]


def can_be_expected_to_render() -> bool:
    """Whether there is OpenGL of some kind, asked in another way than by the probe."""
    if importlib.util.find_spec("lavavu") is not None:
        return True
    try:
        return bool(ctypes.CDLL("libEGL_mesa.so.0") and ctypes.CDLL("libGL.so.1"))
    except OSError:
        return False


def test_every_renderer_draws_the_same_picture_in_any_order_of_imports(tmp_path: Path) -> None:
    names: tuple[gl.Name, ...] = ("egl", "osmesa", "osmesa-wheel")
    available = [name for name in names if gl.probe(name).works]
    if not available:
        assert not can_be_expected_to_render()
        pytest.skip(f"nothing on this machine can render: {gl.INSTALL}")
    first = {name: draw(name, "first", tmp_path / f"{name}.npz") for name in available}
    for name, (picture, ids) in first.items():
        late_picture, late_ids = draw(name, "late", tmp_path / f"{name}-late.npz")
        assert np.array_equal(picture, late_picture), name
        assert np.array_equal(ids, late_ids), name
        reference, reference_ids = first[available[0]]
        assert np.mean(np.abs(picture - reference) <= 2) > 0.99, name  # drivers may round otherwise
        assert np.mean(ids == reference_ids) > 0.99, name


def test_an_osmesa_context_gives_way_to_the_one_that_was_current() -> None:
    try:
        library = osmesa.load_wheel()
    except OSError as error:
        pytest.skip(f"needs the wheel: {error}")
    osmesa.Context.library = library
    osmesa.Context._opengl_loaded = True  # MuJoCo of this process is left alone
    first, second = osmesa.Context(8, 8), osmesa.Context(8, 8)
    first.make_current()
    with second.as_current():
        assert osmesa.current() is second
    assert osmesa.current() is first
    second.free()
    assert osmesa.current() is first
    first.free()
    assert osmesa.current() is None
    with pytest.raises(RuntimeError, match="freed"):
        first.make_current()
    osmesa.Context._opengl_loaded = False


def test_mujoco_gl_is_restored_after_an_error() -> None:
    before = os.environ.get("MUJOCO_GL")
    with pytest.raises(KeyError), osmesa.mujoco_gl("osmesa"):
        assert os.environ["MUJOCO_GL"] == "osmesa"
        raise KeyError
    assert os.environ.get("MUJOCO_GL") == before
