"""How kernels are compiled: by numba, cached on disk, without the argument checks that tests wrap around."""

from __future__ import annotations

import hashlib
import inspect
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any


def _writable_cache() -> None:
    """numba raises at decoration when it can write neither beside this file nor in the home folder."""
    if "NUMBA_CACHE_DIR" in os.environ or os.access(Path(__file__).parent, os.W_OK):
        return
    home_cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    nearest = next((p for p in (home_cache, *home_cache.parents) if p.exists()), None)
    if nearest is None or not os.access(nearest, os.W_OK):
        os.environ["NUMBA_CACHE_DIR"] = str(Path(tempfile.gettempdir()) / f"simbench-numba-{os.getuid()}")


_writable_cache()

import numba  # noqa: E402  (after the cache folder is known)
from numba.core.compiler import Compiler  # noqa: E402


class _NoAlias(Compiler):
    """Array arguments do not overlap: loops over them become vector instructions without checks."""

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()  # type: ignore[no-untyped-call]


def jit(function: Callable[..., Any]) -> Any:
    """Compile a kernel: nogil, cached, IEEE arithmetic."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(inspect.unwrap(function))


def jit_with(*modules: ModuleType) -> Callable[[Callable[..., Any]], Any]:
    """As `jit`, for a kernel that calls helpers of other modules: it is compiled anew when one of these
    changes, which numba's cache does not notice by itself."""
    digests = tuple(hashlib.sha256(inspect.getsource(module).encode()).hexdigest() for module in modules)

    def compile(function: Callable[..., Any]) -> Any:
        compiled = jit(function)
        index: Any = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
        if not hasattr(index, "_source_stamp"):  # a numba that keeps it elsewhere: no cache is never stale
            return numba.njit(nogil=True, error_model="numpy")(inspect.unwrap(function))
        index._source_stamp = (index._source_stamp, *digests)
        return compiled

    return compile


def jit_no_alias(function: Callable[..., Any]) -> Any:
    """Compile an inner loop whose array arguments never overlap; a*b + c may be fused."""
    compiled = numba.njit(
        cache=True,
        nogil=True,
        error_model="numpy",
        fastmath={"contract", "nsz"},
        forceinline=True,
        pipeline_class=_NoAlias,
    )
    return compiled(inspect.unwrap(function))


def jit_inline(function: Callable[..., Any]) -> Any:
    """Compile a helper of kernels into its callers."""
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
    return compiled(inspect.unwrap(function))


def is_compiled(kernel: Any) -> bool:
    """Whether an earlier process has left the kernel compiled in the cache."""
    function = kernel.py_func
    name = f"{function.__module__.rsplit('.', 1)[-1]}.{function.__name__}-*.nbi"
    return any(Path(kernel.stats.cache_path).glob(name))
