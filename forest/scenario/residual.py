"""Residual trees: trees of a given species and height that stand in the plot and do not grow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationInfo, model_validator

from forest.errors import InputError, nearest
from forest.scenario.acts import Act, Fell
from forest.scenario.complete import check_inside
from forest.scenario.files import locate
from forest.scenario.inventory import Inventory
from forest.scenario.model import Environment, Explicit, Planting, Plot
from forest.scenario.placing import SAME_SPOT_M, Spots
from forest.species.parametric import Parameters, load_parameters
from forest.species.schema import Refusal, Table, quantity

#: A trunk is no thicker than this share of its height. An old oak of the open field, 20 m high and
#: 2 m thick, has a tenth; what has more than a quarter is a hollow pollard, or a slip of units.
MOST_DBH_SHARE = 0.25
#: Leaf area per ground below a crown is no more than this; the densest crowns of firs and spruces
#: bear some 10 to 15.
MOST_CROWN_LAI = 20.0


class ResidualTree(Table):
    """A tree that was not simulated, and stands: a parametric tree, scaled to its height."""

    name: str = quantity(
        ..., "its name, by which acts and tables name it", unit="", min_length=1, max_length=60
    )
    x_m: float = quantity(..., "position along x", unit="m", ge=0, le=10000)
    y_m: float = quantity(..., "position along y", unit="m", ge=0, le=10000)
    species: str = quantity(
        ...,
        "a parametric species (`forest tree --list`), or a TOML file of one; relative to the "
        "scenario",
        unit="",
        min_length=1,
    )
    height_m: float = quantity(..., "height of its highest tip", unit="m", ge=0.5, le=150)
    dbh_cm: float | None = quantity(
        None, "stem diameter at 1.3 m; default: as its form has it", unit="cm", gt=0, le=2000
    )
    seed: int = quantity(
        1,
        "each seed is another tree of the species; left out in a scenario, it is the tree's number "
        "in the list",
        unit="",
        ge=0,
        le=2**63 - 1,
    )
    crown_lai: float = quantity(
        4.0,
        "area of its leaves per ground below its crown",
        unit="m2/m2",
        ge=0,
        le=MOST_CROWN_LAI,
    )
    leaf_area_m2: float | None = quantity(
        None, "area of its leaves, in place of crown_lai", unit="m2", ge=0, le=1e5
    )
    like: str = quantity(
        "",
        "the species of the scenario whose leaves shade and whose buds take room as its own do; "
        "default: the first",
        unit="",
    )
    parameters: Parameters | None = quantity(
        None, "the parameters of its form; filled in when the scenario is read", unit=""
    )

    @model_validator(mode="after")
    def _is_a_trunk(self) -> Self:
        most = 100.0 * MOST_DBH_SHARE * self.height_m
        if self.dbh_cm is not None and self.dbh_cm > most:
            raise Refusal(
                f"{self.dbh_cm:g} cm is no trunk of a tree of {self.height_m:g} m",
                key="dbh_cm",
                expected=f"at most {MOST_DBH_SHARE:g} of the height, {most:g} cm",
            )
        return self

    @model_validator(mode="after")
    def _read_species(self, info: ValidationInfo) -> Self:
        """Embed the parameters, so that a stored scenario stands for itself."""
        if self.parameters is not None:
            return self
        is_file = self.species.endswith(".toml")
        source = locate(self.species, info.context) if is_file else self.species
        try:
            self.__dict__["parameters"] = load_parameters(source)
        except InputError as error:
            raise Refusal(str(error), key="species") from None
        if is_file:
            self.__dict__["species"] = Path(self.species).stem
        return self


def number_seeds(trees: Any) -> Any:
    """Give each tree without a seed its number in the list, from 1."""
    if not isinstance(trees, list | tuple):
        return trees
    return tuple(
        {"seed": k, **tree} if isinstance(tree, Mapping) else tree
        for k, tree in enumerate(trees, start=1)
    )


def check_residual(
    trees: Sequence[ResidualTree],
    planting: Planting,
    plot: Plot,
    species: Iterable[str],
    environment: Environment,
) -> None:
    """Refuse residual trees that do not fit the scenario."""
    if trees and environment.rendered is not None:
        raise Refusal(
            "rendered light does not see them",
            key="residual_trees",
            expected="environment.shadow, canopy or markers",
        )
    spots = Spots(plot.size_m, SAME_SPOT_M, periodic=plot.boundary == "periodic")
    names: dict[str, int] = {}
    for i, tree in enumerate(trees):
        key = f"residual_trees[{i}]"
        check_inside(tree.x_m, tree.y_m, plot, key=key)
        other = spots.neighbour(tree.x_m, tree.y_m)
        if other is not None:
            raise Refusal(
                f"stands on the spot of residual_trees[{other}]",
                key=key,
                expected="0.01 m or more apart",
            )
        spots.take(tree.x_m, tree.y_m, i)
        if tree.name in names:
            raise Refusal(
                f"{tree.name!r} is the name of residual_trees[{names[tree.name]}]",
                key=f"{key}.name",
                expected="a name of its own",
            )
        names[tree.name] = i
        if tree.like and tree.like not in species:
            raise Refusal(
                f"unknown species {tree.like[:60]!r}, {nearest(tree.like, species)}",
                key=f"{key}.like",
            )
    if trees and isinstance(planting, Explicit | Inventory):
        for i, (x, y) in enumerate([(one.x_m, one.y_m) for one in planting.trees]):
            other = spots.neighbour(x, y)
            if other is not None:
                raise Refusal(
                    f"stands on the spot of residual_trees[{other}]",
                    key=f"planting.trees[{i}]",
                    expected="0.01 m or more apart",
                )


def check_felled_residual(acts: Sequence[Act], trees: Sequence[ResidualTree], years: range) -> None:
    """Refuse to fell a residual tree that there is not, or that is gone by then."""
    names = [tree.name for tree in trees]
    felled: dict[str, tuple[int, int]] = {}
    fellings = [(i, act) for i, act in enumerate(acts) if isinstance(act, Fell) and act.residual]
    for i, act in fellings:
        for name in act.residual:
            if name not in names:
                hint = nearest(name, names) if names else "there are no residual_trees"
                raise Refusal(f"no residual tree {name[:60]!r}, {hint}", key=f"acts[{i}].residual")
    by_year = [
        (year, i, act)
        for i, act in fellings
        if act.when is None
        for year in act.calendar_years(years)
    ]
    for year, i, act in sorted(by_year, key=lambda entry: entry[:2]):
        for name in act.residual:
            if name in felled:
                by, then = felled[name]
                raise Refusal(
                    f"{name!r} is felled by acts[{by}] in {then}",
                    key=f"acts[{i}].residual",
                    expected="a residual tree that still stands",
                )
            felled[name] = i, year
