"""The record of a year: what the stand writes into the run file's tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.mortality import Death
from forest.dynamics.snags import Snags
from forest.growth import budget
from forest.measure.rings import RingYear, breast_ring_widths, ring_rows
from forest.measure.stand import Flows, Plot, stand_rows
from forest.measure.trees import TreeMeasures
from forest.record.samples import SampleShape, SampleYear
from forest.record.schema import CAUSES, EVENT_KINDS
from forest.trees import table
from forest.trees.metamers import LATERAL, MAIN, TERMINAL

if TYPE_CHECKING:
    from forest.stand import Stand

Columns = dict[str, NDArray[Any]]

_SQUARE_METRES_PER_HECTARE = 10_000.0


class Event(NamedTuple):
    """Something that happened to a tree."""

    tree_id: int
    species: int
    kind: str
    cause: str
    mother_id: int
    dbh_cm: float
    height_m: float
    volume_m3: float

    @classmethod
    def of(
        cls,
        stand: Stand,
        row: int,
        kind: str,
        cause: str,
        measures: TreeMeasures,
        place: int | None = None,
    ) -> Event:
        """Note an event of the tree in a row of the table, whose measures may stand elsewhere."""
        place = row if place is None else place
        return cls(
            int(stand.rows.tree_id[row]),
            int(stand.rows.species[row]),
            kind,
            cause,
            int(stand.rows.mother_id[row]),
            float(measures.dbh_cm[place]),
            float(measures.height_m[place]),
            float(measures.stem_volume_m3[place]),
        )


class Loss(NamedTuple):
    """What acts since the last record took from a sample tree.

    Attributes
    ----------
    species : int
        Index into the scenario's species.
    x, y : float
        Place of its stem base, m.
    serials : list of int
        Serial numbers of the metamers that went.
    """

    species: int
    x: float
    y: float
    serials: list[int]


class YearRecord(NamedTuple):
    """One year of a stand.

    Attributes
    ----------
    year : int
        Calendar year.
    tables : dict of table to columns
        The year's rows of `/trees`, `/stand`, `/events`, `/rings`, `/carbon`, `/climate`, where
        the scenario has them `/stability`, `/deadwood` and `/regeneration`, where acts were done
        `/treatments`, where the wind blew `/storms`, and where there are residual
        trees `/residual`.
    samples : dict of tree id to SampleYear
        The year in the lives of the sample trees.
    """

    year: int
    tables: dict[str, Columns]
    samples: dict[int, SampleYear]


def record_year(
    stand: Stand,
    measures: TreeMeasures,
    deaths: list[Death],
    accounts: NDArray[np.float64],
    serials_before: dict[int, NDArray[np.int32]],
    rings: RingYear,
) -> YearRecord:
    """Write down the year that has just been grown.

    Parameters
    ----------
    stand : Stand
        After growth; trees that die this year are still in its table.
    measures : TreeMeasures
        Of all rows.
    deaths : list of Death
    accounts : float64 (rows, ACCOUNTS)
        The year's carbon accounts, kg per tree.
    serials_before : dict
        Serials of the sample trees' metamers before the year, after acts.
    rings : RingYear
        What the year's rings are read from.
    """
    rows = stand.rows
    alive = np.ones(len(rows.tree_id), np.bool_)
    alive[[death.row for death in deaths]] = False
    living = table.keep(rows, alive)
    kept: dict[str, Any] = {name: column[alive] for name, column in measures._asdict().items()}
    of_living = TreeMeasures(**kept)
    events = [
        *stand.pending,
        *(Event.of(stand, d.row, d.kind, d.cause, measures) for d in deaths),
    ]
    chosen = choose_samples(stand, living, of_living)
    stand.sample_ids.extend(chosen)
    plot = stand.scenario.plot
    tables = {
        "trees": _tree_rows(stand, living, of_living, rings),
        "stand": stand_rows(
            stand.year,
            of_living,
            living.x,
            living.y,
            living.species,
            _flows(events, len(stand.species)),
            Plot(plot.size_m, plot.boundary == "periodic"),
            stand.floor_light,
        ),
        "events": _event_rows(stand.year, events),
        "rings": _ring_rows(stand, living, of_living, rings),
        "carbon": _carbon_rows(stand, accounts),
        "climate": _climate_rows(stand),
    }
    if stand.mechanics is not None:
        tables["stability"] = _stability_rows(stand, living)
    if stand.dead_wood is not None:
        hectares = plot.size_m[0] * plot.size_m[1] / _SQUARE_METRES_PER_HECTARE
        tables["deadwood"] = stand.dead_wood.columns(stand.year, hectares)
    treatments = stand.treatments.columns()
    if treatments:
        tables["treatments"] = treatments
    blown = stand.storms.take(stand.year)
    if blown:
        tables["storms"] = blown
    if stand.residual.trees:
        tables["residual"] = stand.residual.columns(stand.year, stand.steps)
    return YearRecord(stand.year, tables, _sample_years(stand, deaths, serials_before))


def _tree_rows(
    stand: Stand, trees: table.Trees, measures: TreeMeasures, rings: RingYear
) -> Columns:
    n = len(trees.tree_id)
    columns: Columns = {
        "year": np.full(n, stand.year, np.int32),
        "tree_id": trees.tree_id,
        "species": trees.species,
        "x_m": trees.x,
        "y_m": trees.y,
        "age": stand.steps - trees.birth,
        "status": np.zeros(n, np.int8),
        "ring_width_mm": breast_ring_widths(stand.arena.metamers, trees, measures, rings),
    }
    columns.update(measures.columns())
    return columns


def _ring_rows(
    stand: Stand, trees: table.Trees, measures: TreeMeasures, rings: RingYear
) -> Columns:
    output = stand.scenario.output
    heights = np.array(output.ring_heights_m, np.float64)
    metamers = stand.arena.metamers
    columns = ring_rows(metamers, trees, measures, heights, output.ring_crown_base, rings)
    if not columns:
        return {}
    place = columns.pop("metamer")
    if stand.mechanics is None:
        round_, no_side = np.zeros(len(place)), np.full(len(place), np.nan)
        return {**columns, "eccentricity": round_, "thick_side_deg": no_side}
    eccentricity, azimuth = stand.mechanics.thick_sides(stand.arena, place)
    side = np.degrees(azimuth) % 360.0
    return {**columns, "eccentricity": eccentricity, "thick_side_deg": side}


def _stability_rows(stand: Stand, trees: table.Trees) -> Columns:
    assert stand.mechanics is not None
    found = stand.mechanics.stability(stand.arena, trees)
    n = len(trees.tree_id)
    return {
        "year": np.full(n, stand.year, np.int32),
        "tree_id": trees.tree_id,
        "species": trees.species,
        **found._asdict(),
    }


def snag_columns(stand: Stand) -> Columns:
    """Give the snags that stand now, by column."""
    snags = Snags.none() if stand.dead_wood is None else stand.dead_wood.snags
    return {
        "tree_id": snags.tree_id,
        "species": np.array([stand.species_names[k] for k in snags.species], object),
        "x_m": snags.x,
        "y_m": snags.y,
        "dbh_cm": snags.dbh_cm,
        "height_m": snags.height_m,
        "volume_m3": snags.volume_m3,
        "mass_kg": snags.mass_kg,
        "death_year": stand.scenario.start_year + snags.death_step - 1,
    }


def _flows(events: list[Event], species: int) -> Flows:
    def count(*kinds: str) -> NDArray[np.int64]:
        return np.bincount([e.species for e in events if e.kind in kinds], minlength=species)

    volume = np.zeros(species)
    for event in events:
        if event.kind == "felled":
            volume[event.species] += event.volume_m3
    return Flows(count("recruited"), count("died", "windthrown"), count("felled"), volume)


def _event_rows(year: int, events: list[Event]) -> Columns:
    return {
        "year": np.full(len(events), year, np.int32),
        "tree_id": np.array([e.tree_id for e in events], np.int32),
        "species": np.array([e.species for e in events], np.int16),
        "kind": np.array([EVENT_KINDS.index(e.kind) for e in events], np.int8),
        "cause": np.array([CAUSES.index(e.cause) for e in events], np.int8),
        "mother_id": np.array([e.mother_id for e in events], np.int32),
        "dbh_cm": np.array([e.dbh_cm for e in events], np.float64),
        "height_m": np.array([e.height_m for e in events], np.float64),
        "volume_m3": np.array([e.volume_m3 for e in events], np.float64),
    }


def _carbon_rows(stand: Stand, accounts: NDArray[np.float64]) -> Columns:
    k = len(stand.species)
    width, depth = stand.scenario.plot.size_m
    per_hectare = _SQUARE_METRES_PER_HECTARE / (width * depth)
    columns: Columns = {
        "year": np.full(k + 1, stand.year, np.int32),
        "species": np.arange(k + 1, dtype=np.int16),
    }
    for name, column in (
        ("income", budget.INCOME),
        ("leaves", budget.LEAVES),
        ("upkeep", budget.UPKEEP),
        ("extension", budget.EXTENSION),
        ("ring", budget.RING),
        ("reserve_change", budget.RESERVE_CHANGE),
    ):
        sums = np.bincount(stand.rows.species, weights=accounts[:, column], minlength=k)
        columns[name] = np.append(sums, sums.sum()) * per_hectare
    return columns


def _climate_rows(stand: Stand) -> Columns:
    k = len(stand.species)
    values = stand.climate.values(stand.year)
    return {
        "year": np.full(k, stand.year, np.int32),
        "species": np.arange(k, dtype=np.int16),
        **{name: np.full(k, value) for name, value in values.items()},
        "factor": stand.climate.factors(stand.year),
    }


def choose_samples(stand: Stand, trees: table.Trees, measures: TreeMeasures) -> list[int]:
    """Choose the sample trees that are due: by id from the start, by dbh quantile in their year."""
    wanted = stand.scenario.output.sample_trees
    chosen = []
    if stand.steps == 1:
        chosen += [i for i in wanted.ids if i in trees.tree_id]
    if wanted.dbh_quantiles and stand.year == wanted.at_year and len(trees.tree_id):
        thickness = np.where(np.isnan(measures.dbh_cm), -1.0, measures.dbh_cm)
        by_thickness = np.argsort(thickness, kind="stable")
        for quantile in wanted.dbh_quantiles:
            place = round(quantile * (len(by_thickness) - 1))
            chosen.append(int(trees.tree_id[by_thickness[place]]))
    return [i for i in dict.fromkeys(chosen) if i not in stand.sample_ids]


def sample_serials(stand: Stand) -> dict[int, NDArray[np.int32]]:
    """Give the serials of the sample trees' metamers before the year, to tell what is shed."""
    serials = {}
    for tree_id in stand.sample_ids:
        row = int(np.searchsorted(stand.rows.tree_id, tree_id))
        if row < len(stand.rows.tree_id) and stand.rows.tree_id[row] == tree_id:
            start, size = int(stand.rows.start[row]), int(stand.rows.size[row])
            serials[tree_id] = stand.arena.metamers.serial[start : start + size].copy()
    return serials


