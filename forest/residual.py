"""Residual trees: parametric trees that stand in the stand, shade, take room and can be felled.

A tree is grown from the scenario, scaled to its height and dbh, and stays as it is. Once it is
gathered into voxels and points, its measures are kept and its shape is let go, since an old oak has
a million parts; the shape is grown again where it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.environment.standing import Standing, StandingLeaves, StandingSites, together
from forest.environment.surroundings import Surroundings
from forest.errors import InputError, nearest
from forest.measure.crowns import crown_of
from forest.measure.stem import stems_of_skeletons
from forest.parametric import ParametricTree, grow
from forest.record.schema import RESIDUAL_STATUS
from forest.scenario.residual import MOST_CROWN_LAI
from forest.trees.leaves import Leaves
from forest.trees.skeleton import Skeleton

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.scenario.residual import ResidualTree as Wanted
    from forest.species.parametric import Parameters

#: Internodes and leaves of all residual trees of a scenario: some half a minute to gather.
MOST_PARTS = 50_000_000

_BREAST_HEIGHT_M = 1.3


@dataclass(frozen=True)
class ResidualTree:
    """A tree that was not simulated, as it stands on the plot.

    Attributes
    ----------
    name, species : str
        Its name, and that of its parametric species.
    place_m : tuple of float
        Place of the stem base, m.
    height_m : float
        Height of the highest tip.
    dbh_cm : float
        Diameter of the stem at 1.3 m; NaN below that height.
    crown_base_m, crown_radius_m : float
        Height of the lowest leaf-bearing tip (NaN without leaves), and mean reach of the crown in
        eight directions.
    leaf_area_m2, stem_volume_m3 : float
        One-sided area of its leaves, volume of its stem.
    """

    name: str
    species: str
    place_m: tuple[float, float]
    height_m: float
    dbh_cm: float
    crown_base_m: float
    crown_radius_m: float
    leaf_area_m2: float
    stem_volume_m3: float


@dataclass(frozen=True)
class GrownResidual(ResidualTree):
    """A residual tree with its shape.

    Attributes
    ----------
    skeleton : Skeleton
        Its shape in the plot's coordinates; its radius is taken as that over bark. Its `tree_id` is
        below 0, its number with a minus, so that no simulated tree has it.
    leaves : Leaves
        Its leaves, likewise; their areas add up to `leaf_area_m2`.
    """

    skeleton: Skeleton
    leaves: Leaves

    def measures(self) -> ResidualTree:
        """Give the tree without its shape."""
        return ResidualTree(*(getattr(self, field.name) for field in fields(ResidualTree)))


def grow_residual(wanted: Wanted, number: int = 1) -> GrownResidual:
    """Grow the tree that a scenario's table describes.

    The parametric tree of its species and seed is scaled to its height, alike in all directions;
    the radii are then scaled again where a dbh is given. Its leaves share its leaf area in
    proportion to their own areas.

    Parameters
    ----------
    wanted : forest.scenario.residual.ResidualTree
    number : int
        Its number in the scenario's list, from 1.

    Raises
    ------
    InputError
        If the species gives no tree of that height, dbh or leaf area.
    """
    return _scaled(_form(wanted, number), wanted, number)


def _form(wanted: Wanted, number: int) -> ParametricTree:
    """Grow the form of a tree, of any size."""
    where = f"residual_trees[{number - 1}].species"
    assert wanted.parameters is not None  # filled in when the scenario is read
    try:
        form = grow(wanted.parameters, wanted.seed)
    except InputError as error:
        raise InputError(str(error), where=where) from None
    if not (np.isfinite(form.nodes.position).all() and _height(form) > 0.0):
        raise InputError(
            f"'{wanted.species}' gives no tree that stands",
            where=where,
            expected="parameters of a tree with a height",
        )
    return form


def _height(form: ParametricTree) -> float:
    return float(form.nodes.position[:, 2].max(initial=0.0))


def _scaled(form: ParametricTree, wanted: Wanted, number: int) -> GrownResidual:
    """Give a form the size and the place of a tree."""
    where = f"residual_trees[{number - 1}]"
    height = _height(form)
    skeleton = _placed(form, wanted, wanted.height_m / height, number)
    stems = stems_of_skeletons([skeleton], 0.0)
    dbh_cm = 100.0 * float(stems.diameter_at(_BREAST_HEIGHT_M)[0])
    if wanted.dbh_cm is not None:
        if not dbh_cm > 0.0:
            raise InputError(
                "its stem does not reach 1.3 m",
                where=f"{where}.dbh_cm",
                expected="no dbh, or a taller tree",
            )
        skeleton = replace(skeleton, radius=skeleton.radius * (wanted.dbh_cm / dbh_cm))
        stems = stems_of_skeletons([skeleton], 0.0)
        dbh_cm = wanted.dbh_cm
    crown = crown_of(skeleton)
    below = float(np.nan_to_num(crown.projection_m2[0]))
    area = wanted.crown_lai * below if wanted.leaf_area_m2 is None else wanted.leaf_area_m2
    if area > 0.0 and not len(form.leaves.stem):
        raise InputError(
            f"'{wanted.species}' bears no leaves",
            where=f"{where}.leaf_area_m2",
            expected="0, or another species",
        )
    if area > MOST_CROWN_LAI * below:
        raise InputError(
            f"{area:g} m2 of leaves stand over {below:.3g} m2 of ground below the crown",
            where=f"{where}.leaf_area_m2",
            expected=f"at most {MOST_CROWN_LAI:g} times that, {MOST_CROWN_LAI * below:.3g} m2",
        )
    return GrownResidual(
        name=wanted.name,
        species=wanted.species,
        place_m=(wanted.x_m, wanted.y_m),
        skeleton=skeleton,
        leaves=_leaves(form, wanted, wanted.height_m / height, area),
        height_m=wanted.height_m,
        dbh_cm=dbh_cm,
        crown_base_m=float(crown.base_m[0]),
        crown_radius_m=float(crown.radius_m[0].mean()),
        leaf_area_m2=area,
        stem_volume_m3=float(stems.volume()[0]),
    )


def _base(wanted: Wanted) -> NDArray[np.float64]:
    return np.array([wanted.x_m, wanted.y_m, 0.0])


def _placed(form: ParametricTree, wanted: Wanted, factor: float, number: int) -> Skeleton:
    """Scale a tree's shape and put it at its place."""
    shape = form.skeleton(tree_id=-number)
    return replace(
        shape,
        start=_base(wanted) + factor * shape.start,
        end=_base(wanted) + factor * shape.end,
        radius=factor * shape.radius,
        species=wanted.species,
    )


