"""What the acts of a year come to: which metamers, which trees, which places. Changes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import ActError, InputError
from forest.management.brushing import Drawn, draw
from forest.management.filling import pattern_places
from forest.management.selection import Mask, census_of, to_harvest, to_prune, to_thin
from forest.management.treatments import quantities
from forest.measure.tables import plot_of
from forest.measure.trees import TreeMeasures
from forest.scenario.acts import Act, Fell, Plant, Planted, Prune, Pruning
from forest.scenario.cuttings import Thin
from forest.scenario.strokes import Stroke
from forest.trees.pruning import choose_branches, find_cuts
from forest.trees.table import row_of

if TYPE_CHECKING:
    from forest.management.thinning import Census
    from forest.stand import Stand

#: Plantings of a year draw from times that are so far apart, above any number of steps.
_TIMES = 1 << 14

Cuts = dict[int, NDArray[np.int32]]


class Places(NamedTuple):
    """Where seedlings are planted: places, m, and the species' names."""

    x: Sequence[float]
    y: Sequence[float]
    species: list[str]


class Felling(NamedTuple):
    """Trees that are felled, and why; and names of residual trees that are."""

    kind: str
    tree_ids: list[int]
    cause: str
    residual: tuple[str, ...] = ()


class YearOfActs(NamedTuple):
    """The acts of a year in the order in which they are done, by their numbers in the scenario.

    Attributes
    ----------
    measures : TreeMeasures
        Of the stand before them.
    prunings, fellings, plantings, strokes : dict by number of the act
    triggers : list of int
        Acts that a trigger fired.
    """

    measures: TreeMeasures
    prunings: dict[int, Cuts]
    fellings: dict[int, Felling]
    plantings: dict[int, Places]
    strokes: dict[int, Drawn]
    triggers: list[int]

    def touched(self) -> Iterator[tuple[str, Iterable[int]]]:
        """Tell what is done to which trees that stand: kind of act, ids."""
        for cuts in self.prunings.values():
            yield "prune", cuts
        for felling in self.fellings.values():
            yield "fell", felling.tree_ids


def plan_year(stand: Stand, year: int) -> YearOfActs | None:
    """Find out what the acts of a year do to the stand as it is before that year.

    First it is pruned, then felled, then planted, then strokes are laid, each kind in the order of
    the file. A thinning
    or harvest sees what those before it leave; a pruning that chooses trees by rule, and a
    pattern of planting, see what all of them leave. Triggers see the stand before all acts.
    Nothing is changed here, so that a year is acted on wholly or not at all.

    Parameters
    ----------
    stand : Stand
        With the acts of all years in its scenario.
    year : int
        Calendar year.

    Returns
    -------
    YearOfActs or None
        None if there is nothing to do.

    Raises
    ------
    ActError
        If an act names a tree that does not live, or a metamer that is not there.
    """
    asked = _asked(stand, year)
    if not asked:
        return None
    measures = stand.measure()
    due = _due(stand, asked, measures)
    if not due:
        return None
    plan = YearOfActs(measures, {}, {}, {}, {}, [i for i, act in due if act.when is not None])
    census = census_of(stand, measures)
    standing = np.ones(len(census.tree_id), np.bool_)
    first = stand.treatments.number + 1
    numbers = {i: first + k for k, (i, _) in enumerate(due)}
    for i, act in due:
        try:
            if isinstance(act, Prune):
                continue
            if isinstance(act, Stroke):
                plan.strokes[i] = draw(act, stand, f"acts[{i}].{{}} in {year}")
            elif isinstance(act, Plant):
                plan.plantings[i] = _places(act, stand, census, standing, plan, numbers[i])
            else:
                where = f"acts[{i}]"
                gone = [name for done in plan.fellings.values() for name in done.residual]
                felling = _felling(act, stand, census, standing, gone, numbers[i], where)
                plan.fellings[i] = felling
                standing &= ~np.isin(census.tree_id, felling.tree_ids)
        except InputError as refusal:
            raise ActError(str(refusal)) from None
    for i, act in due:
        if isinstance(act, Prune):
            try:
                where = f"acts[{i}].{{}} in {year}"
                plan.prunings[i] = cuts_of(act, stand, census, standing, where)
            except InputError as refusal:
                raise ActError(str(refusal)) from None
    return plan


