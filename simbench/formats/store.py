"""A recording on disk: a folder with what a pipeline may see and, apart from it, the truth.

    recording.json   what it is, how it was made, counts and hashes; `complete` only when all was written
    messages.mcap    calibration and categories, then every message in order of arrival
    truth.mcap       objects, poses, reference; per scan and image what really happened

Both MCAP files hold frames (`isolate/frames.py`, the same as a pipeline in a process of its own is told, but
that pictures are PNG).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain, zip_longest
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from fusion.messages import CameraImage, LidarScan
from scenarios.errors import BadInput, Where
from scenarios.scenario import Spec
from scenarios.validate import validate
from simbench.faults.receipt import Receipt
from simbench.files import prepare_folder, read_plain, write_text
from simbench.formats.container import LogWriter
from simbench.formats.picture_frames import AsPng, picture_frame
from simbench.formats.png import encode
from simbench.formats.reading import Reading, read_parts, read_told
from simbench.formats.stored_frames import ENCODING, MANIFEST, Part, Word
from simbench.formats.truth_frames import truth_frames
from simbench.formats.truth_parts import truth_of
from simbench.isolate.frames import Frame, pack, pieces
from simbench.isolate.told import message_frame, reset_frame
from simbench.recording import Recording

__all__ = [
    "MANIFEST", "MESSAGES", "NOTHING", "TRUTH", "Injected", "Manifest", "Part", "Source", "Stored",
    "check_recording", "first_difference", "read_manifest", "read_recording", "write_recording",
]  # fmt: skip

SCHEMA = "simbench-recording/1"
MESSAGES, TRUTH = "messages.mcap", "truth.mcap"
LONGEST_MANIFEST = 1_000_000


def _receipt(value: object) -> object:
    """A receipt of what a file holds of it; strict models take instances only."""
    return TypeAdapter(Receipt).validate_python(value) if isinstance(value, dict) else value


class Source(Spec):
    """What was recorded, in the words of `simbench generate`."""

    scenario: Word
    system: Word
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    faults: tuple[Word, ...] = ()
    changes: tuple[Word, ...] = ()
    images: Literal["none", "raycast", "gl"] = "none"


class Injected(Spec):
    """Which errors act: the set's label, all fields by fault, how the body shook in words, and what proves
    them."""

    label: Word = "none"
    specs: Mapping[Word, Mapping[str, Any]] = {}
    shake: Word = ""
    receipts: tuple[Annotated[Receipt, BeforeValidator(_receipt)], ...] = ()


NOTHING = Injected()


class Manifest(Spec):
    """What a recording says of itself. simbench: the version that wrote it."""

    complete: bool
    simbench: Word
    source: Source
    injected: Injected = NOTHING
    messages: Part | None = None
    truth: Part | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Stored:
    """What was read. missing: what of it is not there, in sentences; empty: nothing, all hashes are right."""

    manifest: Manifest
    recording: Recording
    missing: tuple[str, ...]

    @property
    def status(self) -> Literal["COMPLETE", "INCOMPLETE"]:
        return "INCOMPLETE" if self.missing else "COMPLETE"


def write_recording(
    recording: Recording,
    folder: Path,
    source: Source,
    injected: Injected = NOTHING,
    as_png: AsPng = encode,
) -> Manifest:
    """Write a recording into a folder that holds none. BadInput: it holds one, or cannot be written."""
    from importlib.metadata import version

    prepare_folder(folder)
    if (folder / MANIFEST).exists():
        raise BadInput("holds a recording already", file=str(folder))
    begun = Manifest(complete=False, simbench=version("simbench"), source=source, injected=injected)
    _write_manifest(begun, folder)
    try:
        with ThreadPoolExecutor(max_workers=1) as beside:  # hashes and checksums release the interpreter
            really = beside.submit(_write, folder / TRUTH, _truth(recording))
            messages = _write(folder / MESSAGES, _messages(recording, as_png))
            truth = really.result()
    except OSError as error:
        raise BadInput(f"cannot be written: {error.strerror or error}", file=str(folder)) from error
    done = begun.model_copy(update={"complete": True, "messages": messages, "truth": truth})
    _write_manifest(done, folder)
    return done


def read_recording(folder: Path, *, images: bool = True) -> Stored:
    """A recording from its folder. One that was cut off is read up to there, and `missing` says so. images:
    False leaves pictures out, once they are checked. BadInput: there is no recording, what is there is
    damaged, or it cannot be (`sound.py`)."""
    manifest, reading = _opened(folder)
    calibration, categories, messages = read_told(reading)
    told = tuple(one for one in messages if images or not isinstance(one, CameraImage))
    recording = Recording(
        calibration=calibration, categories=categories, messages=told, truth=truth_of(read_parts(reading))
    )
    return Stored(manifest=manifest, recording=recording, missing=tuple(reading.missing))


def check_recording(folder: Path) -> tuple[Manifest, tuple[str, ...]]:
    """What a folder's recording says of itself, and what of it is missing: all of `read_recording` but the
    recording, of which one message at a time is held. BadInput as there."""
    manifest, reading = _opened(folder)
    for _ in chain(read_told(reading)[2], read_parts(reading)):
        pass
    return manifest, tuple(reading.missing)


def _opened(folder: Path) -> tuple[Manifest, Reading]:
    manifest = read_manifest(folder)
    missing = [] if manifest.complete else ["recording.json: writing was not completed"]
    return manifest, Reading(
        messages=folder / MESSAGES, truth=folder / TRUTH, parts=(manifest.messages, manifest.truth),
        missing=missing,
    )  # fmt: skip


def read_manifest(folder: Path) -> Manifest:
    """What a folder's recording says of itself. BadInput: there is none, or it is malformed."""
    path = folder / MANIFEST
    if not path.exists():
        raise BadInput(f"holds no {MANIFEST}: no recording lies there", file=str(folder))
    content = read_plain(path, LONGEST_MANIFEST)
    try:
        data = json.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"is no JSON that can be read: {error}", file=str(path)) from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else None
        raise BadInput(f"is no recording: its schema is {str(found)[:60]!r}", file=str(path), allowed=SCHEMA)
    found = validate(Manifest, {k: v for k, v in data.items() if k != "schema"}, Where(file=str(path)))
    if found.complete and (found.messages is None or found.truth is None):
        raise BadInput("says that it is complete, and holds no hash of its files", file=str(path))
    return found


