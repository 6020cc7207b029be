"""Species that stay as they are, for tests that hang on how fast trees grow: no fit moves them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from forest.scenario import Scenario

_GIVEN = tomllib.loads((Path(__file__).parent / "golden" / "species.toml").read_text())
_FIXED = {"pinus_sylvestris": _GIVEN["pine"], "fagus_sylvatica": _GIVEN["beech"]}


def fixed(toml: str, *overrides: str) -> Scenario:
    """Give a scenario whose pines and beeches are those of the goldens.

    What it says of them itself stands, and so do the overrides, given as to `--set`.
    """
    data: dict[str, Any] = tomllib.loads(toml)
    for name, said in data["species"].items():
        data["species"][name] = _with(_FIXED[name], said)
    return Scenario(**data).with_overrides(overrides)


def _with(table: dict[str, Any], said: dict[str, Any]) -> dict[str, Any]:
    both = dict(table)
    for key, value in said.items():
        both[key] = _with(both.get(key, {}), value) if isinstance(value, dict) else value
    return both
