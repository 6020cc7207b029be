"""What the acts of a year come to: which metamers, which trees, which places. Changes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import ActError, InputError
from forest.establishment import check_free
from forest.management.brushing import Drawn, draw
from forest.management.filling import pattern_places
from forest.management.selection import Mask, census_of, to_harvest, to_prune, to_thin
from forest.management.shaping import Change, Cuts, cuts_inside, shape_to_come
from forest.management.treatments import quantities
from forest.measure.tables import plot_of
from forest.measure.trees import TreeMeasures
from forest.scenario.acts import Act, Fell, Plant, Planted, Prune, Pruning
from forest.scenario.choosing import ChosenTrees
from forest.scenario.cuttings import Harvest, Thin
from forest.scenario.shaping import Bend, Bending, ChangeObstacle, Crack, Mark, ObstacleChange
from forest.scenario.strokes import Stroke
from forest.species.schema import Refusal
from forest.species.text import input_error
from forest.trees.pruning import choose_branches, find_cuts
from forest.trees.table import Trees, row_of

if TYPE_CHECKING:
    from forest.environment.obstacles import Solid
    from forest.management.thinning import Census
    from forest.scenario.model import Obstacle
    from forest.stand import Stand
    from forest.trees.metamers import Arena

#: Plantings of a year draw from times that are so far apart, above any number of steps.
_TIMES = 1 << 14

#: In which order the kinds of acts are done in a year; those that fell are not named.
_ORDER = {"mark": 0, "obstacle": 1, "prune": 2, "bend": 3, "crack": 4, "plant": 6, "stroke": 7}
_FELLING = 5


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


class Marked(NamedTuple):
    """Trees that are marked, and with what word."""

    word: str
    tree_ids: list[int]


class YearOfActs(NamedTuple):
    """The acts of a year in the order in which they are done, by their numbers in the scenario.

    Attributes
    ----------
    measures : TreeMeasures
        Of the stand before them.
    markings, changes, prunings, bendings, cracks : dict by number of the act
    fellings, plantings, strokes : dict by number of the act
    triggers : list of int
        Acts that a trigger fired.
    """

    measures: TreeMeasures
    markings: dict[int, Marked]
    changes: dict[int, Change]
    prunings: dict[int, Cuts]
    bendings: dict[int, Bending]
    cracks: dict[int, int]  # the tree
    fellings: dict[int, Felling]
    plantings: dict[int, Places]
    strokes: dict[int, Drawn]
    triggers: list[int]

    def touched(self) -> Iterator[tuple[str, Iterable[int]]]:
        """Tell what is done to which trees that stand: kind of act, ids."""
        for marked in self.markings.values():
            yield "mark", marked.tree_ids
        for cuts in (*(change.cuts for change in self.changes.values()), *self.prunings.values()):
            yield "prune", cuts
        for bending in self.bendings.values():
            yield "bend", (bending.tree_id,)
        for tree_id in self.cracks.values():
            yield "crack", (tree_id,)
        for felling in self.fellings.values():
            yield "fell", felling.tree_ids

    def shape_of(self, stand: Stand, tree_id: int) -> tuple[Arena, Trees]:
        """Give a copy of a tree as the acts of the year will leave it, but for its felling."""
        bendings = [
            (b, f"acts[{i}].{{}}") for i, b in self.bendings.items() if b.tree_id == tree_id
        ]
        cuts = [*(change.cuts for change in self.changes.values()), *self.prunings.values()]
        return shape_to_come(stand, tree_id, cuts, bendings, self.solid(stand))

    def solid(self, stand: Stand) -> Solid:
        """Give the voxels that obstacles fill after it."""
        if not self.changes:
            return stand.surroundings.solid
        return stand.surroundings.solid_of(list(self.changes.values())[-1].obstacles)


def plan_year(stand: Stand, year: int) -> YearOfActs | None:
    """Find out what the acts of a year do to the stand as it is before that year.

    First trees are marked, then obstacles change, it is pruned, bent, felled and planted, then
    strokes are laid, each kind in the order of the file. Marks are given to the stand as it is
    before. A thinning or harvest sees what those before it leave; a pruning that chooses trees by
    rule, and a pattern of planting, see what all of them leave. Planting sees the obstacles as
    they are then, and a stroke its tree as it is pruned and bent. Triggers see the stand before
    all acts. Nothing is changed here, so that a year is acted on wholly or not at all.

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
    triggers = [i for i, act in due if act.when is not None]
    plan = YearOfActs(measures, {}, {}, {}, {}, {}, {}, {}, {}, triggers)
    census = census_of(stand, measures)
    standing = np.ones(len(census.tree_id), np.bool_)
    first = stand.treatments.number + 1
    for k, (i, act) in enumerate(due):
        try:
            if isinstance(act, Prune | Bend | Crack | ChangeObstacle | Plant | Stroke):
                continue
            if isinstance(act, Mark):
                rows = chosen_rows(act, stand, census, standing, f"acts[{i}].{{}} in {year}", plan)
                plan.markings[i] = Marked(act.mark, census.tree_id[rows].tolist())
            else:
                where = f"acts[{i}]"
                gone = [name for done in plan.fellings.values() for name in done.residual]
                felling = _felling(act, stand, census, standing, gone, first + k, where, plan)
                plan.fellings[i] = felling
                standing &= ~np.isin(census.tree_id, felling.tree_ids)
        except InputError as refusal:
            raise ActError(str(refusal)) from None
    try:
        _plan_shapes(stand, year, due, plan, census, standing)
        _plan_new(stand, year, due, plan, census, standing, first)
    except InputError as refusal:
        raise ActError(str(refusal)) from None
    return plan


