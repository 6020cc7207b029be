"""What a stand remembers of acts: the stand before and after each, and when triggers fired."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure.density import relative_density
from forest.measure.stand import Flows, stand_rows
from forest.measure.tables import plot_of
from forest.measure.trees import TreeMeasures
from forest.record.schema import ACT_KINDS
from forest.scenario.timing import is_heard

if TYPE_CHECKING:
    from forest.stand import Stand

Columns = dict[str, NDArray[Any]]

#: In place of an act's number in the scenario.
BY_HAND = -1


class Firing(NamedTuple):
    """How often a trigger has fired, and the last year in which it did."""

    times: int = 0
    last_year: int = 0


class Treatments:
    """The year's treatments so far and the scenario's triggers; part of every checkpoint.

    Attributes
    ----------
    number : int
        Treatments noted since the last record.
    """

    def __init__(self, stand: Stand) -> None:
        self._stand = stand
        self._rows: list[Columns] = []
        self._firings: dict[int, Firing] = {}
        self.number = 0

    def note(self, act: int, kind: str, before: Columns, after: Columns) -> None:
        """Note what became of the stand.

        Parameters
        ----------
        act : int
            The act's number in the scenario, or `BY_HAND`.
        kind : str
            One of `ACT_KINDS`.
        before, after : dict of columns
            As `stand_now` gives them.
        """
        self.number += 1
        for stage, columns in enumerate((before, after)):
            n = len(columns["species"])
            named: Columns = {
                "year": np.full(n, self._stand.year + 1, np.int32),
                "number": np.full(n, self.number, np.int32),
                "act": np.full(n, act, np.int32),
                "kind": np.full(n, ACT_KINDS.index(kind), np.int8),
                "stage": np.full(n, stage, np.int8),
            }
            self._rows.append({**named, **{k: v for k, v in columns.items() if k != "year"}})

    def columns(self) -> Columns:
        """Give the rows noted since the last record; no column if there are none."""
        if not self._rows:
            return {}
        return {name: np.concatenate([r[name] for r in self._rows]) for name in self._rows[0]}

    def clear(self) -> None:
        """Forget the treatments, once they are on record."""
        self._rows = []
        self.number = 0

    def firing(self, act: int) -> Firing:
        """Tell how often a trigger has fired."""
        return self._firings.get(act, Firing())

    def fire(self, act: int, year: int) -> None:
        """Note that a trigger fires."""
        self._firings[act] = Firing(self.firing(act).times + 1, year)

    def _heard(self) -> list[int]:
        """List the triggers that were heard so far, which a resumed run has in the same order.

        Acts of years to come may be others then, so that numbers in the scenario may be too.
        """
        scenario, year = self._stand.scenario, self._stand.year
        return [i for i, a in enumerate(scenario.acts) if is_heard(a, year, scenario.start_year)]

    def state(self) -> Columns:
        """Give all that it remembers, for a checkpoint."""
        firings = [self.firing(act) for act in self._heard()]
        return {
            "firings": np.array(firings, np.int64).reshape(-1, 2),
            "number": np.array([self.number]),
            **{f"row_{name}": column for name, column in self.columns().items()},
        }

    def restore(self, arrays: Columns) -> None:
        """Take back what `state` gave."""
        heard = zip(self._heard(), arrays["firings"].tolist(), strict=True)
        self._firings = {act: Firing(*pair) for act, pair in heard if pair[0]}
        self.number = int(arrays["number"][0])
        start = "row_"
        rows = {k[len(start) :]: v for k, v in arrays.items() if k.startswith(start)}
        self._rows = [rows] if rows else []


def stand_now(
    stand: Stand,
    measures: TreeMeasures,
    standing: NDArray[np.bool_] | None = None,
    gone: NDArray[np.int64] | None = None,
) -> Columns:
    """Give the rows of the stand table for the living trees as they are between two years.

    Parameters
    ----------
    stand : Stand
    measures : TreeMeasures
        Of all its trees, n.
    standing : bool (n,), optional
        Those that count; all if not given.
    gone : int64 (k,), optional
        Rows of those that an act removed.

    Returns
    -------
    dict of columns
        Nothing comes or goes but `gone`; light on the ground is not known (NaN).
    """
    rows, k = stand.rows, len(stand.species)
    removed: NDArray[Any] = np.zeros(k, np.int64)
    volume: NDArray[Any] = np.zeros(k)
    if gone is not None:
        removed = np.bincount(rows.species[gone], minlength=k)
        volume = np.bincount(rows.species[gone], weights=measures.stem_volume_m3[gone], minlength=k)
    here = np.ones(len(rows.tree_id), np.bool_) if standing is None else standing
    kept: dict[str, Any] = {name: column[here] for name, column in measures._asdict().items()}
    none = np.zeros(k, np.int64)
    return stand_rows(
        stand.year,
        TreeMeasures(**kept),
        rows.x[here],
        rows.y[here],
        rows.species[here],
        Flows(none, none, removed, volume),
        plot_of(stand.scenario),
        np.nan,
    )


def quantities(stand: Stand, measures: TreeMeasures) -> Columns:
    """Give what triggers may ask: a value for each species and, last, for all together."""
    columns = stand_now(stand, measures)
    most = np.array([s.mensuration.max_sdi for s in stand.species])
    own = columns["sdi"][:-1] / most
    both = relative_density(columns["sdi"][:-1], most)
    n = len(own) + 1
    age = np.full(n, float(stand.steps))
    return {**columns, "relative_density": np.append(own, both), "age": age}
