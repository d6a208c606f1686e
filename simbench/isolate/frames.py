"""One frame: a head of 12 bytes, a header, a body. The same on a pipe and in a file.

    b"SBF1"   u32 length of the header   u32 length of the body      (numbers are little-endian)
    header    UTF-8, one JSON object: {"kind", its fields, "arrays": [{"name", "dtype", "shape"}, ...]}
    body      the arrays one after another, little-endian, row by row, without gaps

`dtype` is one of `DTYPES`. Whatever is not exactly this raises `FrameError` with one sentence; sizes are
checked before anything of that size is read.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np

MAGIC = b"SBF1"
HEAD = struct.Struct("<4sII")
LONGEST_HEADER = 4 * 2**20
LONGEST_BODY = 256 * 2**20
MOST_ARRAYS = 64
DTYPES = {
    name: np.dtype(code)
    for name, code in (
        ("u8", "<u1"), ("i16", "<i2"), ("i32", "<i4"), ("i64", "<i8"), ("f32", "<f4"), ("f64", "<f8"),
    )
}  # fmt: skip
_NAMES = {dtype: name for name, dtype in DTYPES.items()}


class FrameError(ValueError):
    """Bytes that are no frame, or a frame that is not what it must be; the message is one sentence."""


@runtime_checkable
class Readable(Protocol):
    """A file, a pipe, or bytes in memory."""

    def read(self, size: int, /) -> bytes: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """`fields` are plain JSON values; `arrays` have one of the dtypes of `DTYPES`."""

    kind: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)


def pack(frame: Frame) -> bytes:
    """A frame as bytes. FrameError where it would be refused by `unpack`."""
    return b"".join(pieces(frame))


def pieces(frame: Frame) -> list[bytes | memoryview]:
    """The bytes of a frame, without a copy of its arrays. FrameError as above."""
    specs, body = [], list[memoryview]()
    for name, array in frame.arrays.items():
        little = array
        if array.dtype not in _NAMES or not array.flags.c_contiguous:
            little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        if little.dtype not in _NAMES:
            raise FrameError(f"'{name}' holds {array.dtype}, which no frame can carry")
        specs.append(_spec_text(name, _NAMES[little.dtype], array.shape))
        if array.size:
            body.append(little.data.cast("B"))
    try:
        text = json.dumps({"kind": frame.kind, **frame.fields}, allow_nan=False)
    except (ValueError, TypeError) as error:
        raise FrameError(f"a '{frame.kind}' cannot be written as JSON: {error}") from error
    header = f'{text[:-1]}, "arrays": [{", ".join(specs)}]}}'.encode()
    size = sum(piece.nbytes for piece in body)
    check_sizes(len(header), size)
    return [HEAD.pack(MAGIC, len(header), size) + header, *body]


@lru_cache(maxsize=4096)  # they repeat from frame to frame
def _spec_text(name: str, dtype: str, shape: tuple[int, ...]) -> str:
    return json.dumps({"name": name, "dtype": dtype, "shape": shape})


def sizes(head: bytes) -> tuple[int, int]:
    """Bytes of the header and of the body that follow a head of 12 bytes."""
    if len(head) != HEAD.size:
        raise FrameError(f"no frame has a head of {len(head)} bytes")
    magic, header, body = HEAD.unpack(head)
    if magic != MAGIC:
        raise FrameError(f"no frame begins with {bytes(head)!r}")
    check_sizes(header, body)
    return header, body


def check_sizes(header: int, body: int) -> None:
    """FrameError where a frame of these lengths is too large."""
    for name, length, longest in (("header", header, LONGEST_HEADER), ("body", body, LONGEST_BODY)):
        if length > longest:
            raise FrameError(f"a {name} of {length} bytes is too long; {longest} are allowed")


def unpack(header: bytes, body: bytes) -> Frame:
    """The frame of a header and a body."""
    content = _json(header)
    kind, specs = content.pop("kind", None), content.pop("arrays", [])
    if not isinstance(kind, str):
        raise FrameError("a frame's header has no text 'kind'")
    if not isinstance(specs, list) or len(specs) > MOST_ARRAYS:
        raise FrameError(f"'arrays' of a '{kind}' is no list of at most {MOST_ARRAYS}")
    arrays: dict[str, np.ndarray] = {}
    at = 0
    for spec in specs:
        name, dtype, shape = _spec(kind, spec)
        if name in arrays:
            raise FrameError(f"a '{kind}' has two arrays '{name}'")
        count = math.prod(shape)  # of Python's integers: cannot overflow
        if at + count * dtype.itemsize > len(body):
            raise FrameError(f"'{name}' of a '{kind}' has shape {list(shape)}, but its body ends before")
        arrays[name] = np.frombuffer(body, dtype=dtype, count=count, offset=at).reshape(shape)
        at += count * dtype.itemsize
    if at != len(body):
        raise FrameError(f"the body of a '{kind}' has {len(body)} bytes, but its arrays have {at}")
    return Frame(kind=kind, fields=content, arrays=arrays)


def read(stream: Readable) -> Frame | None:
    """The next frame of a blocking stream; None where it has ended."""
    head = _exactly(stream, HEAD.size)
    if not head:
        return None
    if len(head) < HEAD.size:
        raise FrameError(f"the stream ends within a head, after {len(head)} bytes")
    header_size, body_size = sizes(head)
    header, body = _exactly(stream, header_size), _exactly(stream, body_size)
    if len(header) + len(body) < header_size + body_size:
        raise FrameError("the stream ends within a frame")
    return unpack(header, body)


def _exactly(stream: Readable, size: int) -> bytes:
    """`size` bytes, fewer only at the end of the stream."""
    found = bytearray()
    while len(found) < size and (more := stream.read(min(size - len(found), 2**20))):
        found += more
    return bytes(found)


def _spec(kind: str, spec: object) -> tuple[str, np.dtype[Any], tuple[int, ...]]:
    if not isinstance(spec, dict) or set(spec) != {"name", "dtype", "shape"}:
        raise FrameError(f"an array of a '{kind}' must have exactly name, dtype and shape")
    name, dtype, shape = spec["name"], spec["dtype"], spec["shape"]
    if not isinstance(name, str):
        raise FrameError(f"an array of a '{kind}' has no text as its name")
    if not isinstance(dtype, str) or dtype not in DTYPES:
        raise FrameError(f"'{name[:40]}' of a '{kind}' has no dtype of {', '.join(DTYPES)}")
    if not isinstance(shape, list) or len(shape) > 3 or not all(_is_count(n) for n in shape):
        raise FrameError(f"'{name[:40]}' of a '{kind}' has no shape: a list of up to three counts")
    return name, DTYPES[dtype], tuple(shape)


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**32


def _json(header: bytes) -> dict[str, Any]:
    try:
        content = json.loads(header.decode("utf-8"), object_pairs_hook=_once, parse_constant=_refuse)
    except FrameError:
        raise
    except (ValueError, RecursionError) as error:
        raise FrameError(f"a frame's header is no JSON: {' '.join(str(error).split())[:100]}") from error
    if not isinstance(content, dict):
        raise FrameError("a frame's header is no JSON object")
    return content


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise FrameError("a frame's header names a field twice")
    return found


def _refuse(word: str) -> float:
    raise FrameError(f"a frame's header holds {word}: what may not be finite travels in an array")
