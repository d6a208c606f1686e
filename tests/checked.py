"""What the tests' import hook puts around each function: beartype, at the first call and once per call.

jaxtyping's own decorator binds the arguments to the signature and looks at them twice in every call, which
took half of the whole suite's time, and it has beartype write two checks per function at import, called or
not. Here beartype's one wrapper checks arguments and result; axis names mean the same in both, as long as
jaxtyping's context is open around the call. What needs more (generators, axes named by an argument as in
" {rows}") is left to jaxtyping.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import types
import typing
from collections.abc import Callable
from typing import Any

import jaxtyping

Check = Callable[[Any], Any]
_theirs = jaxtyping.jaxtyped
_context: Any = _theirs("context")  # a new scope of axis names; may be entered again and again


def checked(target: Any = None, *, typechecker: Check) -> Any:
    """As `jaxtyping.jaxtyped(target, typechecker=...)`, cheaper. target: a function or a class, of which the
    `__init__` of dataclasses is checked."""
    if target is None:
        return functools.partial(checked, typechecker=typechecker)
    if inspect.isclass(target):
        if dataclasses.is_dataclass(target) and "__init__" in vars(target):
            target.__init__ = _function(target.__init__, typechecker)  # type: ignore[misc]
        return target
    return (
        _function(target, typechecker)
        if inspect.isfunction(target)
        else _theirs(target, typechecker=typechecker)
    )


def _function(function: Any, typechecker: Check) -> Any:
    if hasattr(function, "__simbench_checked__"):
        return function
    inner: Any = None

    @functools.wraps(function)
    def outer(*args: Any, **kwargs: Any) -> Any:
        nonlocal inner
        if inner is None:
            inner = _with_checks(function, typechecker)
        return inner(*args, **kwargs)

    outer.__simbench_checked__ = True  # type: ignore[attr-defined]
    return outer


def _with_checks(function: types.FunctionType, typechecker: Check) -> Any:
    hints = {name: _resolved(hint, function.__globals__) for name, hint in function.__annotations__.items()}
    arrays = [array for hint in hints.values() for array in _arrays(hint)]
    generates = function.__code__.co_flags & (
        inspect.CO_GENERATOR | inspect.CO_COROUTINE | inspect.CO_ASYNC_GENERATOR
    )
    if generates or any("{" in array.dim_str for array in arrays):
        return _theirs(function, typechecker=typechecker)
    inner = typechecker(_copy(function, hints))
    if not arrays:
        return inner

    def in_scope(*args: Any, **kwargs: Any) -> Any:
        with _context:
            return inner(*args, **kwargs)

    return in_scope


def _resolved(hint: Any, names: dict[str, Any]) -> Any:
    """The type that an annotation names; Any where it names none, as jaxtyping has it."""

    def one() -> None: ...

    one.__annotations__ = {"hint": hint}
    try:
        return typing.get_type_hints(one, names, include_extras=True)["hint"]
    except Exception:
        return Any


def _arrays(hint: Any) -> list[Any]:
    if inspect.isclass(hint) and issubclass(hint, jaxtyping.AbstractArray):
        return [hint]
    return [array for part in typing.get_args(hint) for array in _arrays(part)]


def _copy(function: types.FunctionType, hints: dict[str, Any]) -> types.FunctionType:
    copy = types.FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__annotations__ = hints
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy
