"""The wind in a scenario: named storms, the storms of a climate, and how firm the ground is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forest.species.schema import Refusal, Table, quantity

if TYPE_CHECKING:
    from forest.scenario.scenario import Scenario


class Storm(Table):
    """A storm that blows at the end of a year's growth."""

    year: int = quantity(..., "calendar year", unit="year")
    speed_m_s: float = quantity(
        ...,
        "mean wind (of ten minutes to an hour) at the height of the canopy's top over open land",
        unit="m/s",
        gt=0,
        le=100,
    )
    direction_deg: float = quantity(
        0.0,
        "direction towards which it blows, an azimuth from x towards y",
        unit="degree",
        ge=-360,
        le=360,
    )


class YearlyStorms(Table):
    """The strongest storm of every year, drawn at random."""

    mode_m_s: float = quantity(
        ...,
        "most frequent speed of a year's strongest wind (Gumbel's mode)",
        unit="m/s",
        gt=0,
        le=100,
    )
    dispersion_m_s: float = quantity(
        ..., "how far it varies from year to year (Gumbel's scale)", unit="m/s", gt=0, le=50
    )
    direction_deg: float = quantity(
        0.0,
        "direction towards which storms blow most often, an azimuth from x towards y",
        unit="degree",
        ge=-360,
        le=360,
    )
    concentration: float = quantity(
        0.0,
        "how closely their directions gather around it (von Mises' kappa); 0: all alike",
        unit="",
        ge=0,
        le=500,
    )
    from_m_s: float = quantity(10.0, "weaker storms are passed over", unit="m/s", ge=0, le=100)


class Wind(Table):
    """Storms that break and uproot trees; nothing is thrown where this table is not given."""

    storms: tuple[Storm, ...] = quantity((), "storms by year", unit="", max_length=10_000)
    yearly: YearlyStorms | None = None
    anchorage: float = quantity(
        1.0,
        "factor of the soil on the moment that uproots; 1: well drained mineral soil, about 0.9 "
        "where drainage is poor",
        gt=0,
        le=10,
    )
    from_height_m: float = quantity(
        3.0, "lower trees bend and are let be", unit="m", ge=0.1, le=100
    )


def check_wind(scenario: Scenario) -> None:
    """Refuse storms in years for which the run was not meant."""
    years = scenario.planned_calendar
    for i, storm in enumerate(scenario.wind.storms if scenario.wind else ()):
        if storm.year not in years:
            raise Refusal(
                f"{storm.year} is not a year of the run",
                key=f"wind.storms[{i}].year",
                expected=f"a calendar year, {years[0]} to {years[-1]}",
            )
