"""The measured stand as one table: a row per living tree, all that mensuration can say of it.

Most columns follow from `/trees` and so are there for every tree and year of a run. Crowns by
direction and Hohenadl's form factor need a tree's shape: a live stand has it of every tree, a run
of its sample trees.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, span_of
from forest.measure.bark import bark_thickness, diameter_under_bark
from forest.measure.biomass import compartments
from forest.measure.bucking import MODULE_M, Product, buck
from forest.measure.competition import (
    basal_area_of_larger,
    hegyi_within,
    height_diversity,
    relative_species_profile,
    size_differentiation,
    species_profile,
)
from forest.measure.crowns import Crowns, crown_of, crowns_of
from forest.measure.density import curtis_rd, summation_sdi
from forest.measure.gaps import gap_share
from forest.measure.stand import Plot
from forest.measure.stem import Stems, stems_of, stems_of_skeletons
from forest.measure.structure import Neighbours, mingling
from forest.measure.taper import RINGS_READ, disc_diameters, taper_stems
from forest.measure.volumes import form_factor, normal_form_factor

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run
    from forest.scenario import Scenario
    from forest.species import Species
    from forest.stand import Stand
    from forest.trees.skeleton import Skeleton

#: Columns that need a tree's shape; of the crown's radii, the azimuth at which the sector begins.
SHAPE_COLUMNS = (
    "form_normal",
    *(f"crown_radius_{45 * k:03d}_m" for k in range(8)),
    "crown_projection_m2",
    "crown_volume_m3",
)


class _Codes(NamedTuple):
    """What mensuration must know of each tree's species, (n,)."""

    species: NDArray[np.int64]
    bark_factor: NDArray[np.float64]
    density_kg_m3: NDArray[np.float64]
    sla_m2_kg: NDArray[np.float64]


def measure_run(run: Run, year: int) -> pd.DataFrame:
    """Measure all trees of a run in a year.

    Parameters
    ----------
    run : Run
        With the table `trees`.
    year : int
        Calendar year.

    Returns
    -------
    pandas.DataFrame
        The columns of `/trees`, those of `tree_columns` and `SHAPE_COLUMNS`; the last are NaN but
        for the run's sample trees.

    Raises
    ------
    InputError
        If the run has no such year.
    """
    check_year(run, year)
    trees = run.read("trees", years=(year, year))
    scenario = run.scenario
    columns = tree_columns(trees, scenario.species_list, plot_of(scenario))
    columns.update({name: np.full(len(trees), np.nan) for name in SHAPE_COLUMNS})
    shapes = sample_skeletons(run, year)
    if shapes:
        crowns = [crown_of(skeleton) for skeleton in shapes]
        joined = Crowns(*(np.concatenate(parts) for parts in zip(*crowns, strict=True)))
        stems = stems_of_skeletons(shapes, _bark_factors(scenario, shapes))
        rows = np.searchsorted(trees["tree_id"], [skeleton.tree_id for skeleton in shapes])
        for name, values in _shape_columns(joined, stems).items():
            columns[name][rows] = values
    return _with_columns(trees, columns)


def measure_stand(stand: Stand) -> pd.DataFrame:
    """Measure all trees of a live stand: the columns of `measure_run`, but for `ring_width_mm`."""
    trees = stand.trees
    columns = tree_columns(trees, stand.species, plot_of(stand.scenario))
    crowns = crowns_of(stand.arena.metamers, stand.rows)
    return _with_columns(trees, {**columns, **_shape_columns(crowns, stems_of_stand(stand))})


