"""Checked tables: one definition gives the checks, the messages and the documentation.

Scenario and species files are TOML tables described by frozen pydantic models. Each field
carries its unit, range and description; `describe` turns a model into rows for the docs, and
`refusal` turns pydantic's report into the project's one-line `InputError`.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, Self, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from forest.errors import InputError, nearest
from forest.species.text import input_error, to_inline

#: Nesting of tables and lists; the models need seven.
_DEEPEST = 16


class Refusal(ValueError):
    """A check inside a model failed; `key` is relative to the table that was checked."""

    def __init__(self, what: str, *, key: str = "", expected: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.key = key
        self.expected = expected


class Table(BaseModel):
    """A frozen table that refuses unknown keys, wrong types, NaN and infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        validate_default=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, data: Any) -> Any:
        return as_plain(data)

    @classmethod
    def of(cls, where: str, **given: Any) -> Self:
        """Check keys that were given in Python; `where` names what they are of in messages.

        Raises
        ------
        InputError
            If one is missing, unknown or not allowed.
        """
        try:
            return cls(**given)
        except ValidationError as error:
            raise refusal(error, cls, where=where) from None


def as_plain(data: Any, depth: int = 0) -> Any:
    """Turn lists and arrays into tuples and NumPy scalars into Python's.

    Tables deeper than any model's are refused before they exhaust the stack.
    """
    if depth > _DEEPEST:
        raise Refusal("tables or lists nested too deep", expected=f"at most {_DEEPEST} levels")
    if hasattr(data, "tolist"):
        data = data.tolist()
    if isinstance(data, Mapping):
        return {key: as_plain(value, depth + 1) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return tuple(as_plain(value, depth + 1) for value in data)
    return data


def quantity(
    default: Any,
    description: str,
    *,
    unit: str = "1",
    ge: float | None = None,
    le: float | None = None,
    gt: float | None = None,
    lt: float | None = None,
    min_length: int | None = None,
    max_length: int | None = None,
) -> Any:
    """Define a field with its unit, range and description; `...` as default: required."""
    bounds = {
        "ge": ge,
        "le": le,
        "gt": gt,
        "lt": lt,
        "min_length": min_length,
        "max_length": max_length,
    }
    given: dict[str, Any] = {key: value for key, value in bounds.items() if value is not None}
    return Field(default, description=description, json_schema_extra={"unit": unit}, **given)


# --- messages ------------------------------------------------------------------------------


def refusal(
    error: ValidationError, model: type[BaseModel], *, where: str | Callable[[str], str]
) -> InputError:
    """Turn pydantic's report into one line about its first problem.

    `where` names what was read, or tells the place of a key. A misspelt key is named before the
    key that is missing because of it.
    """
    problems = error.errors(include_url=False)
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    place = _locate(model, first["loc"])
    own = first.get("ctx", {}).get("error")
    if isinstance(own, Refusal):
        key = place.key + ("." if place.key and own.key else "") + own.key
        return input_error(own.what, where=_join(where, key), expected=own.expected)
    if first["type"] == "extra_forbidden":
        hint = nearest(str(first["loc"][-1]), place.siblings)
        return input_error(
            f"unknown key {first['loc'][-1]!r}, {hint}", where=_join(where, place.key)
        )
    last = first["loc"][-1] if first["loc"] else ""
    if first["type"] == "missing":
        what = "missing entry" if isinstance(last, int) else f"missing key {last!r}"
    elif first["type"] == "union_tag_not_found":
        what = "missing key 'kind'"
    elif first["type"] == "union_tag_invalid":
        what = f"unknown kind {_brief(first['ctx']['tag'])}"
    else:
        what = f"{_brief(first['input'])} is not allowed"
    return input_error(what, where=_join(where, place.key), expected=place.expected or first["msg"])


def _join(where: str | Callable[[str], str], key: str) -> str:
    if callable(where):
        return where(key)
    return f"{where}: {key}" if where and key else where or key


def _brief(value: Any) -> str:
    try:
        shown = repr(value)
    except ValueError:  # an integer with more digits than Python prints
        return "a number with thousands of digits"
    return shown if len(shown) <= 60 else shown[:57] + "..."


class _Place(NamedTuple):
    key: str
    siblings: list[str]
    expected: str


def _locate(model: type[BaseModel], loc: tuple[int | str, ...]) -> _Place:
    """Follow a location of pydantic's through the models; leave out the tags of unions."""
    key = ""
    siblings: list[str] = []
    expected = ""
    here: Any = model
    metadata: list[Any] = []
    for step in loc:
        here, metadata = _unwrap(here, metadata)
        members = _members(here)
        tagged = next((m for m in members if step in _tags(m)), None) if len(members) > 1 else None
        if tagged is not None:
            here = tagged
            continue
        key += f"[{step}]" if isinstance(step, int) else f"{'.' if key else ''}{step}"
        expected = ""
        if len(members) == 1 and _is_table(members[0]):
            fields = members[0].model_fields
            siblings = list(fields)
            field = fields.get(str(step))
            if field is None:
                return _Place(key, siblings, "")
            here, metadata = field.annotation, list(field.metadata)
        else:
            siblings = []
            inner = [arg for arg in get_args(here) if arg is not Ellipsis]
            if not inner:
                return _Place(key, siblings, "")
            here, metadata = inner[min(step, len(inner) - 1) if isinstance(step, int) else -1], []
    expected = expectation(here, metadata)
    return _Place(key, siblings, expected)


def _unwrap(annotation: Any, metadata: list[Any]) -> tuple[Any, list[Any]]:
    """Take off `Annotated`, gathering its metadata."""
    while get_origin(annotation) is Annotated:
        annotation, *more = get_args(annotation)
        metadata = metadata + [
            part
            for item in more
            for part in (item.metadata if isinstance(item, FieldInfo) else [item])
        ]
    return annotation, metadata


def _members(annotation: Any) -> list[Any]:
    """List the members of a union, without None and `Annotated`; else the annotation itself."""
    if get_origin(annotation) in (Union, types.UnionType):
        inner = [_unwrap(arg, [])[0] for arg in get_args(annotation) if arg is not type(None)]
        return [member for one in inner for member in _members(one)]
    return [annotation]


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _tags(annotation: Any) -> tuple[Any, ...]:
    """Give the values of `kind` that choose this member of a union."""
    if _is_table(annotation) and "kind" in annotation.model_fields:
        return get_args(annotation.model_fields["kind"].annotation)
    return ()


_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def type_name(annotation: Any) -> str:
    """Name a type in the user's words."""
    annotation, _ = _unwrap(annotation, [])
    members = _members(annotation)
    if len(members) > 1 and all(_tags(m) for m in members):
        tags = [str(tag) for m in members for tag in _tags(m)]
        return "table with kind = " + " | ".join(f'"{tag}"' for tag in tags)
    if len(members) == 1:
        annotation, _ = _unwrap(members[0], [])
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return " | ".join(f'"{arg}"' for arg in args)
    if origin is tuple:
        if args[-1] is Ellipsis:
            return f"list of ({type_name(args[0])})"
        return f"[{', '.join(type_name(arg) for arg in args)}]"
    if origin is dict or _is_table(annotation):
        return "table"
    return _WORDS.get(annotation, getattr(annotation, "__name__", str(annotation)))


def range_text(metadata: list[Any]) -> str:
    """Write the bounds of a field, e.g. ``0 to 1`` or ``above 1, at most 10``."""
    low = high = ""
    length: list[str] = []
    for item in metadata:
        if isinstance(item, annotated_types.Ge):
            low = f"{item.ge:g}" if isinstance(item.ge, float) else f"{item.ge}"
        elif isinstance(item, annotated_types.Gt):
            low = f"above {item.gt:g}"  # type: ignore[str-format]
        elif isinstance(item, annotated_types.Le):
            high = f"{item.le:g}" if isinstance(item.le, float) else f"{item.le}"
        elif isinstance(item, annotated_types.MinLen) and item.min_length:
            length.append(f"at least {item.min_length} entries")
        elif isinstance(item, annotated_types.MaxLen):
            length.append(f"at most {item.max_length} entries")
    if low.startswith("above") and high:
        span = f"{low}, at most {high}"
    elif low and high:
        span = f"{low} to {high}"
    else:
        span = low or (f"at most {high}" if high else "")
    return ", ".join([span, *length] if span else length)


def expectation(annotation: Any, metadata: list[Any]) -> str:
    """Say what a field accepts: its type and range, and those of a list's entries."""
    annotation, metadata = _unwrap(annotation, metadata)
    words = type_name(annotation)
    span = range_text(metadata) or _inner_range(annotation)
    return f"{words}, {span}" if span else words


def _inner_range(annotation: Any) -> str:
    for member in _members(annotation):
        for arg in get_args(member):
            inner, metadata = _unwrap(arg, [])
            span = range_text(metadata) or _inner_range(inner)
            if span:
                return f"each {span}" if not span.startswith("each") else span
    return ""


# --- documentation -------------------------------------------------------------------------


class Row(NamedTuple):
    """One documented key of a table."""

    key: str
    type: str
    unit: str
    default: str
    range: str
    description: str


def describe(model: type[BaseModel]) -> list[Row]:
    """List every key of a model with type, unit, default, range and description.

    Parameters
    ----------
    model : type[BaseModel]
        A table's model, e.g. ``forest.Scenario`` or ``forest.species.Species``.

    Returns
    -------
    list of Row
        In the order of the file; keys of nested tables are dotted, ``<name>`` stands for any
        name and ``[]`` for the entries of a list.
    """
    return list(_rows(model, ""))


def _rows(model: type[BaseModel], prefix: str) -> Iterator[Row]:
    for name, field in model.model_fields.items():
        key = prefix + name
        annotation, metadata = _unwrap(field.annotation, list(field.metadata))
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        row = Row(
            key,
            type_name(annotation),
            str(extra.get("unit", "")),
            _default_text(field),
            range_text(metadata) or _inner_range(annotation),
            field.description or "",
        )
        tables = list(_tables(annotation, key))
        if not tables or row.description:
            yield row
        for path, table in tables:
            yield from _rows(table, path)


def _tables(annotation: Any, key: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Find the tables inside a field, each with the prefix of its keys."""
    members = [_unwrap(m, [])[0] for m in _members(annotation)]
    for member in members:
        origin, args = get_origin(member), get_args(member)
        if _is_table(member):
            tag = f"({_tags(member)[0]})" if len(members) > 1 else ""
            yield f"{key}{tag}.", member
        elif origin is tuple and args[-1] is Ellipsis:
            yield from _tables(_unwrap(args[0], [])[0], f"{key}[]")
        elif origin is dict:
            yield from _tables(_unwrap(args[1], [])[0], f"{key}.<name>")


def _default_text(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined or isinstance(value, BaseModel):
        return ""
    return to_inline(value)
