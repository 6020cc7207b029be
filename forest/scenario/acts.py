"""The acts of a scenario: what is pruned, felled and planted between the years of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from forest.errors import nearest
from forest.scenario.complete import check_spots
from forest.scenario.model import PlantedTree, Plot
from forest.species.schema import Refusal, Table, quantity, refusal

_Id = Annotated[int, Field(ge=1, le=2**31 - 1)]
_Place = Annotated[float, Field(ge=0, le=10000)]
_MOST = 1_000_000
#: Half of what a side holds, where a scenario does not say: a half plane.
_HALF_PLANE_DEG = 90.0


def _year() -> Any:
    return quantity(
        ...,
        "calendar year of the run; the act is done before its growth",
        unit="year",
        ge=-100000,
        le=100000,
    )


class Branches(Table):
    """A choice among the branches that stand on a tree's trunk."""

    _choices: ClassVar[tuple[str, ...]] = ("below_m", "side_deg")

    below_m: float | None = quantity(
        None, "branches that start below this height: lift pruning", unit="m", gt=0, le=200
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

    @classmethod
    def of(cls, where: str, **given: float | None) -> Self:
        """Check a choice that was given in Python; `where` names it in messages."""
        try:
            return cls(**given)
        except ValidationError as error:
            raise refusal(error, cls, where=where) from None

    @property
    def spread_deg(self) -> float:
        """Largest angle between a branch and the side to which it points, degrees."""
        return _HALF_PLANE_DEG if self.within_deg is None else self.within_deg


class _TreesToPrune(Table):
    """The keys of a pruning that do not choose branches; they come first in the documentation."""

    kind: Literal["prune"] = quantity("prune", "kind of act", unit="")
    year: int = _year()
    tree_id: _Id | None = quantity(None, "the tree, or give tree_ids", unit="")
    tree_ids: tuple[_Id, ...] | None = quantity(
        None, "the trees", unit="", min_length=1, max_length=_MOST
    )
    metamer: int | None = quantity(
        None,
        "serial number of a metamer of the tree: it goes with all that it carries",
        unit="",
        ge=0,
        le=2**31 - 1,
    )

    @model_validator(mode="after")
    def _names_its_trees(self) -> Self:
        if (self.tree_id is None) == (self.tree_ids is None):
            what = "missing" if self.tree_id is None else "tree_id and tree_ids are both given"
            key = "tree_id" if self.tree_id is None else ""
            raise Refusal(what, key=key, expected="one of tree_id, tree_ids")
        if self.metamer is not None and self.tree_id is None:
            raise Refusal(
                "a metamer is one tree's", key="metamer", expected="tree_id in place of tree_ids"
            )
        return self

    @property
    def ids(self) -> tuple[int, ...]:
        """The trees."""
        return (self.tree_ids or ()) if self.tree_id is None else (self.tree_id,)

    @property
    def ids_key(self) -> str:
        """The key that names the trees."""
        return "tree_ids" if self.tree_id is None else "tree_id"


class Prune(Branches, _TreesToPrune):
    """Cut branches off some trees: those that one of metamer, below_m and side_deg names."""

    _choices: ClassVar[tuple[str, ...]] = ("metamer", "below_m", "side_deg")


class Fell(Table):
    """Fell trees."""

    kind: Literal["fell"] = quantity("fell", "kind of act", unit="")
    year: int = _year()
    tree_ids: tuple[_Id, ...] = quantity(..., "the trees", unit="", min_length=1, max_length=_MOST)
    cause: Literal["harvest", "thinning", "tending"] = quantity(
        "harvest", "why, in the events; what tending fells is left lying", unit=""
    )


class Plant(Table):
    """Plant seedlings; they grow from this year on."""

    kind: Literal["plant"] = quantity("plant", "kind of act", unit="")
    year: int = _year()
    x_m: tuple[_Place, ...] = quantity(
        ..., "positions along x", unit="m", min_length=1, max_length=_MOST
    )
    y_m: tuple[_Place, ...] = quantity(
        ..., "positions along y", unit="m", min_length=1, max_length=_MOST
    )
    species: tuple[str, ...] = quantity(
        (),
        "a species of the scenario for each tree, or one for all; may be left out where the "
        "scenario has one",
        unit="",
        max_length=_MOST,
    )

    @field_validator("species", mode="before")
    @classmethod
    def _one_for_all(cls, species: Any) -> Any:
        return (species,) if isinstance(species, str) else species

    @model_validator(mode="after")
    def _as_many_of_each(self) -> Plant:
        n = len(self.x_m)
        if len(self.y_m) != n:
            raise Refusal(f"{len(self.y_m)} for {n} x_m", key="y_m", expected="as many of each")
        if len(self.species) not in (0, 1, n):
            raise Refusal(
                f"{len(self.species)} for {n} trees", key="species", expected="one, or one for each"
            )
        return self

    def names(self, known: Sequence[str]) -> list[str]:
        """Name the species of each tree, of a scenario with these."""
        names = self.species or tuple(known[:1])
        return list(names) if len(names) == len(self.x_m) else [names[0]] * len(self.x_m)


Act = Annotated[Prune | Fell | Plant, Field(discriminator="kind")]


def check_acts(acts: Sequence[Act], plot: Plot, species: Iterable[str], years: range) -> None:
    """Refuse acts of which it is known before the run that they cannot be done.

    Parameters
    ----------
    acts : sequence of Act
        In the order of the file.
    plot : Plot
        Where trees can be planted.
    species : iterable of str
        The scenario's species.
    years : range
        The run's calendar years.
    """
    known = list(species)
    for i, act in enumerate(acts):
        if act.year not in years:
            raise Refusal(
                f"{act.year} is not a year of the run",
                key=f"acts[{i}].year",
                expected=f"a calendar year, {years[0]} to {years[-1]}",
            )
        if isinstance(act, Plant):
            _check_places(act, f"acts[{i}]", plot, known)
    _check_felled_once(acts)


def _check_places(act: Plant, key: str, plot: Plot, species: list[str]) -> None:
    if not act.species and len(species) > 1:
        raise Refusal("missing key 'species'", key=key, expected="one of " + ", ".join(species))
    for j, name in enumerate(act.species):
        if name not in species:
            raise Refusal(
                f"unknown species {name[:60]!r}, {nearest(name, species)}",
                key=f"{key}.species[{j}]",
            )
    places = [PlantedTree(x_m=x, y_m=y) for x, y in zip(act.x_m, act.y_m, strict=True)]
    check_spots(places, plot, key=f"{key}.x_m")


def _check_felled_once(acts: Sequence[Act]) -> None:
    """Refuse to prune or fell a tree that is gone; in one year pruning comes before felling."""
    felled: dict[int, int] = {}
    order = sorted(enumerate(acts), key=lambda entry: (entry[1].year, entry[1].kind == "fell"))
    for i, act in order:
        if isinstance(act, Plant):
            continue
        ids, key = (act.ids, act.ids_key) if isinstance(act, Prune) else (act.tree_ids, "tree_ids")
        for tree_id in ids:
            if tree_id in felled:
                raise Refusal(
                    f"tree {tree_id} is felled by acts[{felled[tree_id]}] in "
                    f"{acts[felled[tree_id]].year}",
                    key=f"acts[{i}].{key}",
                    expected="a tree that still stands",
                )
            if isinstance(act, Fell):
                felled[tree_id] = i
