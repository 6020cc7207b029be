"""Species: their parameters, with unit, range and source, as TOML files beside this module."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from forest.errors import InputError, nearest
from forest.species.model import Species
from forest.species.schema import Row, describe, refusal
from forest.species.text import parse_toml, read_text

__all__ = ["Row", "Species", "describe", "load_species", "shipped_table", "species_names"]

_FOLDER = Path(__file__).parent


def species_names() -> list[str]:
    """List the names of the species that come with the program."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def shipped_table(name: str) -> dict[str, Any]:
    """Read a shipped species' file as a plain table.

    Raises
    ------
    InputError
        If there is no such species; the nearest name is given.
    """
    if name not in species_names():
        raise InputError(f"unknown species {name!r}, {nearest(name, species_names())}")
    path = _FOLDER / f"{name}.toml"
    return parse_toml(read_text(path, where=name), where=path.name)


def load_species(name: str) -> Species:
    """Read and check a species that comes with the program.

    Parameters
    ----------
    name : str
        One of `species_names`, e.g. ``"picea_abies"``.

    Raises
    ------
    InputError
        If there is no such species, or its file is not right.
    """
    table = shipped_table(name)
    try:
        return Species(**table)
    except ValidationError as error:
        raise refusal(error, Species, where=f"{name}.toml") from None
