"""What the rules of regeneration read of the species, as arrays of one entry per species."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.species import Species


class SeedTraits(NamedTuple):
    """Fecundity; float64 (species,), names as in a species' `[regeneration]`."""

    maturity_height_m: NDArray[np.float64]
    seeds_per_leaf_m2: NDArray[np.float64]
    light_half: NDArray[np.float64]
    mast_interval_years: NDArray[np.float64]
    mast_share: NDArray[np.float64]


class SproutTraits(NamedTuple):
    """Sprouts from stumps; float64 (species,)."""

    share: NDArray[np.float64]
    max_dbh_cm: NDArray[np.float64]
    per_stump: NDArray[np.float64]
    height_m: NDArray[np.float64]


class SeedlingTraits(NamedTuple):
    """Seedlings; float64 (species,)."""

    survival_light_half: NDArray[np.float64]
    survival_max: NDArray[np.float64]
    growth_light_least: NDArray[np.float64]
    growth_light_slope: NDArray[np.float64]
    max_height_growth_m: NDArray[np.float64]
    sprout_height_m: NDArray[np.float64]
    leaf_area_1m_m2: NDArray[np.float64]
    density_1m_m2: NDArray[np.float64]
    density_exponent: NDArray[np.float64]
    light_use_kg_m2: NDArray[np.float64]  # income per leaf area in full light
    leaf_cost_kg_m2: NDArray[np.float64]  # yearly cost of leaf area
    reserve_fraction: NDArray[np.float64]


class Traits(NamedTuple):
    """All of them, and what becomes of a seed."""

    seed: SeedTraits
    seedling: SeedlingTraits
    sprout: SproutTraits
    germination_share: NDArray[np.float64]
    first_height_m: NDArray[np.float64]
    seed_reserve_kg: NDArray[np.float64]

    @classmethod
    def of(cls, species: Sequence[Species]) -> Traits:
        """Read the species."""

        def each(section: str, key: str) -> NDArray[np.float64]:
            return np.array([getattr(getattr(s, section), key) for s in species], np.float64)

        def own(key: str) -> NDArray[np.float64]:
            return each("regeneration", key)

        def all_of(kind: Any, **others: NDArray[np.float64]) -> Any:
            return kind(**others, **{k: own(k) for k in kind._fields if k not in others})

        leaf_mass = each("leaves", "sla_m2_kg") * each("leaves", "lifespan_years")
        return cls(
            seed=all_of(SeedTraits, light_half=own("seed_light_half")),
            seedling=all_of(
                SeedlingTraits,
                light_use_kg_m2=each("carbon", "light_use_efficiency_kg_m2"),
                leaf_cost_kg_m2=1.0 / leaf_mass,
                reserve_fraction=each("carbon", "reserve_fraction"),
            ),
            sprout=SproutTraits(
                own("sprout_share"),
                own("sprout_max_dbh_cm"),
                own("sprouts_per_stump"),
                own("sprout_height_m"),
            ),
            germination_share=own("germination_share"),
            first_height_m=own("first_height_m"),
            seed_reserve_kg=each("carbon", "seed_reserve_kg"),
        )
