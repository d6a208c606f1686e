"""How kernels are compiled and kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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
