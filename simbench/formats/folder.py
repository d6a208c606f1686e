"""Reading a folder of recorded data that nobody vouches for.

Only files at known names below the folder are opened; a link that leaves it is refused, and so is what is not
a plain file or is larger than it can sensibly be. Whatever is wrong is one `BadInput` with file and line.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from scenarios.errors import BadInput, printable, show
from simbench.formats.picture_size import picture_size

MAX_TEXT_BYTES = 16_000_000
MAX_POINTS_BYTES = 64_000_000  # a full sweep of 64 beams is 2 MB
MAX_IMAGE_BYTES = 64_000_000
MAX_IMAGE_PX = 8192  # along a side
MAX_IMAGE_PIXELS = 40_000_000
FARTHEST_M = 1e6
POINT_BYTES = 16  # x, y, z, reflectance: four little-endian float32


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of a text file that holds something, cut into words."""

    file: str
    number: int
    words: tuple[str, ...]

    def error(self, problem: str, *, field: str | None = None, allowed: str | None = None) -> BadInput:
        """The `BadInput` about this line."""
        return BadInput(problem, file=self.file, line=self.number, field=field, allowed=allowed)

    def number_at(self, index: int, name: str) -> float:
        """The finite number that is word `index`, called `name`. BadInput: it is none."""
        try:
            value = float(self.words[index])
        except ValueError:
            raise self.error(f"must be a number, is {show(self.words[index])}", field=name) from None
        if not math.isfinite(value):
            raise self.error(f"must be a finite number, is {show(self.words[index])}", field=name)
        return value

    def whole_at(self, index: int, name: str) -> int:
        """The whole number that is word `index`. BadInput: it is none."""
        value = self.number_at(index, name)
        if value != round(value) or abs(value) > 1e9:
            raise self.error(f"must be a whole number, is {show(self.words[index])}", field=name)
        return int(value)

    def numbers(self, first: int, name: str) -> tuple[float, ...]:
        """All words from `first` on, as finite numbers."""
        return tuple(self.number_at(i, name) for i in range(first, len(self.words)))


