"""Wood out of a run file: discs, sections and cores of its trees."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from forest.dendro.cores import Core, take_core
from forest.dendro.disc import Disc
from forest.dendro.knots import Branches
from forest.dendro.life import StemLife
from forest.dendro.section import Section
from forest.dendro.section import section as cut
from forest.dendro.stems import RING_COLUMNS, StemRings, at_height, rings_at
from forest.dendro.turns import shortest_turn, unit
from forest.errors import InputError, span_of
from forest.measure.stem import stem_path
from forest.record.identity import damage_reported
from forest.trees.skeleton import Skeleton

if TYPE_CHECKING:
    import h5py

    from forest.record.run import Run

_BREAST_HEIGHT_MM = 1300


def disc(run: Run, tree_id: int, height_m: float, year: int | None) -> Disc:
    """Cut a disc; see `Run.disc`."""
    if tree_id in run.samples:
        life = stem_life(run, tree_id, year)
        return life.disc(height_m, _recorded_rings(run, life, height_m))
    rings = _rings(run, tree_id, height_m, year)
    return Disc.of(rings, _bark_factor(run, rings.species))


def section(
    run: Run, tree_id: int, origin: ArrayLike, normal: ArrayLike, year: int | None
) -> Section:
    """Cut a stem by a plane; see `Run.section`."""
    return cut(stem_life(run, tree_id, year), origin, normal)


def core(
    run: Run,
    tree_id: int,
    height_m: float,
    azimuth_deg: float,
    year: int | None,
    aim_sd_deg: float,
    seed: int,
) -> Core:
    """Take an increment core; see `Run.core`."""
    rings = _rings(run, tree_id, height_m, year)
    return take_core(rings, azimuth_deg, aim_sd_deg=aim_sd_deg, seed=seed)


def stem_life(run: Run, tree_id: int, year: int | None) -> StemLife:
    """Read the stem of a sample tree with its yearly surfaces; see `Run.stem`."""
    _check_years(run, year)
    known = run.sample_years(tree_id) if tree_id in run.samples else np.empty(0, np.int32)
    last = int(known[-1]) if year is None and len(known) else year
    skeleton = run.skeleton(tree_id, int(run.years[-1]) if last is None else last)
    path = stem_path(skeleton)
    with damage_reported(run.path):
        group = run.sample_group(tree_id)
        branches, branch_ends = _branch_rows(group, skeleton.serial[path], int(last or 0))
        serial = np.concatenate((skeleton.serial[path], branches["serial"]))
        ends = np.concatenate((skeleton.end[path], branch_ends))
        lives = _Lives(group, serial, ends, int(last or 0))
    m = len(path)
    node = _places(skeleton.serial[path], branches["parent_serial"])
    start, end = skeleton.start[path], skeleton.end[path]
    there = lives.radius[:, m:] > 0.0
    seen = there.any(axis=0)  # what was lost in the year in which it was made left no wood
    then = len(lives.years) - 1 - np.argmax(there[::-1], axis=0)
    each = np.arange(len(node))
    base = np.broadcast_to(start[0], lives.end[:, :1].shape)
    below = np.concatenate((base, lives.end[:, : m - 1]), axis=1)
    stood = lives.end[then, node]
    along, was = lives.end[then, m + each] - stood, unit(stood - below[then, node])
    turn = shortest_turn(was, unit(end - start)[node])
    return StemLife(
        tree_id=tree_id,
        species=skeleton.species,
        years=lives.years,
        start=start,
        end=end,
        birth_year=skeleton.birth_year[path].astype(np.int64),
        radius=lives.radius[:, :m],
        eccentricity=lives.eccentricity[:, :m],
        thick_side_deg=lives.thick_side_deg[:, :m],
        branches=Branches(
            serial=branches["serial"][seen],
            node=node[seen],
            direction=np.einsum("bij,bj->bi", turn, unit(along))[seen],
            birth_year=branches["birth_year"][seen].astype(np.int64),
            radius=lives.radius[:, m:][:, seen],
        ),
        bark_factor=_bark_factor(run, skeleton.species),
    )


@dataclass(frozen=True)
class YearlyWood:
    """The wood of all internodes that a sample tree has in a year, in the years up to it.

    Attributes
    ----------
    years : int64 (Y,)
        Calendar years on record.
    radius : float64 (Y, n)
        Under bark at the end of each year, m; 0 before an internode was made.
    eccentricity, thick_side_deg : float64 (Y, n)
        Of each year's ring; the azimuth once the internode is upright, 0 for a round ring.
    """

    years: NDArray[np.int64]
    radius: NDArray[np.float64]
    eccentricity: NDArray[np.float64]
    thick_side_deg: NDArray[np.float64]


def yearly_wood(run: Run, skeleton: Skeleton, year: int) -> YearlyWood:
    """Read the radii of the internodes of `run.skeleton(tree, year)` up to that year."""
    with damage_reported(run.path):
        group = run.sample_group(skeleton.tree_id)
        lives = _Lives(group, skeleton.serial, skeleton.end, year)
    return YearlyWood(lives.years, lives.radius, lives.eccentricity, lives.thick_side_deg)


class _Lives:
    """What is on file of some metamers of a sample tree, year by year up to one of them.

    Attributes
    ----------
    years : int64 (Y,)
    radius, eccentricity, thick_side_deg : float64 (Y, w)
        0 where a metamer is not on the tree.
    end : float64 (Y, w, 3)
        Upper ends; those given where nothing bends.
    """

    def __init__(
        self, group: h5py.Group, serial: NDArray[np.int32], end: NDArray[np.float64], year: int
    ) -> None:
        steps = {name: group[f"steps/{name}"][:] for name in ("year", "radii", "shapes")}
        counts = np.diff(steps["radii"], prepend=0)
        living = (counts > 0) & (steps["year"] <= year)
        self.years: NDArray[np.int64] = steps["year"][living].astype(np.int64)
        rows = int(steps["radii"][living][-1])
        on_file = group["radii/serial"][:rows]
        column = np.full(int(max(on_file.max(), serial.max())) + 1, -1, np.int64)
        column[serial] = np.arange(len(serial))
        wanted = column[on_file]
        chosen = np.flatnonzero(wanted >= 0)
        row = np.searchsorted(steps["radii"][living], chosen, side="right")
        at = row, wanted[chosen]
        shape = len(self.years), len(serial)
        self.radius = np.zeros(shape)
        self.radius[at] = group["radii/radius_m"][:rows][chosen]
        self.eccentricity, self.thick_side_deg = np.zeros(shape), np.zeros(shape)
        self.end = np.broadcast_to(end, (*shape, 3)).copy()
        if int(steps["shapes"][living][-1]) == rows:
            self.eccentricity[at] = np.nan_to_num(group["shapes/eccentricity"][:rows][chosen])
            self.thick_side_deg[at] = np.nan_to_num(group["shapes/thick_side_deg"][:rows][chosen])
            for axis, name in enumerate("xyz"):
                self.end[(*at, axis)] = group[f"shapes/end_{name}_m"][:rows][chosen]


def _branch_rows(
    group: h5py.Group, stem: NDArray[np.int32], year: int
) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Read the first metamers of all branches that ever stood on a stem, and their upper ends."""
    step = int(np.flatnonzero(group["steps/year"][:] == year)[0])
    made = int(group["steps/metamers"][step])
    names = ("serial", "parent_serial", "birth_year")
    columns = {name: group[f"metamers/{name}"][:made] for name in names}
    first = np.isin(columns["parent_serial"], stem) & ~np.isin(columns["serial"], stem)
    end = np.stack([group[f"metamers/end_{axis}_m"][:made][first] for axis in "xyz"], axis=1)
    return {name: column[first] for name, column in columns.items()}, end.astype(np.float64)