def _leaves(form: ParametricTree, wanted: Wanted, factor: float, area_m2: float) -> Leaves:
    """Scale a tree's leaves to their area in all and put them at their places."""
    leaves = form.leaves
    size = float(np.sqrt(area_m2 / leaves.area.sum())) if len(leaves.stem) else 1.0
    return leaves._replace(
        position=_base(wanted) + factor * leaves.position,
        length=size * leaves.length,
        width=size * leaves.width,
    )


class ResidualTrees:
    """The residual trees of a stand: those that stand, and those that were felled.

    Parameters
    ----------
    scenario : Scenario
    surroundings : Surroundings
        Told what stands, at once and whenever a tree is felled.

    Attributes
    ----------
    trees : tuple of ResidualTree
        All of the scenario, in its order.
    """

    def __init__(self, scenario: Scenario, surroundings: Surroundings) -> None:
        wanted = self._wanted = scenario.residual_trees
        self._surroundings = surroundings
        self._start_year = scenario.start_year
        self._felled_step = np.zeros(len(wanted), np.int32)  # 0 while it stands
        species = list(dict.fromkeys(one.species for one in wanted))
        self._species = np.array([species.index(one.species) for one in wanted], np.int16)
        gathered: dict[int, tuple[ResidualTree, Standing]] = {}
        for k, tree in _grow_all(wanted):
            standing = _standing(tree, scenario, wanted[k].like, surroundings.voxel_m)
            gathered[k] = tree.measures(), standing
        self.trees = tuple(gathered[k][0] for k in range(len(wanted)))
        self._parts = [gathered[k][1] for k in range(len(wanted))]
        self._tell()

    def __len__(self) -> int:
        """Count those that stand."""
        return int(np.count_nonzero(self._felled_step == 0))

    def __iter__(self) -> Iterator[ResidualTree]:
        """Go through those that stand."""
        return iter([self.trees[k] for k in np.flatnonzero(self._felled_step == 0)])

    def _tell(self) -> None:
        """Tell the surroundings what stands."""
        left = np.flatnonzero(self._felled_step == 0)
        self._surroundings.standing = together([self._parts[k] for k in left])

    @property
    def places_m(self) -> NDArray[np.float64]:
        """Places of the stems that stand, m, float64 (n, 2)."""
        return np.array([tree.place_m for tree in self], np.float64).reshape(-1, 2)

    def row_of(self, name: str, where: str) -> int:
        """Find a tree that stands; `where` names the place of its name in messages.

        Raises
        ------
        InputError
            If there is none of this name, or it was felled.
        """
        names = [tree.name for tree in self.trees]
        if name not in names:
            hint = nearest(str(name), names) if names else "the scenario has no residual_trees"
            raise InputError(f"no residual tree '{name}', {hint}", where=where)
        row = names.index(name)
        if self._felled_step[row]:
            year = self._start_year + int(self._felled_step[row]) - 1
            raise InputError(
                f"'{name}' was felled before the growth of {year}",
                where=where,
                expected="a residual tree that still stands",
            )
        return row

    def fell(self, row: int, step: int) -> None:
        """Fell a tree before the growth of a step."""
        self._felled_step[row] = step
        self._tell()

    def skeleton(self, name: str) -> Skeleton:
        """Grow the shape of a tree that stands once more.

        Raises
        ------
        InputError
            If there is no such tree, or it was felled.
        """
        row = self.row_of(name, "Stand.residual")
        return grow_residual(self._wanted[row], row + 1).skeleton

    @property
    def table(self) -> pd.DataFrame:
        """The trees that stand now: a row each, with the columns of `/residual` but the year."""
        import pandas as pd

        rows = np.flatnonzero(self._felled_step == 0)
        columns = self._columns(rows)
        columns["name"] = np.array([self.trees[k].name for k in rows], object)
        columns["species"] = np.array([self.trees[k].species for k in rows], object)
        return pd.DataFrame(columns)

    def columns(self, year: int, step: int) -> dict[str, NDArray[Any]]:
        """Give the year's rows of `/residual`: what stands or was felled before it."""
        rows = np.flatnonzero((self._felled_step == 0) | (self._felled_step == step))
        felled = RESIDUAL_STATUS.index("felled")
        return {
            "year": np.full(len(rows), year, np.int32),
            **self._columns(rows),
            "status": np.where(self._felled_step[rows] == step, felled, 0).astype(np.int8),
        }

    def _columns(self, rows: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        trees = [self.trees[k] for k in rows]
        place = np.array([tree.place_m for tree in trees], np.float64).reshape(-1, 2)
        measures = ("height_m", "dbh_cm", "crown_base_m", "crown_radius_m")
        amounts = ("leaf_area_m2", "stem_volume_m3")
        return {
            "residual_id": (rows + 1).astype(np.int32),
            "name": rows.astype(np.int16),
            "species": self._species[rows],
            "x_m": place[:, 0],
            "y_m": place[:, 1],
            **{
                key: np.array([getattr(tree, key) for tree in trees], np.float64)
                for key in measures + amounts
            },
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """Tell which trees were felled, for a checkpoint; their shapes come from the scenario."""
        return {"felled_step": self._felled_step.copy()}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        self._felled_step = np.array(arrays["felled_step"], np.int32)
        self._tell()


def _grow_all(wanted: Sequence[Wanted]) -> Iterator[tuple[int, GrownResidual]]:
    """Grow the trees one by one, in the order of their forms: each form is grown once."""
    alike: dict[tuple[Parameters | None, int], list[int]] = {}
    for k, one in enumerate(wanted):
        alike.setdefault((one.parameters, one.seed), []).append(k)
    parts = 0
    for rows in alike.values():
        form = _form(wanted[rows[0]], rows[0] + 1)
        parts += len(rows) * (len(form.nodes.z) + len(form.leaves.stem))
        if parts > MOST_PARTS:
            raise InputError(
                f"the trees have more than {MOST_PARTS:,} internodes and leaves in all",
                where="residual_trees",
                expected="fewer trees, or species with fewer branches and leaves",
            )
        for k in rows:
            yield k, _scaled(form, wanted[k], k + 1)


def _standing(tree: GrownResidual, scenario: Scenario, like: str, voxel_m: float) -> Standing:
    """Tell how a tree shades and takes room, by the measure of a species of the scenario."""
    species = scenario.species[like] if like else scenario.species_list[0]
    shape, leaves = tree.skeleton, tree.leaves
    blade = leaves.length[:, None] * leaves.direction
    middle = np.asarray(leaves.position + 0.5 * blade, np.float64)
    buds_per_m2 = species.leaves.shade_factor / species.leaves.area_m2
    sites = None
    if scenario.environment.markers is not None:
        internodes = species.shoots.occupancy_radius_internodes
        radius = species.architecture.internode_length_m * internodes
        sites = StandingSites.along(shape.start, shape.end, shape.radius, middle, radius)
    return Standing(StandingLeaves.at(middle, leaves.area, voxel_m, buds_per_m2), sites)