def tree_columns(
    trees: pd.DataFrame, species: Sequence[Species], plot: Plot
) -> dict[str, NDArray[np.float64]]:
    """Give what follows from the columns of `/trees` in one year.

    Parameters
    ----------
    trees : pandas.DataFrame
        n rows of one year, the whole stand.
    species : sequence of Species
        Of the scenario.
    plot : Plot
        Size and boundary.

    Returns
    -------
    dict of float64 (n,)
        `dbh_under_bark_cm`, `bark_thickness_mm` (at 1.3 m, one side), `slenderness` (height per
        dbh), `crown_length_m`, `crown_ratio`; form factors over bark `form_factor` (of the cylinder
        as thick as at 1.3 m) and `form_absolute` (as at the base); the mass of each compartment
        (`forest.measure.biomass.Compartments`); `bal_m2ha`, `hegyi` (6 m), `size_differentiation`
        (4 neighbours that have a dbh), `mingling` (4 neighbours) and `nearest_m` (distance to the
        nearest tree).
    """
    of = _codes(trees, species)
    value = {
        name: trees[name].to_numpy(np.float64)
        for name in trees.columns
        if name.endswith(("_m", "_m2", "_m3", "_cm", "_kg"))
    }
    dbh, height = value["dbh_cm"], value["height_m"]
    volume = value["stem_volume_m3"]
    crown = height - value["crown_base_m"]
    parts = compartments(
        value["biomass_kg"],
        volume,
        value["leaf_area_m2"],
        bark_factor=of.bark_factor,
        density_kg_m3=of.density_kg_m3,
        sla_m2_kg=of.sla_m2_kg,
    )
    return {
        "dbh_under_bark_cm": diameter_under_bark(dbh, of.bark_factor),
        "bark_thickness_mm": 10.0 * bark_thickness(dbh, of.bark_factor),
        "slenderness": 100.0 * height / dbh,
        "crown_length_m": crown,
        "crown_ratio": crown / height,
        "form_factor": form_factor(volume, 0.01 * dbh, height),
        "form_absolute": form_factor(volume, 0.01 * value["base_diameter_cm"], height),
        **parts._asdict(),
        **_among_others(value, of, plot),
    }


def stand_indices(trees: pd.DataFrame, plot: Plot) -> dict[str, float]:
    """Give the indices of a whole stand, beside those of `/stand`.

    Parameters
    ----------
    trees : pandas.DataFrame
        As `measure_run` or `measure_stand` gives them.
    plot : Plot
        Size and boundary.

    Returns
    -------
    dict of float
        `summation_sdi`, `curtis_rd`, `species_profile` (Pretzsch's A), `relative_species_profile`,
        `height_diversity` (Shannon of basal area in layers of 2 m), `gap_share` (of the plot, not
        under a crown of more than a third of the top height), and the means of the trees' `hegyi`,
        `bal_m2ha` and `size_differentiation`; NaN where there is no tree to tell,
        but for `summation_sdi` (0) and `gap_share` (1).
    """
    dbh = trees["dbh_cm"].to_numpy(np.float64)
    ground = trees["basal_area_m2"].to_numpy(np.float64)
    height = trees["height_m"].to_numpy(np.float64)
    qmd = float(np.sqrt((trees["dbh_cm"] ** 2).mean()))
    indices = {
        "summation_sdi": summation_sdi(dbh, plot.hectares),
        "curtis_rd": float(curtis_rd(ground.sum() / plot.hectares, qmd)),
        "species_profile": species_profile(height, trees["species"]),
        "relative_species_profile": relative_species_profile(height, trees["species"]),
        "height_diversity": height_diversity(height, ground),
        "gap_share": gap_share(trees, plot),
    }
    for name in ("hegyi", "bal_m2ha", "size_differentiation"):
        indices[name] = float(trees[name].mean())
    return indices


def buck_run(
    run: Run, year: int, products: Sequence[Product], *, module_m: float = MODULE_M
) -> pd.DataFrame:
    """Cut the trees of a run as they stood in a year; see `forest.measure.bucking.buck`.

    Sample trees are cut along their own stems, all others along stems drawn through their discs
    (`forest.measure.taper`).

    Returns
    -------
    pandas.DataFrame
        The logs, with `tree_id`, `species` and `stem` (`exact` or `drawn`) in place of `stem`.

    Raises
    ------
    InputError
        If the run has no such year or no table of trees or rings, or a product is not right.
    """
    import pandas as pd

    check_year(run, year)
    of = {s.name: s.mensuration for s in run.scenario.species_list}
    trees = run.read("trees", years=(year, year))
    trees = trees[trees["stem_volume_m3"] > 0.0]
    shapes = sample_skeletons(run, year)
    exact = stems_of_skeletons(shapes, _bark_factors(run.scenario, shapes))
    ids = np.array([skeleton.tree_id for skeleton in shapes], np.int64)
    kinds = [skeleton.species for skeleton in shapes]
    others = trees[~trees["tree_id"].isin(ids)]
    bark = np.array([of[name].bark_factor for name in others["species"]], np.float64)
    rings = run.read("rings", RINGS_READ, years=(int(run.years[0]), year))
    drawn = taper_stems(others, disc_diameters(rings), bark)
    logs = []
    for name, stems, number, species in (
        ("exact", exact, ids, kinds),
        ("drawn", drawn, others["tree_id"].to_numpy(), others["species"].tolist()),
    ):
        stump = np.array([of[one].stump_height_m for one in species], np.float64)
        cut = buck(stems, products, stump_m=stump, module_m=module_m)
        part = _name_trees(cut, number, species)
        part.insert(2, "stem", pd.Categorical([name] * len(part), ["exact", "drawn"]))
        logs.append(part)
    return pd.concat(logs).sort_values(["tree_id", "log"], ignore_index=True)


