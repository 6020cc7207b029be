"""Dead trees that stand, and dead wood: how long it stands, how it falls, decays and shades.

A tree that dies standing is a snag until the year of its fall, which is drawn when it dies. Its
wood is then lying dead wood, as is at once that of trees that fall when they die: by the wind, by
buckling, below 1.3 m, or felled and left. All of it decays exponentially.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.draws import uniforms_of
from forest.dynamics.mortality import Death
from forest.environment.plant_area import PlantArea
from forest.random import STREAM_SNAG

if TYPE_CHECKING:
    from forest.measure.trees import TreeMeasures
    from forest.species import Species
    from forest.stand import Stand

#: Trees that die of these lie at once.
LYING_CAUSES = ("wind", "buckling")
#: Felled trees that are left in the stand; all others are taken away.
_LEFT_CAUSES = ("tending",)

#: Height of the slices in which a stem's plant area is told, m.
_SLICE_M = 0.5
#: The branches' plant area stands at so many places around the stem, at half the crown's reach.
_AROUND = 8
_HALF_PI = 0.5 * np.pi

#: Columns of the table of snags: name -> (dtype, meaning).
COLUMNS: dict[str, tuple[type, str]] = {
    "tree_id": (np.int32, "number of the tree"),
    "species": (np.int16, "index into the scenario's list of species"),
    "x": (np.float64, "place of the stem base, m"),
    "y": (np.float64, "place of the stem base, m"),
    "dbh_cm": (np.float64, "stem diameter over bark at 1.3 m when it died"),
    "base_diameter_cm": (np.float64, "at the base"),
    "height_m": (np.float64, "height when it died"),
    "crown_base_m": (np.float64, "height above which its branches stand"),
    "crown_radius_m": (np.float64, "their reach"),
    "branch_area_m2": (np.float64, "half of the surface of its branches when it died"),
    "volume_m3": (np.float64, "volume of the stem, less what has decayed"),
    "mass_kg": (np.float64, "dry mass of stem and branches, less what has decayed"),
    "death_step": (np.int32, "step in which it died"),
    "fall_step": (np.int32, "step in which it falls"),
}


class Snags(NamedTuple):
    """The table of snags, one array per column; see `COLUMNS`."""

    tree_id: NDArray[np.int32]
    species: NDArray[np.int16]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    dbh_cm: NDArray[np.float64]
    base_diameter_cm: NDArray[np.float64]
    height_m: NDArray[np.float64]
    crown_base_m: NDArray[np.float64]
    crown_radius_m: NDArray[np.float64]
    branch_area_m2: NDArray[np.float64]
    volume_m3: NDArray[np.float64]
    mass_kg: NDArray[np.float64]
    death_step: NDArray[np.int32]
    fall_step: NDArray[np.int32]

    @classmethod
    def none(cls) -> Self:
        """No snag."""
        return cls(*(np.empty(0, dtype) for dtype, _ in COLUMNS.values()))

    def keep(self, rows: NDArray[np.bool_]) -> Snags:
        """Give the rows for which `rows` is true."""
        kept: dict[str, Any] = {name: column[rows] for name, column in self._asdict().items()}
        return Snags(**kept)

    def join(self, more: Snags) -> Snags:
        """Give the rows of both."""
        columns: dict[str, Any] = {
            name: np.concatenate((column, getattr(more, name)))
            for name, column in self._asdict().items()
        }
        return Snags(**columns)


class SnagSpecies(NamedTuple):
    """Fall and decay; float64 arrays of one entry per species."""

    snag_half_life_years: NDArray[np.float64]
    snag_fall_exponent: NDArray[np.float64]
    branch_half_life_years: NDArray[np.float64]
    decay_standing_per_year: NDArray[np.float64]
    decay_lying_per_year: NDArray[np.float64]

    @classmethod
    def of(cls, species: Sequence[Species]) -> Self:
        """Read the species."""
        return cls(*(np.array([getattr(s.mortality, key) for s in species]) for key in cls._fields))


def years_standing(
    draws: NDArray[np.float64], half_life_years: NDArray[np.float64], exponent: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Draw for how many years snags stand: the share 0.5^((t/T)^q) stands longer than t.

    Parameters
    ----------
    draws : float64 (n,)
        Uniform numbers.
    half_life_years, exponent : float64 (n,)
        T and q of each snag.

    Returns
    -------
    int32 (n,)
        Whole years, 1 or more.
    """
    years = half_life_years * (-np.log2(draws)) ** (1.0 / exponent)
    return np.clip(np.ceil(years), 1.0, 1e6).astype(np.int32)


def is_left(kind: str, cause: str) -> bool:
    """Tell whether a tree that goes between two years stays in the stand as lying dead wood."""
    return kind == "windthrown" or cause in _LEFT_CAUSES