def _asked(stand: Stand, year: int) -> list[tuple[int, Act]]:
    """List the acts that the calendar lets be done in a year, and the triggers that are heard."""
    start = stand.scenario.start_year
    asked = []
    for i, act in enumerate(stand.scenario.acts):
        if not act.may_be_in(year, start):
            continue
        if act.when is not None:
            times, last = stand.treatments.firing(i)
            if act.at_most is not None and times >= act.at_most:
                continue
            if times and year - last < (act.wait_years or 1):
                continue
        asked.append((i, act))
    return asked


def _due(
    stand: Stand, asked: list[tuple[int, Act]], measures: TreeMeasures
) -> list[tuple[int, Act]]:
    """List the acts that are done, in their order: prunings, fellings, plantings, strokes."""
    found = None
    due = []
    for i, act in asked:
        condition = act.condition
        if condition is not None:
            if found is None:
                found = quantities(stand, measures)
            kind = stand.species_names.index(act.when_species) if act.when_species else -1
            if not condition.holds(float(found[condition.quantity][kind])):
                continue
        due.append((i, act))
    order = {"prune": 0, "plant": 2, "stroke": 3}
    return sorted(due, key=lambda entry: order.get(entry[1].kind, 1))


def _felling(
    act: Act,
    stand: Stand,
    census: Census,
    standing: Mask,
    gone: Sequence[str],
    number: int,
    where: str,
) -> Felling:
    if isinstance(act, Fell):
        year = stand.year + 1
        rows = [row_of(stand.rows, i, where=f"{where}.tree_ids in {year}") for i in act.tree_ids]
        ids = [i for i, row in zip(act.tree_ids, rows, strict=True) if standing[row]]
        for name in act.residual:
            stand.residual.row_of(name, f"{where}.residual in {year}")
        names = [name for name in act.residual if name not in gone]
        return Felling("fell", list(dict.fromkeys(ids)), act.cause, tuple(dict.fromkeys(names)))
    if isinstance(act, Thin):
        chosen = to_thin(act, census, stand, standing, number)
        return Felling("thin", census.tree_id[np.sort(chosen)].tolist(), act.cause)
    assert not isinstance(act, Prune | Plant | Stroke)
    chosen = to_harvest(act, census, stand, standing)
    return Felling("harvest", census.tree_id[chosen].tolist(), "harvest")


def _places(
    act: Plant, stand: Stand, census: Census, standing: Mask, plan: YearOfActs, number: int
) -> Places:
    if act.pattern is None:
        return Places(act.x_m, act.y_m, act.names(stand.species_names))
    planned = list(plan.plantings.values())
    x = np.concatenate([census.x[standing], *(np.asarray(p.x, np.float64) for p in planned)])
    y = np.concatenate([census.y[standing], *(np.asarray(p.y, np.float64) for p in planned)])
    return fill(act, stand, x, y, number)


def fill(
    act: Planted, stand: Stand, x: NDArray[np.float64], y: NDArray[np.float64], number: int
) -> Places:
    """Find the places of a pattern between stems."""
    scenario = stand.scenario
    names, shares = act.mix({name: use.share for name, use in scenario.species.items()})
    new_x, new_y, kind = pattern_places(
        act,
        np.concatenate((x, stand.residual.places_m[:, 0])),
        np.concatenate((y, stand.residual.places_m[:, 1])),
        shares,
        plot_of(scenario),
        scenario.seed,
        time=number * _TIMES + stand.steps + 1,
    )
    return Places(new_x.tolist(), new_y.tolist(), [names[k] for k in kind])


def cuts_of(act: Pruning, stand: Stand, census: Census, standing: Mask, where: str) -> Cuts:
    """Find the metamers at which a pruning cuts; `where` names a key of it in messages."""
    arena, trees = stand.arena.metamers, stand.rows
    if act.ids:
        rows = [row_of(trees, i, where=where.format(act.ids_key)) for i in act.ids]
    else:
        rows = to_prune(act, act.thickest_ha, census, stand, standing).tolist()
    cuts: Cuts = {}
    for row in rows:
        if act.metamer is None:
            serials = choose_branches(arena, trees, row, act)
        else:
            serials = np.array([act.metamer], np.int32)
            find_cuts(arena, trees, row, serials, where=where.format("metamer"))
        if serials.size:
            cuts[int(trees.tree_id[row])] = serials
    return cuts
