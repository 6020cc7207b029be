"""A stand's regeneration: its year from seed to tree, and what it remembers of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.mortality import Death
from forest.dynamics.regeneration import cohorts as seedlings
from forest.dynamics.regeneration.cells import Cells
from forest.dynamics.regeneration.cohorts import Cohorts, Ground
from forest.dynamics.regeneration.dispersal import Dispersal, draw_mothers
from forest.dynamics.regeneration.fecundity import mast_factors, seeds_borne
from forest.dynamics.regeneration.recruits import Places, find_places
from forest.dynamics.regeneration.sprouts import Stumps, no_stumps, sprout_cohorts
from forest.dynamics.regeneration.traits import Traits
from forest.environment.canopy import Canopy, through_layers
from forest.establishment import Newcomers, establish

if TYPE_CHECKING:
    from forest.growth.parameters import SpeciesTraits
    from forest.measure.trees import TreeMeasures
    from forest.scenario import Scenario
    from forest.stand import Stand
    from forest.trees.table import Trees

Columns = dict[str, NDArray[Any]]

#: What breaks or burns a stem, beside storms, and leaves a stump with living roots.
_BREAKING = ("buckling", "fire")
#: Bounds of the height classes of `/regeneration`, m.
_LOW_M, _HIGH_M = 0.1, 0.5


class Regeneration:
    """The seeds, seedlings and sprouts of one stand.

    Parameters
    ----------
    scenario : Scenario
        With a table `regeneration`.
    canopy : Canopy
        Light at the ground, which seedlings read and shade.

    Attributes
    ----------
    cells : Cells
        The ground's cells.
    cohorts : Cohorts
        The seedlings now.
    """

    def __init__(self, scenario: Scenario, canopy: Canopy) -> None:
        spec = scenario.regeneration
        assert spec is not None
        self._spec = spec
        self._seed = scenario.seed
        self._canopy = canopy
        periodic = scenario.plot.boundary == "periodic"
        self.cells = Cells.over(scenario.plot.size_m, spec.cell_m, periodic)
        self._traits = Traits.of(scenario.species_list)
        voxel_m = scenario.environment.canopy.voxel_m if scenario.environment.canopy else 1.0
        self._voxel_cell = self.cells.of_voxels(canopy.ground_light.shape, voxel_m)
        self._rain = np.array([spec.seed_rain.get(s.name, 0.0) for s in scenario.species_list])
        self._dispersal = [
            Dispersal(s.kernel, s.kernel_distance_m, s.kernel_shape, self.cells)
            for s in (species.regeneration for species in scenario.species_list)
        ]
        self.cohorts = seedlings.no_cohorts()
        self._stumps = no_stumps()

    # ------------------------------------------------------------------ the year

    def year(
        self,
        stand: Stand,
        grown: Trees,
        measures: TreeMeasures,
        deaths: Sequence[Death],
        traits: SpeciesTraits,
    ) -> Columns:
        """Let seedlings live the year that the stand has grown; those tall enough become trees.

        Parameters
        ----------
        stand : Stand
            After its dead were buried.
        grown : Trees
            Its table with this year's dead.
        measures : TreeMeasures
            Of the rows of `grown`.
        deaths : sequence of Death
        traits : SpeciesTraits

        Returns
        -------
        dict of column to array
            The year's rows of `/regeneration`.
        """
        alive = np.ones(len(grown.tree_id), np.bool_)
        alive[[death.row for death in deaths]] = False
        year, of = stand.year, self._traits
        trees = stand.rows
        kind, at = trees.species.astype(np.int64), self.cells.of(trees.x, trees.y)
        height = measures.height_m[alive]
        tally = _Tally(len(stand.species), self.cells.per_hectare())

        ground = self._ground(kind, at, height)
        factor = stand.growth_year().income_factor
        died, crowded = seedlings.live_a_year(
            self.cohorts, ground, of.seedling, factor, seed=self._seed, year=year
        )
        tally.add("died_ha", self.cohorts.species, died)
        tally.add("crowded_ha", self.cohorts.species, crowded)
        self.cohorts = seedlings.keep(self.cohorts, self.cohorts.n > 0)
        sprouts = sprout_cohorts(self._stumps, self.cells, of.sprout, seed=self._seed, year=year)
        tally.add("sprouts_ha", sprouts.species, sprouts.n)
        self._stumps = no_stumps()
        broken = [d.row for d in deaths if d.broken or d.cause in _BREAKING]
        self.note_stumps(grown, broken, measures)

        mast = mast_factors(self._seed, year, of.seed)
        light, area = measures.light[alive], measures.leaf_area_m2[alive]
        borne = seeds_borne(kind, height, area, light, of.seed) * mast[kind]
        new = self._germinate(ground, kind, at, borne, mast, trees.tree_id, year, tally)
        self.cohorts = seedlings.join(self.cohorts, sprouts, *new)
        self._hand_over(stand, traits, tally)
        self.cohorts = seedlings.merge(self.cohorts, self._spec.cohorts_per_cell)
        self._shade()
        tally.rows["mast"][:] = mast
        tally.state(self.cohorts, of)
        return {
            "year": np.full(len(mast), year, np.int32),
            "species": np.arange(len(mast), dtype=np.int16),
            **tally.rows,
        }

    def _ground(
        self, kind: NDArray[np.int64], at: NDArray[np.int64], height: NDArray[np.float64]
    ) -> Ground:
        """Tell seedlings of the light above them, and of the room that trees take."""
        light = self.cells.sum(self._voxel_cell, self._canopy.ground_light.ravel())
        voxels = self.cells.sum(self._voxel_cell, None)
        low = np.maximum(height, seedlings.HALF_HEIGHT_M)
        needs = 1.0 / (seedlings.room(low, kind, self._traits.seedling) * self.cells.area)
        taken = self.cells.sum(at, needs)
        return Ground(light / voxels, taken, self._canopy.layer_transmission, self.cells.area)

    def _germinate(
        self,
        ground: Ground,
        kind: NDArray[np.int64],
        at: NDArray[np.int64],
        borne: NDArray[np.float64],
        mast: NDArray[np.float64],
        tree_id: NDArray[np.int32],
        year: int,
        tally: _Tally,
    ) -> list[Cohorts]:
        """Let seeds fall and germinate: a new cohort of a species in each cell where one does."""
        of = self._traits
        lai = seedlings.leaf_index(self.cohorts, of.seedling, self.cells.count, ground.area)
        light = ground.light * through_layers(ground.transmission, lai)
        new = []
        for k, dispersal in enumerate(self._dispersal):
            own = kind == k
            rain = float(self._rain[k] * mast[k] * ground.area)
            seeds = dispersal.fall(self.cells.sum(at[own], borne[own])) + rain
            tally.rows["seeds_ha"][k] = float(seeds.sum()) * self.cells.per_hectare()
            half = float(of.seedling.survival_light_half[k])
            lives = seedlings.survival(light, half, 1.0)
            n = seedlings.germinate(
                seeds * of.germination_share[k] * lives, seed=self._seed, kind=k, year=year
            )
            cell = np.flatnonzero(n)
            tally.rows["germinated_ha"][k] = float(n.sum()) * self.cells.per_hectare()
            mother = draw_mothers(
                cell,
                seeds[cell],
                self.cells,
                dispersal.table,
                at[own],
                borne[own],
                seed=self._seed,
                kind=k,
                year=year,
            )
            ids = np.append(tree_id[own], 0).astype(np.int64)  # the last stands for outside: -1
            size = len(cell)
            new.append(
                Cohorts(
                    cell=cell,
                    species=np.full(size, k, np.int64),
                    n=n[cell],
                    height=np.full(size, of.first_height_m[k]),
                    age=np.zeros(size),
                    mother=ids[mother],
                    reserve=np.full(size, of.seed_reserve_kg[k]),
                    sprout=np.zeros(size, np.bool_),
                )
            )
        return new

    def _hand_over(self, stand: Stand, traits: SpeciesTraits, tally: _Tally) -> None:
        """Make trees of the seedlings that are tall enough."""
        tall = self.cohorts.height >= self._spec.handover_height_m
        if not tall.any():
            return
        ready = seedlings.keep(self.cohorts, tall)
        self.cohorts = seedlings.keep(self.cohorts, ~tall)
        rows = stand.rows
        places = find_places(ready, self.cells, rows.x, rows.y, seed=self._seed, year=stand.year)
        free = ~stand.surroundings.blocked(places.x, places.y)
        places = Places(places.x[free], places.y[free], places.cohort[free])
        placed = np.bincount(places.cohort, minlength=len(ready.n))
        tally.add("recruits_ha", ready.species, placed)
        tally.add("crowded_ha", ready.species, ready.n - placed)
        if len(places.cohort):
            establish(stand, _newcomers(ready, places), "recruited", traits)

    def move_under(self, canopy: Canopy) -> None:
        """Let the seedlings live under another canopy, as when an obstacle is put up."""
        self._canopy = canopy
        self._shade()

    def _shade(self) -> None:
        """Let the seedlings shade the lowest layer of next year's canopy."""
        lai = seedlings.leaf_index(
            self.cohorts, self._traits.seedling, self.cells.count, self.cells.area
        )
        self._canopy.grow_under(lai[self._voxel_cell].reshape(self._canopy.ground_light.shape))

    # ------------------------------------------------------------------ stumps

    def note_stumps(self, trees: Trees, rows: Sequence[int], measures: TreeMeasures) -> None:
        """Remember trees that were felled or broken: their stumps may sprout in the next year.

        Parameters
        ----------
        trees : Trees
            The table that they still stand in.
        rows : sequence of int
            Their rows; one named twice is remembered once.
        measures : TreeMeasures
            Of all rows.
        """
        if not len(rows):
            return
        which = np.unique(np.asarray(rows, np.int64))
        more = Stumps(
            trees.tree_id[which].astype(np.int64),
            trees.species[which].astype(np.int64),
            trees.x[which],
            trees.y[which],
            measures.dbh_cm[which],
            trees.reserve[which],
        )
        columns = [np.concatenate(pair) for pair in zip(self._stumps, more, strict=True)]
        self._stumps = Stumps(*columns)

    # ------------------------------------------------------------------ checkpoints

    def state(self) -> dict[str, NDArray[Any]]:
        """What the next year needs: seedlings and fresh stumps."""
        return {
            **{f"cohort_{name}": column for name, column in self.cohorts._asdict().items()},
            **{f"stump_{name}": column for name, column in self._stumps._asdict().items()},
        }

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        self.cohorts = Cohorts(*(np.array(arrays[f"cohort_{k}"]) for k in Cohorts._fields))
        self._stumps = Stumps(*(np.array(arrays[f"stump_{k}"]) for k in Stumps._fields))
        self._shade()


