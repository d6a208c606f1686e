"""What holds for every test: checked array shapes, no global randomness, repeatable examples."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import jaxtyping
import numpy as np
import pytest
import scipy.stats  # noqa: F401  (its import draws without a seed: before the poison below)
from hypothesis import settings

from tests.checked import checked

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("fusion", "scenarios", "simbench")

settings.register_profile("simbench", derandomize=True, deadline=None, database=None, print_blob=True)
settings.load_profile("simbench")


# -- shapes: jaxtyping's annotations are enforced by beartype ---------------------------------------------


def checked_modules() -> Iterator[str]:
    """All modules but two kinds, which cannot be checked.

    Those with numba kernels: numba compiles the function itself, not one that checks its arguments. Those
    that name a Protocol which is not `@runtime_checkable`: beartype refuses to look at an instance of it.
    """
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    texts = {path: path.read_text(encoding="utf-8") for path in paths if path.name != "__init__.py"}
    opaque = [
        name
        for text in texts.values()
        for marked, name in re.findall(r"^(@runtime_checkable\n)?class (\w+)\(Protocol", text, re.MULTILINE)
        if not marked
    ]
    hidden = re.compile(
        "|".join([r"^\s*(?:import|from) numba\b", *(rf"\b{name}\b" for name in opaque)]), re.M
    )
    for path, text in texts.items():
        if not hidden.search(text):
            yield ".".join(path.relative_to(ROOT).with_suffix("").parts)


# An int is a float, as type checkers have it. A wrong argument is a TypeError, as jaxtyping has it.
CHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True, violation_type=TypeError))"
jaxtyping.install_import_hook(list(checked_modules()), CHECKER)  # puts `jaxtyping.jaxtyped` around functions
jaxtyping.jaxtyped = checked


# -- randomness: whoever draws is handed a Generator -------------------------------------------------------

_KEPT_FOR_HYPOTHESIS = {"seed", "get_state", "set_state"}  # it saves and restores the global state


def _poisoned(name: str) -> Callable[..., NoReturn]:
    def refuse(*_: object, **__: object) -> NoReturn:
        raise AssertionError(f"np.random.{name} draws from global state; take a numpy Generator as argument")

    return refuse


def _seeded_default_rng(original: Callable[..., np.random.Generator]) -> Callable[..., np.random.Generator]:
    def default_rng(seed: Any = None) -> np.random.Generator:
        if seed is None:
            raise AssertionError("np.random.default_rng() without a seed differs from run to run")
        return original(seed)

    return default_rng


for _name in dir(np.random):
    _owner = getattr(getattr(np.random, _name), "__self__", None)
    if isinstance(_owner, np.random.RandomState) and _name not in _KEPT_FOR_HYPOTHESIS:
        setattr(np.random, _name, _poisoned(_name))
np.random.default_rng = _seeded_default_rng(np.random.default_rng)


# -- order: files that take long begin first, so that no worker waits for another at the end ---------------

LONG = (
    "test_install.py", "test_tutorial.py", "test_relations.py", "test_prove.py", "test_receipts.py",
    "test_suite_run.py", "test_cluster.py", "test_run.py", "test_cli.py", "test_hostile.py",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))
