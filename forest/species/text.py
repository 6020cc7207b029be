"""Text in and out: files that the user named, TOML, and messages about them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forest.errors import InputError


def input_error(what: str, *, where: str = "", expected: str = "") -> InputError:
    """Make an `InputError` whose text, quoted from any file, can be printed."""
    return InputError(_printable(what), where=_printable(where), expected=_printable(expected))


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def read_bytes(path: Path, *, where: str) -> bytes:
    """Read a file that the user named, or say in one line why it cannot be read."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise input_error(f"no such file {str(path)!r}", where=where) from None
    except IsADirectoryError:
        raise input_error(f"{str(path)!r} is a folder", where=where, expected="a file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise input_error(f"cannot read {str(path)!r}: {reason}", where=where) from None


def read_text(path: Path, *, where: str) -> str:
    """Read a UTF-8 text file that the user named."""
    try:
        return read_bytes(path, where=where).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise input_error(
            f"byte {error.start} of {str(path)!r} is not UTF-8", where=where, expected="a text file"
        ) from None


def parse_toml(text: str, *, where: str) -> dict[str, Any]:
    """Parse TOML or say in one line, with line and column, why it cannot be parsed."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise input_error(f"not TOML: {str(error) or 'nested too deep'}", where=where) from None


def to_inline(value: Any) -> str:
    """Write a plain value as TOML on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return _quote(value)
    if isinstance(value, Mapping):
        pairs = (f"{_bare(k)} = {to_inline(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(pairs) + "}"
    return "[" + ", ".join(to_inline(item) for item in value) + "]"


def to_toml(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """Write a nested table of plain values as TOML; entries that are None are left out."""
    lines: list[str] = []
    inner: list[str] = []
    for key, value in table.items():
        if value is None:
            continue
        if isinstance(value, Mapping):
            inner.append(to_toml(value, (*path, key)))
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            rows = "".join(f"    {to_inline(item)},\n" for item in value)
            lines.append(f"{_bare(key)} = [\n{rows}]\n")
        else:
            lines.append(f"{_bare(key)} = {to_inline(value)}\n")
    header = f"\n[{'.'.join(_bare(part) for part in path)}]\n" if path else ""
    if not lines and inner:
        header = ""
    return header + "".join(lines) + "".join(inner)


def _bare(key: str) -> str:
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if plain else _quote(key)


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return (
        '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    )
