"""Taking a frame apart: every field and array is asked for once, by type and shape; none may be left."""

from __future__ import annotations

from typing import Any

import numpy as np

from simbench.isolate.frames import DTYPES, Frame, FrameError

Shape = tuple[int | str, ...]
LONGEST_NAME = 200
MOST_NAMES = 10_000  # of the boxes of an image, or the objects of a scene


class Taken:
    """What is still to be taken of a frame. `FrameError` where something is missing, wrong, or left at `end`.

    A word in a shape is a count: equal words must be equal counts, in all arrays and lists of the frame.
    """

    def __init__(self, frame: Frame) -> None:
        self.kind = frame.kind
        self._fields, self._arrays = dict(frame.fields), dict(frame.arrays)
        self.counts: dict[str, int] = {}

    def integer(self, name: str) -> int:
        value = self._field(name)
        if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 2**63:
            raise self.error(f"'{name}' is no integer of 64 bits")
        return value

    def text(self, name: str) -> str:
        return self._name(name, self._field(name))

    def texts(self, name: str, count: str) -> tuple[str, ...]:
        value = self._field(name)
        if not isinstance(value, list):
            raise self.error(f"'{name}' is no list")
        if len(value) > MOST_NAMES:
            raise self.error(f"'{name}' has {len(value)} entries; {MOST_NAMES} are allowed")
        self._count(name, count, len(value))
        return tuple(self._name(name, item) for item in value)

    def optional(self, name: str, default: Any) -> Any:
        return self._fields.pop(name, default)

    def array(self, name: str, dtype: str, shape: Shape) -> np.ndarray:
        if name not in self._arrays:
            raise self.error(f"there is no array '{name}'")
        found = self._arrays.pop(name)
        if found.dtype != DTYPES[dtype]:
            raise self.error(f"'{name}' holds {found.dtype}, not {dtype}")
        fits = found.ndim == len(shape) and all(
            isinstance(want, str) or want == have for want, have in zip(shape, found.shape, strict=True)
        )
        if not fits:
            wanted = " ".join(map(str, shape))
            raise self.error(f"'{name}' has shape {list(found.shape)}, not [{wanted}]")
        for want, have in zip(shape, found.shape, strict=True):
            if isinstance(want, str):
                self._count(name, want, have)
        return found

    def end(self) -> None:
        """Nothing may be left."""
        for name in (*self._fields, *self._arrays):
            raise self.error(f"it has '{name[:40]}', which is not known")

    def error(self, problem: str) -> FrameError:
        return FrameError(f"a '{self.kind}' is malformed: {problem}")

    def _count(self, name: str, word: str, have: int) -> None:
        if self.counts.setdefault(word, have) != have:
            raise self.error(f"'{name}' has {have} rows, not {self.counts[word]}")

    def _field(self, name: str) -> Any:
        if name not in self._fields:
            raise self.error(f"there is no field '{name}'")
        return self._fields.pop(name)

    def _name(self, name: str, value: object) -> str:
        if not isinstance(value, str) or len(value) > LONGEST_NAME:
            raise self.error(f"'{name}' is no text of up to {LONGEST_NAME} characters")
        return value
