"""A year of a run as a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, span_of
from forest.parametric import Parameters, load_parameters
from forest.record.run import Run
from forest.residual import GrownResidual, grow_residual
from forest.species import Species
from forest.surface.grass import GRASSES
from forest.surface.instances import Instances, Model
from forest.surface.scene import Census
from forest.surface.terrain import HeightField
from forest.trees.leaves import Leaves, leaves_of
from forest.trees.skeleton import Skeleton
from forest.view.scenery.build import Stock, grow_light, parametric_model
from forest.view.scenery.colours import colours_of, parametric_colours
from forest.view.scenery.scenery import Scenery

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.stand import Stand

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
#: Of a residual tree, which is single and often near.
MOST_RESIDUAL_LEAVES = 200_000
_ALL_RESIDUAL_LEAVES = 4_000_000  # of all of them together
#: Trees of a view at most, those of all repeats together.
MOST_TILED = 200_000
#: Shapes of a species that are kept at most; other trees take the one that is nearest in height.
MOST_SHAPES = 60

_LITTER = (0.42, 0.33, 0.21)
_LEAVES_PER_SITE = 3  # that share its area; a single one would be as large as a hand


class _Shape(NamedTuple):
    """A shape on record: which model it is, and whose."""

    height_m: float
    model: int
    tree_id: int
    year: int


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
    shapes_year: int | None = None,
    tile: int = 1,
    grass: str | None = "meadow",
) -> Scenery:
    """Put up the living trees of a year at their places.

    A tree whose shape of that year is on record, among the sample trees or in `shapes`, stands as
    it is. Others take the shape of their species that is nearest in height, scaled to their own;
    of a sample tree that of the year nearest to this one. If there is none, a parametric species
    stands in (`STAND_INS`), scaled likewise. Residual trees that stand are put up as they are.

    Parameters
    ----------
    run : Run
        With the table of trees.
    year : int, optional
        Calendar year; the last one if not given.
    shapes : iterable of Skeleton
        More trees, e.g. those of a checkpoint.
    shapes_year : int, optional
        Their calendar year; the view's unless given.
    tile : int
        The plot is repeated so many times along x and along y, as scenery around the one in the
        middle.
    grass : str or None
        Kind of grass outside the plots, one of `forest.surface.grass.GRASSES`.

    Raises
    ------
    InputError
        If there is no table of trees, the year is not on record, or there are more than
        `MOST_TILED` trees with all repeats.
    """
    year = _year(run, year)
    columns = ["tree_id", "species", "x_m", "y_m", "height_m", "dbh_cm", "status"]
    trees = run.read("trees", columns, years=(year, year))
    found = _found(run, year, shapes, year if shapes_year is None else shapes_year)
    return _put_up(
        _Standing(
            run.scenario,
            year,
            trees[(trees["status"] == "living") & (trees["height_m"] > 0.0)],
            _residual_rows(run, year),
            *found,
        ),
        tile=tile,
        grass=grass,
    )


def scenery_of_stand(stand: Stand, *, tile: int = 1, grass: str | None = "meadow") -> Scenery:
    """Put up the trees of a stand as it stands, like `scenery_of_run` those of a year."""
    found = {int(tree_id): stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id}
    trees = stand.trees
    return _put_up(
        _Standing(
            stand.scenario,
            stand.year,
            trees[trees["height_m"] > 0.0],
            stand.residual.table,
            found,
            dict.fromkeys(found, stand.year),
            set(),
        ),
        tile=tile,
        grass=grass,
    )


class _Standing(NamedTuple):
    """What stands in a year: rows of the trees, and of what skeletons there are the years."""

    scenario: Scenario
    year: int
    trees: pd.DataFrame
    residual: pd.DataFrame
    found: dict[int, Skeleton]
    years: dict[int, int]
    samples: set[int]  # all of these become models


def _put_up(standing: _Standing, *, tile: int, grass: str | None) -> Scenery:
    """Give every tree a model: its own, one of its species, or a stand-in."""
    scenario, year, trees = standing.scenario, standing.year, standing.trees
    residual = standing.residual
    stock = Stock()
    _check_tile(len(trees), tile)
    known = _shapes_on_record(standing, stock)
    names = trees["species"].astype(str).to_numpy()
    ids, heights = trees["tree_id"].to_numpy(), trees["height_m"].to_numpy(np.float64)
    model = np.zeros(len(trees), np.int64)
    as_it_is = np.zeros(len(trees), np.bool_)
    stand_in = 0
    lent: set[int] = set()
    for k, name in enumerate(names):
        if known.get(name):
            best = _best(known[name], int(ids[k]), float(heights[k]), year)
            model[k], as_it_is[k] = best.model, best.tree_id == ids[k] and best.year == year
            if not as_it_is[k]:
                lent.add(best.year)
        else:
            seed = int(ids[k]) % _STAND_IN_SEEDS
            model[k] = _stand_in(name, seed, scenario.species[name].group, stock)
            stand_in += 1
    model = np.concatenate((model, _residual_models(scenario, residual, stock)))
    heights = np.concatenate((heights, residual["height_m"].to_numpy(np.float64)))
    as_it_is = np.concatenate((as_it_is, np.ones(len(residual), np.bool_)))
    spots = np.concatenate([t[["x_m", "y_m"]].to_numpy(np.float64) for t in (trees, residual)])
    sizes = np.array(stock.heights)
    scale = np.where(as_it_is, 1.0, heights / sizes[model]) if len(model) else np.empty(0)
    width, depth = scenario.plot.size_m
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
        census=_census(scenario, trees, residual, tile),
        notes=_told(year, as_it_is[: len(names)], stand_in, lent, tile),
    )


def _check_tile(trees: int, tile: int) -> None:
    if trees * tile**2 > MOST_TILED:
        most = int((MOST_TILED / trees) ** 0.5)
        raise InputError(
            f"{tile} x {tile} plots of {trees} trees are {trees * tile**2:,} trees",
            expected=f"at most {MOST_TILED:,}: a tile of {max(most, 1)} or less",
        )


def _best(known: list[_Shape], tree_id: int, height_m: float, year: int) -> _Shape:
    """Choose a tree's shape: its own of the year, or that which is nearest in height."""
    return min(
        known,
        key=lambda s: (
            s.tree_id != tree_id or s.year != year,
            abs(s.height_m - height_m),
            s.tree_id != tree_id,
        ),
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
            expected=span_of(run.years[0], run.years[-1]),
        )
    return year


