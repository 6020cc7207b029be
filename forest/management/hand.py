"""Acts by hand: what a script does to a stand between two steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from forest.dynamics.storms import BROKEN, STOOD
from forest.errors import InputError
from forest.management import doing
from forest.management.brushing import draw
from forest.management.plan import (
    Felling,
    Marked,
    Places,
    change_of,
    chosen_rows,
    cuts_of,
    fill,
)
from forest.management.selection import census_of, to_harvest, to_thin
from forest.management.shaping import shape_to_come
from forest.management.treatments import BY_HAND
from forest.scenario.acts import Branches, Planted, Pruning, check_planted
from forest.scenario.cuttings import Harvesting, Thinning, check_rule
from forest.scenario.model import Regular
from forest.scenario.shaping import Bending, Marking, ObstacleChange
from forest.scenario.strokes import Stroking, check_stroke
from forest.species.schema import Refusal
from forest.species.text import input_error
from forest.trees.pruning import choose_branches, find_cuts
from forest.trees.table import row_of

if TYPE_CHECKING:
    import pandas as pd

    from forest.growth.parameters import SpeciesTraits
    from forest.stand import Stand

Leans = float | Sequence[float]


class Hand:
    """The acts of `forest.Stand`. Each takes effect at once and is on record with the next year."""

    _traits: SpeciesTraits

    def plant(
        self,
        x: Sequence[float] | None = None,
        y: Sequence[float] | None = None,
        species: str | Sequence[str] | None = None,
        *,
        lean_deg: Leans = 0.0,
        lean_azimuth_deg: Leans = 0.0,
        **pattern: Any,
    ) -> list[int]:
        """Plant seedlings; they start to grow with the next step.

        Parameters
        ----------
        x, y : sequences of float, optional
            Places, m, inside the plot.
        species : str or sequence of str, optional
            Name or names of species of the scenario; of a pattern, those that are mixed.
        lean_deg, lean_azimuth_deg : float or sequence of float
            Angle of the stems to the vertical, 0 to 85, and the direction towards which they lean,
            from x to y.
        **pattern
            In place of places, as in a scenario's acts: `pattern` ("regular" or "random") with
            `spacing_m` or `density_ha`, `min_distance_m`, `shares`, `clear_m`, `within`. See
            `forest.scenario.acts.Planted`.

        Returns
        -------
        list of int
            The new trees' ids.

        Raises
        ------
        InputError
            If a place lies outside the plot, a species is unknown, or the pattern is not right.
        """
        stand = cast("Stand", self)
        if species is None and not pattern and len(stand.species_names) > 1:
            known = "one of " + ", ".join(stand.species_names)
            raise InputError("no species given", where="Stand.plant", expected=known)
        if x is not None and y is not None and not pattern:
            names = [species or stand.species_names[0]] * len(x)
            if species is not None and not isinstance(species, str):
                names = list(species)
            places = Places(x, y, cast("list[str]", names))
        else:
            places = _pattern(stand, x, y, species, pattern)
        leans = (lean_deg, lean_azimuth_deg)
        measures = stand.measure()
        return doing.plant(stand, BY_HAND, places, leans, self._traits, measures)[1]

    def fell(self, tree_ids: Sequence[int], cause: str = "harvest") -> list[int]:
        """Fell trees: they are gone at once, with an event in the next year's record.

        Parameters
        ----------
        tree_ids : sequence of int
            Living trees; one named twice is felled once.
        cause : str
            One of `forest.record.schema.CAUSES`.

        Returns
        -------
        list of int
            The ids of the felled trees.

        Raises
        ------
        InputError
            If there is no such tree or cause; then none is felled.
        """
        stand = cast("Stand", self)
        felling = doing.felling_by_hand(stand, tree_ids, cause)
        doing.fell(stand, BY_HAND, felling, stand.measure())
        return felling.tree_ids

    def fell_residual(self, name: str) -> None:
        """Fell a residual tree: from the next step on it neither shades nor takes room.

        Parameters
        ----------
        name : str
            Its name in the scenario.

        Raises
        ------
        InputError
            If there is no such tree, or it was felled.
        """
        stand = cast("Stand", self)
        stand.residual.row_of(name, "Stand.fell_residual")
        felling = Felling("fell", [], "harvest", (name,))
        doing.fell(stand, BY_HAND, felling, stand.measure())

    def blow(self, speed_m_s: float, direction_deg: float = 0.0) -> list[int]:
        """Let a storm break and uproot trees between two years.

        Their events, and the rows of `/storms`, come with the next year's record.

        Parameters
        ----------
        speed_m_s : float
            Mean wind at the height of the canopy's top over open land, m/s.
        direction_deg : float
            Azimuth towards which it blows, from x towards y.

        Returns
        -------
        list of int
            Ids of the trees that fell.

        Raises
        ------
        InputError
            If there is no such storm.
        """
        stand = cast("Stand", self)
        measures = stand.measure()
        outcome = stand.storms.blow(stand, speed_m_s, direction_deg, measures)
        fallen = np.flatnonzero(outcome != STOOD)
        ids: list[int] = stand.rows.tree_id[fallen].tolist()
        if stand.regeneration is not None:
            broken = np.flatnonzero(outcome == BROKEN)
            stand.regeneration.note_stumps(stand.rows, broken.tolist(), measures)
        doing.take_out(stand, fallen, "windthrown", "wind", measures)
        return ids

    def critical_wind(self, direction_deg: float = 0.0) -> pd.DataFrame:
        """Tell the storms of a direction that the trees would not withstand; none falls.

        Returns
        -------
        pandas.DataFrame
            A row per tree of at least `wind.from_height_m`, with the columns of `/storms` that need
            no storm.
        """
        import pandas as pd

        stand = cast("Stand", self)
        return pd.DataFrame(stand.storms.critical(stand, direction_deg))

    def thin(self, **rule: Any) -> list[int]:
        """Thin by rule, as a scenario's act of kind `thin`: ``thin(method="below", n_ha=800)``.

        Parameters
        ----------
        **rule
            The keys of `forest.scenario.cuttings.Thinning`.

        Returns
        -------
        list of int
            The ids of the felled trees; none if the target was met before.

        Raises
        ------
        InputError
            If the rule is not right; then none is felled.
        """
        stand = cast("Stand", self)
        checked = Thinning.of("Stand.thin", **rule)
        _fits(stand, checked, "Stand.thin")
        measures = stand.measure()
        census = census_of(stand, measures)
        standing = np.ones(len(census.tree_id), np.bool_)
        rows = to_thin(checked, census, stand, standing, stand.treatments.number + 1)
        felling = Felling("thin", census.tree_id[np.sort(rows)].tolist(), checked.cause)
        doing.fell(stand, BY_HAND, felling, measures)
        return felling.tree_ids

    def harvest(self, **rule: Any) -> list[int]:
        """Harvest by rule, as a scenario's act of kind `harvest`.

        Parameters
        ----------
        **rule
            The keys of `forest.scenario.cuttings.Harvesting`, as
            ``harvest(method="gap", gap={"kind": "circle", "x_m": 5, "y_m": 5, "radius_m": 3})``.

        Returns
        -------
        list of int
            The ids of the felled trees.

        Raises
        ------
        InputError
            If the rule is not right; then none is felled.
        """
        stand = cast("Stand", self)
        checked = Harvesting.of("Stand.harvest", **rule)
        _fits(stand, checked, "Stand.harvest")
        measures = stand.measure()
        census = census_of(stand, measures)
        rows = to_harvest(checked, census, stand, np.ones(len(census.tree_id), np.bool_))
        felling = Felling("harvest", census.tree_id[rows].tolist(), "harvest")
        doing.fell(stand, BY_HAND, felling, measures)
        return felling.tree_ids

    def prune(
        self,
        tree_id: int | Sequence[int] | None = None,
        metamer: int | Sequence[int] | None = None,
        **choice: Any,
    ) -> int:
        """Cut parts off trees: at metamers, or the branches on their trunks that a choice names.

        Parameters
        ----------
        tree_id : int or sequence of int, optional
            Living trees; in place of them `thickest_ha` or `all_trees` in `choice`.
        metamer : int or sequence of int, optional
            Serial numbers of metamers of one tree: each goes with all that it carries.
        **choice
            In place of metamers, as in a scenario's acts: `below_m`, the height below which
            branches go, m; `below_share`, that height as a share of the tree's; or `side_deg`,
            the side to which those point that go, with or without `within_deg`, `from_m`, `to_m`.
            See `forest.scenario.acts.Pruning`.

        Returns
        -------
        int
            Metamers removed.

        Raises
        ------
        InputError
            If there is no such tree or metamer, or if the first metamer is to go: fell the tree.
        """
        stand = cast("Stand", self)
        arena, trees, where = stand.arena.metamers, stand.rows, "Stand.prune"
        measures = stand.measure()
        if isinstance(tree_id, int | np.integer):
            row = row_of(stand.rows, int(tree_id), where=where)
            if metamer is None:
                serials = choose_branches(arena, trees, row, Branches.of(where, **choice))
            elif choice:
                raise InputError(
                    f"metamer and {min(choice)} exclude each other",
                    where=where,
                    expected="one of them",
                )
            else:
                find_cuts(arena, trees, row, metamer, where=where)
                serials = np.atleast_1d(np.asarray(metamer, np.int32))
            cuts = {int(tree_id): serials}
        else:
            ids = {} if tree_id is None else {"tree_ids": tuple(doing.whole_ids(tree_id, where))}
            given = {} if metamer is None else {"metamer": metamer}
            rule = Pruning.of(where, **ids, **given, **choice)
            with _one_line(where):
                check_rule(rule, "", stand.scenario.plot, stand.species_names, rows_m=True)
            census = census_of(stand, measures)
            standing = np.ones(len(census.tree_id), np.bool_)
            cuts = cuts_of(rule, stand, census, standing, where)
        return doing.cut(stand, BY_HAND, cuts, self._traits.of["branch_pipe"], measures)[1]

    def mark(self, tree_ids: Sequence[int] | None = None, *, mark: str, **rule: Any) -> list[int]:
        """Mark trees with a word, by which acts can name them.

        Parameters
        ----------
        tree_ids : sequence of int, optional
            Living trees; in place of them `thickest_ha`, `all_trees` or `marked` in `rule`.
        mark : str
            A short word.
        **rule
            See `forest.scenario.shaping.Marking`.

        Returns
        -------
        list of int
            The ids of the marked trees.

        Raises
        ------
        InputError
            If there is no such tree, or the rule is not right; then none is marked.
        """
        stand, where = cast("Stand", self), "Stand.mark"
        ids = {} if tree_ids is None else {"tree_ids": tuple(doing.whole_ids(tree_ids, where))}
        checked = Marking.of(where, mark=mark, **ids, **rule)
        with _one_line(where):
            check_rule(checked, "", stand.scenario.plot, stand.species_names, rows_m=True)
        measures = stand.measure()
        census = census_of(stand, measures)
        standing = np.ones(len(census.tree_id), np.bool_)
        rows = chosen_rows(checked, stand, census, standing, where)
        marked = Marked(mark, census.tree_id[rows].tolist())
        doing.mark(stand, BY_HAND, marked, measures)
        return marked.tree_ids

    def bend(self, tree_id: int, metamer: int, to_m: Sequence[float]) -> float:
        """Bend an axis until a metamer's upper end is as near to a place as it can come.

        See `forest.mechanics.arranging.bend_axis`; the branch keeps the shape.

        Parameters
        ----------
        tree_id : int
            A living tree.
        metamer : int
            Serial number of the metamer.
        to_m : (float, float, float)
            The place, m, in the plot's coordinates.

        Returns
        -------
        float
            Distance from it that is left, m.

        Raises
        ------
        InputError
            If there is no such tree or metamer, or something would come to lie below the ground or
            in an obstacle; then nothing moves.
        """
        stand, where = cast("Stand", self), "Stand.bend"
        act = Bending.of(where, tree_id=tree_id, metamer=metamer, to_m=to_m)
        row_of(stand.rows, act.tree_id, where=where)
        where += ": {}"
        shape_to_come(stand, act.tree_id, [], [(act, where)], stand.surroundings.solid)
        return doing.bend(stand, BY_HAND, act, stand.measure(), where)[1]

    def obstacle(self, **change: Any) -> int:
        """Put up an obstacle, move it or take it away; it counts from the next step on.

        Parameters
        ----------
        **change
            As in a scenario's acts: `add`, a table of `obstacles` with a name; `move` with `by_m`;
            or `remove`. See `forest.scenario.shaping.ObstacleChange`.

        Returns
        -------
        int
            Trees of which something was cut off.

        Raises
        ------
        InputError
            If there is no such obstacle, or a tree stands where it comes; then nothing is done.
        """
        stand, where = cast("Stand", self), "Stand.obstacle"
        act = ObstacleChange.of(where, **change)
        standing = np.ones(len(stand.rows.tree_id), np.bool_)
        found = change_of(act, stand, stand.obstacles.now, standing, where + ": {}")
        kappa = self._traits.of["branch_pipe"]
        doing.change_obstacle(stand, BY_HAND, found, kappa, stand.measure())
        return len(found.cuts)

    def stroke(self, points_m: Any = (), radius_m: Any = 0.5, **stroke: Any) -> int:
        """Lay markers along the path of a brush (Palubicki et al. 2009, section 5).

        Parameters
        ----------
        points_m : array_like (n, 3)
            The path, m.
        radius_m : float or sequence of n floats
            Radius of the brush: pen pressure.
        **stroke
            As in a scenario's act of kind `stroke`: `spacing_m` or `markers_m3`, `steps`,
            `hold_steps`, `tree_id`, `metamer`, `bud`, `from_metamer`, `mirror`, `rotation`,
            `tiling`. See `forest.scenario.strokes.Stroking`.

        Returns
        -------
        int
            Its number in `Stand.strokes`.

        Raises
        ------
        InputError
            If the stroke is not right, or there is no such tree, metamer or bud.
        """
        stand, where = cast("Stand", self), "Stand.stroke"
        checked = Stroking.of(where, points_m=points_m, radius_m=radius_m, **stroke)
        with _one_line(where):
            check_stroke(checked, "", stand.scenario.environment, stand.scenario.plot)
        drawn = draw(checked, stand, stand.arena, stand.rows, where + ": {}")
        return doing.stroke(stand, BY_HAND, drawn, stand.measure())


def _pattern(
    stand: Stand,
    x: Sequence[float] | None,
    y: Sequence[float] | None,
    species: str | Sequence[str] | None,
    pattern: dict[str, Any],
) -> Places:
    where = "Stand.plant"
    places = {"x_m": () if x is None else x, "y_m": () if y is None else y}
    names = {} if species is None else {"species": species}
    act = Planted.of(where, **places, **names, **pattern)
    shares = {name: use.share for name, use in stand.scenario.species.items()}
    with _one_line(where):
        check_planted(act, "", stand.scenario.plot, shares)
    solid, number = stand.surroundings.solid, stand.treatments.number + 1
    return fill(act, stand, stand.rows.x, stand.rows.y, number, solid)


def _fits(stand: Stand, rule: Thinning | Harvesting, where: str) -> None:
    scenario = stand.scenario
    regular = isinstance(scenario.planting, Regular)
    with _one_line(where):
        check_rule(rule, "", scenario.plot, scenario.species, regular)


@contextmanager
def _one_line(where: str) -> Iterator[None]:
    """Turn a refusal into the user's error; `where` names the act."""
    try:
        yield
    except Refusal as refused:
        place = f"{where}: {refused.key}" if refused.key else where
        raise input_error(refused.what, where=place, expected=refused.expected) from None
