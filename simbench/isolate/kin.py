"""The processes that a pipeline's process has started, and their memory, from /proc.

Kin are found by their session, and, where they left that, by a word in their environment.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

TOKEN = "SIMBENCH_PIPELINE_PROCESS"
_PAGE = os.sysconf("SC_PAGE_SIZE")
_ROUNDS = 50


def in_session(session: int) -> list[int]:
    """Live processes of a session; zombies are dead."""
    found = []
    for pid in _all():
        state, _, _, sid = _stat(pid)
        if sid == session and state not in "ZX":
            found.append(pid)
    return found


def memory_mb(pids: list[int]) -> float:
    """Resident memory of processes together; pages that they share count once for each of them."""
    pages = [words[1] for pid in pids if len(words := _read(pid, "statm").split()) > 1]
    return sum(map(int, pages)) * _PAGE / 2**20


def own_memory_mb(pids: list[int]) -> float:
    """The same with shared pages counted once in all. Slower."""
    total = 0
    for pid in pids:
        for line in _read(pid, "smaps_rollup").splitlines():
            if line.startswith("Pss:"):
                total += int(line.split()[1])
    return total / 1024


def end(session: int, token: str, gone: Callable[[], bool], grace_s: float) -> None:
    """SIGTERM to a session, then, after `grace_s` or once its leader is `gone`, SIGKILL to all kin until none
    lives. The leader must not have been waited for: so its number is still its own."""
    _signal_group(session, signal.SIGTERM)
    until = time.monotonic() + grace_s
    while not gone() and time.monotonic() < until:
        time.sleep(0.01)
    for _ in range(_ROUNDS):
        _signal_group(session, signal.SIGKILL)
        left = {*in_session(session), *_marked(token)}
        if not left:
            return
        for pid in left:
            _signal(pid, signal.SIGKILL)
        time.sleep(0.01)


def _marked(token: str) -> list[int]:
    wanted = f"{TOKEN}={token}".encode()
    found = []
    for pid in _all():
        try:
            words = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        except OSError:  # it is another user's, or has just ended
            continue
        if wanted in words and _stat(pid)[0] not in "ZX":
            found.append(pid)
    return found


def _all() -> Iterator[int]:
    return (int(name) for name in os.listdir("/proc") if name.isdigit())


def _stat(pid: int) -> tuple[str, int, int, int]:
    """State, parent, group and session of a process; dead where it is gone."""
    words = _read(pid, "stat").rpartition(")")[2].split()
    return (words[0], int(words[1]), int(words[2]), int(words[3])) if len(words) > 3 else ("X", 0, 0, 0)


def _read(pid: int, name: str) -> str:
    try:
        return Path(f"/proc/{pid}/{name}").read_text(encoding="utf-8", errors="replace")
    except OSError:  # it has just ended
        return ""


def _signal(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def _signal_group(group: int, number: signal.Signals) -> None:
    try:
        os.killpg(group, number)
    except ProcessLookupError:
        return