def _found(
    run: Run, year: int, shapes: Iterable[Skeleton], shapes_year: int
) -> tuple[dict[int, Skeleton], dict[int, int], set[int]]:
    """Take each tree's shape of the year nearest to that one: shapes, years, sample trees."""
    years: dict[int, int] = {}
    for tree_id in run.samples:
        recorded = [int(one) for one in run.sample_years(tree_id)]
        if recorded:
            years[tree_id] = min(recorded, key=lambda one: (abs(one - year), one))
    samples = set(years)
    found = {tree_id: run.skeleton(tree_id, at) for tree_id, at in years.items()}
    for skeleton in shapes:
        at = years.get(skeleton.tree_id)
        if at is None or abs(shapes_year - year) < abs(at - year):
            found[skeleton.tree_id], years[skeleton.tree_id] = skeleton, shapes_year
    return found, years, samples


def _shapes_on_record(standing: _Standing, stock: Stock) -> dict[str, list[_Shape]]:
    """Make models of the shapes on record, for each species evenly over the heights."""
    species, years = standing.scenario.species, standing.years
    by_species: dict[str, list[Skeleton]] = {}
    for skeleton in sorted(standing.found.values(), key=lambda s: float(s.end[:, 2].max())):
        by_species.setdefault(skeleton.species, []).append(skeleton)
    known: dict[str, list[_Shape]] = {}
    for name, trees in by_species.items():
        even = np.unique(np.linspace(0, len(trees) - 1, MOST_SHAPES).round().astype(int))
        kept = [s for k, s in enumerate(trees) if k in even or s.tree_id in standing.samples]
        for skeleton in kept:
            number = stock.number(
                skeleton.tree_id,
                lambda s=skeleton: simulated_model(s, species),  # type: ignore[misc]
            )
            known.setdefault(name, []).append(
                _Shape(stock.heights[number], number, skeleton.tree_id, years[skeleton.tree_id])
            )
    return known


