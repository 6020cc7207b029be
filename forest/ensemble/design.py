"""The runs of a sweep: every scenario with every combination of settings, some times over."""

from __future__ import annotations

import hashlib
import itertools
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forest.errors import InputError
from forest.scenario import Scenario
from forest.species.text import to_inline

#: What names a scenario: its file, or a name for one built in Python.
Scenarios = str | Path | Sequence[str | Path] | Mapping[str, Scenario]

_LONGEST_NAME = 150  # a file's name may have 255 bytes, and checkpoints add to it
_OPENING, _CLOSING, _QUOTES = "[{", "]}", "\"'"


@dataclass(frozen=True)
class PlannedRun:
    """One run of a sweep.

    Attributes
    ----------
    name : str
        What its file is called, without the suffix.
    origin : str
        The name of its scenario.
    settings : dict
        The keys that the sweep varies, with their values in this run.
    replicate : int
        Counts from 0; added to the scenario's seed.
    scenario : Scenario
        What to grow.
    digest : str
        Hash of the scenario.
    """

    name: str
    origin: str
    settings: dict[str, Any]
    replicate: int
    scenario: Scenario
    digest: str


def plan(
    scenarios: Scenarios, settings: Mapping[str, Sequence[Any]], replicates: int
) -> list[PlannedRun]:
    """List the runs of a sweep and check the scenario of each.

    Raises
    ------
    InputError
        If a scenario cannot be read, a setting is not allowed, or two runs are the same.
    """
    if replicates < 1:
        raise InputError(f"{replicates} replicates", where="replicates", expected="1 or more")
    varied = {key: _checked_values(key, values) for key, values in settings.items()}
    if "seed" in varied:
        raise InputError(
            "the seed is no setting",
            where="--set seed",
            expected="--replicates N, which count up from the scenario's seed",
        )
    runs = []
    for origin, scenario in _named(scenarios):
        for values in itertools.product(*varied.values()):
            chosen = dict(zip(varied, values, strict=True))
            runs += list(_replicate(origin, scenario, chosen, replicates))
    if not runs:
        raise InputError("no scenario to run", expected="one or more")
    _check_unique(run.name for run in runs)
    return runs


def _replicate(
    origin: str, scenario: Scenario, settings: dict[str, Any], replicates: int
) -> Iterator[PlannedRun]:
    changes = [f"{key}={to_inline(value)}" for key, value in settings.items()]
    texts = [f"{key}={text_of(value)}" for key, value in settings.items()]
    for replicate in range(replicates):
        name = _file_name([origin, *texts], replicate)
        seed = f"seed={scenario.seed + replicate}"
        try:
            one = scenario.with_overrides([*changes, seed])
        except InputError as error:
            raise InputError(str(error), where=name) from None
        yield PlannedRun(name, origin, settings, replicate, one, one.digest())


def _named(scenarios: Scenarios) -> list[tuple[str, Scenario]]:
    if isinstance(scenarios, Mapping):
        return list(scenarios.items())
    paths = [scenarios] if isinstance(scenarios, str | Path) else scenarios
    if isinstance(paths, Scenario) or any(isinstance(path, Scenario) for path in paths):
        raise InputError(
            "a scenario without a name", where="scenarios", expected="{'its name': scenario}"
        )
    return [(Path(path).stem, Scenario.load(path)) for path in paths]


def _check_unique(names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(
                f"two runs are called '{name}'",
                expected="scenarios of different names, and each value of a setting once",
            )
        seen.add(name)


def _file_name(parts: Sequence[str], replicate: int) -> str:
    """Join the parts to a name that any file system takes; a hash stands for what is left out."""
    text = "__".join(parts)
    name = re.sub(r"[^A-Za-z0-9._=+,-]+", "_", text)
    if name != text or len(name) > _LONGEST_NAME:
        name = f"{name[:_LONGEST_NAME]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return f"{name}__r{replicate}"


# --- settings ------------------------------------------------------------------------------------


def read_settings(texts: Iterable[str]) -> dict[str, list[Any]]:
    """Read ``key.path=value,value...``; commas inside brackets or quotes do not split.

    Raises
    ------
    InputError
        If a text has no key or an empty value, or two have the same key.
    """
    settings: dict[str, list[Any]] = {}
    for text in texts:
        key, sign, values = (part.strip() for part in text.partition("="))
        parts = [part.strip() for part in _split(values)]
        if not (sign and key and all(parts)):
            raise InputError(
                f"'{text}' is not a setting", where="--set", expected="key.path=value,value..."
            )
        if key in settings:
            raise InputError(
                f"'{key}' is given twice", where="--set", expected=f"{key}=value,value..."
            )
        settings[key] = [_value(part) for part in parts]
    return settings


def text_of(value: Any) -> str:
    """Write a value as a user would type it: text without quotes where nothing else is meant."""
    plain = isinstance(value, str) and _value(value) == value
    return str(value) if plain else to_inline(value)


def _split(text: str) -> Iterator[str]:
    start = depth = 0
    quote = ""
    for at, sign in enumerate(text):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in _QUOTES:
            quote = sign
        elif sign in _OPENING:
            depth += 1
        elif sign in _CLOSING:
            depth -= 1
        elif sign == "," and depth == 0:
            yield text[start:at]
            start = at + 1
    yield text[start:]


def _value(text: str) -> Any:
    """Read a value as TOML, or as text if it is none."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if len(parsed) == 1 else text


def _checked_values(key: str, values: Any) -> list[Any]:
    values = _plain(key, values)
    if not isinstance(values, list) or not values:
        raise InputError(
            f"{values!r} is no list of values",
            where=f"settings: {key}",
            expected="a list of one value or more",
        )
    return values


def _plain(key: str, value: Any) -> Any:
    """Turn arrays, their numbers and tuples into plain values; refuse what TOML cannot hold."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(key, item) for item in value]
    if isinstance(value, Mapping):
        return {name: _plain(key, item) for name, item in value.items()}
    if isinstance(value, bool | int | float | str):
        return value
    raise InputError(
        f"{value!r} is no value of a scenario",
        where=f"settings: {key}",
        expected="a number, text, true or false, a list or a table",
    )
