"""Keys that are changed beside a scenario's file: ``--set``, ``--years`` and ``--seed``.

They act before the scenario is checked, so that the whole is judged as it will run.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from forest.species.text import input_error


class Changes:
    """Changed keys, in order: a later one overrules an earlier one.

    Parameters
    ----------
    overrides : iterable of str
        ``"key.path=value"``; the value is read as TOML, or as text if it is none.
    **given : int or None
        Keys with an option of their own, such as ``years``; None = not given.

    Raises
    ------
    InputError
        If an override is not ``key=value``.
    """

    def __init__(self, overrides: Iterable[str] = (), **given: int | None) -> None:
        self._values: list[tuple[str, list[str], Any]] = []
        for override in overrides:
            path, sign, text = override.partition("=")
            keys = [key.strip() for key in path.split(".")]
            if not sign or not all(keys):
                raise input_error(
                    f"{override!r} is not an override", where="--set", expected="key.path=value"
                )
            self._values.append(("--set", keys, _value(text)))
        for key, value in given.items():
            if value is not None:
                self._values.append((f"--{key}", [key], value))

    def apply(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Give the tables of a scenario with the changes in them.

        Where fewer years are to be grown than were meant, it keeps how many those were.
        """
        changed = dict(data)
        for option, keys, value in self._values:
            _put(changed, option, keys, value)
        meant = [data.get(key) for key in ("years", "planned_years")]
        most = max((n for n in meant if isinstance(n, int)), default=0)
        if isinstance(changed.get("years"), int) and "planned_years" not in self._first_keys():
            changed.pop("planned_years", None)
            if changed["years"] < most:
                changed["planned_years"] = most
        return changed

    def _first_keys(self) -> set[str]:
        return {keys[0] for _, keys, _ in self._values}

    def place(self, key: str, file: str) -> str:
        """Name what put a refused key where it stands: the option that gave it, or the file.

        Where the file had the key, the options that it may not agree with are named beside it.
        """
        for option, keys, _ in reversed(self._values):
            path = ".".join(keys)
            within = key == path or key.startswith((f"{path}.", f"{path}["))
            if within or (key and path.startswith(f"{key}.")):
                return f"{option}: {key}"
        if file:
            options = ", ".join(dict.fromkeys(option for option, _, _ in self._values))
            file += f" with {options}" if options else ""
        else:
            file = "--set"
        return f"{file}: {key}" if key else file


def _put(data: dict[str, Any], option: str, keys: list[str], value: Any) -> None:
    table = data
    for depth, key in enumerate(keys[:-1]):
        inner = table.get(key, {})
        if not isinstance(inner, Mapping):
            raise input_error(
                f"{'.'.join(keys[: depth + 1])!r} is not a table",
                where=f"{option}: {'.'.join(keys)}",
                expected="the key of a table",
            )
        table[key] = dict(inner)  # so that changes reach no other scenario
        table = table[key]
    table[keys[-1]] = value


def _value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if len(parsed) == 1 else text
