"""`PATH=VALUE` changes to a scenario file's tree, as `--set` and the axes of a stress test ask for them."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from scenarios.errors import Where, show
from scenarios.yaml_source import parse_yaml

OPTION = "--set"


def changed(tree: Mapping[str, Any], changes: Sequence[str]) -> dict[str, Any]:
    """A copy of the tree with the values at some paths replaced; a path's words are joined by dots, a list's
    places count from 0.

    BadInput: a change is no PATH=VALUE, the path leads nowhere, or to a whole part of the file.
    """
    result: dict[str, Any] = copy.deepcopy(dict(tree))
    where = Where(file=OPTION)
    for change in changes:
        path, equals, text = (part.strip() for part in change.partition("="))
        if not equals or not path or not text:
            raise where.error(f"is PATH=VALUE, as in road.width_m=40; this is {show(change)}")
        _set(result, path, parse_yaml(text, f"{OPTION} {path}").data, where)
    return result


def varied(text: str) -> str:
    """The change of `PATH=LOW..HIGH` (uniform), `PATH=A|B|C` (one of them) or `PATH=DISTRIBUTION`, as
    `--vary` asks for it. BadInput: it leaves nothing to the seed."""
    where = Where(file="--vary")
    path, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not path or not value:
        raise where.error(f"is PATH=LOW..HIGH, as in road.width_m=30..60; this is {show(text)}")
    low, dots, high = value.partition("..")
    if value.startswith("{"):
        return text
    if dots:
        return f"{path}={{uniform: [{low}, {high}]}}"
    if "|" in value:
        return f"{path}={{choice: [{', '.join(value.split('|'))}]}}"
    raise where.error(
        f"{path}: {show(value)} leaves nothing to the seed", allowed="LOW..HIGH, A|B|C or a distribution"
    )


def _set(tree: Any, path: str, value: Any, where: Where) -> None:
    *way, last = path.split(".")
    for word in way:
        tree = tree[_key(tree, word, path, where)]
    key = _key(tree, last, path, where)
    if isinstance(tree[key], Mapping) and not _is_distribution(tree[key]):
        raise where.error(
            f"{path} is a whole part of the file; go on to one of its values", allowed=_keys(tree[key])
        )
    tree[key] = value


def _key(tree: Any, word: str, path: str, where: Where) -> Any:
    if isinstance(tree, list):
        if word.isdecimal() and int(word) < len(tree):
            return int(word)
        raise where.error(
            f"{path}: '{word}' is no place in a list of {len(tree)}", allowed=f"0 to {len(tree) - 1}"
        )
    if not isinstance(tree, Mapping):
        raise where.error(f"{path}: there is nothing below {show(tree)}")
    if word not in tree:
        raise where.unknown("word of the path", word, tuple(str(k) for k in tree))
    return word


def _is_distribution(value: Mapping[str, Any]) -> bool:
    return len(value) == 1 and next(iter(value)) in ("uniform", "normal", "choice")


def _keys(value: Mapping[str, Any]) -> str:
    return ", ".join(str(key) for key in value)
