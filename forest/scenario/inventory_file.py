"""Reading an inventory: its trees are checked, and those without a height get one from a curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError, ValidationInfo

from forest.errors import nearest
from forest.scenario import files, placing
from forest.scenario.complete import check_inside
from forest.scenario.inventory import (
    LEAST_FOR_CURVE,
    Inventory,
    InventoryTree,
    curve_height,
    fit_height_curve,
)
from forest.species.schema import Refusal, refusal

_NUMBERS = ("dbh_cm", "height_m", "crown_base_m", "age")


def embed_inventory(planting: Inventory, info: ValidationInfo) -> Inventory:
    """Give the inventory with all its trees, each with a species and a height.

    Raises
    ------
    Refusal
        If a tree cannot be: the message names its line in the file, or its place in the list.
    """
    plot, species = info.data.get("plot"), info.data.get("species")
    if plot is None or species is None:
        return planting  # refused for plot or species
    for key, names in (("species", [planting.species]), ("height_curve", planting.height_curve)):
        for name in names:
            if name and name not in species:
                raise Refusal(f"unknown species {name[:60]!r}, {nearest(name, species)}", key=key)
    trees = list(planting.trees) or _read(planting, info.context)
    only = next(iter(species)) if len(species) == 1 else ""
    spots = placing.Spots(plot.size_m, placing.SAME_SPOT_M, periodic=plot.boundary == "periodic")
    for i, tree in enumerate(trees):
        key, label = tree_label(planting, tree, i)
        check_inside(tree.x_m, tree.y_m, plot, key=key, label=label)
        name = tree.species or planting.species or only
        if name not in species:
            hint = nearest(name, species)
            what = f"unknown species {name[:60]!r}" if name else "no species"
            raise Refusal(f"{label}{what}, {hint}", key=key)
        other = spots.neighbour(tree.x_m, tree.y_m)
        if other is not None:
            raise Refusal(
                f"{label}stands on the spot of {_short(trees[other], other)}",
                key=key,
                expected="trees 0.01 m or more apart",
            )
        spots.take(tree.x_m, tree.y_m, i)
        trees[i] = tree.model_copy(update={"species": name})
    curves = _height_curves(planting, trees)
    for i, tree in enumerate(trees):
        if tree.height_m is None and tree.dbh_cm is not None:
            height = curve_height(tree.dbh_cm, curves[tree.species])
            trees[i] = _checked(planting, tree.model_dump() | {"height_m": height}, i)
    return planting.model_copy(update={"trees": tuple(trees), "height_curve": curves})


def tree_label(planting: Inventory, tree: InventoryTree, i: int) -> tuple[str, str]:
    """Name the i-th tree in messages: the key, and what stands before the message."""
    if tree.line:
        return "file", f"{planting.file!r} line {tree.line}: "
    return f"trees[{i}]", ""


def _short(tree: InventoryTree, i: int) -> str:
    return f"line {tree.line}" if tree.line else f"trees[{i}]"


def _read(planting: Inventory, context: Any) -> list[InventoryTree]:
    if not planting.file:
        raise Refusal("no trees", key="file", expected="a CSV file, or trees")
    try:
        rows = files.read_inventory(planting.file, _NUMBERS, context)
    except Refusal as error:
        raise Refusal(error.what, key="file", expected=error.expected) from None
    return [_checked(planting, row, i) for i, row in enumerate(rows)]


def _checked(planting: Inventory, row: Mapping[str, Any], i: int) -> InventoryTree:
    """Make a tree of a row; name the row if it cannot be one."""
    try:
        return InventoryTree(**row)
    except ValidationError as error:
        line = row.get("line", 0)
        where = f"{planting.file!r} line {line}" if line else f"trees[{i}]"
        said = str(refusal(error, InventoryTree, where=where))
        raise Refusal(said, key="file" if line else "") from None


def _height_curves(
    planting: Inventory, trees: list[InventoryTree]
) -> dict[str, tuple[float, float]]:
    """Give the height curve of each species of which a tree has no height."""
    curves = dict(planting.height_curve)
    for name, (a, b) in curves.items():
        if not (a > 0.0 and b > 0.0):
            raise Refusal(
                f"[{a:g}, {b:g}] does not rise towards a greatest height",
                key=f"height_curve.{name}",
                expected="a and b above 0",
            )
    for i, tree in enumerate(trees):
        if tree.height_m is not None or tree.species in curves:
            continue
        known = [t for t in trees if t.species == tree.species and t.height_m and t.dbh_cm]
        curve = fit_height_curve(
            [t.dbh_cm for t in known if t.dbh_cm], [t.height_m for t in known if t.height_m]
        )
        if curve is None:
            key, label = tree_label(planting, tree, i)
            raise Refusal(
                f"{label}no height, and no height curve can be fitted to the {len(known)} trees "
                f"of {tree.species} that have one",
                key=key,
                expected=f"a height, {LEAST_FOR_CURVE} trees or more that have one and rise with "
                f"dbh, or height_curve.{tree.species} = [a, b]",
            )
        curves[tree.species] = curve
    return curves