def _places(serials: NDArray[np.int32], wanted: NDArray[np.int32]) -> NDArray[np.int64]:
    order = np.argsort(serials)
    return np.asarray(order[np.searchsorted(serials, wanted, sorter=order)], np.int64)


def _rings(run: Run, tree_id: int, height_m: float, year: int | None) -> StemRings:
    """Find the rings of any tree at a height, or say where there are any."""
    _check_years(run, year)
    if tree_id in run.samples:
        life = stem_life(run, tree_id, year)
        found = _recorded_rings(run, life, height_m)
        return life.rings(height_m) if found is None else found
    if "rings" not in run.tables:
        raise InputError(
            "holds no table rings", where=str(run.path), expected="one, or sample trees"
        )
    rings = _of_tree(run, tree_id)
    upto = rings if year is None else rings[rings["year"] <= year]
    if not len(rings):
        _refuse_tree(run, tree_id)
    last = int(rings["year"].max())
    if year is not None and (year > last or not len(upto)):
        raise InputError(
            f"tree {tree_id} has no ring of {year}",
            where=str(run.path),
            expected=span_of(rings["year"].min(), last),
        )
    found = rings_at(upto, tree_id, height_m)
    radius_m = _breast_radius(run, found) if found.cambial_age[0] > 1 else math.nan
    return found if math.isnan(radius_m) else _around_old_wood(found, radius_m)


