"""When an act is done: in years of the calendar, or whenever the stand has come to a state."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, Self

from pydantic import BaseModel, Field, model_validator

from forest.errors import nearest
from forest.species.schema import Refusal, Table, quantity

_CalendarYear = Annotated[int, Field(ge=-100000, le=100000)]
_TRIGGER = re.compile(r"\s*(\w+)\s*(<=|>=|<|>)\s*([-+0-9.eE]+)\s*")
_OFTEN = 10_000

#: What a trigger may ask: columns of `/stand`, relative density, and years since the start.
QUANTITIES = (
    "n_ha",
    "basal_area_m2ha",
    "qmd_cm",
    "mean_dbh_cm",
    "top_height_m",
    "lorey_height_m",
    "volume_m3ha",
    "biomass_tha",
    "lai",
    "canopy_cover",
    "sdi",
    "gini_basal_area",
    "shannon",
    "simpson",
    "clark_evans",
    "mingling",
    "relative_density",
    "age",
)


class Condition(NamedTuple):
    """A quantity of the stand, a comparison and a number."""

    quantity: str
    sign: str
    value: float

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``"sdi > 900"``; `Refusal` if it is none."""
        found = _TRIGGER.fullmatch(text)
        try:
            name, sign, number = found.groups() if found else ("", "", "x")
            value = float(number)
            if not math.isfinite(value):
                raise ValueError(number)
        except ValueError:
            raise Refusal(
                f"{text[:60]!r} is no trigger",
                key="when",
                expected='a quantity, one of < <= > >=, and a number, as "sdi > 900"',
            ) from None
        if name not in QUANTITIES:
            raise Refusal(f"unknown quantity {name!r}, {nearest(name, QUANTITIES)}", key="when")
        return cls(name, sign, value)

    def holds(self, found: float) -> bool:
        """Compare; a quantity that is missing (NaN) fires nothing."""
        answers = {
            "<": found < self.value,
            "<=": found <= self.value,
            ">": found > self.value,
            ">=": found >= self.value,
        }
        return answers[self.sign]


