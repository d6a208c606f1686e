"""`simbench doctor` says what is there and what is missing, and its exit status says whether anything is."""

from __future__ import annotations

import dataclasses
import shutil
from collections import namedtuple

import numpy as np
import pytest

from simbench import doctor
from simbench.sensors import camera, gl

Usage = namedtuple("Usage", "total used free")
FOUND = gl.Renderer(
    name="osmesa", how="the system's OSMesa", gl="llvmpipe", probe_s=0.5, passed_over=("egl: no",)
)


@pytest.fixture(autouse=True)
def healthy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "provision", lambda: FOUND)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(9e9, 0, 9e9))
    monkeypatch.setattr(doctor, "_proc_value", lambda path, key: "8000000 kB" if "mem" in path else "a CPU")


def value(name: str) -> str:
    return next(finding.value for finding in doctor.report() if finding.name == name)


def test_where_nothing_is_missing_it_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor.main() == 0
    printed = capsys.readouterr().out
    assert printed.endswith("nothing is missing\n")
    for name in ("python", "cpu", "memory", "disk", "numpy", "mujoco", "pictures", "OpenGL", "driver"):
        assert f"ok       {name} " in printed


def test_a_fallback_of_opengl_is_not_silent() -> None:
    assert "osmesa: the system's OSMesa" in value("OpenGL")
    assert value("passed over") == "egl: no"


def nothing_draws() -> gl.Renderer:
    raise gl.RenderingUnavailable(f"nothing renders: {gl.INSTALL}")


def test_without_opengl_only_one_choice_of_images_is_absent_and_nothing_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gl, "provision", nothing_draws)
    assert doctor.main() == 0
    printed = capsys.readouterr().out
    (line,) = (line for line in printed.splitlines() if " OpenGL " in line and gl.INSTALL in line)
    assert line.startswith("absent ") and "only for --images gl" in line
    assert "ok       pictures " in printed
    assert printed.endswith("nothing is missing but OpenGL for --images gl\n")


def test_what_is_missing_is_not_hidden_by_what_is_absent(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gl, "provision", nothing_draws)
    monkeypatch.setattr(doctor, "PACKAGES", ("no-such-package",))
    assert doctor.main() == 1
    assert capsys.readouterr().out.endswith("missing: no-such-package\n")


def test_pictures_are_tried_not_believed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_picture(*_: object) -> camera.Frame:
        raise ImportError("no numba")

    monkeypatch.setattr(camera, "take", no_picture)
    assert doctor.main() == 1
    printed = capsys.readouterr().out
    assert "missing  pictures " in printed and "ImportError: no numba" in printed
    assert printed.endswith("missing: pictures\n")


@pytest.mark.parametrize("wrong", ["no board", "board elsewhere", "black"])
def test_a_wrong_picture_is_not_taken_for_a_picture(monkeypatch: pytest.MonkeyPatch, wrong: str) -> None:
    right = camera.take

    def spoiled(*arguments: object) -> camera.Frame:
        frame = right(*arguments)  # type: ignore[arg-type]
        changed: dict[str, np.ndarray] = {
            "no board": {"object_id": np.full_like(frame.object_id, -1)},
            "board elsewhere": {"depth_m": frame.depth_m + 1},
            "black": {"rgb": np.zeros_like(frame.rgb)},
        }[wrong]
        return dataclasses.replace(frame, **changed)

    doctor.take_picture()
    monkeypatch.setattr(camera, "take", spoiled)
    with pytest.raises(RuntimeError, match="does not show the board"):
        doctor.take_picture()


def test_a_full_disk_and_a_missing_package_are_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(9e9, 9e9, 1e6))
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package"))
    assert doctor.main() == 1
    assert capsys.readouterr().out.endswith("missing: disk, no-such-package\n")


def test_memory_is_read_in_units_of_1024_bytes() -> None:
    assert value("memory") == "8.2 GB available"


def test_little_memory_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_proc_value", lambda path, key: "1000000 kB")
    (memory,) = (finding for finding in doctor.report() if finding.name == "memory")
    assert not memory.ok
