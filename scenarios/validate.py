"""From a plain tree to a schema's model; what does not fit becomes one `BadInput` with its place."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any, TypeVar

from scenarios.errors import BadInput, FieldPath, Where, nearest, show

if TYPE_CHECKING:
    from pydantic import BaseModel

    Model = TypeVar("Model", bound=BaseModel)

_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "mapping_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "none_required": "null",
}
_BOUNDS = {
    "greater_than": (">", "gt"),
    "greater_than_equal": (">=", "ge"),
    "less_than": ("<", "lt"),
    "less_than_equal": ("<=", "le"),
}


def validate(
    model: type[Model], tree: Any, where: Where, drawn: Collection[FieldPath] = (), when: str = ""
) -> Model:
    """The strict model of a plain tree. BadInput: the first thing (by line) that does not fit.

    drawn: paths whose value came from a distribution; a message about one ends in `when`, e.g.
    "at an end of its distribution".
    """
    from pydantic import ValidationError

    data = frozen(tree)
    try:
        return model.model_validate(data)
    except ValidationError as error:
        found = [(_real_path(e["loc"], data), e) for e in error.errors(include_url=False)]
    # A union reports every branch: an error inside the value says more than "not a number".
    found = [(p, e) for p, e in found if not (e["type"] in _KINDS and any(_inside(q, p) for q, _ in found))]
    first = min((path for path, _ in found), key=lambda path: where.line(path) or 0)
    here = [e for path, e in found if path == first]
    note = f" {when}" if when and any(first[: len(path)] == path for path in drawn) else ""
    raise _bad_input(first, here, where, note)


def frozen(tree: Any) -> Any:
    """The tree with tuples for lists, as the strict models want it."""
    if isinstance(tree, dict):
        return {key: frozen(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return tuple(frozen(value) for value in tree)
    return tree


def _real_path(loc: tuple[int | str, ...], data: Any) -> FieldPath:
    """The part of pydantic's location that exists in the data: the names of union branches fall out."""
    path: list[str | int] = []
    for word in loc:
        inside_dict = isinstance(data, dict) and word in data
        inside_tuple = isinstance(data, tuple) and isinstance(word, int) and word < len(data)
        if inside_dict or inside_tuple:
            data = data[word]
            path.append(word)
    return tuple(path)


def _inside(path: FieldPath, outer: FieldPath) -> bool:
    return len(path) > len(outer) and path[: len(outer)] == outer


def _bad_input(path: FieldPath, errors: list[Any], where: Where, note: str) -> BadInput:
    if len(errors) > 1 and all(e["type"] in _KINDS for e in errors):
        kinds = list(dict.fromkeys(_KINDS[e["type"]] for e in errors))
        return where.error(f"must be {' or '.join(kinds)}, is {show(errors[0]['input'])}{note}", path)
    error = next((e for e in errors if e["type"] not in _KINDS), errors[0])
    kind, context, value = error["type"], error.get("ctx", {}), show(error["input"])
    if kind == "unknown_key":
        key, known = context["key"], context["known"]
        return where.error(
            f"unknown key {show(key)}", (*path, key), allowed=", ".join(known), hint=nearest(key, known)
        )
    if kind == "rule":
        return where.error(f"{context['problem']}{note}", (*path, *context["field"]))
    if kind == "missing":
        name = error["loc"][-1]
        what = f"'{name}' is missing" if isinstance(name, str) else f"needs at least {name + 1} values"
        return where.error(what, path)
    if kind in _KINDS:
        return where.error(f"must be {_KINDS[kind]}, is {value}{note}", path)
    if kind in _BOUNDS:
        sign, key = _BOUNDS[kind]
        bound = context[key]
        negative = sign == ">=" and bound == 0
        what = "must not be negative" if negative else f"must be {sign} {bound:g}"
        return where.error(f"{what}, is {value}{note}", path)
    if kind == "literal_error":
        allowed = [word.strip("'") for word in context["expected"].replace(" or ", ", ").split(", ")]
        given = error["input"]
        hint = nearest(given, allowed) if isinstance(given, str) else None
        others = [_KINDS[e["type"]] for e in errors if e["type"] in _KINDS]  # other branches of a union
        choices = " or ".join([", ".join(allowed), *others])
        return where.error(f"unknown value {value}{note}", path, allowed=choices, hint=hint)
    if kind == "string_pattern_mismatch":
        return where.error(
            f"{value} is no name{note}",
            path,
            allowed="lower-case letters, digits, - and _, starting with a letter",
        )
    if kind == "too_short":
        least = context["min_length"]
        return where.error(f"needs at least {least} entries, has {context['actual_length']}", path)
    if kind == "too_long":
        return where.error(f"has more than {context['max_length']} values", path)
    if kind == "string_too_long":
        return where.error(f"{value} is longer than {context['max_length']} letters", path)
    return where.error(f"{error['msg']}{note}", path)
