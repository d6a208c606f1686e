"""The import hook's checks: as strict as jaxtyping's own, function by function."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from beartype import BeartypeConf, beartype
from jaxtyping import Float64, Int64

from fusion.geometry import Transform, rotation_exp
from tests.checked import checked

check = checked(typechecker=beartype(conf=BeartypeConf(is_pep484_tower=True, violation_type=TypeError)))

Points = Float64[np.ndarray, "n 3"]


@check
def moved(xyz_m: Points, by_m: Float64[np.ndarray, "n 3"], *, times: int = 1) -> Points:
    """Moves."""
    return xyz_m + times * by_m


@check
def first(xyz_m: Points, n: int) -> Float64[np.ndarray, "n 3"]:
    return xyz_m[:n]


@check
def rows(count: int) -> Float64[np.ndarray, " {count}"]:
    return np.zeros(max(count, 2))


@check
def name_of(name: str) -> int:
    return name  # type: ignore[return-value]


@check
def several(*values: float, **named: Points | None) -> tuple[Points, ...]:
    return tuple(points for points in named.values() if points is not None)


@check
def counted(up_to: int) -> Iterator[int]:
    yield from range(up_to)


@check
def not_resolved(value: NoSuchType) -> int:  # type: ignore[name-defined]
    return 1


@check
@dataclass(frozen=True, kw_only=True)
class Held:
    stamp_ns: Int64[np.ndarray, " n"]
    xyz_m: Float64[np.ndarray, "n 3"]
    name: str = "held"


class Holder:
    @check
    def __init__(self, points: Points) -> None:
        self.points = points

    @property
    @check
    def shape(self) -> tuple[int, str]:
        return self.points.shape  # type: ignore[return-value]

    @classmethod
    @check
    def of(cls, count: int) -> Holder:
        return cls(np.zeros((count, 3)))

    @staticmethod
    @check
    def twice(points: Points) -> Float64[np.ndarray, "n 6"]:
        return np.hstack([points, points])


def zeros(*shape: int) -> np.ndarray:
    return np.zeros(shape)


def test_what_is_right_passes_and_comes_back_unchanged() -> None:
    assert moved(zeros(4, 3), np.ones((4, 3)), times=2).sum() == 24.0
    assert [x.shape for x in several(1, 2.0, np.float64(3.0), a=zeros(2, 3), b=None)] == [(2, 3)]
    assert list(counted(3)) == [0, 1, 2]
    assert not_resolved("anything") == 1
    assert Holder.of(2).points.shape == (2, 3) and Holder.twice(zeros(5, 3)).shape == (5, 6)
    assert Held(stamp_ns=np.arange(2), xyz_m=zeros(2, 3)).name == "held"


@pytest.mark.parametrize(
    "call",
    [
        pytest.param(lambda: moved(zeros(4, 2), zeros(4, 2)), id="a fixed axis"),
        pytest.param(lambda: moved(zeros(3), zeros(3)), id="the number of axes"),
        pytest.param(lambda: moved(zeros(4, 3).astype(np.float32), zeros(4, 3)), id="the kind of number"),
        pytest.param(lambda: moved([[0.0] * 3], zeros(1, 3)), id="no array"),
        pytest.param(lambda: moved(zeros(4, 3), zeros(5, 3)), id="an axis of two arguments"),
        pytest.param(lambda: moved(zeros(4, 3), zeros(4, 3), times="2"), id="a plain type by name"),
        pytest.param(lambda: first(zeros(4, 3), 2), id="an axis of argument and result"),
        pytest.param(lambda: rows(1), id="an axis that an argument's value names"),
        pytest.param(lambda: name_of("x"), id="a plain result"),
        pytest.param(lambda: name_of(1), id="a plain argument"),
        pytest.param(lambda: several("1"), id="one of *args"),
        pytest.param(lambda: several(a=zeros(2, 2)), id="one of **kwargs"),
        pytest.param(lambda: several(a=zeros(2, 3), b=zeros(4, 3)), id="an axis of two of **kwargs"),
        pytest.param(lambda: counted("3"), id="an argument of a generator"),
        pytest.param(lambda: Held(stamp_ns=np.arange(2), xyz_m=zeros(3, 3)), id="an axis of two fields"),
        pytest.param(lambda: Held(stamp_ns=np.arange(2), xyz_m=zeros(2, 3), name=1), id="a field"),
        pytest.param(lambda: Holder(zeros(2, 2)), id="a method"),
        pytest.param(lambda: Holder(zeros(2, 3)).shape, id="a property"),
        pytest.param(lambda: Holder.of("2"), id="a class method"),
        pytest.param(lambda: Holder.twice(zeros(2, 2)), id="a static method"),
        pytest.param(lambda: rotation_exp(zeros(2)), id="a function of ours, by the import hook"),
        pytest.param(
            lambda: Transform(rotation=np.eye(2), translation_m=zeros(3)),
            id="a data class of ours, by the import hook",
        ),
    ],
)
def test_it_is_noticed_if_wrong_at_every_call(call: object) -> None:
    for _ in range(2):
        with pytest.raises(TypeError, match=r"violates type hint|Type-check error"):
            call()  # type: ignore[operator]


def test_axis_names_of_one_call_say_nothing_about_the_next_nor_about_calls_inside() -> None:
    @check
    def outer(xyz_m: Points) -> Points:
        moved(zeros(7, 3), zeros(7, 3))
        return xyz_m

    assert outer(zeros(1, 3)).shape == (1, 3)
    assert outer(zeros(2, 3)).shape == (2, 3)
    with pytest.raises(TypeError, match=r"violates type hint|Type-check error"):
        moved(zeros(4, 3), zeros(5, 3))
    assert moved(zeros(5, 3), zeros(5, 3)).shape == (5, 3)


def test_the_import_hook_uses_it() -> None:
    assert hasattr(rotation_exp, "__simbench_checked__")


def test_a_checked_function_looks_like_itself() -> None:
    assert (moved.__name__, moved.__doc__) == ("moved", "Moves.")
    assert moved.__wrapped__.__kwdefaults__ == {"times": 1}
    assert moved.__annotations__ == moved.__wrapped__.__annotations__


def test_decorators_of_functions_go_around_the_check() -> None:
    calls = []

    @cache
    @check
    def once(n: int) -> int:
        calls.append(n)
        return n

    assert (once(1), once(1), calls) == (1, 1, [1])
