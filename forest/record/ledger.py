"""The two ledgers that must balance every year: of trees, and of dry mass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.record.schema import EVENT_KINDS, STATUS

Columns = Mapping[str, NDArray[Any]]

#: Largest allowed gap of the carbon ledger, relative to its largest entry.
CARBON_TOLERANCE = 1e-6

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
    row = {"year": year, "living_before": living_before, **count, "living": living}
    del row["pruned"]
    return {name: np.array([value], np.int32) for name, value in row.items()}


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