def _sample_years(
    stand: Stand, deaths: list[Death], before: dict[int, NDArray[np.int32]]
) -> dict[int, SampleYear]:
    """Tell the year of each sample tree; one that dies or is felled loses all its metamers."""
    rows = stand.rows
    dies = {death.row for death in deaths}
    years = {}
    for tree_id in stand.sample_ids:
        row = int(np.searchsorted(rows.tree_id, tree_id))
        known = before.get(tree_id)
        loss = stand.losses.get(tree_id)
        if row < len(rows.tree_id) and rows.tree_id[row] == tree_id:
            cut = [] if loss is None else loss.serials
            years[tree_id] = _sample_year(stand, row, known, cut, row in dies)
        elif loss is not None:
            years[tree_id] = _felled_year(loss)
    return years


def _felled_year(loss: Loss) -> SampleYear:
    """Tell the last year of a felled tree: nothing is left to measure."""
    none = np.empty(0, np.int32)
    return SampleYear(
        species=loss.species,
        base=np.array([loss.x, loss.y, 0.0]),
        new_serial=none,
        new_parent_serial=none,
        new_end=np.empty((0, 3), np.float32),
        new_order=np.empty(0, np.uint8),
        new_main=np.empty(0, np.bool_),
        new_birth_year=none,
        dead_serial=np.array(sorted(loss.serials), np.int32),
        serial=none,
        radius=np.empty(0, np.float32),
        leafy=np.empty(0, np.bool_),
    )


