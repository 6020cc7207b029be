"""The climate of a scenario: years from a file, from a generator, and single years by hand."""

from __future__ import annotations

from pydantic import ValidationInfo, model_validator

from forest.scenario import files
from forest.species.schema import Refusal, Table, quantity

#: Variables of a year, with the least and greatest value that is believed.
VARIABLES: dict[str, tuple[float, float]] = {
    "temperature_c": (-60.0, 60.0),
    "precipitation_mm": (0.0, 10_000.0),
    "drought_index": (-10.0, 10.0),
    "growth_index": (0.0, 5.0),
}


def _variable(name: str, description: str, unit: str) -> float | None:
    low, high = VARIABLES[name]
    found: float | None = quantity(None, description, unit=unit, ge=low, le=high)
    return found


class ExtremeYear(Table):
    """One year whose growth is given."""

    year: int = quantity(..., "calendar year", unit="year", ge=-100000, le=100000)
    factor: float = quantity(..., "factor on that year's income", ge=0, le=2)


class ClimateYear(Table):
    """The climate of a year; every year of a series has the same variables."""

    year: int = quantity(..., "calendar year", unit="year", ge=-100000, le=100000)
    temperature_c: float | None = _variable("temperature_c", "mean annual temperature", "°C")
    precipitation_mm: float | None = _variable("precipitation_mm", "annual precipitation", "mm")
    drought_index: float | None = _variable(
        "drought_index",
        "standardized drought index in the sense of SPEI: 0 is usual, below 0 dry, -2 very dry",
        "1",
    )
    growth_index: float | None = _variable(
        "growth_index", "factor on the income of all species; 1 is a mean year", "1"
    )


class Process(Table):
    """One variable as the generator draws it."""

    mean: float = quantity(..., "mean in the first year of the run", ge=-1e4, le=1e4)
    sd: float = quantity(..., "standard deviation of usual years", ge=0, le=1e4)
    trend_per_decade: float = quantity(0.0, "change of the mean in ten years", ge=-1e4, le=1e4)
    autocorrelation: float = quantity(
        0.0, "correlation of a year with the one before: AR(1), stationary", ge=-0.95, le=0.95
    )
    extreme_shift_sd: float = quantity(
        0.0, "what an extreme year adds, in standard deviations", ge=-20, le=20
    )


class Generator(Table):
    """A stochastic climate: trend, autocorrelation and extreme years, drawn by seed and year."""

    extreme_probability: float = quantity(
        0.0, "chance that a year is extreme, in all variables together", unit="1/year", ge=0, le=1
    )
    temperature_c: Process | None = None
    precipitation_mm: Process | None = None
    drought_index: Process | None = None
    growth_index: Process | None = None

    @model_validator(mode="after")
    def _draws_something(self) -> Generator:
        if not self.draws:
            raise Refusal("draws nothing", expected="a table " + " or ".join(VARIABLES))
        return self

    @property
    def draws(self) -> dict[str, Process]:
        """The variables that it draws."""
        found = {name: getattr(self, name) for name in VARIABLES}
        return {name: process for name, process in found.items() if process is not None}


class Climate(Table):
    """How years differ: a growth index of their own, or a climate to which species respond."""

    noise_sd: float = quantity(
        0.0,
        "standard deviation of the yearly growth index, which is a factor on all income, from a "
        "mean of 1",
        ge=0,
        le=1,
    )
    extreme_years: tuple[ExtremeYear, ...] = quantity(
        (), "years whose growth index is multiplied by a factor", unit="", max_length=10000
    )
    file: str = quantity(
        "",
        "CSV with columns year and any of temperature_c, precipitation_mm, drought_index and "
        "growth_index; relative to the scenario; becomes `series` when it is read",
        unit="",
    )
    series: tuple[ClimateYear, ...] = quantity(
        (), "the climate of consecutive years; goes before what is drawn", unit="", max_length=20000
    )
    repeat: bool = quantity(
        False, "years that the series does not cover are those of the series again", unit=""
    )
    generator: Generator | None = None

    @model_validator(mode="after")
    def _parts_agree(self) -> Climate:
        seen: set[int] = set()
        for i, entry in enumerate(self.extreme_years):
            if entry.year in seen:
                raise Refusal(
                    f"the year {entry.year} is given twice", key=f"extreme_years[{i}].year"
                )
            seen.add(entry.year)
        _check_series(self.series)
        if self.file and self.series:
            raise Refusal("there is a series already", key="file", expected="one of the two")
        if self.repeat and not (self.file or self.series):
            raise Refusal("there is nothing to repeat", key="repeat", expected="a file or a series")
        if self.noise_sd > 0.0 and self.generator and self.generator.growth_index:
            raise Refusal(
                "noise_sd draws the growth index already",
                key="generator.growth_index",
                expected="one of the two",
            )
        return self

    @property
    def given(self) -> tuple[str, ...]:
        """The variables of the series."""
        return _variables(self.series[0]) if self.series else ()

    @property
    def drawn(self) -> tuple[str, ...]:
        """The variables that are drawn in years which the series does not cover."""
        drawn = tuple(self.generator.draws) if self.generator else ()
        return (*drawn, "growth_index") if self.noise_sd > 0.0 else drawn


def _variables(year: ClimateYear) -> tuple[str, ...]:
    return tuple(name for name in VARIABLES if getattr(year, name) is not None)


def _check_series(series: tuple[ClimateYear, ...]) -> None:
    """Refuse gaps, and years that differ in what they tell."""
    for i, year in enumerate(series):
        expected = series[0].year + i
        if year.year != expected:
            raise Refusal(
                f"{year.year} does not follow {expected - 1}",
                key=f"series[{i}].year",
                expected=f"{expected}: consecutive years",
            )
        if not _variables(year) or _variables(year) != _variables(series[0]):
            raise Refusal(
                f"the year {year.year} tells {', '.join(_variables(year)) or 'nothing'}",
                key=f"series[{i}]",
                expected=", ".join(_variables(series[0]) or VARIABLES),
            )


def embed_file(climate: Climate, info: ValidationInfo) -> Climate:
    """Turn the file that a climate names into its series."""
    if not climate.file:
        return climate
    try:
        rows = files.read_climate(climate.file, VARIABLES, info.context)
    except Refusal as error:
        raise Refusal(error.what, key="file", expected=error.expected) from None
    series = tuple(ClimateYear(year=year, **values) for year, values in rows)
    return climate.model_copy(update={"file": "", "series": series})


def check_covered(climate: Climate, calendar: range) -> None:
    """Refuse a series that leaves a year of the run without a variable."""
    if not climate.series or climate.repeat:
        return
    first, last = climate.series[0].year, climate.series[-1].year
    open_ = [name for name in climate.given if name not in climate.drawn]
    if open_ and not (first <= calendar[0] and calendar[-1] <= last):
        raise Refusal(
            f"{first} to {last} do not cover the run, {calendar[0]} to {calendar[-1]}",
            key="climate.series",
            expected=f"all its years, repeat = true, or a generator of {', '.join(open_)}",
        )
