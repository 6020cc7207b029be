"""How long the trees of a species live, how long they stand when dead, and how they decay."""

from __future__ import annotations

from forest.species.schema import Table, quantity


class Mortality(Table):
    """Death by age and at random, snags and dead wood; `[mortality]` of a scenario turns them on.

    `forest.dynamics.mortality` and `forest.dynamics.snags` have the equations.
    """

    longevity_years: float = quantity(
        300.0, "age that longevity_share of the trees reach, of those that die of age alone (L)",
        unit="year", gt=0, le=10000,
    )  # fmt: skip
    longevity_share: float = quantity(0.01, "that share (s)", gt=0, lt=1)
    ageing_exponent: float = quantity(
        4.0, "s^((a/L)^k) of the trees reach age a: 1 = a steady hazard, above = it rises (k)",
        ge=1, le=20,
    )  # fmt: skip
    background_per_year: float = quantity(
        0.004, "chance a year to die of what the model does not know", unit="1/year", ge=0, le=1
    )
    snag_half_life_years: float = quantity(
        12.0, "years after which half of the snags have fallen (T)", unit="year", gt=0, le=1000
    )
    snag_fall_exponent: float = quantity(
        2.0, "0.5^((t/T)^q) of the snags still stand after t years: 1 = falling evenly from the "
        "first year, above = after a lag (q)", ge=0.2, le=20,
    )  # fmt: skip
    branch_half_life_years: float = quantity(
        3.0, "years in which a snag loses half of its branches", unit="year", gt=0, le=1000
    )
    decay_standing_per_year: float = quantity(
        0.02, "rate at which snags lose wood, exponential", unit="1/year", ge=0, le=2
    )
    decay_lying_per_year: float = quantity(
        0.04, "rate at which lying dead wood is lost, exponential", unit="1/year", ge=0, le=2
    )