def _sample_year(
    stand: Stand, row: int, known: NDArray[np.int32] | None, cut: list[int], dies: bool
) -> SampleYear:
    rows = stand.rows
    start, n = int(rows.start[row]), int(rows.size[row])
    part = slice(start, start + n)
    arena = stand.arena.metamers
    serial = arena.serial[part].copy()
    parent = arena.parent[part]
    parent_serial = np.where(parent >= 0, serial[parent], -1).astype(np.int32)
    base = np.array([rows.x[row], rows.y[row], 0.0])
    # serials rise within a tree, so what is new stands at the end and a search finds the lost
    new = np.ones(n, np.bool_)
    lost = np.empty(0, np.int32)
    if known is not None and known.size:
        new = serial > known[-1]
        place = np.minimum(np.searchsorted(serial, known), n - 1)
        lost = known[serial[place] != known]
    lost = np.union1d(lost, np.array(cut, np.int32))
    state = arena.state[part]
    exponent = float(stand.pipe_exponent[rows.species[row]])
    if dies:
        lost = np.union1d(lost, serial)
    here = np.zeros(n, np.bool_) if dies else np.ones(n, np.bool_)
    end = (arena.tip[part] + base).astype(np.float32)
    shape = None
    if stand.mechanics is not None:
        index = start + np.flatnonzero(here)
        eccentricity, azimuth = stand.mechanics.thick_sides(stand.arena, index)
        shape = SampleShape(end[here], eccentricity, np.degrees(azimuth) % 360.0)
    return SampleYear(
        species=int(rows.species[row]),
        base=base,
        new_serial=serial[new],
        new_parent_serial=parent_serial[new],
        new_end=end[new],
        new_order=arena.order[part][new],
        new_main=(state[new] & MAIN) != 0,
        new_birth_year=(arena.birth[part][new] + stand.scenario.start_year - 1).astype(np.int32),
        dead_serial=lost.astype(np.int32),
        serial=serial[here],
        radius=(0.5 * arena.pipe[part][here] ** (1.0 / exponent)).astype(np.float32),
        leafy=(state[here] & (TERMINAL | LATERAL)) != 0,
        shape=shape,
    )