def _write_manifest(manifest: Manifest, folder: Path) -> None:
    content = {"schema": SCHEMA, **manifest.model_dump(mode="json")}
    write_text(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def _messages(recording: Recording, as_png: AsPng = encode) -> Iterator[tuple[str, int, int, Frame]]:
    """Topic, arrival, claimed stamp and frame."""
    first_ns = recording.messages[0].arrival_ns if recording.messages else 0
    yield "/calibration", first_ns, first_ns, reset_frame(recording.calibration, recording.categories)
    for message in recording.messages:
        if isinstance(message, CameraImage):
            frame = picture_frame(message, as_png)
        else:
            frame = message_frame(message)
        yield f"/{message.sensor}/{frame.kind}", message.arrival_ns, message.stamp_ns, frame


def _truth(recording: Recording) -> Iterator[tuple[str, int, int, Frame]]:
    stamps = [m.stamp_ns for m in recording.messages if isinstance(m, LidarScan)]
    claimed = (min(stamps), max(stamps) + recording.truth.period_ns) if stamps else ()
    for topic, t_ns, frame in truth_frames(recording.truth, claimed):
        yield topic, t_ns, t_ns, frame


def _write(path: Path, frames: Iterator[tuple[str, int, int, Frame]]) -> Part:
    """Times before 0 are written as 0 in the index; frames hold the true ones."""
    counts: dict[str, int] = {}
    with LogWriter(path, encoding=ENCODING, describe=_described) as log:
        for topic, log_ns, publish_ns, frame in frames:
            seq = counts.get(topic, 0)
            log.add(topic, pieces(frame), log_ns=max(log_ns, 0), publish_ns=max(publish_ns, 0), seq=seq)
            counts[topic] = seq + 1
        total = log.close()
    return Part(count=sum(counts.values()), sha256=total, topics=counts)


def _described(topic: str) -> tuple[str, str]:
    return f"simbench/{topic.rpartition('/')[2]}", "SHA-256 (32 bytes), then a frame: see docs/formats.md"


def first_difference(stored: Recording, again: Recording) -> str | None:
    """Where two recordings differ first, in words; None: all frames of both are equal bit by bit."""
    for what, frames in (("message", _messages), ("truth", _truth)):
        for number, (one, other) in enumerate(zip_longest(frames(stored), frames(again))):
            if one is None or other is None:
                return f"{what} {number}: only one of both has it"
            if pack(one[3]) != pack(other[3]):
                return f"{what} {number}, {one[0]} at {one[1]} ns"
    return None