def _plan_shapes(
    stand: Stand,
    year: int,
    due: list[tuple[int, Act]],
    plan: YearOfActs,
    census: Census,
    standing: Mask,
) -> None:
    """Find out what changes the shape of trees: obstacles, prunings, bendings; and cracks."""
    obstacles = stand.obstacles.now
    for i, act in due:
        where = f"acts[{i}].{{}} in {year}"
        if isinstance(act, ChangeObstacle):
            plan.changes[i] = change_of(act, stand, obstacles, standing, where)
            obstacles = plan.changes[i].obstacles
        elif isinstance(act, Prune):
            plan.prunings[i] = cuts_of(act, stand, census, standing, where, plan)
        elif isinstance(act, Bend):
            row_of(stand.rows, act.tree_id, where=where.format("tree_id"))
            plan.bendings[i] = act
            plan.shape_of(stand, act.tree_id)
        elif isinstance(act, Crack):
            row = row_of(stand.rows, act.tree_id, where=where.format("tree_id"))
            height = float(plan.measures.height_m[row])
            if act.height_m > height:
                raise InputError(
                    f"{act.height_m:g} m is above tree {act.tree_id}",
                    where=where.format("height_m"),
                    expected=f"0 to {height:.3g} m",
                )
            plan.cracks[i] = act.tree_id


def _plan_new(
    stand: Stand,
    year: int,
    due: list[tuple[int, Act]],
    plan: YearOfActs,
    census: Census,
    standing: Mask,
    first: int,
) -> None:
    """Find out what is planted and which strokes are drawn; both see what the others leave."""
    for k, (i, act) in enumerate(due):
        where = f"acts[{i}].{{}} in {year}"
        if isinstance(act, Plant):
            plan.plantings[i] = _places(act, stand, census, standing, plan, first + k, where)
        elif isinstance(act, Stroke):
            place, trees = stand.arena, stand.rows
            if act.tree_id is not None:
                row_of(trees, act.tree_id, where=where.format("tree_id"))
                place, trees = plan.shape_of(stand, act.tree_id)
            plan.strokes[i] = draw(act, stand, place, trees, where)


def change_of(
    act: ObstacleChange,
    stand: Stand,
    obstacles: Sequence[Obstacle],
    standing: Mask,
    where: str,
) -> Change:
    """Find out what a change of obstacles comes to; `where` names a key of it in messages."""
    key = "add" if act.add is not None else "move" if act.move is not None else "remove"
    try:
        after = act.applied(obstacles)
    except Refusal as refused:
        place = where.format(refused.key)
        raise input_error(refused.what, where=place, expected=refused.expected) from None
    if act.remove is not None:
        return Change(after, {})
    try:
        solid = stand.surroundings.solid_of(after)
    except InputError as refused:
        raise InputError(str(refused), where=where.format(key)) from None
    return Change(after, cuts_inside(stand, solid, standing, where=where.format(key)))


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
    """List the acts that are done, in their order."""
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
    return sorted(due, key=lambda entry: _ORDER.get(entry[1].kind, _FELLING))


