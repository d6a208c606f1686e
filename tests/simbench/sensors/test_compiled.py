"""How kernels are compiled and kept."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import simbench
from simbench.sensors import ray_kernel
from simbench.sensors.compiled import is_compiled


def test_a_kernel_counts_as_compiled_once_its_code_lies_in_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Kernel:
        """What numba's dispatchers tell of themselves."""

        py_func = ray_kernel._bins.py_func

        class stats:
            cache_path = str(tmp_path)

    assert not is_compiled(Kernel)
    (tmp_path / "ray_kernel._bins-12.py311.nbi").touch()
    assert is_compiled(Kernel)


def test_the_kernels_of_the_package_are_found_after_a_call() -> None:
    first, last = np.empty((1, 3), np.int32), np.empty((1, 3), np.int32)
    ray_kernel._bins(np.array([[0.0, 1.0]]), 0.0, 0.5, first, last)
    assert first.tolist() == [[0, 1, 1]]
    assert last.tolist() == [[1, 1, 2]]
    assert is_compiled(ray_kernel._bins)


def test_a_kernel_is_compiled_anew_when_a_module_of_its_helpers_changes(tmp_path: Path) -> None:
    """Two processes with one cache; between them only the helper's file changes."""
    (tmp_path / "helper.py").write_text(
        "from simbench.sensors.compiled import jit\n\n@jit\ndef one():\n    return 1\n"
    )
    (tmp_path / "kernel.py").write_text(
        "import helper\nfrom helper import one\nfrom simbench.sensors.compiled import jit_with\n\n"
        "@jit_with(helper)\ndef answer():\n    return one()\n\n"
        "print(answer(), len(answer.stats.cache_hits))\n"
    )
    root = Path(simbench.__file__).parents[1]
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tmp_path}:{root}",
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
    }

    def told() -> list[str]:
        run = subprocess.run(
            [sys.executable, str(tmp_path / "kernel.py")], env=environment, capture_output=True, text=True
        )
        assert run.returncode == 0, run.stderr
        return run.stdout.split()

    assert told() == ["1", "0"]
    assert told() == ["1", "1"]
    helper = tmp_path / "helper.py"
    helper.write_text(helper.read_text().replace("return 1", "return 2"))
    assert told() == ["2", "0"]
