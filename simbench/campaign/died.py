"""How a task can end without an answer, whatever ran it."""

from __future__ import annotations


class WorkerDied(RuntimeError):  # noqa: N818  (what happened, not who is wrong)
    """The process that worked on a task is gone. how: "signal 9", "exit code 3", or what else is known."""

    def __init__(self, how: str) -> None:
        self.how = how
        super().__init__(how)


class TookTooLong(RuntimeError):  # noqa: N818
    """A task was given up after its time limit."""

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        super().__init__(f"took longer than {limit_s:g} s")

    def __reduce__(self) -> tuple[object, ...]:
        """Send the limit home, not the sentence."""
        return TookTooLong, (self.limit_s,)


def in_words(exit_code: int) -> str:
    """An exit code as multiprocessing gives it: negative for a signal."""
    return f"signal {-exit_code}" if exit_code < 0 else f"exit code {exit_code}"
