"""The frames of one of a recording's two files, each as it is read, and what the manifest
says of that file."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from scenarios.errors import BadInput
from scenarios.scenario import Spec
from simbench.formats.container import CutOff, Entry, read_log
from simbench.isolate.frames import HEAD, Frame, FrameError, sizes, unpack

ENCODING = "simbench-frame/1"
MANIFEST = "recording.json"


def _printable(text: str) -> str:
    """ValueError: it would do something to a terminal."""
    if not text.isprintable():
        raise ValueError("it holds a character that cannot be printed")
    return text


Word = Annotated[str, Field(max_length=4000), AfterValidator(_printable)]


class Part(Spec):
    """One of the two files. sha256: of the hashes of its messages, in their order."""

    count: Annotated[int, Field(ge=0)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    topics: Mapping[Word, Annotated[int, Field(ge=1)]]


def frames_of(path: Path, part: Part | None, missing: list[str]) -> Iterator[Frame]:
    """All frames, one by one; what is missing is added at the end. BadInput: the file is damaged, or another
    than the manifest says."""
    total, counts = hashlib.sha256(), Counter[str]()
    try:
        for entry in read_log(path, encoding=ENCODING):
            total.update(entry.digest)
            counts[entry.topic] += 1
            yield _frame(entry, path)
    except CutOff:
        of = "" if part is None else f" of {part.count}"
        missing.append(f"{path.name}: it is cut off after {counts.total()}{of} messages")
        return
    if part is not None and total.hexdigest() != part.sha256:
        raise BadInput(f"is not the file that {MANIFEST} tells of: its hash is another", file=str(path))
    if part is not None and (part.count, dict(part.topics)) != (counts.total(), counts):
        raise BadInput(f"has not the messages that {MANIFEST} counts", file=str(path))


def _frame(entry: Entry, path: Path) -> Frame:
    try:
        header, body = sizes(entry.data[: HEAD.size])
        if HEAD.size + header + body != len(entry.data):
            raise FrameError(f"a frame of {HEAD.size + header + body} bytes stands in {len(entry.data)}")
        return unpack(entry.data[HEAD.size : HEAD.size + header], entry.data[HEAD.size + header :])
    except (FrameError, ValueError, OverflowError) as error:
        raise BadInput(f"{entry.topic[:80]}, message {entry.seq}: {error}", file=str(path)) from None
