"""A pipeline in a process of its own, as the three methods of any pipeline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Any

from fusion.messages import Calibration, CategorySize, FusionOutput, Measurement, Trajectory
from scenarios.errors import BadInput
from simbench.isolate.answers import Steps, read_output, read_trajectories
from simbench.isolate.fields import Taken
from simbench.isolate.frames import Frame, FrameError
from simbench.isolate.limits import Failed, Limits
from simbench.isolate.process import Process
from simbench.isolate.reference import Command
from simbench.isolate.told import PROTOCOL, message_frame, reset_frame

LONGEST_WHY = 400


class Session:
    """Raises `Failed` or `TimedOut` where the process does; BadInput where its pipeline cannot be loaded. A
    context manager, like its process.

    `took_ns`: of the last update, by the pipeline's process where it says so, and never more than the bench
    has waited.
    """

    def __init__(self, command: Command, limits: Limits) -> None:
        self._process = Process(command, limits)
        self._told = 0
        self._steps: Steps = {}
        self.took_ns = 0
        try:
            self.reads_images = self._describe(command.name, limits.start_s)
        except BaseException:
            self._process.close()
            raise

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.close()

    def finish(self) -> None:
        """No more questions. Failed: it said more than it was asked."""
        self._process.finish()

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        """Begin a run."""
        self._told = 0
        answer, _ = self._ask(reset_frame(calibration, categories), "reset", "ready")
        with _reading("reset"):
            Taken(answer).end()

    def update(self, measurement: Measurement) -> FusionOutput | None:
        """Tell one message."""
        name = type(measurement).__name__
        what = f"message {self._told} ({name} {measurement.seq} of '{measurement.sensor}')"
        self._told += 1
        answer, waited_ns = self._ask(message_frame(measurement), what, "nothing", "output")
        fields = dict(answer.fields)
        took_ns = fields.pop("took_ns", waited_ns)
        rest = Frame(kind=answer.kind, fields=fields, arrays=answer.arrays)
        with _reading(what):
            if type(took_ns) is not int or took_ns < 0:
                raise FrameError("'took_ns' is no count of nanoseconds")
            self.took_ns = min(took_ns, waited_ns)
            if rest.kind == "output":
                return read_output(rest)
            Taken(rest).end()
        return None

    def trajectories(self) -> tuple[Trajectory, ...]:
        """End a run."""
        answer, _ = self._ask(Frame(kind="finish"), "finish", "trajectories")
        with _reading("finish"):
            found, self._steps = read_trajectories(answer)
        return found

    def timings_ns(self) -> Steps:
        """The nanoseconds of the pipeline's own steps; it says them with its trajectories."""
        return self._steps

    def _describe(self, name: str, limit_s: float) -> bool:
        """Whether it reads images. BadInput: it says itself that it cannot be loaded."""
        answer = self._process.ask(Frame(kind="describe"), "describe", limit_s).frame
        if answer.kind == "error":
            allowed, hint = (_text(answer.fields.get(key)) for key in ("allowed", "hint"))
            raise BadInput(_why(answer), allowed=allowed, hint=hint)
        if answer.kind != "description":
            raise Failed(f"its answer to describe is a '{answer.kind[:40]}'")
        with _reading("describe"):
            taken = Taken(answer)
            if (protocol := taken.text("protocol")) != PROTOCOL:
                raise FrameError(f"it speaks '{protocol}', not {PROTOCOL}")
            reads = taken.optional("reads_images", True)
            taken.end()
            if not isinstance(reads, bool):
                raise FrameError("'reads_images' is neither true nor false")
        return reads

    def _ask(self, frame: Frame, what: str, *kinds: str) -> tuple[Frame, int]:
        answer = self._process.ask(frame, what)
        if answer.frame.kind == "error":
            raise Failed(_why(answer.frame))
        if answer.frame.kind not in kinds:
            known = " or ".join(kinds)
            raise Failed(f"its answer to {what} is a '{answer.frame.kind[:40]}', not {known}")
        return answer.frame, answer.waited_ns


@contextmanager
def _reading(what: str) -> Iterator[None]:
    try:
        yield
    except FrameError as error:
        raise Failed(f"its answer to {what} cannot be used: {error}") from error


def _why(answer: Frame) -> str:
    return (_text(answer.fields.get("why")) or "it answered with an error and no reason")[:LONGEST_WHY]


def _text(value: Any) -> str | None:
    """Text on one line, None where it is none."""
    if not isinstance(value, str):
        return None
    return "".join(c if c.isprintable() else "?" for c in " ".join(value.split()))
