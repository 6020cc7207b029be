"""What kills trees beside want of light, and what becomes of the dead; deaths that a user gives."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from forest.errors import nearest
from forest.scenario import files
from forest.scenario.complete import check_inside
from forest.scenario.model import Plot
from forest.species.schema import Refusal, Table, quantity, refusal

#: Columns of a file of disturbances, and how their cells are read; a cell may be empty.
_CELLS: dict[str, Callable[[str], Any]] = {
    "year": files.as_whole_number,
    "tree_id": files.as_whole_number,
    "x_m": files.as_number,
    "y_m": files.as_number,
    "radius_m": files.as_number,
    "share": files.as_number,
    "species": str,
    "min_dbh_cm": files.as_number,
    "max_dbh_cm": files.as_number,
    "cause": str,
}


class Disturbance(Table):
    """Deaths in a year: of one tree, or of the trees in a patch, or of a share of them."""

    year: int = quantity(
        ..., "calendar year of the run in which they die", unit="year", ge=-100000, le=100000
    )
    tree_id: int | None = quantity(None, "the tree that dies", unit="", ge=1, le=2**31 - 1)
    x_m: float | None = quantity(None, "centre of a patch", unit="m", ge=0, le=10000)
    y_m: float | None = quantity(None, "centre of a patch", unit="m", ge=0, le=10000)
    radius_m: float | None = quantity(
        None, "radius of the patch; all trees whose stems stand in it die", unit="m", gt=0, le=10000
    )
    share: float | None = quantity(
        None,
        "share of the trees, of the patch or of the plot, that die; each is drawn by itself",
        ge=0,
        le=1,
    )
    species: str | None = quantity(None, "only trees of this species of the scenario", unit="")
    min_dbh_cm: float | None = quantity(
        None, "only trees of this dbh or more; a tree below 1.3 m counts as 0", unit="cm", ge=0,
        le=1000,
    )  # fmt: skip
    max_dbh_cm: float | None = quantity(
        None, "only trees of this dbh or less", unit="cm", ge=0, le=1000
    )
    cause: Literal["fire", "insects", "disease", "browsing", "drought", "wind", "other"] = quantity(
        "other", "why, in the events; trees that wind kills lie, others stand as snags", unit=""
    )
    source: str = quantity(
        "", "file and line; filled in when a file is read", unit="", max_length=300
    )

    @model_validator(mode="after")
    def _names_its_trees(self) -> Disturbance:
        patch = [key for key in ("x_m", "y_m", "radius_m") if getattr(self, key) is not None]
        if self.tree_id is not None:
            for key in (*patch, "share", "species", "min_dbh_cm", "max_dbh_cm"):
                if getattr(self, key) is not None:
                    raise Refusal("given beside tree_id", key=key, expected="one of them")
        elif not patch and self.share is None:
            raise Refusal("names no trees", expected="tree_id, or x_m, y_m and radius_m, or share")
        elif patch and len(patch) < len(("x_m", "y_m", "radius_m")):
            missing = next(k for k in ("x_m", "y_m", "radius_m") if k not in patch)
            raise Refusal("not given", key=missing, expected="x_m, y_m and radius_m of a patch")
        low, high = self.min_dbh_cm, self.max_dbh_cm
        if low is not None and high is not None and low > high:
            raise Refusal(
                f"{high:g} lies below min_dbh_cm", key="max_dbh_cm", expected=f"{low:g} or more"
            )
        return self


def _read(events: Any, info: ValidationInfo) -> Any:
    """Read the disturbances of a file, where one is named."""
    if not isinstance(events, str):
        return events
    return tuple(
        _disturbance(events, line, row)
        for line, row in files.read_rows(events, info.context, ("year",))
    )


def _disturbance(file: str, line: int, row: dict[str, str]) -> Disturbance:
    label = f"{file!r} line {line}"
    given: dict[str, Any] = {}
    for column, cell in row.items():
        if column not in _CELLS:
            raise Refusal(f"{file!r} has a column {column[:60]!r}, {nearest(column, _CELLS)}")
        if cell:
            try:
                given[column] = _CELLS[column](cell)
            except ValueError:
                kind = "whole number" if _CELLS[column] is files.as_whole_number else "number"
                raise Refusal(
                    f"{label}, column {column!r}: {cell[:40]!r} is not allowed",
                    expected=f"a {kind}",
                ) from None
    try:
        return Disturbance(**given, source=label[-300:])
    except ValidationError as error:
        raise Refusal(str(refusal(error, Disturbance, where=label))) from None


class Mortality(Table):
    """What kills trees beside suppression, and whether the dead stand."""

    age: bool = quantity(
        False, "trees die of age: a hazard that rises to the species' longevity", unit=""
    )
    background: bool = quantity(
        False, "trees die at random, at the species' background rate", unit=""
    )
    buckling: bool = quantity(
        False,
        "trees whose own weight buckles their stem die (Greenhill 1881: a safety factor below 1); "
        "needs the table mechanics",
        unit="",
    )
    snags: bool = quantity(
        False,
        "dead trees stand, shade and fall, and dead wood is counted until it has decayed",
        unit="",
    )
    events: Annotated[
        tuple[Disturbance, ...],
        BeforeValidator(_read),
        Field(
            max_length=1_000_000,
            description="deaths that are given, as tables or as the name of a CSV file with these "
            "columns (its rows are kept here)",
            json_schema_extra={"unit": ""},
        ),
    ] = ()


def check_mortality(
    mortality: Mortality, *, mechanics: bool, plot: Plot, species: Iterable[str], years: range
) -> None:
    """Refuse mortality that does not fit the rest of a scenario.

    Parameters
    ----------
    mortality : Mortality
    mechanics : bool
        Whether the scenario has mechanics.
    plot : Plot
    species : iterable of str
        The scenario's species.
    years : range
        The run's calendar years.
    """
    if mortality.buckling and not mechanics:
        raise Refusal(
            "buckling is found by mechanics", key="mortality.buckling", expected="[mechanics]"
        )
    known = list(species)
    for i, event in enumerate(mortality.events):
        key = "mortality.events" if event.source else f"mortality.events[{i}]"
        label = f"{event.source}: " if event.source else ""
        if event.year not in years:
            raise Refusal(
                f"{label}{event.year} is not a year of the run",
                key=key,
                expected=f"a calendar year, {years[0]} to {years[-1]}",
            )
        if event.species is not None and event.species not in known:
            hint = nearest(event.species, known)
            raise Refusal(f"{label}unknown species {event.species[:60]!r}, {hint}", key=key)
        if event.x_m is not None and event.y_m is not None:
            check_inside(event.x_m, event.y_m, plot, key=key, label=label)
    _check_dead_once(mortality.events)


def _check_dead_once(events: tuple[Disturbance, ...]) -> None:
    """Refuse to let a tree die in two years."""
    died: dict[int, int] = {}
    for i, event in sorted(enumerate(events), key=lambda entry: entry[1].year):
        if event.tree_id is None:
            continue
        year = died.setdefault(event.tree_id, event.year)
        if year != event.year:
            label = f"{event.source}: " if event.source else ""
            raise Refusal(
                f"{label}tree {event.tree_id} has died in {year}",
                key="mortality.events" if event.source else f"mortality.events[{i}].tree_id",
                expected="a tree that still lives",
            )