class DeadWood:
    """The snags and the lying dead wood of a stand.

    Parameters
    ----------
    species : sequence of Species
    seed : int
        The scenario's.

    Attributes
    ----------
    snags : Snags
        In order of death.
    lying : float64 (species, 2)
        Lying dead wood: volume, m3, and dry mass, kg.
    flows : dict of str to float64 (species, 2)
        Of the last year: `input`, `fallen` and `decayed` volume and mass.
    counts : dict of str to int64 (species,)
        Of the last year: snags that are `new`, and those that have `fallen`.
    """

    def __init__(self, species: Sequence[Species], seed: int) -> None:
        self._traits = SnagSpecies.of(species)
        self._sla = np.array([s.leaves.sla_m2_kg for s in species])
        self._seed = seed
        self.snags = Snags.none()
        self.lying = np.zeros((len(species), 2))
        self._left = np.zeros((len(species), 2))  # laid down since the last year ended
        self.flows = {name: self._nothing() for name in ("input", "fallen", "decayed")}
        self.counts = {name: np.zeros(len(species), np.int64) for name in ("new", "fallen")}

    def _nothing(self) -> NDArray[np.float64]:
        return np.zeros_like(self.lying)

    def pass_year(self, stand: Stand, deaths: Sequence[Death], measures: TreeMeasures) -> None:
        """Let what is dead decay and fall, then take in the trees that die this year.

        Parameters
        ----------
        stand : Stand
            The dying still stand in its tables.
        deaths : sequence of Death
        measures : TreeMeasures
            Of all rows of its tree table.
        """
        k = len(self.lying)
        self.flows = {"input": self._left, "decayed": self._decay()}
        self._left = self._nothing()
        falls = self.snags.fall_step <= stand.steps
        self.flows["fallen"] = _sums(self.snags.keep(falls), k)
        self.lying = self.lying + self.flows["fallen"]
        self.counts["fallen"] = np.bincount(self.snags.species[falls], minlength=k)
        self.snags = self.snags.keep(~falls)
        dead = [death.row for death in deaths]
        stands = np.array(
            [d.cause not in LYING_CAUSES and measures.dbh_cm[d.row] > 0.0 for d in deaths],
            np.bool_,
        )
        fresh = self._fresh(stand, np.array(dead, np.int64), measures)
        self.flows["input"] = self.flows["input"] + _sums(fresh, k)
        self.lying = self.lying + _sums(fresh.keep(~stands), k)
        self.snags = self.snags.join(fresh.keep(stands))
        self.counts["new"] = np.bincount(fresh.species[stands], minlength=k)

    def leave(self, stand: Stand, rows: Sequence[int], measures: TreeMeasures) -> None:
        """Lay down trees between two years: those that are felled and left, or thrown at once."""
        wood = _sums(self._fresh(stand, np.array(rows, np.int64), measures), len(self.lying))
        self.lying = self.lying + wood
        self._left = self._left + wood

    def _fresh(self, stand: Stand, rows: NDArray[np.int64], measures: TreeMeasures) -> Snags:
        """Give trees of the tree table as snags that die in this step."""
        trees = stand.rows
        species = trees.species[rows]
        draws = uniforms_of(self._seed, STREAM_SNAG, trees.tree_id[rows], 0, 0)[:, 0]
        half_life, exponent, *_ = (column[species] for column in self._traits)
        leaves = measures.leaf_area_m2[rows] / self._sla[species]
        crown_base = measures.crown_base_m[rows]
        height = measures.height_m[rows]
        return Snags(
            tree_id=trees.tree_id[rows],
            species=species,
            x=trees.x[rows],
            y=trees.y[rows],
            dbh_cm=measures.dbh_cm[rows],
            base_diameter_cm=measures.base_diameter_cm[rows],
            height_m=height,
            crown_base_m=np.where(np.isnan(crown_base), 0.5 * height, crown_base),
            crown_radius_m=measures.crown_radius_m[rows],
            branch_area_m2=np.array([_branch_area(stand, int(row)) for row in rows], np.float64),
            volume_m3=measures.stem_volume_m3[rows],
            mass_kg=np.maximum(measures.biomass_kg[rows] - leaves, 0.0),
            death_step=np.full(len(rows), stand.steps, np.int32),
            fall_step=stand.steps + years_standing(draws, half_life, exponent),
        )

    def _decay(self) -> NDArray[np.float64]:
        """Take a year's decay out of all dead wood; give what decayed."""
        before = self.lying + _sums(self.snags, len(self.lying))
        kept = np.exp(-self._traits.decay_standing_per_year)[self.snags.species]
        self.snags = self.snags._replace(
            volume_m3=self.snags.volume_m3 * kept, mass_kg=self.snags.mass_kg * kept
        )
        self.lying = self.lying * np.exp(-self._traits.decay_lying_per_year)[:, None]
        return before - (self.lying + _sums(self.snags, len(self.lying)))

    def plant_area(self, step: int, voxel_m: float) -> PlantArea:
        """Give the plant area with which the snags shade at the start of a step.

        A stem is a cone, cut into slices; half of its surface counts, as of leaves one side does.
        Branches stand on a ring around the stem, evenly between crown base and top, and half of
        them break off in each half-life.
        """
        stem = _stem_slices(self.snags)
        half_life = self._traits.branch_half_life_years[self.snags.species]
        left = 0.5 ** ((step - self.snags.death_step) / half_life)
        branches = _branch_ring(self.snags, self.snags.branch_area_m2 * left)
        place, area = (np.concatenate(pair) for pair in zip(stem, branches, strict=True))
        return PlantArea.at(place, area, voxel_m)

    def columns(self, year: int, hectares: float) -> dict[str, NDArray[Any]]:
        """Give the rows of `/deadwood` after a year: one per species, and one for all."""
        k = len(self.lying)
        columns: dict[str, NDArray[Any]] = {
            "year": np.full(k + 1, year, np.int32),
            "species": np.arange(k + 1, dtype=np.int16),
        }
        standing = np.bincount(self.snags.species, minlength=k)
        for name, count in (
            ("snags", standing),
            *((f"{n}_snags", c) for n, c in self.counts.items()),
        ):
            columns[f"{name}_ha"] = np.append(count, count.sum()) / hectares
        amounts = {"standing": _sums(self.snags, k), "lying": self.lying, **self.flows}
        for name, amount in amounts.items():
            whole = np.vstack((amount, amount.sum(axis=0))) / hectares
            columns[f"{name}_m3ha"] = whole[:, 0]
            columns[f"{name}_tha"] = whole[:, 1] / 1000.0
        return columns

    def state(self) -> dict[str, NDArray[Any]]:
        """Give all that the next year needs, for a checkpoint."""
        return {**self.snags._asdict(), "lying": self.lying, "left": self._left}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        self.snags = Snags(**{name: np.array(arrays[name]) for name in COLUMNS})
        self.lying, self._left = np.array(arrays["lying"]), np.array(arrays["left"])


