"""What this machine offers to simbench, and what is missing: `simbench doctor`.

`report()` only looks and returns data; `main()` prints it. Reading takes a second, most of it the renderer's
probe.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from simbench.sensors import gl

PACKAGES = ("mujoco", "numpy", "scipy", "opencv-python-headless", "numba", "pydantic", "matplotlib", "av")
NEEDED_DISK_B = 1e9
NEEDED_MEMORY_B = 2e9


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line. `ok` is false where something is missing; `value` then says what to do."""

    name: str
    value: str
    ok: bool = True


def report() -> tuple[Finding, ...]:
    """All findings, in the order in which they are printed."""
    return (
        Finding(name="python", value=f"{platform.python_version()} ({sys.executable})"),
        Finding(name="system", value=f"{platform.system()} {platform.release()} {platform.machine()}"),
        _cpu(),
        _memory(),
        _disk(),
        *_packages(),
        *_renderer(),
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


def _renderer() -> Iterable[Finding]:
    try:
        found = gl.provision()
    except gl.RenderingUnavailable as error:
        yield Finding(name="renderer", value=str(error), ok=False)
        return
    yield Finding(name="renderer", value=f"{found.name}: {found.how}, found in {found.probe_s:.1f} s")
    yield Finding(name="OpenGL", value=found.gl)
    for sentence in found.passed_over:
        yield Finding(name="passed over", value=sentence)


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
    """Prints the findings. 0: nothing is missing; 1: something is, and its line says what to do."""
    findings = report()
    width = max(len(finding.name) for finding in findings)
    for finding in findings:
        print(f"{'ok     ' if finding.ok else 'missing'}  {finding.name:<{width}}  {finding.value}")
    missing = [finding.name for finding in findings if not finding.ok]
    print(f"\nmissing: {', '.join(missing)}" if missing else "\nnothing is missing")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