def buck_stand(
    stand: Stand, products: Sequence[Product], *, module_m: float = MODULE_M
) -> pd.DataFrame:
    """Cut all trees of a live stand, on paper; the table is that of `buck_run`."""
    height = np.array([s.mensuration.stump_height_m for s in stand.species])
    logs = buck(
        stems_of_stand(stand), products, stump_m=height[stand.rows.species], module_m=module_m
    )
    names = [stand.species_names[k] for k in stand.rows.species]
    return _name_trees(logs, stand.rows.tree_id, names)


def stems_of_stand(stand: Stand) -> Stems:
    """Take the stems of a live stand's trees, in the order of `stand.trees`."""
    return stems_of(stand.arena.metamers, stand.rows, stand.measured_species)


def sample_skeletons(run: Run, year: int) -> list[Skeleton]:
    """Give the shapes of the sample trees that lived in a year, in order of their ids."""
    living = set(run.read("trees", ["tree_id"], years=(year, year))["tree_id"])
    shapes = []
    for tree_id in run.samples:
        if tree_id in living and year in run.sample_years(tree_id):
            shapes.append(run.skeleton(tree_id, year))
    return shapes


def plot_of(scenario: Scenario) -> Plot:
    """Give the plot of a scenario."""
    return Plot(scenario.plot.size_m, scenario.plot.boundary == "periodic")


def _with_columns(trees: pd.DataFrame, columns: dict[str, NDArray[np.float64]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame({**dict(trees.items()), **columns})


def check_year(run: Run, year: int) -> None:
    """Refuse a year that is not on file."""
    if year in run.years:
        return
    years = span_of(run.years[0], run.years[-1]) if len(run.years) else "a whole year"
    what = f"no year {year}" if len(run.years) else "no year on file yet"
    raise InputError(what, where=str(run.path), expected=years)


def _bark_factors(scenario: Scenario, shapes: Sequence[Skeleton]) -> NDArray[np.float64]:
    of = {s.name: s.mensuration.bark_factor for s in scenario.species_list}
    return np.array([of[skeleton.species] for skeleton in shapes])


def _codes(trees: pd.DataFrame, species: Sequence[Species]) -> _Codes:
    numbers = {s.name: k for k, s in enumerate(species)}
    kind = np.array([numbers[name] for name in trees["species"]], np.int64)

    def each(values: list[float]) -> NDArray[np.float64]:
        return np.asarray(np.array(values, np.float64)[kind], np.float64)

    return _Codes(
        kind,
        each([s.mensuration.bark_factor for s in species]),
        each([s.wood.density_kg_m3 for s in species]),
        each([s.leaves.sla_m2_kg for s in species]),
    )


def _among_others(
    value: dict[str, NDArray[np.float64]], of: _Codes, plot: Plot
) -> dict[str, NDArray[np.float64]]:
    """Give what a tree has around itself."""
    x, y, dbh = value["x_m"], value["y_m"], value["dbh_cm"]
    n = len(x)
    everyone = Neighbours(x, y, *plot)
    has = ~np.isnan(dbh)
    alone = np.full(n, np.nan)
    differs = alone.copy()
    if has.sum() > 1:
        thick = everyone if has.all() else Neighbours(x[has], y[has], *plot)
        differs[has] = size_differentiation(thick, dbh[has])
    return {
        "bal_m2ha": basal_area_of_larger(value["basal_area_m2"], plot.hectares),
        "hegyi": hegyi_within(x, y, dbh, *plot),
        "size_differentiation": differs,
        "mingling": mingling(everyone, of.species) if n > 1 else alone,
        "nearest_m": everyone.nearest if n > 1 else alone,
    }


def _shape_columns(crowns: Crowns, stems: Stems) -> dict[str, NDArray[np.float64]]:
    values = (
        normal_form_factor(stems),
        *crowns.radius_m.T,
        crowns.projection_m2,
        crowns.volume_m3,
    )
    return dict(zip(SHAPE_COLUMNS, values, strict=True))


def _name_trees(logs: pd.DataFrame, ids: NDArray[Any], species: Sequence[str]) -> pd.DataFrame:
    stem = logs.pop("stem").to_numpy()
    logs.insert(0, "tree_id", ids[stem])
    logs.insert(1, "species", np.asarray(species, object)[stem])
    return logs
