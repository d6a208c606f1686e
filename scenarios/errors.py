"""Bad input: one sentence that says what is wrong, where, and what is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

FieldPath: TypeAlias = tuple[str | int, ...]

LONGEST_VALUE = 48
LONGEST_FIELD = 300
LONGEST_SENTENCE = 2000


class BadInput(ValueError):  # noqa: N818 (a sentence for the user, not a failure of the program)
    """What the user wrote cannot be used. `str(error)` is one line without control characters, whatever a
    file said; a command prints it and exits 2.

    problem: what is wrong. file, line, field: where (each may be None). allowed: what would be right.
    hint: the nearest known word.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | None = None,
        line: int | None = None,
        field: str | None = None,
        allowed: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = file
        self.line = line
        self.field = field
        self.allowed = allowed
        self.hint = hint
        place = [file] if file else []
        place += [f"line {line}"] if line else []
        place += [field[:LONGEST_FIELD]] if field else []
        text = f"{', '.join(place)}: {problem}" if place else problem
        text += f" (allowed: {allowed})" if allowed else ""
        text += f"; did you mean '{hint}'?" if hint else "."
        if len(text) > LONGEST_SENTENCE:
            text = text[:LONGEST_SENTENCE] + "..."
        super().__init__(printable(text))

    def __reduce__(self) -> tuple[object, ...]:
        """Keep all attributes when a worker process sends the error home."""
        return _rebuild, (self.problem, self.file, self.line, self.field, self.allowed, self.hint)


def _rebuild(
    problem: str, file: str | None, line: int | None, field: str | None, allowed: str | None, hint: str | None
) -> BadInput:
    return BadInput(problem, file=file, line=line, field=field, allowed=allowed, hint=hint)


@dataclass(frozen=True, kw_only=True)
class Where:
    """The place of a tree of plain data: its file and the line of every path inside it.

    lines maps paths from the root of the file; prefix is where the tree hangs in that file.
    """

    file: str | None
    lines: Mapping[FieldPath, int] = field(default_factory=dict)
    prefix: FieldPath = ()

    def at(self, *path: str | int) -> Where:
        """The place of a subtree."""
        return Where(file=self.file, lines=self.lines, prefix=(*self.prefix, *path))

    def line(self, path: FieldPath = ()) -> int | None:
        """Line of `path`, or of the nearest thing around it."""
        whole = (*self.prefix, *path)
        for length in range(len(whole), -1, -1):
            if whole[:length] in self.lines:
                return self.lines[whole[:length]]
        return None

    def error(
        self, problem: str, path: FieldPath = (), *, allowed: str | None = None, hint: str | None = None
    ) -> BadInput:
        """The `BadInput` about `path` of this tree."""
        whole = (*self.prefix, *path)
        return BadInput(
            problem,
            file=self.file,
            line=self.line(path),
            field=dotted(whole) or None,
            allowed=allowed,
            hint=hint,
        )

    def unknown(self, what: str, word: str, known: Iterable[str], path: FieldPath = ()) -> BadInput:
        """The `BadInput` about a word that is not one of `known`."""
        known = sorted(known)
        return self.error(
            f"unknown {what} {show(word)}",
            path,
            allowed=", ".join(known) or "none",
            hint=nearest(word, known),
        )


def dotted(path: FieldPath) -> str:
    """`("a", "b", 2)` as `a.b[2]`."""
    text = ""
    for word in path:
        text += f"[{word}]" if isinstance(word, int) else f".{word}" if text else word
    return text


def printable(text: str) -> str:
    """`text` on one line, without control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)


def show(value: object) -> str:
    """A value as a message quotes it: short, on one line."""
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = printable(str(value))
    if len(text) > LONGEST_VALUE:
        text = text[:LONGEST_VALUE] + "..."
    return f"'{text}'" if isinstance(value, str) else text


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word that `word` was probably meant to be."""
    import difflib

    plain = {_plain(k): k for k in known}
    close = difflib.get_close_matches(_plain(word)[:100], list(plain), n=1, cutoff=0.6)
    return plain[close[0]] if close else None


def _plain(word: str) -> str:
    return word.lower().replace("_", "-")