def _recorded_rings(run: Run, life: StemLife, height_m: float) -> StemRings | None:
    """Take a sample tree's rings out of the table rings; None if it has none of that height."""
    if "rings" not in run.tables:
        return None
    rings, year = _of_tree(run, life.tree_id), int(life.years[-1])
    here = rings[at_height(rings, height_m) & (rings["year"] <= year).to_numpy()]
    if not len(here) or int(here["year"].max()) != year:
        return None
    found = rings_at(here, life.tree_id, height_m)
    return _around_old_wood(found, life.radius[-1, life.internode_at(height_m)])


def _around_old_wood(rings: StemRings, radius_m: float) -> StemRings:
    """Tell the wood inside the first ring of a tree that came into the run with rings behind it."""
    if rings.cambial_age[0] == 1:
        return rings
    return rings._replace(undated_mm=max(1000.0 * radius_m - float(rings.width_mm.sum()), 0.0))


def _breast_radius(run: Run, rings: StemRings) -> float:
    """Give a tree's radius under bark at 1.3 m in the year of its last ring, m; NaN if not told."""
    if "trees" not in run.tables or round(1000.0 * rings.stem_height_m) != _BREAST_HEIGHT_MM:
        return float("nan")
    last = int(rings.year[-1])
    trees = run.read("trees", ["tree_id", "dbh_cm"], years=(last, last))
    (dbh_cm,) = trees.loc[trees["tree_id"] == rings.tree_id, "dbh_cm"]
    return 0.005 * float(dbh_cm) * (1.0 - _bark_factor(run, rings.species))


def _of_tree(run: Run, tree_id: int) -> pd.DataFrame:
    """Give a tree's rings at set heights."""
    rings = run.rings
    mine = (rings["tree_id"] == tree_id).to_numpy() & (rings["place"] == "height").to_numpy()
    return rings.loc[mine, list(RING_COLUMNS)]


def _check_years(run: Run, year: int | None) -> None:
    if not len(run.years):
        raise InputError("holds no years yet", where=str(run.path))
    if year is not None and year not in run.years:
        raise InputError(
            f"no year {year}",
            where=str(run.path),
            expected=span_of(run.years[0], run.years[-1]),
        )


def _refuse_tree(run: Run, tree_id: int) -> None:
    """Say that a tree never lived, or that it never grew so high as to have a ring on record."""
    seen = run.trees["tree_id"] if "trees" in run.tables else run.rings["tree_id"]
    if (seen == tree_id).any():
        heights = ", ".join(f"{h:g}" for h in run.scenario.output.ring_heights_m)
        raise InputError(
            f"tree {tree_id} has no rings",
            where=str(run.path),
            expected=f"a tree that grew to a height whose rings are told: {heights} m",
        )
    span = f"; its trees are numbered {seen.min()} to {seen.max()}" if len(seen) else ""
    raise InputError(f"no tree {tree_id} ever lived in this run{span}", where=str(run.path))


def _bark_factor(run: Run, species: str) -> float:
    return {s.name: s.mensuration.bark_factor for s in run.scenario.species_list}[species]