def _newcomers(cohorts: Cohorts, places: Places) -> Newcomers:
    """Make upright trees of seedlings: their cohort's height, age, mother and reserve."""
    of = places.cohort
    upright = np.zeros((len(of), 3))
    upright[:, 2] = 1.0
    return Newcomers(
        places.x,
        places.y,
        cohorts.species[of].astype(np.int16),
        upright,
        cohorts.height[of],
        np.rint(cohorts.age[of]).astype(np.int64),
        cohorts.mother[of],
        cohorts.reserve[of],
    )


class _Tally:
    """The year's rows of `/regeneration`: numbers per hectare, by species."""

    _COUNTS = (
        "mast", "seeds_ha", "germinated_ha", "sprouts_ha", "died_ha", "crowded_ha", "recruits_ha",
    )  # fmt: skip

    def __init__(self, species: int, per_hectare: float) -> None:
        self._species = species
        self._per_hectare = per_hectare
        self.rows: Columns = {name: np.zeros(species) for name in self._COUNTS}

    def _sum(self, kind: NDArray[np.int64], weight: NDArray[Any]) -> NDArray[np.float64]:
        return np.bincount(kind, weight, self._species).astype(np.float64)

    def add(self, column: str, kind: NDArray[np.int64], n: NDArray[np.int64]) -> None:
        """Add plants of some species to a column."""
        self.rows[column] += self._sum(kind, n) * self._per_hectare

    def state(self, cohorts: Cohorts, traits: Traits) -> None:
        """Tell of the seedlings that live at the end of the year."""
        kind, n, height = cohorts.species, cohorts.n, cohorts.height
        number = self._sum(kind, n)
        for name, which in (
            ("n_ha", height >= 0.0),
            ("n_low_ha", height < _LOW_M),
            ("n_high_ha", height >= _HIGH_M),
        ):
            self.rows[name] = self._sum(kind, n * which) * self._per_hectare
        total = self._sum(kind, n * height)
        mean = np.full(self._species, np.nan)
        np.divide(total, number, out=mean, where=number > 0)
        self.rows["mean_height_m"] = mean
        leaves = n * traits.seedling.leaf_area_1m_m2[kind] * height**2
        self.rows["lai"] = self._sum(kind, leaves) * self._per_hectare / 10_000.0
        self.rows["reserve_kg_ha"] = self._sum(kind, n * cohorts.reserve) * self._per_hectare