@dataclass(frozen=True, kw_only=True)
class Folder:
    """A folder as the user named it (`shown`) and where it really is (`root`). `digest`: of all that was
    read."""

    shown: str
    root: Path
    digest: Any = field(default_factory=hashlib.sha256, compare=False, repr=False)

    @classmethod
    def open(cls, path: str) -> Folder:
        """BadInput: there is no such folder."""
        if not path:
            raise BadInput("the path of the folder is empty", allowed="kitti:PATH")
        try:
            root = Path(path).resolve()
            there, is_folder = root.exists(), root.is_dir()
        except (OSError, ValueError, RuntimeError) as error:
            raise BadInput(f"cannot be read: {_reason(error)}", file=path) from None
        if not is_folder:
            raise BadInput("not a folder" if there else "no such folder", file=path)
        return cls(shown=path, root=root)

    def fresh(self) -> Folder:
        """The same folder with nothing read yet."""
        return Folder(shown=self.shown, root=self.root)

    def name_of(self, part: str) -> str:
        """How messages name a file: with the folder as the user wrote it."""
        return str(Path(self.shown) / PurePosixPath(part))

    def has(self, part: str) -> bool:
        """Whether there is a file or folder below this one."""
        try:
            return (self.root / part).exists()
        except OSError:
            return False

    def entries(self, part: str) -> tuple[str, ...]:
        """Names in a folder below this one, sorted; none where there is no such folder."""
        try:
            return tuple(sorted(path.name for path in self._inside(part).iterdir()))
        except (FileNotFoundError, NotADirectoryError):
            return ()
        except OSError as error:
            raise BadInput(f"cannot be read: {_reason(error)}", file=self.name_of(part)) from None

    def size(self, part: str) -> int:
        """Bytes of a file. BadInput as for reading it."""
        return self._file(part).stat().st_size

    def lines(self, part: str) -> tuple[Line, ...]:
        """The lines of a text file that hold something."""
        name = self.name_of(part)
        raw = self._bytes(part, MAX_TEXT_BYTES)
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = raw[: error.start].count(b"\n") + 1
            raise BadInput("not UTF-8 text", file=name, line=line) from None
        return tuple(_lines(name, text))

    def text(self, part: str) -> bytes:
        """A text file as it is."""
        return self._bytes(part, MAX_TEXT_BYTES)

    def check_points(self, part: str) -> int:
        """Bytes of a sweep. BadInput: its file is not there, or its size is not that of whole points."""
        size, name = self.size(part), self.name_of(part)
        if size > MAX_POINTS_BYTES:
            raise BadInput(f"larger than {MAX_POINTS_BYTES // 1_000_000} MB", file=name)
        if size % POINT_BYTES:
            raise BadInput(
                f"{size} bytes are no whole number of points", file=name,
                allowed=f"a multiple of {POINT_BYTES} bytes: x, y, z, reflectance as float32",
            )  # fmt: skip
        return size

    def points(self, part: str) -> Float32[np.ndarray, "n 4"]:
        """x, y, z [m] and reflectance of a sweep. BadInput: a size or a number that cannot be."""
        self.check_points(part)
        found = np.frombuffer(self._bytes(part, MAX_POINTS_BYTES), dtype="<f4").reshape(-1, 4)
        whole = np.isfinite(found).all(axis=1)
        if not whole.all():
            first = int(np.flatnonzero(~whole)[0])
            raise BadInput(
                f"point {first} (byte {first * POINT_BYTES}) holds a number that is not finite; "
                f"{int((~whole).sum())} of {len(found)} points do",
                file=self.name_of(part),
            )
        if len(found) and np.abs(found[:, :3]).max() > FARTHEST_M:
            first = int(np.flatnonzero((np.abs(found[:, :3]) > FARTHEST_M).any(axis=1))[0])
            raise BadInput(
                f"point {first} lies too far away", file=self.name_of(part), allowed=f"up to {FARTHEST_M:g} m"
            )
        reflectance = found[:, 3]
        if len(found) and not (reflectance.min() >= 0.0 and reflectance.max() <= 1.0):
            first = int(np.flatnonzero((reflectance < 0.0) | (reflectance > 1.0))[0])
            raise BadInput(
                f"point {first} has a reflectance of {reflectance[first]:g}",
                file=self.name_of(part),
                allowed="0 to 1",
            )
        return found.astype(np.float32)

    def image(self, part: str) -> UInt8[np.ndarray, "h w 3"]:
        """An image file as RGB. BadInput: OpenCV cannot read it."""
        raw, name = self._bytes(part, MAX_IMAGE_BYTES), self.name_of(part)
        unreadable = BadInput("not an image that can be read", file=name, allowed="PNG or JPEG")
        try:
            width, height = picture_size(raw)
        except ValueError:
            raise unreadable from None
        if max(width, height) > MAX_IMAGE_PX or width * height > MAX_IMAGE_PIXELS:
            raise BadInput(f"{width}x{height} pixels are too many", file=name)
        try:
            bgr = cv2.imdecode(np.frombuffer(raw, dtype=np.uint8), cv2.IMREAD_COLOR)
        except cv2.error:
            raise unreadable from None
        if bgr is None:
            raise unreadable
        return np.ascontiguousarray(bgr[..., ::-1])

    def _bytes(self, part: str, most: int) -> bytes:
        path, name = self._file(part), self.name_of(part)
        try:
            with path.open("rb") as file:
                raw = file.read(min(os.fstat(file.fileno()).st_size, most + 1))
        except OSError as error:
            raise BadInput(f"cannot be read: {_reason(error)}", file=name) from None
        if len(raw) > most:
            raise BadInput(f"larger than {most // 1_000_000} MB", file=name)
        self.digest.update(f"{part}\0{len(raw)}\0".encode())
        self.digest.update(raw)
        return raw

    def _file(self, part: str) -> Path:
        path, name = self._inside(part), self.name_of(part)
        if not path.exists():
            raise BadInput("no such file", file=name)
        if not path.is_file():
            raise BadInput("not a file", file=name)
        return path

    def _inside(self, part: str) -> Path:
        try:
            path = (self.root / part).resolve()
        except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle
            raise BadInput(f"cannot be read: {_reason(error)}", file=self.name_of(part)) from None
        if not path.is_relative_to(self.root):
            raise BadInput("is a link that leaves the folder", file=self.name_of(part))
        return path


def _lines(name: str, text: str) -> Iterator[Line]:
    for number, line in enumerate(text.split("\n"), start=1):
        words = tuple(line.split())
        if words:
            yield Line(file=name, number=number, words=words)


def _reason(error: Exception) -> str:
    text = error.strerror if isinstance(error, OSError) else None
    return printable(text or str(error))
