"""What this machine offers to simbench, and what is missing: `simbench doctor`.

`report()` looks and returns data; `main()` prints it. That takes a few seconds: it takes a small picture by
rays and lets OpenGL draw one. The first picture after an install compiles the ray kernels.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from simbench.sensors import gl

PACKAGES = ("mujoco", "numpy", "scipy", "opencv-python-headless", "numba", "pydantic", "matplotlib", "av")
NEEDED_DISK_B = 1e9
NEEDED_MEMORY_B = 2e9
PICTURE_PX = (64, 40)
WAIT = "looking ... (the first time up to a minute: the ray kernels are compiled)"
BOARD_M = 7.5  # from the front camera of the scenario static-board to its board


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line. `ok` is false where something is missing; `value` then says what to do.

    only_for: what alone does not work without it; empty: everything needs it.
    """

    name: str
    value: str
    ok: bool = True
    only_for: str = ""

    @property
    def state(self) -> str:
        """`ok`, `missing`, or `absent` where only `only_for` needs it."""
        return "ok" if self.ok else "absent" if self.only_for else "missing"


def report() -> tuple[Finding, ...]:
    """All findings, in the order in which they are printed."""
    return (
        Finding(name="python", value=f"{platform.python_version()} ({sys.executable})"),
        Finding(name="system", value=f"{platform.system()} {platform.release()} {platform.machine()}"),
        _cpu(),
        _memory(),
        _disk(),
        *_packages(),
        _pictures(),
        *_opengl(),
        *_lock(),
    )


def _cpu() -> Finding:
    model = _proc_value("/proc/cpuinfo", "model name") or platform.processor() or "unknown"
    cores = len(os.sched_getaffinity(0))
    return Finding(name="cpu", value=f"{model}, {cores} core{'s' * (cores != 1)} for this process")


def _memory() -> Finding:
    text = _proc_value("/proc/meminfo", "MemAvailable")
    if text is None:
        return Finding(name="memory", value="unknown (no /proc/meminfo)")
    free_b = float(text.split()[0]) * 1024
    enough = free_b >= NEEDED_MEMORY_B
    advice = "" if enough else f"; the demo needs up to {_gb(NEEDED_MEMORY_B)}"
    return Finding(name="memory", value=f"{_gb(free_b)} available{advice}", ok=enough)


def _disk() -> Finding:
    free_b = shutil.disk_usage(Path.cwd()).free
    writable = os.access(Path.cwd(), os.W_OK)
    value = f"{_gb(free_b)} free in the working folder"
    if not writable:
        value += ", which is not writable: pass --out DIR"
    elif free_b < NEEDED_DISK_B:
        value += f"; {_gb(NEEDED_DISK_B)} are wise"
    return Finding(name="disk", value=value, ok=writable and free_b >= NEEDED_DISK_B)


def _packages() -> Iterable[Finding]:
    for name in PACKAGES:
        try:
            yield Finding(name=name, value=importlib.metadata.version(name))
        except importlib.metadata.PackageNotFoundError:
            yield Finding(name=name, value="missing; reinstall simbench", ok=False)


def _pictures() -> Finding:
    """Whether rays take pictures here, which is what everything but `--images gl` uses."""
    started = time.perf_counter()
    try:
        take_picture()
    except Exception as error:  # whatever it is: a doctor names it and goes on
        why = f"rays take no picture here ({type(error).__name__}: {error}); reinstall simbench"
        return Finding(name="pictures", value=why, ok=False)
    took_s = time.perf_counter() - started
    return Finding(name="pictures", value=f"by rays, without OpenGL; took a small one in {took_s:.1f} s")


def take_picture() -> None:
    """Takes a small picture by rays of a board 7.5 m ahead. Raises RuntimeError unless it shows the board."""
    from simbench.capture import set_in_motion  # here: where a package is missing, that is a finding
    from simbench.case import Job
    from simbench.sensors.camera import take
    from simbench.stage import stage

    staged = stage(Job(scenario="static-board", system="car", seed=0, pipelines=(), size_px=PICTURE_PX))
    motion, name = set_in_motion(staged.world, staged.rig, staged.system.ego, None), "cam-front"
    frame = take(motion, name, staged.rig.cameras[name], staged.rig.pinholes[name], 0, 0.0, None)
    board = staged.world.find("board")
    depth_m = frame.depth_m[frame.object_id == board.object_id]
    if not len(depth_m) or abs(depth_m - BOARD_M).max() > 0.5 or frame.rgb.std() < 5:
        raise RuntimeError("the picture does not show the board that stands before the camera")


def _opengl() -> Iterable[Finding]:
    only_for = "--images gl"
    try:
        found = gl.provision()
    except gl.RenderingUnavailable as error:
        yield Finding(name="OpenGL", value=f"only for {only_for}: {error}", ok=False, only_for=only_for)
        return
    how = f"{found.name}: {found.how}, found in {found.probe_s:.1f} s; only for {only_for}"
    yield Finding(name="OpenGL", value=how, only_for=only_for)
    yield Finding(name="driver", value=found.gl, only_for=only_for)
    for sentence in found.passed_over:
        yield Finding(name="passed over", value=sentence, only_for=only_for)


def _lock() -> Iterable[Finding]:
    """In a checkout: which lock it has."""
    lock = Path(__file__).resolve().parents[1] / "requirements.lock"
    if lock.is_file():
        with lock.open(encoding="utf-8") as file:
            first = file.readline().strip()
        yield Finding(
            name="lock", value=first.removeprefix("# ") or "requirements.lock is empty", ok=bool(first)
        )


def _proc_value(path: str, key: str) -> str | None:
    """The first value of `key` in a file of `key: value` lines; None where either is not there."""
    try:
        text = Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    for line in text.splitlines():
        name, _, value = line.partition(":")
        if name.strip() == key:
            return value.strip()
    return None


def _gb(count_b: float) -> str:
    return f"{count_b / 1e9:.1f} GB"


def main() -> int:
    """Prints the findings. 0: nothing is missing, or only what one choice needs; 1: something is, and its
    line says what to do."""
    print(WAIT, file=sys.stderr, flush=True)
    findings = report()
    width = max(len(finding.name) for finding in findings)
    for finding in findings:
        print(f"{finding.state:<7}  {finding.name:<{width}}  {finding.value}")
    missing = [finding.name for finding in findings if finding.state == "missing"]
    absent = [f"{finding.name} for {finding.only_for}" for finding in findings if finding.state == "absent"]
    but = f" but {', '.join(absent)}" if absent else ""
    print(f"\nmissing: {', '.join(missing)}" if missing else f"\nnothing is missing{but}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
