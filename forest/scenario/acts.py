"""The acts of a scenario: what is pruned, felled and planted between the years of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from forest.errors import nearest
from forest.scenario.choosing import MOST_IDS, ChosenTrees, Id, Word
from forest.scenario.complete import check_spots
from forest.scenario.cuttings import Harvest, Rule, Thin, check_rule
from forest.scenario.model import PlantedTree, Plot
from forest.scenario.placing import MOST_TREES, random_count
from forest.scenario.regions import Region, check_region
from forest.scenario.shaping import Bend, ChangeObstacle, Crack, Mark
from forest.scenario.strokes import Stroke
from forest.scenario.timing import Timing, check_timing
from forest.species.schema import Refusal, Table, quantity

_Place = Annotated[float, Field(ge=0, le=10000)]
_Spacing = Annotated[float, Field(ge=0.05, le=10000)]
_MOST = MOST_IDS
#: Half of what a side holds, where a scenario does not say: a half plane.
_HALF_PLANE_DEG = 90.0


class Branches(Table):
    """A choice among the branches that stand on a tree's trunk."""

    _choices: ClassVar[tuple[str, ...]] = ("below_m", "below_share", "side_deg")

    below_m: float | None = quantity(
        None, "branches that start below this height: lift pruning", unit="m", gt=0, le=200
    )
    below_share: float | None = quantity(
        None, "branches that start below this share of the tree's height", gt=0, le=1
    )
    side_deg: float | None = quantity(
        None,
        "branches that point to this side, from foot to tip: azimuth from x (0) towards y (90)",
        unit="degree",
        ge=-360,
        le=360,
    )
    within_deg: float | None = quantity(
        None,
        f"largest angle between a branch and `side_deg`; default: {_HALF_PLANE_DEG:g}, all of "
        "that side",
        unit="degree",
        gt=0,
        le=180,
    )
    from_m: float | None = quantity(
        None, "lowest start of a branch on that side; default: the ground", unit="m", ge=0, le=200
    )
    to_m: float | None = quantity(
        None, "highest start of a branch on that side; default: the top", unit="m", ge=0, le=200
    )

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        chosen = [key for key in self._choices if getattr(self, key) is not None]
        if len(chosen) != 1:
            what = " and ".join(chosen) + " exclude each other" if chosen else "nothing to cut"
            raise Refusal(what, expected="one of " + ", ".join(self._choices))
        for key in ("within_deg", "from_m", "to_m"):
            if self.side_deg is None and getattr(self, key) is not None:
                raise Refusal("given without side_deg", key=key, expected="side_deg beside it")
        if self.from_m is not None and self.to_m is not None and self.from_m > self.to_m:
            raise Refusal(
                f"{self.to_m:g} lies below from_m", key="to_m", expected=f"{self.from_m:g} or more"
            )
        return self

    @property
    def spread_deg(self) -> float:
        """Largest angle between a branch and the side to which it points, degrees."""
        return _HALF_PLANE_DEG if self.within_deg is None else self.within_deg


class _TreesToPrune(ChosenTrees):
    """The keys of a pruning that do not choose branches; they come first in the documentation."""

    metamer: int | None = quantity(
        None,
        "serial number of a metamer of the tree: it goes with all that it carries",
        unit="",
        ge=0,
        le=2**31 - 1,
    )

    @model_validator(mode="after")
    def _metamer_of_one_tree(self) -> Self:
        if self.metamer is not None and self.tree_id is None:
            ways = ("tree_ids", "thickest_ha", "all_trees", "marked")
            given = next(key for key in ways if getattr(self, key) is not None)
            raise Refusal(
                "a metamer is one tree's", key="metamer", expected=f"tree_id in place of {given}"
            )
        return self


class Pruning(Branches, _TreesToPrune):
    """What is cut off which trees."""

    _choices: ClassVar[tuple[str, ...]] = ("metamer", "below_m", "below_share", "side_deg")

    @property
    def in_words(self) -> str:
        """Say what is done."""
        return f"prune {self.trees_in_words}".rstrip()


class Prune(Pruning, Timing):
    """Cut branches off some trees: those that one of metamer, below_m, below_share and side_deg
    names.
    """

    kind: Literal["prune"] = quantity("prune", "kind of act", unit="")


