"""`-k EXPR` and `-m TAG`: which cases of a suite run. Words joined by `and`, `or`, `not` and parentheses.

    close and not (wearable or flex)

With -k a word is found in the id of a case, small and capital letters alike; with -m it is a tag of its
block.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence

from scenarios.errors import BadInput, nearest, show
from simbench.suite.plan import Group

TOKEN = re.compile(r"\s*(\(|\)|[^\s()]+)")
Test = Callable[[str], bool]
"""Whether a word holds."""


class _Reader:
    """Reads an expression; says whether it holds under a test of words."""

    def __init__(self, text: str, option: str) -> None:
        self._tokens, self._at = TOKEN.findall(text), 0
        self._text, self._option = text, option

    def whole(self, test: Test) -> bool:
        value = self._either(test)
        if self._at < len(self._tokens):
            raise self._wrong(f"nothing may follow before {show(self._tokens[self._at])}")
        return value

    def _either(self, test: Test) -> bool:
        value = self._both(test)
        while self._next() == "or":
            self._at += 1
            value = self._both(test) or value
        return value

    def _both(self, test: Test) -> bool:
        value = self._one(test)
        while self._next() == "and":
            self._at += 1
            value = self._one(test) and value
        return value

    def _one(self, test: Test) -> bool:
        token = self._next()
        if token is None:
            raise self._wrong("a word is missing at the end")
        self._at += 1
        if token == "not":
            return not self._one(test)
        if token == "(":
            value = self._either(test)
            if self._next() != ")":
                raise self._wrong("a parenthesis is not closed")
            self._at += 1
            return value
        if token in (")", "and", "or"):
            raise self._wrong(f"a word is missing before {show(token)}")
        return test(token)

    def _next(self) -> str | None:
        return self._tokens[self._at] if self._at < len(self._tokens) else None

    def _wrong(self, problem: str) -> BadInput:
        return BadInput(f"{self._option} {show(self._text)}: {problem}", allowed="words, and, or, not, ( )")


def chosen(
    groups: Sequence[Group],
    *,
    words: str | None = None,
    tags: str | None = None,
    only: Collection[str] | None = None,
) -> tuple[tuple[Group, int], ...]:
    """The cases (group, seed) that all conditions let through. only: ids of cases, None: all.

    BadInput: a malformed expression, a tag that no block has.
    """  # fmt: skip
    known = {tag for group in groups for tag in group.tags}

    def tagged(group: Group) -> Test:
        def holds(tag: str) -> bool:
            if tag not in known:
                raise BadInput(
                    f"no block has the tag {show(tag)}", allowed=", ".join(sorted(known)) or "none",
                    hint=nearest(tag, known),
                )  # fmt: skip
            return tag in group.tags

        return holds

    found = []
    for group in groups:
        if tags is not None and not _Reader(tags, "-m").whole(tagged(group)):
            continue
        for seed in group.seeds:
            case = group.case(seed)
            if words is not None and not _Reader(words, "-k").whole(_contains(case.lower())):
                continue
            if only is None or case in only:
                found.append((group, seed))
    return tuple(found)


def _contains(text: str) -> Test:
    return lambda word: word.lower() in text
