"""The wheel runs outside the clone: offline, with package and home read-only, also for root."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("fusion", "scenarios", "simbench")
DATA = (".yaml", ".xml", ".json")

LIBC = ctypes.CDLL(None, use_errno=True)
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2


@dataclass(frozen=True, kw_only=True)
class Installed:
    """`packages`: what the wheel was unpacked to. `work`: the only folder that may be written."""

    wheel: Path
    packages: Path
    home: Path
    work: Path


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    base = tmp_path_factory.mktemp("install")
    source, packages, home, work = (base / name for name in ("source", "packages", "home", "work"))
    skip = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=skip)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(base)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (wheel,) = base.glob("simbench-*.whl")
    for folder in (home, work):
        folder.mkdir()
    with zipfile.ZipFile(wheel) as file:
        file.extractall(packages)
    shutil.rmtree(source)
    for folder in (packages, home):
        set_writable(folder, False)
    yield Installed(wheel=wheel, packages=packages, home=home, work=work)
    for folder in (packages, home):
        set_writable(folder, True)


def set_writable(folder: Path, writable: bool) -> None:
    for path in (folder, *folder.rglob("*")):
        mode = 0o755 if path.is_dir() else 0o644
        path.chmod(mode if writable else mode & ~0o222)


def obey_permissions() -> None:
    """In the child: root writes what it likes until it gives up these capabilities for what it executes."""
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        if os.geteuid() == 0 and LIBC.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), "cannot give up a capability of root")


# The child sees this environment's packages but not the clone, and has no network: any connection fails.
START = """
import socket, sys
def refuse(*_, **__): raise OSError("this test runs offline")
socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse
sys.path[:0] = [sys.argv.pop(1)]
sys.path.append(sys.argv.pop(1))
assert not any(path.startswith(CLONE) for path in sys.path[:-1]), sys.path
"""


def run(installed: Installed, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs code in a fresh interpreter whose only own packages are the installed ones."""
    site = sysconfig.get_paths()["purelib"]
    interpreter = str(Path(sys.executable).resolve())
    start = START.replace("CLONE", repr(str(ROOT)))
    return subprocess.run(
        [interpreter, "-I", "-S", "-c", start + code, str(installed.packages), site, *arguments],
        cwd=installed.work,
        env={
            "PATH": os.environ["PATH"],
            "HOME": str(installed.home),
            "PYTHONPATH": os.pathsep.join((str(installed.packages), site)),  # for its own children
            "TMPDIR": str(installed.work),
            "LANG": "C.UTF-8",
        },
        preexec_fn=obey_permissions,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )


def test_the_wheel_holds_all_code_and_data_and_nothing_else(installed: Installed) -> None:
    with zipfile.ZipFile(installed.wheel) as file:
        held = {name for name in file.namelist() if ".dist-info/" not in name}
    wanted = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.suffix in (".py", *DATA) and "__pycache__" not in path.parts
    }
    assert wanted <= held, wanted - held
    assert {name.split("/")[0] for name in held} == set(PACKAGES)


def test_our_pipelines_are_entry_points_that_exist(installed: Installed) -> None:
    code = """
from importlib.metadata import entry_points
found = entry_points(group="simbench.pipelines")
for entry in sorted(found, key=lambda e: e.name): print(entry.name, entry.load().__name__)
"""
    done = run(installed, code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "frustum_dbscan FrustumDbscan",
        "nearest_gap NearestGap",
        "probabilistic Probabilistic",
        "probabilistic_paper ProbabilisticPaper",
        "robust Robust",
        "roi_cluster RoiCluster",
        "shrunken_median ShrunkenMedian",
        "static_projection StaticProjection",
        "static_projection_ground StaticProjectionGround",
    ]


DEMO = "from simbench.cli import main; sys.argv[0] = 'simbench'; sys.exit(main())"


# The demo in one process, so that kernels are compiled once; then workers, which find them compiled.
@pytest.mark.parametrize(
    "words",
    [
        ("demo", "--seeds", "0", "--jobs", "1"),
        ("run", "overtake-approach", "--system", "car", "--seeds", "0-1", "--jobs", "2",
         "--pipeline", "static_projection", "--set", "systems.car.duration_s=0.6"),
    ],
    ids=["the demo", "a run by workers"],
)  # fmt: skip
def test_it_runs_from_the_wheel_offline_with_package_and_home_read_only(
    installed: Installed, words: tuple[str, ...]
) -> None:
    shutil.rmtree(installed.work / "out", ignore_errors=True)
    done = run(installed, DEMO, *words, "--images", "none", "--out", "out")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (installed.work / "out" / "result.json").is_file()
    assert (installed.work / "out" / "report.html").is_file()
    assert list(installed.home.iterdir()) == []


def test_the_child_can_really_not_write_there_nor_connect(installed: Installed) -> None:
    code = """
import os, pathlib, urllib.request
import simbench
for folder in (pathlib.Path(simbench.__file__).parent, pathlib.Path.home()):
    assert not os.access(folder, os.W_OK), folder
    try: (folder / "x").touch()
    except PermissionError: pass
    else: raise SystemExit("could write")
pathlib.Path("x").touch()
try: urllib.request.urlopen("http://example.invalid")
except OSError as error: print(error)
print(simbench.__file__)
"""
    done = run(installed, code)
    assert done.returncode == 0, done.stderr
    assert "offline" in done.stdout
    assert str(installed.packages) in done.stdout
