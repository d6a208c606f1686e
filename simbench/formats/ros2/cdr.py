"""ROS 2 messages as bytes and back: plain CDR, by the definitions of `definitions.py`.

A message is a dict of its fields; a list of numbers is an array, a list of bytes is bytes. Bytes come from
anywhere: a list says how long it is before its values, and is believed only as far as there are bytes for it,
before anything of that size is made. Either byte order is read.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from simbench.formats.ros2.definitions import PRIMITIVES, Field, fields_of, short

Message = dict[str, Any]
MOST_PADDING = 3  # bytes that a middleware may leave behind a message
_LITTLE = b"\x00\x01\x00\x00"


class MessageError(ValueError):
    """Bytes that are not the message that they should be; one sentence."""


def encode(name: str, message: Message) -> bytes:
    """A message as bytes. Fields that are not given are 0, empty, or of such."""
    out = bytearray(_LITTLE)
    _write(out, short(name), message)
    return bytes(out)


def decode(name: str, data: bytes) -> Message:
    """The message of bytes. MessageError: they are none, or there are more or fewer than it has."""
    if len(data) < len(_LITTLE):
        raise MessageError(f"{len(data)} bytes are no message")
    if data[0] != 0 or data[1] not in (0, 1):
        raise MessageError(f"its encoding is 0x{data[0]:02x}{data[1]:02x}, not plain CDR")
    taken = _Taken(data, "<" if data[1] else ">")
    message = taken.message(short(name))
    if not 0 <= len(data) - taken.at <= MOST_PADDING:
        raise MessageError(f"{len(data) - taken.at} bytes are left over")
    return message


def _write(out: bytearray, name: str, message: Message) -> None:
    for field in fields_of(name):
        value = message.get(field.name)
        if value is None:
            out += _nothing(field.kind, field.count, (len(out) - len(_LITTLE)) % 8)
        elif field.count is None:
            _WRITERS.get(field.kind, _write_message)(out, field.kind, value)
        else:
            _write_many(out, field, value)


@cache
def _nothing(kind: str, count: int | None, phase: int) -> bytes:
    """What stands for a field that is not given, where the message has `phase` bytes, modulo 8."""
    out = bytearray(len(_LITTLE) + phase)
    if count is not None and count < 0:
        _write_number(out, "uint32", 0)
    for _ in range(1 if count is None else max(count, 0)):
        empty: Any = "" if kind == "string" else 0 if kind in PRIMITIVES else {}
        _WRITERS.get(kind, _write)(out, kind, empty)
    return bytes(out[len(_LITTLE) + phase :])


def _write_number(out: bytearray, kind: str, value: Any) -> None:
    one = _ONE[kind]
    if gap := (len(_LITTLE) - len(out)) % one.size:
        out += bytes(gap)
    out += one.pack(value)


def _write_text(out: bytearray, kind: str, value: str) -> None:
    text = value.encode("utf-8") + b"\x00"
    _write_number(out, "uint32", len(text))
    out += text


def _write_message(out: bytearray, kind: str, value: Message) -> None:
    if floats := _floats(kind):  # a pose, a vector: by far the most
        if gap := (len(_LITTLE) - len(out)) % 8:
            out += bytes(gap)
        out += floats.pack(*_flat(kind, value))
    else:
        _write(out, kind, value)


_ONE = {kind: struct.Struct("<" + letter) for kind, letter in PRIMITIVES.items() if letter != "s"}
_WRITERS: dict[str, Callable[[bytearray, str, Any], None]] = {
    **dict.fromkeys(_ONE, _write_number),
    "string": _write_text,
}


def _write_many(out: bytearray, field: Field, value: Any) -> None:
    if field.count is not None and field.count < 0:
        _write_number(out, "uint32", len(value))
    elif len(value) != field.count:
        raise MessageError(f"'{field.name}' has {len(value)} values, not {field.count}")
    if field.kind not in _ONE:
        for one in value:
            _WRITERS.get(field.kind, _write)(out, field.kind, one)
    elif isinstance(value, bytes):
        out += value
    else:
        array = np.ascontiguousarray(value, dtype="<" + PRIMITIVES[field.kind])
        if len(array) and (gap := (len(_LITTLE) - len(out)) % array.itemsize):
            out += bytes(gap)
        out += array.tobytes()


@cache
def _floats(kind: str) -> struct.Struct | None:
    """All numbers of a type that is made of float64 alone; None where it has anything else, or lists."""
    total = 0
    for field in fields_of(kind):
        inner = 1 if field.kind == "float64" else None if field.kind in PRIMITIVES else _floats(field.kind)
        if inner is None or field.count is not None:
            return None
        total += inner if isinstance(inner, int) else inner.size // 8
    return struct.Struct(f"<{total}d")


def _flat(kind: str, message: Message) -> list[float]:
    """The numbers of a type that is made of float64 alone, in their order."""
    found: list[float] = []
    for field in fields_of(kind):
        value = message.get(field.name)
        if field.kind == "float64":
            found.append(0.0 if value is None else value)
        else:
            found += _flat(field.kind, value or {})
    return found


@cache
def _least(name: str) -> int:
    """Bytes that a value of a type has at least, without gaps."""
    if name in PRIMITIVES:
        return 4 if name == "string" else struct.calcsize(PRIMITIVES[name])
    return sum(_least_of(field) for field in fields_of(name))


def _least_of(field: Field) -> int:
    if field.count is None:
        return _least(field.kind)
    return 4 if field.count < 0 else field.count * _least(field.kind)


class _Taken:
    """What is still to be taken of a message."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order, self.at = data, order, len(_LITTLE)

    def message(self, name: str) -> Message:
        return {field.name: self._field(field) for field in fields_of(name)}

    def _field(self, field: Field) -> Any:
        letter = PRIMITIVES.get(field.kind)
        if field.count is None:
            return self._one(field.kind, letter)
        count = int(self._number("I")) if field.count < 0 else field.count
        if count * _least(field.kind) > len(self.data) - self.at:
            raise MessageError(f"'{field.name}' says it has {count} values, but the message ends before")
        if letter is None or letter == "s":
            return [self._one(field.kind, letter) for _ in range(count)]
        if letter == "B":
            return self._bytes(count)
        dtype = np.dtype(self.order + letter)
        if count:
            self._align(dtype.itemsize)
        return np.frombuffer(self._bytes(count * dtype.itemsize), dtype=dtype)

    def _one(self, kind: str, letter: str | None) -> Any:
        if letter is None:
            return self.message(kind)
        return self._text() if letter == "s" else self._number(letter)

    def _text(self) -> str:
        size = int(self._number("I"))
        raw = self._bytes(size)
        if raw and raw[-1]:
            raise MessageError("a text does not end in a zero")
        try:
            return raw[:-1].decode("utf-8")
        except UnicodeDecodeError:
            raise MessageError("a text is no UTF-8") from None

    def _number(self, letter: str) -> Any:
        size = struct.calcsize(letter)
        self._align(size)
        return struct.unpack(self.order + letter, self._bytes(size))[0]

    def _bytes(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise MessageError("it ends before its end")
        self.at += size
        return self.data[self.at - size : self.at]

    def _align(self, size: int) -> None:
        self.at += -(self.at - len(_LITTLE)) % size
