"""A campaign: every task once, whatever happens to workers, driver, disk or clock in between."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass, field
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

from scenarios.errors import BadInput
from simbench.campaign.died import TookTooLong, WorkerDied
from simbench.campaign.executor import in_flight
from simbench.campaign.key import code_digest
from simbench.campaign.ledger import Done, Ledger

Task = TypeVar("Task")
TRIES = 3
CHECK_S = 5.0
"""How long nothing may come back before the executor is asked whether something will."""


def campaign(
    work: Callable[[Task], str],
    tasks: Iterable[Task],
    key: Callable[[Task], str],
    executor: Executor,
    ledger: Ledger,
    done: Callable[[Done], None] = lambda _: None,
) -> Iterator[Done]:
    """What `work` makes of every task, in the order of the tasks; what the ledger holds is not made again.

    work: a function of a module that gives JSON text: the same bytes wherever it runs. done: hears of every
    row as soon as it is on the disk. Few tasks are handed out at a time, and what is finished is read back
    from the ledger, so that memory does not grow with their number. A task whose worker died is tried again;
    at the third time it runs alone, after all others, so that it is known to be the one; then it counts as
    failed. BadInput of a task ends the campaign, as do a full disk and a lost cluster: the ledger is intact,
    and the same call goes on from there.
    """
    return _Campaign(work=work, executor=executor, ledger=ledger, told=done).run(enumerate(tasks), key)


@dataclass(kw_only=True)
class _Open(Generic[Task]):
    """A task that is not over. deaths: how its workers died so far."""

    key: str
    place: int
    task: Task
    deaths: list[str] = field(default_factory=list)


@dataclass(kw_only=True)
class _Campaign(Generic[Task]):
    work: Callable[[Task], str]
    executor: Executor
    ledger: Ledger
    told: Callable[[Done], None]
    running: dict[Future[Any], _Open[Task]] = field(default_factory=dict)
    suspects: deque[_Open[Task]] = field(default_factory=deque)
    ended: SimpleQueue[Future[Any]] = field(default_factory=SimpleQueue)
    open: set[str] = field(default_factory=set)

    def run(self, feed: Iterator[tuple[int, Task]], key: Callable[[Task], str]) -> Iterator[Done]:
        due: deque[str] = deque()  # keys in the order of the tasks
        try:
            more = True
            while more or due:
                room = in_flight(self.executor)
                while more and len(self.running) < room:
                    for place, task in islice(feed, 1):
                        due.append(key(task))
                        self.begin(due[-1], place, task)
                        break
                    else:
                        more = False
                    while due and due[0] not in self.open:
                        yield self.ledger.get(due.popleft())
                if not self.running and self.suspects:
                    self.submit(self.suspects.popleft())
                if self.running:
                    self.collect()
                while due and due[0] not in self.open:
                    yield self.ledger.get(due.popleft())
        finally:
            for future in self.running:
                future.cancel()

    def begin(self, key: str, place: int, task: Task) -> None:
        """Hand out a task that is neither kept nor under way."""
        if key not in self.open and key not in self.ledger:
            self.open.add(key)
            self.submit(_Open(key=key, place=place, task=task))

    def submit(self, one: _Open[Task]) -> None:
        future = self.executor.submit(answer, self.work, one.task, code_digest())
        self.running[future] = one
        future.add_done_callback(self.ended.put)

    def collect(self) -> None:
        """Wait for one task, and keep what came of it."""
        future = self.next_ended()
        one = self.running.pop(future)
        try:
            value, failure = future.result()
        except WorkerDied as died:
            one.deaths.append(died.how)
            if len(one.deaths) < TRIES:
                if len(one.deaths) == TRIES - 1:
                    self.suspects.append(one)
                else:
                    self.submit(one)
                return
            how = ", ".join(dict.fromkeys(one.deaths))
            row = Done(
                key=one.key, value=None, failure=f"its worker died {TRIES} times: {how}", status="died"
            )
        except TookTooLong as late:
            row = Done(key=one.key, value=None, failure=str(late), status="timeout")
        except CancelledError as error:
            raise BadInput("a task was cancelled by what runs it; the same command goes on") from error
        else:
            row = Done(
                key=one.key, value=value, failure=failure, status="ok" if failure is None else "raised"
            )
        self.ledger.add(row, one.place)
        self.open.discard(one.key)
        self.told(row)

    def next_ended(self) -> Future[Any]:
        check = getattr(self.executor, "check", lambda: None)
        while True:
            try:
                return self.ended.get(timeout=CHECK_S)
            except Empty:
                check()


def answer(work: Callable[[Task], str], task: Task, code: str) -> tuple[str | None, str | None]:
    """In a worker: what the work gives, or why it gives nothing. BadInput and a machine that cannot draw are
    raised: they are of the whole campaign. So is a worker that runs other code than the driver."""
    if code_digest() != code:
        raise BadInput(
            "a worker runs other code than the driver: another version, or files changed meanwhile"
        )
    try:
        value = work(task)
        if not isinstance(value, str):
            raise TypeError(f"the work gave {type(value).__name__}, not JSON text")
        return value, None
    except (Exception, SystemExit) as error:
        if isinstance(error, BadInput) or _cannot_draw(error):
            raise
        return None, " ".join(f"{type(error).__name__}: {error}".split())


def _cannot_draw(error: BaseException) -> bool:
    gl = sys.modules.get("simbench.sensors.gl")
    return gl is not None and isinstance(error, gl.RenderingUnavailable)
