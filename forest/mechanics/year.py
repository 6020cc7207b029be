"""A year of mechanics: rings set in the shape of last summer, then trees bend under their load.

One object per stand, with the species' wood and the scratch memory that is kept from year to year.
What a metamer must remember is in the arena's companions (`forest.mechanics.rods.Rods`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment.obstacles import Solid
from forest.growth.dealing import Deal, Workbench, deal
from forest.growth.parameters import support
from forest.mechanics.branch_points import reaction_rings
from forest.mechanics.equilibrium import Bench, Settled, settle
from forest.mechanics.loads import LoadSpecies, bury_sites, hang, make_loads
from forest.mechanics.righting import BETA, NONE, STRAIN
from forest.mechanics.rings import upright_azimuth
from forest.mechanics.rods import Rods, allocate_rods, frame_new
from forest.mechanics.shelter import Plot, sheltered, silhouettes, upwind_depth
from forest.mechanics.stability import Stability, stability
from forest.mechanics.stems import NO_RIGIDITY, StemSpecies
from forest.mechanics.stress import Wind
from forest.mechanics.wind_growth import feel_wind
from forest.mechanics.wood import lay_wood, wood_traits
from forest.species import Species
from forest.trees.metamers import Arena, Metamers
from forest.trees.table import Trees

if TYPE_CHECKING:
    from collections.abc import Callable

#: The canopy's top: this quantile of the trees' heights.
_CANOPY_TOP = 0.9
_RIGHTING = {"none": NONE, "beta": BETA, "strain": STRAIN}


class MechanicsSpec(NamedTuple):
    """What a scenario says of mechanics; see `forest.scenario.model.Mechanics`."""

    bending: bool
    righting: str
    tolerance_rad: float
    wind_m_s: float
    wind_growth: bool


class Mechanics:
    """The mechanics of one stand.

    Parameters
    ----------
    spec : MechanicsSpec
    species : sequence of Species
    pipe_exponent : float64 (species,)
        n of the run: diameter = pipe^(1/n).
    plot : Plot
        Where the wind blows.

    Attributes
    ----------
    settled : Settled or None
        How the trees came to rest in the last year; None before, or if they do not bend.
    ring : float32 (capacity of the arena, 2)
        Eccentricity of each metamer's ring of the last year, and its thick side as an azimuth
        (see `forest.mechanics.branch_points.reaction_rings`) or, where trees bend, as an angle
        in the metamer's frame.
    """

    def __init__(
        self,
        spec: MechanicsSpec,
        species: Sequence[Species],
        pipe_exponent: NDArray[np.float64],
        plot: Plot,
    ) -> None:
        self._spec = spec
        self._plot = plot
        self._woods = wood_traits(species, pipe_exponent)
        self._load_species = LoadSpecies.of(species, pipe_exponent)
        self._stems = stem_species(species, pipe_exponent)
        share = np.array([s.mechanics.wind_stress_limit for s in species], np.float64)
        self._wind_limit = share * self._stems.rupture
        self._wind_need = np.zeros(0, np.float32)
        self._workbench = Workbench()
        self._tropism, self._stiffness = _tropism(species)
        self._bench = Bench()
        self._loads = make_loads(0)
        self.settled: Settled | None = None
        self.ring = np.zeros((0, 2), np.float32)

    @property
    def companions(self) -> Callable[[int], Rods] | None:
        """What the arena must keep of each metamer."""
        return allocate_rods if self._spec.bending else None

    def bend(self, arena: Arena, trees: Trees, step: int, solid: Solid, voxel_m: float) -> None:
        """Lay this year's rings in the shape of last summer, then bend all trees under their load.

        Reaction wood therefore answers last summer's lean, with a lag of one year. Sites that come
        to lie in the ground or in an obstacle die. Taylor-Hell 2005, sections 4 to 6; without
        bending the rings follow from the statics of branch points (Hart & Baker 2003, 5.1).

        Parameters
        ----------
        arena, trees : Arena, Trees
            All trees, with this year's shoots and thickness.
        step : int
            Years grown so far.
        solid : Solid
            Near-field voxels that obstacles fill.
        voxel_m : float
            Edge of those voxels, m.
        """
        metamers = arena.metamers
        if not self._spec.bending:
            self.ring = reaction_rings(metamers, trees, self._stems)
            return
        rods: Rods = arena.companions
        shared = deal(trees.size)
        if len(self._loads.weight) != arena.capacity:
            self._loads = make_loads(arena.capacity)
            self.ring = np.zeros((arena.capacity, 2), np.float32)
        frame_new(metamers, trees, shared, rods, step, self._tropism, self._stiffness)
        righting = _RIGHTING[self._spec.righting]
        lay_wood(metamers, trees, shared, rods, self._woods, righting, self.ring)
        self.settle(arena, trees)
        bury_sites(metamers, trees, shared, solid, voxel_m)

    def settle(self, arena: Arena, trees: Trees) -> None:
        """Bring all trees to rest under summer's load."""
        metamers = arena.metamers
        shared = deal(trees.size)
        hang(metamers, trees, shared, self._load_species, self._loads)
        self.settled = settle(
            metamers,
            trees,
            shared,
            arena.companions,
            self._loads,
            self._bench.work(shared),
            tolerance=self._spec.tolerance_rad,
        )

    def winter(self, arena: Arena, trees: Trees, row: int) -> tuple[Metamers, Trees]:
        """Give one tree as it stands in winter, without fruit and what leaves fall.

        Returns
        -------
        Metamers, Trees
            Copies that hold this tree alone; the arena stays as it is.
        """
        size = int(trees.size[row])
        here = slice(int(trees.start[row]), int(trees.start[row]) + size)
        fields: list[Any] = [field[here].copy() for field in arena.metamers]
        metamers = Metamers(*fields)
        columns: list[Any] = [column[row : row + 1].copy() for column in trees]
        alone = Trees(*columns)
        alone.start[:] = 0
        if self._spec.bending:
            rods = Rods(*(field[here].copy() for field in arena.companions))
            shared = deal(alone.size)
            loads = make_loads(size)
            hang(metamers, alone, shared, self._load_species.in_winter(), loads)
            tolerance = self._spec.tolerance_rad
            work = Bench().work(shared)
            settle(metamers, alone, shared, rods, loads, work, tolerance=tolerance)
        return metamers, alone

    def thick_sides(
        self, arena: Arena, index: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the eccentricity of some metamers' last ring, and the azimuth of its thick side.

        Parameters
        ----------
        index : int64 (n,)
            Metamers of the arena.

        Returns
        -------
        eccentricity, azimuth : float64 (n,)
            0 to 1; rad from x to y, after the shortest turn that sets the metamer upright. NaN
            where the ring is round.
        """
        eccentricity = self.ring[index, 0].astype(np.float64)
        azimuth = self.ring[index, 1].astype(np.float64)
        if self._spec.bending:
            azimuth = upright_azimuth(arena.companions.frame[index], azimuth)
        return eccentricity, np.where(eccentricity > 0.0, azimuth, np.nan)

    @property
    def wind_growth(self) -> bool:
        """Whether the wind feeds back on growth."""
        return self._spec.wind_growth

    def feel_wind(self, arena: Arena, trees: Trees, shared: Deal) -> NDArray[np.float32]:
        """Find the d^2 that each metamer needs in the usual wind, m2 (capacity of the arena,)."""
        if len(self._wind_need) != arena.capacity:
            self._wind_need = np.zeros(arena.capacity, np.float32)
        feel_wind(
            arena.metamers,
            trees,
            shared,
            self._workbench.scratch(shared),
            self._stems,
            self._wind_limit,
            self._wind(arena, trees),
            self._wind_need,
        )
        return self._wind_need

    def stability(self, arena: Arena, trees: Trees) -> Stability:
        """Measure how safely the trees stand, in still air and in the scenario's wind."""
        rigidity = arena.companions.rigidity if self._spec.bending else NO_RIGIDITY
        wind = self._wind(arena, trees) if self._spec.wind_m_s > 0.0 else None
        return stability(arena.metamers, trees, self._stems, wind, rigidity)

    def _wind(self, arena: Arena, trees: Trees) -> Wind:
        """The usual wind as it comes to each tree past those upwind."""
        seen = silhouettes(arena.metamers, trees, self._stems.leaf_area)
        tall = seen.height[seen.height > 0.0]
        canopy_height = float(np.quantile(tall, _CANOPY_TOP)) if len(tall) else 0.0
        share, attenuation = sheltered(upwind_depth(trees.x, trees.y, seen, self._plot))
        return Wind(self._spec.wind_m_s * share, max(canopy_height, 0.1), attenuation)


def _tropism(species: Sequence[Species]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the tropic torque of each species' new metamers, N m, and what resists it, N m2."""
    tropism = np.zeros((len(species), 3))
    stiffness = np.ones((len(species), 3))
    for k, s in enumerate(species):
        modulus = 1e9 * s.mechanics.modulus_juvenile_gpa
        area_moment = np.pi / 64.0 * s.wood.twig_diameter_m**4
        tropism[k, 2] = s.mechanics.tropic_torque_nm
        stiffness[k] = modulus * area_moment
        stiffness[k, 0] *= 2.0 * s.mechanics.shear_ratio
    return tropism, stiffness


def stem_species(species: Sequence[Species], pipe_exponent: NDArray[np.float64]) -> StemSpecies:
    """Read what statics must know of the species; the exponent is that of the run."""

    def each(key: str, scale: float = 1.0) -> NDArray[np.float64]:
        return np.array([scale * getattr(s.mechanics, key) for s in species], np.float64)

    leaves = [s.leaves.area_m2 / s.leaves.sla_m2_kg for s in species]
    return StemSpecies(
        pipe_exponent=pipe_exponent,
        green_density=each("green_density_kg_m3"),
        support=support(species, each("green_density_kg_m3")),
        leaf_mass=np.array(leaves) * each("leaf_water_factor"),
        leaf_area=np.array([s.leaves.area_m2 for s in species]),
        modulus=each("modulus_mature_gpa", 1e9),
        rupture=each("rupture_mpa", 1e6),
        drag=each("drag_coefficient"),
        compression_wood=np.array([float(s.group == "conifer") for s in species]),
    )
