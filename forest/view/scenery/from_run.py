"""A year of a run as a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.parametric import load_parameters
from forest.record.run import Run
from forest.species import Species
from forest.surface.grass import GRASSES
from forest.surface.instances import Instances, Model
from forest.surface.terrain import HeightField
from forest.trees.leaves import leaves_of
from forest.trees.skeleton import Skeleton
from forest.view.scenery.build import Stock, grow_light, parametric_model
from forest.view.scenery.colours import colours_of
from forest.view.scenery.scenery import Scenery

if TYPE_CHECKING:
    import pandas as pd

#: Parametric species that stand in for simulated ones of which no shape is on record.
STAND_INS: Mapping[str, str] = {
    "picea_abies": "balsam_fir",
    "pinus_sylvestris": "balsam_fir",
    "fagus_sylvatica": "black_tupelo",
    "betula_pendula": "quaking_aspen",
    "quercus_robur": "california_black_oak",
    "generic_deciduous": "quaking_aspen",
}

_Codes = NDArray[np.uint8]

_STAND_IN_SEEDS = 3
_MOST_LEAVES = 20_000
#: Shapes of a species that are kept at most; other trees take the one that is nearest in height.
MOST_SHAPES = 60

_LITTER = (0.42, 0.33, 0.21)
_LEAVES_PER_SITE = 3  # that share its area; a single one would be as large as a hand


class _Shape(NamedTuple):
    """A shape on record: which model it is, and whose."""

    height_m: float
    model: int
    tree_id: int


def simulated_model(skeleton: Skeleton, species: Mapping[str, Species]) -> tuple[Model, float]:
    """Make the model of a simulated tree, and give its height, m."""
    kind = species[skeleton.species]
    evergreen = kind.group == "conifer"
    bark, foliage = colours_of(skeleton.species, evergreen=evergreen)
    model = Model.of(
        skeleton,
        leaves_of(skeleton, kind, per_site=_LEAVES_PER_SITE),
        evergreen=evergreen,
        bark=bark,
        foliage=foliage,
    )
    return model, float(skeleton.end[:, 2].max() - skeleton.start[0, 2])


def scenery_of_run(
    run: Run,
    year: int | None = None,
    *,
    shapes: Iterable[Skeleton] = (),
    tile: int = 1,
    grass: str | None = "meadow",
) -> Scenery:
    """Put up the living trees of a year at their places.

    A tree whose shape is on record, among the sample trees or in `shapes`, stands as it is. Others
    take the shape of their species that is nearest in height, scaled to their own. If there is
    none, a parametric species stands in (`STAND_INS`), scaled likewise. Residual trees that stand
    are put up in their own form.

    Parameters
    ----------
    run : Run
        With the table of trees.
    year : int, optional
        Calendar year; the last one if not given.
    shapes : iterable of Skeleton
        More trees of that year, e.g. those of a checkpoint.
    tile : int
        The plot is repeated so many times along x and along y, as scenery around the one in the
        middle.
    grass : str or None
        Kind of grass outside the plots, one of `forest.surface.grass.GRASSES`.

    Raises
    ------
    InputError
        If there is no table of trees, or the year is not on record.
    """
    year = _year(run, year)
    columns = ["tree_id", "species", "x_m", "y_m", "height_m", "status"]
    trees = run.read("trees", columns, years=(year, year))
    trees = trees[(trees["status"] == "living") & (trees["height_m"] > 0.0)]
    stock = Stock()
    known = _shapes_on_record(run, year, shapes, stock)
    names = trees["species"].astype(str).to_numpy()
    ids, heights = trees["tree_id"].to_numpy(), trees["height_m"].to_numpy(np.float64)
    model = np.zeros(len(trees), np.int64)
    as_it_is = np.zeros(len(trees), np.bool_)
    stand_in = 0
    for k, name in enumerate(names):
        if known.get(name):
            best = min(
                known[name], key=lambda s: (s.tree_id != ids[k], abs(s.height_m - heights[k]))
            )
            model[k], as_it_is[k] = best.model, best.tree_id == ids[k]
        else:
            seed = int(ids[k]) % _STAND_IN_SEEDS
            model[k] = _stand_in(name, seed, run.scenario.species[name].group, stock)
            stand_in += 1
    model_of_residual, residual = _residual(run, year, stock)
    model = np.concatenate((model, model_of_residual))
    heights = np.concatenate((heights, residual["height_m"].to_numpy(np.float64)))
    as_it_is = np.concatenate((as_it_is, np.zeros(len(residual), np.bool_)))
    spots = np.concatenate([t[["x_m", "y_m"]].to_numpy(np.float64) for t in (trees, residual)])
    sizes = np.array(stock.heights)
    scale = np.where(as_it_is, 1.0, heights / sizes[model]) if len(model) else np.empty(0)
    width, depth = run.scenario.plot.size_m
    shift = (np.arange(tile) - tile // 2).astype(np.float64)
    places = [
        np.column_stack((spots[:, 0] + i * width, spots[:, 1] + j * depth, np.zeros(len(spots))))
        for i in shift
        for j in shift
    ]
    low, high = shift[0], shift[-1] + 1.0
    extent = (low * width, low * depth, high * width, high * depth)
    return Scenery(
        models=tuple(stock.models),
        instances=Instances.of(
            np.tile(model, tile**2), np.concatenate(places), np.tile(scale, tile**2)
        ),
        heights=sizes,
        terrain=HeightField.flat(),
        extent=extent,
        grasses={1: GRASSES[grass]} if grass else {},
        grass_at=_grass_around(extent),
        ground=_LITTER,
        notes=_told(year, as_it_is, stand_in, names, tile),
    )


def _grass_around(extent: tuple[float, float, float, float]) -> Callable[[Any, Any], _Codes]:
    """Let grass of code 1 grow outside a rectangle: within it lies litter."""
    x0, y0, x1, y1 = extent

    def code_at(x: Any, y: Any) -> _Codes:
        return np.asarray((x < x0) | (x > x1) | (y < y0) | (y > y1), np.uint8)

    return code_at


def _year(run: Run, year: int | None) -> int:
    if "trees" not in run.tables or not len(run.years):
        raise InputError("holds no table of trees", where=str(run.path))
    if year is None:
        return int(run.years[-1])
    if year not in run.years:
        raise InputError(
            f"year {year} is not on record",
            where=str(run.path),
            expected=f"a year from {run.years[0]} to {run.years[-1]}",
        )
    return year


def _shapes_on_record(
    run: Run, year: int, shapes: Iterable[Skeleton], stock: Stock
) -> dict[str, list[_Shape]]:
    """Make models of the shapes of that year, for each species evenly over the heights."""
    found = {
        tree_id: run.skeleton(tree_id, year)
        for tree_id in run.samples
        if year in run.sample_years(tree_id)
    }
    samples = set(found)
    for skeleton in shapes:
        found.setdefault(skeleton.tree_id, skeleton)
    by_species: dict[str, list[Skeleton]] = {}
    for skeleton in sorted(found.values(), key=lambda s: float(s.end[:, 2].max())):
        by_species.setdefault(skeleton.species, []).append(skeleton)
    known: dict[str, list[_Shape]] = {}
    for name, trees in by_species.items():
        even = np.unique(np.linspace(0, len(trees) - 1, MOST_SHAPES).round().astype(int))
        kept = [s for k, s in enumerate(trees) if k in even or s.tree_id in samples]
        for skeleton in kept:
            number = stock.number(
                skeleton.tree_id,
                lambda s=skeleton: simulated_model(s, run.scenario.species),  # type: ignore[misc]
            )
            known.setdefault(name, []).append(
                _Shape(stock.heights[number], number, skeleton.tree_id)
            )
    return known


def _residual(run: Run, year: int, stock: Stock) -> tuple[NDArray[np.int64], pd.DataFrame]:
    """Give the models of the residual trees that stand in a year, and their rows of `/residual`."""
    import pandas as pd

    if "residual" not in run.tables:
        return np.empty(0, np.int64), pd.DataFrame(columns=["x_m", "y_m", "height_m"])
    rows = run.read("residual", years=(year, year))
    rows = rows[rows["status"] == "standing"]
    number = []
    for one in rows["residual_id"]:
        tree = run.scenario.residual_trees[one - 1]
        assert tree.parameters is not None  # filled in when the scenario was read
        parameters, seed = tree.parameters, tree.seed
        number.append(
            stock.number(
                ("residual", parameters, seed),
                lambda p=parameters, s=seed: parametric_model(  # type: ignore[misc]
                    grow_light(p, s, _MOST_LEAVES)
                ),
            )
        )
    return np.array(number, np.int64), rows


def _stand_in(species: str, seed: int, group: str, stock: Stock) -> int:
    """Give the model of a parametric tree in the colours of a simulated species."""
    parametric = STAND_INS.get(species, "balsam_fir" if group == "conifer" else "quaking_aspen")
    return stock.number(
        ("stand-in", species, seed),
        lambda: parametric_model(
            grow_light(load_parameters(parametric), seed, _MOST_LEAVES), species
        ),
    )


def _told(
    year: int, as_it_is: NDArray[np.bool_], stand_in: int, names: NDArray[np.str_], tile: int
) -> tuple[str, ...]:
    own = int(as_it_is.sum())
    notes = [
        f"{len(names)} living trees in {year}: {own} as they are on record, "
        f"{len(names) - own - stand_in} scaled from the nearest in height of their species, "
        f"{stand_in} by parametric stand-ins"
    ]
    if tile > 1:
        notes.append(f"the plot is repeated {tile} x {tile} times, as scenery")
    return tuple(notes)
