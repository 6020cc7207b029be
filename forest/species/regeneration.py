"""How a species comes back: seeds, seedlings, and sprouts from its stumps."""

from __future__ import annotations

from typing import Literal

from forest.species.schema import Table, quantity


class Regeneration(Table):
    """Seeds, seedlings and sprouts of a species; used where a scenario has a table regeneration."""

    maturity_height_m: float = quantity(
        8.0, "height from which a tree bears seed", unit="m", ge=0, le=100
    )
    seeds_per_leaf_m2: float = quantity(
        30.0,
        "viable seeds a year per leaf area of a tree in full light, mean over mast and other years",
        unit="1/m2",
        ge=0,
        le=1e5,
    )
    seed_light_half: float = quantity(
        0.3,
        "h of the factor on seeds by the mean light L of a crown, L (1 + h) / (L + h); "
        "0 = light does not matter",
        ge=0,
        le=10,
    )
    mast_interval_years: float = quantity(
        3.0, "mean years from one mast year to the next", unit="year", ge=1, le=100
    )
    mast_share: float = quantity(
        0.5, "share of all seeds that falls in mast years alone", ge=0, le=1
    )
    kernel: Literal["lognormal", "2dt"] = quantity(
        "lognormal",
        "how seeds spread: by the logarithm of the distance (Greene et al. 2004), or by Student's "
        "t in the plane (Clark et al. 1999)",
        unit="",
    )
    kernel_distance_m: float = quantity(
        15.0,
        "median distance of a lognormal kernel; scale of a 2Dt kernel, the square root of its u",
        unit="m",
        gt=0,
        le=5000,
    )
    kernel_shape: float = quantity(
        1.0,
        "standard deviation of the distance's logarithm; p of a 2Dt kernel, small = far",
        gt=0,
        le=10,
    )
    germination_share: float = quantity(
        0.03,
        "seeds that are seedlings at the end of their first summer, in light that suffices",
        ge=0,
        le=1,
    )
    survival_light_half: float = quantity(
        0.05, "light at which half of what could live survives a year", gt=0, le=1
    )
    survival_max: float = quantity(
        0.95, "share of seedlings that survives a year in full light", ge=0, le=1
    )
    growth_light_least: float = quantity(
        0.04, "light at which seedlings stop growing in height", ge=0, le=0.9
    )
    growth_light_slope: float = quantity(
        2.5, "how soon light saturates growth in height (Botkin et al. 1972)", gt=0, le=50
    )
    first_height_m: float = quantity(
        0.05, "height of a seedling at the end of its first summer", unit="m", gt=0, le=1
    )
    max_height_growth_m: float = quantity(
        0.4, "yearly growth in height of a tall seedling in full light", unit="m", gt=0, le=3
    )
    leaf_area_1m_m2: float = quantity(
        0.2,
        "leaf area of a seedling 1 m tall; it rises as the height's square",
        unit="m2",
        gt=0,
        le=20,
    )
    density_1m_m2: float = quantity(
        3.0, "most seedlings that stand on a square metre when 1 m tall", unit="1/m2", gt=0, le=1000
    )
    density_exponent: float = quantity(
        1.5, "that number falls as the height to this power", ge=0, le=4
    )
    sprout_share: float = quantity(0.0, "share of stumps that sprout", ge=0, le=1)
    sprout_max_dbh_cm: float = quantity(
        30.0, "dbh of the thickest tree whose stump sprouts", unit="cm", ge=0, le=500
    )
    sprouts_per_stump: float = quantity(
        3.0, "sprouts that are left of a stump's after a year, mean", ge=0, le=100
    )
    sprout_height_m: float = quantity(
        0.8, "their height in the first year, and yearly growth in full light", unit="m", gt=0, le=5
    )