class Fell(Timing):
    """Fell trees, residual trees, or both."""

    kind: Literal["fell"] = quantity("fell", "kind of act", unit="")
    tree_ids: tuple[Id, ...] = quantity((), "the trees", unit="", max_length=_MOST)
    marked: Word | None = quantity(None, "fells the trees that bear this mark", unit="")
    residual: tuple[str, ...] = quantity(
        (), "names of residual trees, or one name", unit="", max_length=10000
    )
    cause: Literal["harvest", "thinning", "tending"] = quantity(
        "harvest", "why, in the events; what tending fells is left lying", unit=""
    )

    @field_validator("residual", mode="before")
    @classmethod
    def _one_name(cls, residual: Any) -> Any:
        return (residual,) if isinstance(residual, str) else residual

    @model_validator(mode="after")
    def _fells_something(self) -> Self:
        if not self.tree_ids and not self.residual and self.marked is None:
            raise Refusal("missing", key="tree_ids", expected="tree_ids, marked or residual")
        return self

    @property
    def in_words(self) -> str:
        """Say what is done."""
        return "fell" if self.marked is None else f"fell trees marked {self.marked}"


class Planted(Table):
    """Where seedlings are planted, and of which species."""

    x_m: tuple[_Place, ...] = quantity(
        (), "positions along x, or give a pattern", unit="m", max_length=_MOST
    )
    y_m: tuple[_Place, ...] = quantity((), "positions along y", unit="m", max_length=_MOST)
    species: tuple[str, ...] = quantity(
        (),
        "a species of the scenario for each tree, or one for all; may be left out where the "
        "scenario has one; of a pattern: the species that are mixed, all if left out",
        unit="",
        max_length=_MOST,
    )
    pattern: Literal["regular", "random"] | None = quantity(
        None, "in place of positions: fill the plot", unit=""
    )
    spacing_m: tuple[_Spacing, _Spacing] | None = quantity(
        None, "regular: spacing along x and y", unit="m"
    )
    density_ha: float | None = quantity(
        None, "random: trees per hectare, before places are left out", unit="1/ha", gt=0, le=1e7
    )
    min_distance_m: float | None = quantity(
        None, "random: least distance between new trees; default: 0", unit="m", ge=0, le=100
    )
    shares: tuple[Annotated[float, Field(ge=0, le=1e6)], ...] | None = quantity(
        None,
        "of a pattern: shares of the species; default: those of the scenario",
        min_length=1,
        max_length=200,
    )
    clear_m: float | None = quantity(
        None,
        "of a pattern: nearer than this to a stem nothing is planted; default: 1",
        unit="m",
        ge=0,
        le=100,
    )
    within: Region | None = quantity(None, "of a pattern: plant only there", unit="")

    @field_validator("species", mode="before")
    @classmethod
    def _one_for_all(cls, species: Any) -> Any:
        return (species,) if isinstance(species, str) else species

    @model_validator(mode="after")
    def _places_or_pattern(self) -> Self:
        if self.pattern is None:
            for key in ("spacing_m", "density_ha", "min_distance_m", "shares", "clear_m", "within"):
                if getattr(self, key) is not None:
                    raise Refusal("given without a pattern", key=key, expected="pattern beside it")
            self._as_many_of_each()
        else:
            self._whole_pattern(self.pattern)
        return self

    def _as_many_of_each(self) -> None:
        n = len(self.x_m)
        if not n:
            raise Refusal("missing", key="x_m", expected="positions, or a pattern")
        if len(self.y_m) != n:
            raise Refusal(f"{len(self.y_m)} for {n} x_m", key="y_m", expected="as many of each")
        if len(self.species) not in (0, 1, n):
            raise Refusal(
                f"{len(self.species)} for {n} trees", key="species", expected="one, or one for each"
            )

    def _whole_pattern(self, pattern: str) -> None:
        if self.x_m or self.y_m:
            raise Refusal("pattern and positions exclude each other", expected="one of them")
        regular = pattern == "regular"
        needs = "spacing_m" if regular else "density_ha"
        other = ("density_ha", "min_distance_m") if regular else ("spacing_m",)
        if getattr(self, needs) is None:
            raise Refusal(f"missing key {needs!r}", expected=f"it for a {pattern} pattern")
        for key in other:
            if getattr(self, key) is not None:
                raise Refusal(f"given beside pattern {pattern!r}", key=key, expected=f"{needs}")
        if self.shares is not None:
            if len(self.shares) != len(self.species):
                what = f"{len(self.shares)} for {len(self.species)} species"
                raise Refusal(what, key="shares", expected="one for each")
            if not sum(self.shares):
                raise Refusal("every share is 0", key="shares", expected="a share above 0")

    def names(self, known: Sequence[str]) -> list[str]:
        """Name the species of each tree at given places, of a scenario with these."""
        names = self.species or tuple(known[:1])
        return list(names) if len(names) == len(self.x_m) else [names[0]] * len(self.x_m)

    def mix(self, known: dict[str, float]) -> tuple[list[str], list[float]]:
        """Name the species of a pattern with their shares, of a scenario with these shares."""
        names = list(self.species or known)
        return names, list(self.shares or (known[name] for name in names))

    @property
    def in_words(self) -> str:
        """Say what is done."""
        if self.pattern is None:
            return "plant"
        if self.spacing_m is not None:
            return f"plant every {self.spacing_m[0]:g} x {self.spacing_m[1]:g} m"
        return f"plant {self.density_ha:g}/ha"


