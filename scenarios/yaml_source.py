"""A careful YAML reader: plain data, and the line of every path in it.

Words are read as YAML 1.2's core schema reads them: `1e3` is a number, `on` and `12:30` are text. Refused:
aliases and anchors, tags, duplicate keys, keys that are not words, numbers that are not finite, more than one
document, nesting deeper than 32, files above 1 MB.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from scenarios.errors import BadInput, FieldPath, Where, printable, show

MAX_BYTES = 1_000_000
MAX_DEPTH = 32
MAX_DIGITS = 18

_TAG = "tag:yaml.org,2002:"


@dataclass(frozen=True, kw_only=True)
class Document:
    """What a file holds: dicts, lists, str, int, float, bool, None. `where` knows the line of every path."""

    data: Any
    where: Where


class _Refused(Exception):  # noqa: N818
    def __init__(self, problem: str, line: int) -> None:
        super().__init__(problem)
        self.problem = problem
        self.line = line


class _Loader(yaml.SafeLoader):
    """Composes nodes only; what it must not see is refused before a node is made."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 (PyYAML's way)
    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> Any:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            raise _Refused(f"the alias *{event.anchor} is not allowed", line)
        if getattr(event, "anchor", None) is not None:
            raise _Refused(f"the anchor &{event.anchor} is not allowed", line)
        if getattr(event, "tag", None) is not None:
            raise _Refused(f"the tag {event.tag} is not allowed", line)
        if self.depth >= MAX_DEPTH:
            raise _Refused(f"nested deeper than {MAX_DEPTH} levels", line)
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("infinite", r"[-+]?\.?(inf|Inf|INF|infinity|nan|NaN|NAN)", list("-+.iInN")),
):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(rf"^(?:{_pattern})$"), _first)


def read_yaml(path: Path, shown_as: str | None = None) -> Document:
    """The document in the file. `shown_as`: how messages name the file. BadInput: it cannot be read."""
    name = str(path) if shown_as is None else shown_as
    try:
        if not path.exists():
            raise BadInput("no such file", file=name)
        if not path.is_file():
            raise BadInput("not a file", file=name)
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, BadInput):
            raise
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BadInput(f"cannot be read: {reason}", file=name) from None
    if len(raw) > MAX_BYTES:
        raise BadInput(f"larger than {MAX_BYTES // 1_000_000} MB", file=name)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise BadInput("not UTF-8 text", file=name, line=line) from None
    return parse_yaml(text, name)


def parse_yaml(text: str, name: str) -> Document:
    """The document in `text`; `name` stands for the file in messages. BadInput: it cannot be read."""
    lines: dict[FieldPath, int] = {}
    try:
        node = _Loader(text).get_single_node()
        if node is None:
            raise BadInput("holds nothing", file=name)
        lines[()] = node.start_mark.line + 1
        data = _plain(node, (), lines)
    except _Refused as error:
        raise BadInput(printable(error.problem), file=name, line=error.line) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = printable(error.problem or error.context or "broken")
        raise BadInput(f"not YAML: {problem}", file=name, line=mark.line + 1 if mark else None) from None
    except yaml.reader.ReaderError as error:
        line = text[: error.position].count("\n") + 1
        raise BadInput("not YAML: holds a control character", file=name, line=line) from None
    except RecursionError:
        raise BadInput("nested too deeply", file=name) from None
    return Document(data=data, where=Where(file=name, lines=lines))


def _plain(node: yaml.Node, path: FieldPath, lines: dict[FieldPath, int]) -> Any:
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, path, lines)
    if isinstance(node, yaml.SequenceNode):
        items = []
        for index, item in enumerate(node.value):
            lines[(*path, index)] = item.start_mark.line + 1
            items.append(_plain(item, (*path, index), lines))
        return items
    return _scalar(node)


def _mapping(node: yaml.MappingNode, path: FieldPath, lines: dict[FieldPath, int]) -> dict[str, Any]:
    mapping: dict[str, Any] = {}
    for key_node, value_node in node.value:
        line = key_node.start_mark.line + 1
        if key_node.tag != _TAG + "str":
            shown = show(key_node.value) if isinstance(key_node, yaml.ScalarNode) else "a list or mapping"
            raise _Refused(f"a key must be a word, is {shown}", line)
        key = key_node.value
        if key in mapping:
            first = lines[(*path, key)]
            raise _Refused(f"the key {show(key)} stands here twice, first in line {first}", line)
        lines[(*path, key)] = line
        mapping[key] = _plain(value_node, (*path, key), lines)
    return mapping


def _scalar(node: yaml.Node) -> str | int | float | bool | None:
    text, kind, line = node.value, node.tag.removeprefix(_TAG), node.start_mark.line + 1
    if kind == "null":
        return None
    if kind == "bool":
        return bool(text.lower() == "true")
    if kind == "int":
        if len(text) > MAX_DIGITS:
            raise _Refused(f"the number {show(text)} has more than {MAX_DIGITS} digits", line)
        return int(text)
    if kind == "infinite" or (kind == "float" and not math.isfinite(float(text))):
        raise _Refused(f"the number {show(text)} is not finite", line)
    if kind == "float":
        return float(text)
    return str(text)
