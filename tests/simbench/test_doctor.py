"""`simbench doctor` says what is there and what is missing, and its exit status says whether anything is."""

from __future__ import annotations

import shutil
from collections import namedtuple

import pytest

from simbench import doctor
from simbench.sensors import gl

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
    for name in ("python", "cpu", "memory", "disk", "numpy", "mujoco", "renderer", "OpenGL"):
        assert f"ok       {name} " in printed


def test_a_fallback_of_the_renderer_is_not_silent() -> None:
    assert "osmesa: the system's OSMesa" in value("renderer")
    assert value("passed over") == "egl: no"


def test_without_a_renderer_it_names_what_to_install_and_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def provision() -> gl.Renderer:
        raise gl.RenderingUnavailable(f"nothing renders: {gl.INSTALL}")

    monkeypatch.setattr(gl, "provision", provision)
    assert doctor.main() == 1
    printed = capsys.readouterr().out
    assert gl.INSTALL in printed
    assert printed.endswith("missing: renderer\n")


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