class Plant(Planted, Timing):
    """Plant seedlings; they grow from this year on."""

    kind: Literal["plant"] = quantity("plant", "kind of act", unit="")


Act = Annotated[
    Prune | Fell | Plant | Thin | Harvest | Mark | Bend | Crack | ChangeObstacle | Stroke,
    Field(discriminator="kind"),
]


def check_acts(
    acts: Sequence[Act], plot: Plot, species: dict[str, float], years: range, rows_m: bool
) -> None:
    """Refuse acts of which it is known before the run that they cannot be done.

    Parameters
    ----------
    acts : sequence of Act
        In the order of the file.
    plot : Plot
        Where trees can be planted.
    species : dict of str to float
        The scenario's species and their shares.
    years : range
        The run's calendar years.
    rows_m : bool
        Whether the planting says how far apart its rows are.
    """
    for i, act in enumerate(acts):
        check_timing(act, f"acts[{i}]", years, species)
        if isinstance(act, Plant):
            check_planted(act, f"acts[{i}]", plot, species)
        elif isinstance(act, Rule):
            check_rule(act, f"acts[{i}]", plot, species, rows_m)
    _check_felled_once(acts, years)


def check_planted(act: Planted, key: str, plot: Plot, species: dict[str, float]) -> None:
    """Refuse a planting that does not fit the stand; `key` is where it stands."""
    start = f"{key}." if key else ""
    if act.pattern is None and not act.species and len(species) > 1:
        raise Refusal("missing key 'species'", key=key, expected="one of " + ", ".join(species))
    for j, name in enumerate(act.species):
        if name not in species:
            raise Refusal(
                f"unknown species {name[:60]!r}, {nearest(name, species)}",
                key=f"{start}species[{j}]",
            )
    if act.pattern is None:
        places = [PlantedTree(x_m=x, y_m=y) for x, y in zip(act.x_m, act.y_m, strict=True)]
        check_spots(places, plot, key=f"{start}x_m")
        return
    if not sum(act.mix(species)[1]):
        raise Refusal("every share is 0", key=f"{start}shares", expected="a share above 0")
    if act.within is not None:
        check_region(act.within, plot.size_m, plot.boundary == "periodic", f"{start}within")
    _check_room(act, start, plot)


def _check_room(act: Planted, start: str, plot: Plot) -> None:
    width, depth = plot.size_m
    if act.density_ha is not None:
        try:
            random_count(plot.size_m, act.density_ha, act.min_distance_m or 0.0)
        except Refusal as error:
            name = error.key.rpartition(".")[2]
            raise Refusal(error.what, key=f"{start}{name}", expected=error.expected) from None
    elif act.spacing_m is not None:
        columns, rows = width / act.spacing_m[0], depth / act.spacing_m[1]
        if columns * rows > MOST_TREES:
            raise Refusal(
                "too many trees",
                key=f"{start}spacing_m",
                expected=f"at most {MOST_TREES} trees on the plot",
            )


def _check_felled_once(acts: Sequence[Act], years: range) -> None:
    """Refuse to do something to a tree that is gone.

    In one year felling comes after all but strokes.
    """
    order = {"fell": 1, "stroke": 2}
    felled: dict[int, tuple[int, int]] = {}
    by_id = [
        (year, order.get(act.kind, 0), i, act)
        for i, act in enumerate(acts)
        if act.when is None and isinstance(act, Prune | Fell | Mark | Bend | Crack | Stroke)
        for year in act.calendar_years(years)
    ]
    for year, _, i, act in sorted(by_id, key=lambda entry: entry[:3]):
        if isinstance(act, ChosenTrees | Stroke):
            ids, key = act.ids, act.ids_key
        else:
            ids, key = (
                ((act.tree_id,), "tree_id")
                if isinstance(act, Bend | Crack)
                else (act.tree_ids, "tree_ids")
            )
        for tree_id in ids:
            if tree_id in felled:
                by, then = felled[tree_id]
                raise Refusal(
                    f"tree {tree_id} is felled by acts[{by}] in {then}",
                    key=f"acts[{i}].{key}",
                    expected="a tree that still stands",
                )
            if isinstance(act, Fell):
                felled[tree_id] = i, year