def _residual_rows(run: Run, year: int) -> pd.DataFrame:
    """Read the rows of the residual trees that stand in a year."""
    import pandas as pd

    if "residual" not in run.tables:
        return pd.DataFrame(columns=["residual_id", "x_m", "y_m", "height_m", "dbh_cm"])
    rows = run.read("residual", years=(year, year))
    return rows[rows["status"] == "standing"]


def _residual_models(scenario: Scenario, rows: pd.DataFrame, stock: Stock) -> NDArray[np.int64]:
    """Give the models of residual trees."""
    number = []
    most = min(MOST_RESIDUAL_LEAVES, _ALL_RESIDUAL_LEAVES // max(len(rows), 1))
    for one in rows["residual_id"]:
        wanted = scenario.residual_trees[one - 1]
        assert wanted.parameters is not None  # filled in when the scenario was read
        tree = grow_residual(wanted, int(one))
        number.append(
            stock.number(
                ("residual", one),
                lambda t=tree, p=wanted.parameters: residual_model(t, p, most),  # type: ignore[misc]
            )
        )
    return np.array(number, np.int64)


def _census(scenario: Scenario, trees: pd.DataFrame, residual: pd.DataFrame, tile: int) -> Census:
    """Tell who the trees are, those of each plot in turn."""
    ids = [trees["tree_id"], -residual["residual_id"]]
    of_residual = [scenario.residual_trees[k - 1].species for k in residual["residual_id"]]
    dbh = [table["dbh_cm"].to_numpy(np.float64) for table in (trees, residual)]
    return Census(
        np.tile(np.concatenate(ids).astype(np.int64), tile**2),
        np.tile(np.array([*trees["species"].astype(str), *of_residual], np.str_), tile**2),
        np.tile(np.concatenate(dbh), tile**2),
    )


def residual_model(
    tree: GrownResidual, parameters: Parameters, most_leaves: int
) -> tuple[Model, float]:
    """Make the model of a residual tree as it stands in the run, and give its height, m.

    Its stems have its own radii, its leaves its leaf area in all; of more than
    `most_leaves` every so-manieth is drawn, larger.
    """
    bark, foliage = parametric_colours(parameters)
    model = Model.of(
        tree.skeleton,
        _fewer(tree.leaves, most_leaves),
        evergreen=parameters.evergreen,
        bark=bark,
        foliage=foliage,
        lobes=(parameters.lobes, parameters.lobe_depth),
        lobed_levels=1 if parameters.leaves else parameters.depth,
    )
    return model, tree.height_m


def _fewer(leaves: Leaves, most: int) -> Leaves:
    """Take an even part of the leaves at most, so much larger that their area in all stays."""
    total = len(leaves.stem)
    if total <= most:
        return leaves
    columns: list[Any] = [column[np.arange(most) * total // most] for column in leaves]
    some = Leaves(*columns)
    size = float(np.sqrt(leaves.area.sum() / max(some.area.sum(), 1e-12)))
    return some._replace(length=size * some.length, width=size * some.width)


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
    year: int, as_it_is: NDArray[np.bool_], stand_in: int, lent: set[int], tile: int
) -> tuple[str, ...]:
    own, total = int(as_it_is.sum()), len(as_it_is)
    of_years = f" (shapes of {', '.join(map(str, sorted(lent)))})" if lent else ""
    notes = [
        f"{total} living trees in {year}: {own} as they are on record, "
        f"{total - own - stand_in} scaled from the nearest in height of their species{of_years}, "
        f"{stand_in} by parametric stand-ins"
    ]
    if tile > 1:
        notes.append(f"the plot is repeated {tile} x {tile} times, as scenery")
    return tuple(notes)
