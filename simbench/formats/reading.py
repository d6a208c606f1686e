"""A recording's two files read as streams: every message and every part of the truth is handed out as soon as
it is known to be sound. Memory grows with what the caller keeps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from fusion.messages import Calibration, CategorySize, Measurement
from scenarios.errors import BadInput
from simbench.formats.picture_frames import PICTURE, Album
from simbench.formats.sound import Heard, sound_messages
from simbench.formats.sound_truth import Outline, check_fit, sound_parts
from simbench.formats.stored_frames import Part, frames_of
from simbench.formats.truth_parts import TruthPart, truth_parts
from simbench.isolate.frames import Frame, FrameError
from simbench.isolate.told import read_message, read_reset


@dataclass(kw_only=True, eq=False)
class Reading:
    """Which files, and what is known of them so far. missing: what of them is not there, in sentences."""

    messages: Path
    truth: Path
    parts: tuple[Part | None, Part | None]  # what the manifest says of them
    missing: list[str]
    heard: list[Heard] = field(default_factory=list)
    outline: Outline = field(default_factory=Outline)


def read_told(
    reading: Reading,
) -> tuple[Calibration, dict[str, CategorySize], Iterator[Measurement]]:
    """What a pipeline is told, its messages one by one. BadInput, also from these: the file is damaged, or
    what it holds cannot be."""
    file = str(reading.messages)
    frames = frames_of(reading.messages, reading.parts[0], reading.missing)
    first = next(frames, None)
    if first is None or first.kind != "reset":
        wrong = "is cut off before its calibration" if first is None else "does not begin with a calibration"
        raise BadInput(wrong, file=file)
    try:
        calibration, categories = read_reset(first)
    except FrameError as error:
        raise BadInput(f"is malformed: {error}", file=file) from None
    messages = _messages(frames, file)
    return calibration, categories, sound_messages(calibration, categories, messages, reading.heard, file)


def read_parts(reading: Reading) -> Iterator[TruthPart]:
    """The truth part by part, after all messages, and whether all fits. BadInput: as above."""
    file = str(reading.truth)
    before = len(reading.missing)
    frames = frames_of(reading.truth, reading.parts[1], reading.missing)
    try:
        yield from sound_parts(truth_parts(frames), reading.outline, file)
    except FrameError as error:
        if reading.missing[before:]:
            raise BadInput("is cut off before its poses", file=file) from None
        raise BadInput(f"is malformed: {error}", file=file) from None
    check_fit(reading.outline, reading.heard, whole=not reading.missing, file=file)


def _messages(frames: Iterator[Frame], file: str) -> Iterator[Measurement]:
    pictures = Album()
    try:
        for frame in frames:
            yield pictures.read(frame) if frame.kind == PICTURE else read_message(frame)
    except FrameError as error:
        raise BadInput(f"is malformed: {error}", file=file) from None
