"""The two ledgers that must balance every year: of trees, and of dry mass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.record.schema import DEATH_CAUSES, EVENT_KINDS, FELLING_CAUSES, STATUS, STAYING_KINDS

if TYPE_CHECKING:
    import pandas as pd

Columns = Mapping[str, NDArray[Any]]

#: Largest allowed gap of the carbon ledger, relative to its largest entry.
CARBON_TOLERANCE = 1e-6

_CAME = ("planted", "recruited")
_SPENT = ("leaves", "upkeep", "extension", "ring", "reserve_change")


class LedgerError(RuntimeError):
    """A ledger that does not balance: a fault of the program, not of its input."""


def population_row(
    year: int, living_before: int, trees: Columns, events: Columns
) -> dict[str, NDArray[np.int32]]:
    """Balance the living trees of a year: before + planted + recruited - lost = now.

    Parameters
    ----------
    year : int
        Calendar year.
    living_before : int
        Living trees at the end of the year before.
    trees, events : mappings of column to array
        The year's rows, `status` and `kind` as codes.

    Returns
    -------
    dict of arrays of one entry
        The year's row of `/population`.

    Raises
    ------
    LedgerError
        If trees came or went without an event.
    """
    counts = np.bincount(np.asarray(events["kind"], np.int64), minlength=len(EVENT_KINDS))
    count = {kind: int(n) for kind, n in zip(EVENT_KINDS, counts, strict=True)}
    living = int(np.count_nonzero(trees["status"] == STATUS.index("living")))
    came = count["planted"] + count["recruited"]
    went = count["died"] + count["felled"] + count["windthrown"]
    if living_before + came - went != living:
        raise LedgerError(
            f"the population ledger of {year} does not balance: {living_before} living before"
            f" + {count['planted']} planted + {count['recruited']} recruited - {count['died']} died"
            f" - {count['felled']} felled - {count['windthrown']} windthrown is not {living} living"
        )
    changes = {kind: n for kind, n in count.items() if kind not in STAYING_KINDS}
    row = {"year": year, "living_before": living_before, **changes, "living": living}
    return {name: np.array([value], np.int32) for name, value in row.items()}


def by_cause(population: pd.DataFrame, events: pd.DataFrame) -> pd.DataFrame:
    """Set up the ledger of the living with a column for each cause of death and of felling.

    Parameters
    ----------
    population, events : DataFrame
        The whole tables of a run.

    Returns
    -------
    DataFrame
        A row per year, its index: `living_before`, `planted`, `recruited`, `died_<cause>` for
        each of `DEATH_CAUSES`, `felled_<cause>` for each of `FELLING_CAUSES`, `windthrown` and
        `living`, and columns for whatever else the events name.

    Raises
    ------
    LedgerError
        If the events of a year do not lead from `living_before` to `living`, or a year does not
        begin with the trees with which the one before ended.
    """
    known = (
        *_CAME,
        *(f"died_{cause}" for cause in DEATH_CAUSES),
        *(f"felled_{cause}" for cause in FELLING_CAUSES),
        "windthrown",
    )
    kinds, causes = events["kind"].astype(str), events["cause"].astype(str)
    names = kinds.where(~kinds.isin(("died", "felled")), kinds + "_" + causes)
    further = sorted(set(names) - {*known, *STAYING_KINDS})
    years = population["year"].to_numpy()
    ledger = population.set_index("year")[["living_before"]].astype(np.int64)
    for name in (*known, *further):
        place = np.searchsorted(years, events["year"].to_numpy()[(names == name).to_numpy()])
        ledger[name] = np.bincount(place, minlength=len(years))
    ledger["living"] = population["living"].to_numpy(np.int64)
    _check_causes(ledger)
    return ledger


def _check_causes(ledger: pd.DataFrame) -> None:
    """Check that each year's columns lead to its living trees, and begin with those before."""
    columns = {str(name): column.to_numpy() for name, column in ledger.items()}
    before, living = columns.pop("living_before"), columns.pop("living")
    change = sum(n if name in _CAME else -n for name, n in columns.items())
    wrong = before + change != living
    wrong[1:] |= before[1:] != living[:-1]
    if wrong.any():
        year = ledger.index[int(np.flatnonzero(wrong)[0])]
        raise LedgerError(f"the events of {year} do not account for its living trees")


def check_carbon(year: int, carbon: Columns) -> None:
    """Check that each row's income equals what was spent and put aside.

    Raises
    ------
    LedgerError
        If they differ by more than `CARBON_TOLERANCE` of the row's largest entry.
    """
    income = np.asarray(carbon["income"], np.float64)
    spent = np.stack([np.asarray(carbon[name], np.float64) for name in _SPENT])
    gap = np.abs(income - spent.sum(axis=0))
    largest = np.maximum(np.abs(income), np.abs(spent).max(axis=0))
    # Written so that a gap of NaN fails too.
    wrong = np.flatnonzero(~(gap <= CARBON_TOLERANCE * largest))
    if wrong.size:
        row = int(wrong[0])
        raise LedgerError(
            f"the carbon ledger of {year} does not balance in row {row}: income {income[row]:.9g},"
            f" spent and put aside {spent[:, row].sum():.9g} kg/ha"
        )
