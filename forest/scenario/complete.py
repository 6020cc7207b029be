"""Completing a scenario: species from the shipped ones, explicit trees from a stem map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationInfo

from forest.errors import nearest
from forest.scenario import files, placing
from forest.scenario.model import Explicit, PlantedTree, Plot, StemMap
from forest.species import shipped_table, species_names
from forest.species.model import SECTIONS
from forest.species.schema import Refusal, as_plain

_OVERRIDE = "set in the scenario"


def complete(name: str, given: Any) -> Any:
    """Complete a species of the scenario from the shipped one that it names."""
    if not isinstance(given, dict):
        return given
    base = given.get("base", name)
    if base not in species_names():
        hint = nearest(str(base), species_names())
        key = f"{name}.base" if "base" in given else name
        raise Refusal(f"unknown species {str(base)[:60]!r}, {hint}", key=key)
    if given.get("name", name) != name:
        raise Refusal(
            f"{given['name']!r} is not the table's name", key=f"{name}.name", expected=repr(name)
        )
    table = {**shipped_table(base), "name": name, "base": base}
    own_sources = given.get("sources", {})
    for key, value in given.items():
        if key not in SECTIONS or not isinstance(value, dict):
            if key != "sources":
                table[key] = value
            continue
        changed = [k for k in value if value[k] != as_plain(table[key].get(k))]
        table["sources"][key] = {**table["sources"][key], **dict.fromkeys(changed, _OVERRIDE)}
        table[key] = {**table[key], **value}
    if not isinstance(own_sources, dict):
        table["sources"] = own_sources
        return table
    for section, entries in own_sources.items():
        old = table["sources"].get(section, {})
        table["sources"][section] = {**old, **entries} if isinstance(entries, dict) else entries
    return table


def embed_stem_map(planting: StemMap, info: ValidationInfo) -> Explicit:
    """Turn a stem map into explicit trees; its lines are checked here, where they are known."""
    plot, species = info.data.get("plot"), info.data.get("species")
    if plot is None or species is None:
        return Explicit(trees=(PlantedTree(x_m=0.0, y_m=0.0),))  # refused for plot or species
    spots = placing.Spots(plot.size_m, placing.SAME_SPOT_M, periodic=plot.boundary == "periodic")
    trees = []
    if planting.species and planting.species not in species:
        hint = nearest(planting.species, species)
        raise Refusal(f"unknown species {planting.species[:60]!r}, {hint}", key="species")
    try:
        rows = files.read_stem_map(planting.file, planting.species, info.context)
    except Refusal as error:
        raise Refusal(error.what, key="file", expected=error.expected) from None
    for line, x, y, name in rows:
        label = f"{planting.file!r} line {line}"
        check_inside(x, y, plot, key="file", label=f"{label}: ")
        name = name or (next(iter(species)) if len(species) == 1 else "")
        if name not in species:
            hint = nearest(name, species)
            what = f"unknown species {name[:60]!r}" if name else "no species"
            raise Refusal(f"{label}, column 'species': {what}, {hint}", key="file")
        other = spots.neighbour(x, y)
        if other is not None:
            raise Refusal(
                f"{label} stands on the spot of line {other}",
                key="file",
                expected="trees 0.01 m or more apart",
            )
        spots.take(x, y, line)
        trees.append(PlantedTree(x_m=x, y_m=y, species=name))
    return Explicit(trees=tuple(trees))


def check_inside(x: float, y: float, plot: Plot, *, key: str, label: str = "") -> None:
    """Refuse a tree that stands outside the plot."""
    if not (0 <= x <= plot.size_m[0] and 0 <= y <= plot.size_m[1]):
        raise Refusal(
            f"{label}({x:g}, {y:g}) is outside the plot",
            key=key,
            expected=f"x_m 0 to {plot.size_m[0]:g}, y_m 0 to {plot.size_m[1]:g}",
        )


def check_spots(trees: Sequence[PlantedTree], plot: Plot, *, key: str) -> None:
    """Refuse trees outside the plot, and two on one spot; `key` is that of their list."""
    spots = placing.Spots(plot.size_m, placing.SAME_SPOT_M, periodic=plot.boundary == "periodic")
    for i, tree in enumerate(trees):
        check_inside(tree.x_m, tree.y_m, plot, key=f"{key}[{i}]")
        other = spots.neighbour(tree.x_m, tree.y_m)
        if other is not None:
            raise Refusal(
                f"stands on the spot of {key.rpartition('.')[2]}[{other}]",
                key=f"{key}[{i}]",
                expected="0.01 m or more apart",
            )
        spots.take(tree.x_m, tree.y_m, i)
