"""On what a run was made: versions, machine, renderer. Left out of every comparison of bytes."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

PACKAGES = ("simbench", "mujoco", "numpy", "scipy", "opencv-python-headless", "numba", "pydantic")


def environment(images: str) -> dict[str, object]:
    """Plain data for `result.json` and the report's footer."""
    renderer = {"none": "none", "raycast": "rays, without OpenGL"}.get(images, images)
    if images == "gl":
        from simbench.sensors import gl

        found = gl.provision()
        renderer = f"{found.name} ({found.gl})"
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpus": os.cpu_count(),
        "renderer": renderer,
        "revision": revision(),
        "packages": {name: importlib.metadata.version(name) for name in PACKAGES},
    }


def revision() -> str:
    """The commit of the checkout that runs, with a mark when it was changed; else the installed version."""
    root = Path(__file__).parent.parent
    if (root / ".git").exists():
        try:
            described = subprocess.run(
                ["git", "-C", str(root), "describe", "--always", "--dirty"],
                capture_output=True, text=True, timeout=5, check=True,
            )  # fmt: skip
            return described.stdout.strip()
        except (OSError, subprocess.SubprocessError) as why:
            return f"unknown ({type(why).__name__})"
    return importlib.metadata.version("simbench")
