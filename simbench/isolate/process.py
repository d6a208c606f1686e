"""A process that answers frames, held to its limits, and ended with everything that it started.

One thread does all: while the bench waits for an answer it writes the question, reads the answer, drains what
is said on stderr, and looks at the clock and at the memory. So neither side can block the other.
"""

from __future__ import annotations

import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from simbench.isolate import confine, kin
from simbench.isolate.frames import HEAD, Frame, FrameError, pack, sizes, unpack
from simbench.isolate.limits import Failed, Limits, TimedOut
from simbench.isolate.reference import Command

TICK_S = 0.02  # between two looks at the memory of the process
KIN_EVERY = 10  # ticks between two looks for its children
GRACE_S = 0.5  # from SIGTERM to SIGKILL; at most this long for an end of its own
CHUNK = 2**20
TAIL = 8192  # bytes of stderr that are kept
LONGEST_WORDS = 200
MOST_ANSWERED = 2**30  # bytes in a case


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """`frame` without its id; `waited_ns`: from the question, packed, to the answer, read."""

    frame: Frame
    waited_ns: int


class Process:
    """`ask`, and be answered. Raises `Failed` or `TimedOut`, with one sentence; OSError where it cannot be
    started at all. A context manager: leaving it ends the process, its children, and its folder.
    """

    def __init__(self, command: Command, limits: Limits) -> None:
        self._limits = limits
        self._folder = Path(tempfile.mkdtemp(prefix="simbench-pipeline-")).resolve()
        self._token = uuid.uuid4().hex
        self._begun = self._looked = time.monotonic()
        self._looks = self._asked = self._answered = 0
        self._found, self._tail = bytearray(), bytearray()
        self._silent = self._closed = False
        try:
            self._child = subprocess.Popen(
                _words(command, limits),
                cwd=self._folder,
                env={**dict(command.environment), kin.TOKEN: self._token},
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                bufsize=0,
                start_new_session=True,
            )  # fmt: skip
        except OSError:
            remove(self._folder)
            raise
        assert self._child.stdin and self._child.stdout and self._child.stderr
        self._in, self._out, self._err = (
            stream.fileno() for stream in (self._child.stdin, self._child.stdout, self._child.stderr)
        )
        for number in (self._in, self._out, self._err):
            os.set_blocking(number, False)
        self._ready = selectors.DefaultSelector()
        self._ready.register(self._out, selectors.EVENT_READ)
        self._ready.register(self._err, selectors.EVENT_READ)

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def ask(self, frame: Frame, what: str, limit_s: float | None = None) -> Answer:
        """The answer to a frame. `what` is asked, in words; `limit_s`: None: that of a message."""
        self._asked += 1
        numbered = Frame(kind=frame.kind, fields={"id": self._asked, **frame.fields}, arrays=frame.arrays)
        question = memoryview(pack(numbered))
        begun = time.perf_counter_ns()
        until = time.monotonic() + (self._limits.message_s if limit_s is None else limit_s)
        self._ready.register(self._in, selectors.EVENT_WRITE)
        try:
            while True:
                for key, _ in self._ready.select(TICK_S):
                    if key.fd == self._in:
                        question = self._write(question, what)
                    elif key.fd == self._out:
                        self._read()
                    else:
                        self._listen()
                answer = self._take(what)
                if answer is not None:
                    if question:
                        raise Failed(f"it answered before it had read all of {what}")
                    return Answer(frame=answer, waited_ns=time.perf_counter_ns() - begun)
                self._check_life(what)
                self._check_memory(what)
                self._check_time(what, until, limit_s)
        finally:
            if self._in in self._ready.get_map():
                self._ready.unregister(self._in)

    def finish(self) -> None:
        """No more questions. Failed: it said more than it was asked."""
        self._child.stdin.close()  # type: ignore[union-attr]
        until = time.monotonic() + GRACE_S
        while not self._silent and not self._found and time.monotonic() < until:
            for key, _ in self._ready.select(TICK_S):
                self._read() if key.fd == self._out else self._listen()
        if self._found:
            raise Failed("it wrote more than one answer to a question, or something that is no answer")

    def close(self) -> None:
        """End the process and all that it started, whatever they do; remove their folder."""
        if self._closed:
            return
        self._closed = True
        try:
            kin.end(self._child.pid, self._token, lambda: self._exit() is not None, GRACE_S)
        finally:
            self._child.wait()
            self._ready.close()
            for stream in (self._child.stdin, self._child.stdout, self._child.stderr):
                stream.close()  # type: ignore[union-attr]
            remove(self._folder)

    # -- the three pipes ----------------------------------------------------------------------------------

    def _write(self, question: memoryview, what: str) -> memoryview:
        try:
            left = question[os.write(self._in, question[:CHUNK]) :]
        except BlockingIOError:
            return question
        except BrokenPipeError:
            self._ready.unregister(self._in)
            self._settle()
            self._check_life(what)
            raise Failed(f"it closed its input before it had read all of {what}{self._words()}") from None
        if not left:
            self._ready.unregister(self._in)
        return left

    def _read(self) -> None:
        try:
            more = os.read(self._out, CHUNK)
        except BlockingIOError:
            return
        if not more:
            self._silent = True
            self._ready.unregister(self._out)
        self._found += more
        self._answered += len(more)

    def _listen(self) -> None:
        try:
            more = os.read(self._err, CHUNK)
        except BlockingIOError:
            return
        if not more:
            self._ready.unregister(self._err)
        self._tail = (self._tail + more)[-TAIL:]

    def _take(self, what: str) -> Frame | None:
        """The answer, once all of it is there and nothing else."""
        if self._answered > MOST_ANSWERED:
            raise Failed(f"it answered with more than {MOST_ANSWERED >> 20} MB in all")
        if len(self._found) < HEAD.size:
            return None
        try:
            header, body = sizes(bytes(self._found[: HEAD.size]))
            end = HEAD.size + header + body
            if len(self._found) < end:
                return None
            frame = unpack(
                bytes(self._found[HEAD.size : HEAD.size + header]),
                bytes(self._found[HEAD.size + header : end]),
            )
        except FrameError as error:
            raise Failed(f"its answer to {what} is no frame: {error}") from error
        if len(self._found) > end:
            raise Failed(f"it wrote more than one answer to {what}")
        self._found.clear()
        fields = dict(frame.fields)
        if fields.pop("id", None) != self._asked:
            raise Failed(f"its answer to {what} has not the id of the question, {self._asked}")
        return Frame(kind=frame.kind, fields=fields, arrays=frame.arrays)

    # -- what can go wrong --------------------------------------------------------------------------------

    def _check_life(self, what: str) -> None:
        if self._silent:
            self._settle()
        ended = self._exit()
        if ended is None and not self._silent:
            return
        if not self._silent and self._ready.select(0):
            return  # something it said is still to be read
        self._listen_to_the_end()
        if ended is None:
            how = "closed its output"
        elif ended.si_code == os.CLD_EXITED:
            how = f"ended with exit code {ended.si_status}"
        else:
            how = f"was ended by {signal.Signals(ended.si_status).name}"
        raise Failed(f"its process {how} before it answered {what}{self._words()}")

    def _check_memory(self, what: str) -> None:
        if time.monotonic() - self._looked < TICK_S:
            return
        self._looked = time.monotonic()
        self._looks += 1
        most, pid = self._limits.memory_mb, self._child.pid
        pids = [pid, *(n for n in kin.in_session(pid) if n != pid)] if self._looks % KIN_EVERY == 0 else [pid]
        if kin.memory_mb(pids) > most and kin.own_memory_mb(pids) > most:
            raise Failed(f"it took more than {most} MB of memory while it worked on {what}")

    def _check_time(self, what: str, until: float, limit_s: float | None) -> None:
        now = time.monotonic()
        if now > self._begun + self._limits.case_s:
            raise TimedOut(f"the case took more than {self._limits.case_s:g} s; {what} was not yet answered")
        if now > until:
            limit_s = self._limits.message_s if limit_s is None else limit_s
            raise TimedOut(f"{what} was not answered within {limit_s:g} s{self._words()}")

    def _exit(self) -> os.waitid_result | None:
        """How it ended, None while it lives. It stays unwaited for, so that its number stays its own."""
        return os.waitid(os.P_PID, self._child.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)

    def _settle(self) -> None:
        """A process whose pipe has just broken is about to end: a moment, to say how."""
        until = time.monotonic() + GRACE_S
        while self._exit() is None and time.monotonic() < until:
            time.sleep(0.005)

    def _listen_to_the_end(self) -> None:
        while self._err in self._ready.get_map() and any(
            key.fd == self._err for key, _ in self._ready.select(0)
        ):
            self._listen()

    def _words(self) -> str:
        """The last line on stderr, if there is one."""
        text = self._tail.decode("utf-8", errors="replace").replace(str(self._folder), ".")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if not lines:
            return ""
        printable = "".join(c if c.isprintable() else "?" for c in lines[-1])
        return f"; its last words: {printable[:LONGEST_WORDS]}"


def _words(command: Command, limits: Limits) -> list[str]:
    limited = [str(limits.memory_mb), str(os.getpid())]
    if command.is_host:
        return [*command.words, *limited]
    return [sys.executable, "-I", "-S", confine.__file__, *limited, *command.words]


def remove(folder: Path) -> None:
    """Remove a folder and all in it, also what was made unwritable. Links are not followed."""
    for place, folders, _ in os.walk(folder):
        for name in (".", *folders):
            path = Path(place, name)
            if not path.is_symlink():
                path.chmod(0o700)
    shutil.rmtree(folder, ignore_errors=True)
