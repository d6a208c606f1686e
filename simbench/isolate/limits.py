"""How much a pipeline in a process of its own may take, and which pipelines run so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Isolate = Literal["users", "all", "none"]
"""Which pipelines get a process of their own: all but simbench's own, all, or none (to debug one)."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """message_s: from a message to its answer. case_s: a whole case, start included. start_s: until it has
    said what it is (imports take time). memory_mb: resident memory of the process and its children.
    """

    message_s: float = 10.0
    case_s: float = 600.0
    start_s: float = 60.0
    memory_mb: int = 4096


DEFAULT = Limits()


class Failed(Exception):  # noqa: N818 (an outcome of a case, not an error of ours)
    """The pipeline's process did not do what it must; the message is one sentence."""


class TimedOut(Failed):
    """It took longer than it may."""