def _felling(
    act: Act,
    stand: Stand,
    census: Census,
    standing: Mask,
    gone: Sequence[str],
    number: int,
    where: str,
    plan: YearOfActs,
) -> Felling:
    if isinstance(act, Fell):
        year = stand.year + 1
        rows = [row_of(stand.rows, i, where=f"{where}.tree_ids in {year}") for i in act.tree_ids]
        ids = [i for i, row in zip(act.tree_ids, rows, strict=True) if standing[row]]
        if act.marked is not None:
            ids += census.tree_id[standing & bearing(act.marked, stand, census, plan)].tolist()
        for name in act.residual:
            stand.residual.row_of(name, f"{where}.residual in {year}")
        names = [name for name in act.residual if name not in gone]
        return Felling("fell", list(dict.fromkeys(ids)), act.cause, tuple(dict.fromkeys(names)))
    if isinstance(act, Thin):
        chosen = to_thin(act, census, stand, standing, number)
        return Felling("thin", census.tree_id[np.sort(chosen)].tolist(), act.cause)
    assert isinstance(act, Harvest)
    chosen = to_harvest(act, census, stand, standing)
    return Felling("harvest", census.tree_id[chosen].tolist(), "harvest")


def _places(
    act: Plant,
    stand: Stand,
    census: Census,
    standing: Mask,
    plan: YearOfActs,
    number: int,
    where: str,
) -> Places:
    solid = plan.solid(stand)
    if act.pattern is None:
        where = where.format("x_m[{}]")
        check_free(stand.surroundings, act.x_m, act.y_m, where=where, solid=solid)
        return Places(act.x_m, act.y_m, act.names(stand.species_names))
    planned = list(plan.plantings.values())
    x = np.concatenate([census.x[standing], *(np.asarray(p.x, np.float64) for p in planned)])
    y = np.concatenate([census.y[standing], *(np.asarray(p.y, np.float64) for p in planned)])
    return fill(act, stand, x, y, number, solid)


def fill(
    act: Planted,
    stand: Stand,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    number: int,
    solid: Solid,
) -> Places:
    """Find the places of a pattern between stems and obstacles."""
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
    free = ~stand.surroundings.blocked(new_x, new_y, solid)
    return Places(new_x[free].tolist(), new_y[free].tolist(), [names[k] for k in kind[free]])


def bearing(word: str, stand: Stand, census: Census, plan: YearOfActs | None) -> Mask:
    """Tell which trees bear a mark, those of the same year's plan as well."""
    ids = stand.marks.bearing(word)
    for marked in plan.markings.values() if plan is not None else ():
        if marked.word == word:
            ids += marked.tree_ids
    return np.isin(census.tree_id, ids)


def chosen_rows(
    act: ChosenTrees,
    stand: Stand,
    census: Census,
    standing: Mask,
    where: str,
    plan: YearOfActs | None = None,
) -> list[int]:
    """Find the rows of the trees that an act means; `where` names a key of it in messages."""
    if act.ids:
        return [row_of(stand.rows, i, where=where.format(act.ids_key)) for i in act.ids]
    if act.marked is not None:
        standing = standing & bearing(act.marked, stand, census, plan)
    rows: list[int] = to_prune(act, act.thickest_ha, census, stand, standing).tolist()
    return rows


def cuts_of(
    act: Pruning,
    stand: Stand,
    census: Census,
    standing: Mask,
    where: str,
    plan: YearOfActs | None = None,
) -> Cuts:
    """Find the metamers at which a pruning cuts; `where` names a key of it in messages."""
    arena, trees = stand.arena.metamers, stand.rows
    cuts: Cuts = {}
    for row in chosen_rows(act, stand, census, standing, where, plan):
        if act.metamer is None:
            serials = choose_branches(arena, trees, row, act)
        else:
            serials = np.array([act.metamer], np.int32)
            find_cuts(arena, trees, row, serials, where=where.format("metamer"))
        if serials.size:
            cuts[int(trees.tree_id[row])] = serials
    return cuts