def _sums(snags: Snags, n_species: int) -> NDArray[np.float64]:
    """Sum up volume and mass by species, float64 (species, 2)."""
    amounts = (snags.volume_m3, snags.mass_kg)
    return np.stack([np.bincount(snags.species, a, n_species) for a in amounts], axis=1)


def _branch_area(stand: Stand, row: int) -> float:
    """Half of the surface of a tree's branches, m2."""
    trees, arena = stand.rows, stand.arena.metamers
    here = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
    branch = arena.order[here] > 0
    exponent = stand.pipe_exponent[trees.species[row]]
    diameter = arena.pipe[here][branch].astype(np.float64) ** (1.0 / exponent)
    return float(_HALF_PI * (diameter * arena.length[here][branch]).sum())


def _stem_slices(snags: Snags) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cut stems, cones, into slices: places, m (n, 3), and half of their surfaces, m2 (n,)."""
    slices = np.maximum(np.ceil(snags.height_m / _SLICE_M), 1.0).astype(np.int64)
    snag = np.repeat(np.arange(len(slices)), slices)
    k = np.arange(len(snag)) - np.repeat(np.cumsum(slices) - slices, slices)
    thick = snags.height_m[snag] / slices[snag]
    z = (k + 0.5) * thick
    diameter = 0.01 * snags.base_diameter_cm[snag] * (1.0 - z / snags.height_m[snag])
    place = np.stack((snags.x[snag], snags.y[snag], z), axis=1)
    return place, _HALF_PI * diameter * thick


def _branch_ring(
    snags: Snags, area_m2: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Spread branches around stems: places, m (n, 3), and areas, m2 (n,)."""
    n = len(area_m2)
    azimuth = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    reach = 0.5 * snags.crown_radius_m[:, None]
    depth = (np.arange(_AROUND) * 3 % _AROUND + 0.5) / _AROUND  # neighbours at unlike heights
    span = (snags.height_m - snags.crown_base_m)[:, None]
    place = np.stack(
        (
            snags.x[:, None] + reach * np.cos(azimuth),
            snags.y[:, None] + reach * np.sin(azimuth),
            snags.crown_base_m[:, None] + depth * span,
        ),
        axis=2,
    )
    return place.reshape(_AROUND * n, 3), np.repeat(area_m2 / _AROUND, _AROUND)