class Timing(Table):
    """When an act is done: one of `year`, `years`, `every_years` and `when`."""

    kind: str = quantity("", "kind of act", unit="")
    year: _CalendarYear | None = quantity(
        None, "calendar year of the run; the act is done before its growth", unit="year"
    )
    years: tuple[_CalendarYear, ...] | None = quantity(
        None, "several such years", unit="year", min_length=1, max_length=_OFTEN
    )
    every_years: int | None = quantity(
        None, "years from one time to the next", unit="year", ge=1, le=_OFTEN
    )
    when: str | None = quantity(
        None,
        "trigger: a quantity of the stand at the end of the year before, a comparison and a "
        'number, as "sdi > 900"',
        unit="",
        max_length=200,
    )
    when_species: str | None = quantity(
        None, "the species whose quantity it is; default: all together", unit="", max_length=60
    )
    from_year: _CalendarYear | None = quantity(
        None, "first year for `every_years` and `when`; default: that of the run", unit="year"
    )
    until_year: _CalendarYear | None = quantity(
        None, "last year for `every_years` and `when`; default: that of the run", unit="year"
    )
    wait_years: int | None = quantity(
        None, "least years between two times of a trigger; default: 1", unit="year", ge=1, le=_OFTEN
    )
    at_most: int | None = quantity(
        None, "times that a trigger may fire; default: no limit", unit="", ge=1, le=_OFTEN
    )

    @model_validator(mode="after")
    def _one_time(self) -> Self:
        kinds = ("year", "years", "every_years", "when")
        given = [key for key in kinds if getattr(self, key) is not None]
        if len(given) != 1:
            what = " and ".join(given) + " exclude each other" if given else "no time given"
            raise Refusal(what, expected="one of " + ", ".join(kinds))
        belongs = {
            "from_year": ("every_years", "when"),
            "until_year": ("every_years", "when"),
            "when_species": ("when",),
            "wait_years": ("when",),
            "at_most": ("when",),
        }
        for key, to in belongs.items():
            if getattr(self, key) is not None and given[0] not in to:
                raise Refusal(f"given beside {given[0]}", key=key, expected=" or ".join(to))
        first, last = self.from_year, self.until_year
        if first is not None and last is not None and last < first:
            raise Refusal(
                f"{last} lies before from_year", key="until_year", expected=f"{first} or later"
            )
        if self.when is not None:
            Condition.parse(self.when)
        return self

    @property
    def condition(self) -> Condition | None:
        """The trigger, if there is one."""
        return None if self.when is None else Condition.parse(self.when)

    def may_be_in(self, year: int, start_year: int) -> bool:
        """Tell whether the calendar lets the act be done in a year of a run.

        Of a trigger it says whether it is heard in that year.
        """
        if self.year is not None:
            return year == self.year
        if self.years is not None:
            return year in self.years
        first = start_year if self.from_year is None else max(self.from_year, start_year)
        if year < first or (self.until_year is not None and year > self.until_year):
            return False
        if self.every_years is None:
            return True
        origin = start_year if self.from_year is None else self.from_year
        return (year - origin) % self.every_years == 0

    def calendar_years(self, calendar: range) -> list[int]:
        """List the years of a run in which it may be done."""
        if self.year is not None:
            return [self.year] if self.year in calendar else []
        return [year for year in calendar if self.may_be_in(year, calendar.start)]

    @property
    def time_in_words(self) -> str:
        """Say when it is done."""
        if self.year is not None:
            return f"in {self.year}"
        if self.years is not None:
            return "in " + ", ".join(map(str, self.years))
        words = (
            f"every {self.every_years} years"
            if self.every_years is not None
            else f"when {self.when}" + (f" of {self.when_species}" if self.when_species else "")
        )
        limits = []
        if self.from_year is not None:
            limits.append(f"from {self.from_year}")
        if self.until_year is not None:
            limits.append(f"until {self.until_year}")
        if self.wait_years is not None:
            limits.append(f"{self.wait_years} years apart")
        if self.at_most is not None:
            limits.append(f"at most {self.at_most} times")
        return words + (f" ({', '.join(limits)})" if limits else "")


def check_timing(act: Timing, key: str, calendar: range, species: Iterable[str]) -> None:
    """Refuse a time that is not one of the run, or a trigger on a species that is not there."""
    for name, years in (("year", (act.year,)), ("years", act.years or ())):
        for i, year in enumerate(years):
            if year is not None and year not in calendar:
                raise Refusal(
                    f"{year} is not a year of the run",
                    key=f"{key}.{name}" + (f"[{i}]" if name == "years" else ""),
                    expected=f"a calendar year, {calendar[0]} to {calendar[-1]}",
                )
    if not act.calendar_years(calendar):
        raise Refusal(
            "no year of the run is meant",
            key=f"{key}.{'from_year' if act.from_year is not None else 'until_year'}",
            expected=f"years from {calendar[0]} to {calendar[-1]}",
        )
    if act.when_species is not None and act.when_species not in species:
        raise Refusal(
            f"unknown species {act.when_species!r}, {nearest(act.when_species, species)}",
            key=f"{key}.when_species",
        )


def acts_so_far(acts: Sequence[Timing], done: range) -> list[Mapping[str, Any]]:
    """Tell what of the acts belongs to the years that are done; the rest may still be changed.

    Of acts with fixed years the years that are done and what is done in them; triggers as they
    are, once they have been heard.
    """
    told: list[Mapping[str, Any]] = []
    for act in acts:
        years = act.calendar_years(done)
        if not years:
            continue
        content = act.model_dump()
        if act.when is None:
            for key in Timing.model_fields.keys() - {"kind"}:
                content.pop(key)
            content["done"] = years
        told.append(content)
    return told


def is_heard(act: BaseModel, year: int, start_year: int) -> bool:
    """Tell whether an act is a trigger that was heard in a year of the run or before."""
    assert isinstance(act, Timing)
    first = start_year if act.from_year is None else act.from_year
    return act.when is not None and first <= year
