"""The process of a Python pipeline: `main` answers frames until they end.

Frames come on what was stdin and go to what was stdout. Both are put aside first: the pipeline's own stdin is
empty, and what it prints, by Python or below, goes to stderr. Imports nothing heavy: neither MuJoCo nor numba
nor anything that knows the truth.
"""

from __future__ import annotations

import os
import sys
import time
from types import MappingProxyType
from typing import Any, BinaryIO

from fusion.messages import FusionOutput
from scenarios.errors import BadInput
from simbench.isolate.answers import output_frame, trajectories_frame
from simbench.isolate.confine import confine
from simbench.isolate.frames import Frame, FrameError, pack, read
from simbench.isolate.told import PROTOCOL, read_message, read_reset
from simbench.plugins import last_line, load_pipeline


def main(reference: str, folder: str, memory_mb: str, parent: str) -> None:
    """Serve one pipeline. `folder` is the user's: files are named relative to it, modules are found there."""
    confine(int(memory_mb), int(parent))
    told, answers = _take_stdio()
    sys.path.insert(0, folder)
    host = Host(reference, folder)
    while (frame := read(told)) is not None:
        answers.write(host.answer(frame))
        answers.flush()


def _take_stdio() -> tuple[BinaryIO, BinaryIO]:
    """The protocol's two streams, out of reach of whoever reads from 0 or writes to 1."""
    told, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.close(empty)
    os.dup2(2, 1)
    return told, answers


def _whole(reference: str, folder: str) -> str:
    """A reference to a file by its whole path; its folder is where its neighbours are found."""
    where, _, _ = reference.rpartition(":")
    if not where.endswith(".py"):
        return reference
    sys.path.insert(0, os.path.dirname(os.path.abspath(os.path.join(folder, where))))
    return os.path.join(folder, reference)


class Host:
    """A pipeline, made when its first run begins."""

    def __init__(self, reference: str, folder: str) -> None:
        self._reference = _whole(reference, folder)
        self._place = self._reference.removesuffix(reference)  # the user named it without
        self._factory: Any = None
        self._pipeline: Any = None

    def answer(self, frame: Frame) -> bytes:
        """The answer to a frame; an `error` where the pipeline raises or answers what it may not."""
        fields = dict(frame.fields)
        number = fields.pop("id")
        try:
            found = self._answer(Frame(kind=frame.kind, fields=fields, arrays=frame.arrays))
            return pack(_numbered(found, number))
        except BadInput as error:
            problem = error.problem.replace(self._place, "") if self._place else error.problem
            why = {"why": problem, "allowed": error.allowed, "hint": error.hint}
        except FrameError as error:
            why = {"why": str(error)}
        except BaseException as error:  # whatever the user's code raises ends its case, SystemExit too
            why = {"why": last_line(error)}
        return pack(_numbered(Frame(kind="error", fields=why), number))

    def _answer(self, frame: Frame) -> Frame:
        if frame.kind == "describe":
            self._factory = load_pipeline(self._reference)
            reads = bool(getattr(self._factory, "reads_images", True))
            return Frame(kind="description", fields={"protocol": PROTOCOL, "reads_images": reads})
        if frame.kind == "reset":
            calibration, categories = read_reset(frame)
            if self._pipeline is None:
                self._pipeline = self._factory()
            self._pipeline.reset(calibration, MappingProxyType(categories))
            return Frame(kind="ready")
        if frame.kind == "finish":
            tracks = tuple(self._pipeline.trajectories())
            clock = getattr(self._pipeline, "timings_ns", None)
            steps = {step: tuple(values) for step, values in clock().items()} if clock else {}
            return trajectories_frame(tracks, steps)
        message = read_message(frame)
        begun = time.perf_counter_ns()
        output = self._pipeline.update(message)
        took = {"took_ns": time.perf_counter_ns() - begun}
        if output is None:
            return Frame(kind="nothing", fields=took)
        if not isinstance(output, FusionOutput):
            raise FrameError(f"update must return a FusionOutput or None, not {type(output).__name__}")
        found = output_frame(output)
        return Frame(kind=found.kind, fields={**found.fields, **took}, arrays=found.arrays)


def _numbered(frame: Frame, number: int) -> Frame:
    return Frame(kind=frame.kind, fields={"id": number, **frame.fields}, arrays=frame.arrays)
