"""Which trees an act means: by number, by the mark that they bear, or by rule."""

from __future__ import annotations

import re
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from forest.scenario.cuttings import Rule
from forest.species.schema import Refusal, quantity

Id = Annotated[int, Field(ge=1, le=2**31 - 1)]


def _is_word(text: str) -> str:
    if not re.fullmatch("[a-z][a-z0-9_]{0,29}", text):
        raise Refusal(
            f"{text[:60]!r} is no short word",
            expected="small letters, digits and _, a letter first, 30 at most",
        )
    return text


#: What a tree can be marked with.
Word = Annotated[str, AfterValidator(_is_word)]
MOST_IDS = 1_000_000


class ChosenTrees(Rule):
    """A choice of trees."""

    _by_rule: ClassVar[tuple[str, ...]] = ("species", "min_dbh_cm", "max_dbh_cm")

    tree_id: Id | None = quantity(None, "the tree, or give tree_ids", unit="")
    tree_ids: tuple[Id, ...] | None = quantity(
        None, "the trees", unit="", min_length=1, max_length=MOST_IDS
    )
    marked: Word | None = quantity(None, "in place of ids: the trees that bear this mark", unit="")
    thickest_ha: float | None = quantity(
        None, "in place of ids: the thickest trees that have a dbh", unit="1/ha", gt=0, le=1e7
    )
    all_trees: Literal[True] | None = quantity(None, "in place of ids: all trees", unit="")

    @model_validator(mode="after")
    def _names_its_trees(self) -> Self:
        ways = ("tree_id", "tree_ids", "thickest_ha", "all_trees", "marked")
        given = [key for key in ways if getattr(self, key) is not None]
        if len(given) != 1:
            what = " and ".join(given) + " are both given" if given else "missing"
            key = "" if given else "tree_id"
            raise Refusal(what, key=key, expected="one of " + ", ".join(ways))
        for key in self._by_rule:
            if self.ids and getattr(self, key) is not None:
                raise Refusal(
                    f"given beside {given[0]}", key=key, expected="thickest_ha or all_trees"
                )
        return self

    @property
    def ids(self) -> tuple[int, ...]:
        """The trees; none if a mark or a rule chooses them."""
        return (self.tree_ids or ()) if self.tree_id is None else (self.tree_id,)

    @property
    def ids_key(self) -> str:
        """The key that names the trees."""
        return "tree_ids" if self.tree_id is None else "tree_id"

    @property
    def trees_in_words(self) -> str:
        """Name the trees, as "the 200 thickest/ha"; nothing where they are named by number."""
        if self.marked is not None:
            return f"trees marked {self.marked}"
        if self.thickest_ha is not None:
            return f"the {self.thickest_ha:g} thickest/ha"
        return "all trees" if self.all_trees else ""
