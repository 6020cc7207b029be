"""What a scenario's acts come to in their year: which metamers, which trees, which places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import ActError, InputError
from forest.trees.pruning import choose_branches, find_cuts
from forest.trees.table import row_of

if TYPE_CHECKING:
    from forest.scenario.acts import Prune
    from forest.stand import Stand


class YearOfActs(NamedTuple):
    """The acts of a year, in the order in which they are done.

    Attributes
    ----------
    cuts : dict of tree id to int32 array
        Serial numbers of the metamers at which trees are pruned.
    fellings : list of (tree ids, cause)
    plantings : list of (x, y, species)
        Places, m, and the species' names.
    """

    cuts: dict[int, NDArray[np.int32]]
    fellings: list[tuple[Sequence[int], str]]
    plantings: list[tuple[Sequence[float], Sequence[float], list[str]]]


def acts_of(stand: Stand, year: int) -> YearOfActs:
    """Find out what the acts of a year do to the stand as it is before that year.

    All of them see the same stand, whatever their order in the file: first it is pruned, then
    felled, then planted. Nothing is changed here, so that a year is acted on wholly or not at all.

    Parameters
    ----------
    stand : Stand
        With the acts of all years in its scenario.
    year : int
        Calendar year.

    Raises
    ------
    ActError
        If an act names a tree that does not live, or a metamer that is not there.
    """
    due = YearOfActs({}, [], [])
    for i, act in enumerate(stand.scenario.acts):
        if act.year != year:
            continue
        try:
            if act.kind == "prune":
                _add_cuts(due.cuts, act, stand, f"acts[{i}].{{}} in {year}")
            elif act.kind == "fell":
                for tree_id in act.tree_ids:
                    row_of(stand.rows, tree_id, where=f"acts[{i}].tree_ids in {year}")
                due.fellings.append((act.tree_ids, act.cause))
            else:
                due.plantings.append((act.x_m, act.y_m, act.names(stand.species_names)))
        except InputError as refusal:
            raise ActError(str(refusal)) from None
    return due


def _add_cuts(cuts: dict[int, NDArray[np.int32]], act: Prune, stand: Stand, where: str) -> None:
    arena, trees = stand.arena.metamers, stand.rows
    for tree_id in act.ids:
        row = row_of(trees, tree_id, where=where.format(act.ids_key))
        if act.metamer is None:
            serials = choose_branches(arena, trees, row, act)
        else:
            serials = np.array([act.metamer], np.int32)
            find_cuts(arena, trees, row, serials, where=where.format("metamer"))
        cuts[tree_id] = np.union1d(cuts.get(tree_id, serials), serials)
