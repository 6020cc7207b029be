"""Acts that mark trees, bend branches, crack bark, and put up, move and take away obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from pydantic import model_validator

from forest.errors import nearest
from forest.scenario.choosing import ChosenTrees, Id, Word
from forest.scenario.model import FARTHEST_M, Obstacle, Point
from forest.scenario.timing import Timing
from forest.species.schema import Refusal, Table, quantity


class Marking(ChosenTrees):
    """Which trees are marked, and with what word."""

    mark: Word = quantity(..., 'a short word, as "crop", "fell", "habitat"', unit="")

    @property
    def in_words(self) -> str:
        """Say what is done."""
        return f"mark {self.trees_in_words or 'trees'} {self.mark!r}"


class Mark(Marking, Timing):
    """Mark trees with a word, by which later acts can name them; a tree may bear several."""

    kind: Literal["mark"] = quantity("mark", "kind of act", unit="")


class Bending(Table):
    """Which branch is bent, and where to."""

    tree_id: Id = quantity(..., "the tree", unit="")
    metamer: int = quantity(
        ...,
        "serial number of a metamer of the tree: its axis is bent from its start up to there",
        unit="",
        ge=0,
        le=2**31 - 1,
    )
    to_m: Point = quantity(
        ...,
        "where the metamer's upper end shall go; it goes as near as its length allows, and joints "
        "that turn by 20 degrees at most",
        unit="m",
    )

    @property
    def in_words(self) -> str:
        """Say what is done."""
        return "bend"


class Bend(Bending, Timing):
    """Bend a branch or a stem, and tie it: it keeps the shape."""

    kind: Literal["bend"] = quantity("bend", "kind of act", unit="")


class Cracking(Table):
    """Where on a stem the bark is torn."""

    tree_id: Id = quantity(..., "the tree", unit="")
    height_m: float = quantity(
        ..., "height above the stem's foot, within the tree", unit="m", ge=0, le=200
    )
    azimuth_deg: float = quantity(
        ...,
        "side of the stem: azimuth from x (0) towards y (90)",
        unit="degree",
        ge=-360,
        le=360,
    )

    @property
    def in_words(self) -> str:
        """Say what is done."""
        return "crack"


class Crack(Cracking, Timing):
    """Start a fracture in the bark of a stem; growth does not heed it."""

    kind: Literal["crack"] = quantity("crack", "kind of act", unit="")


class ObstacleChange(Table):
    """One obstacle that comes, moves or goes."""

    add: Obstacle | None = quantity(None, "an obstacle to put up; it needs a name", unit="")
    move: str | None = quantity(None, "name of an obstacle to move", unit="", max_length=60)
    by_m: Point | None = quantity(None, "by how much it is moved", unit="m")
    remove: str | None = quantity(None, "name of an obstacle to take away", unit="", max_length=60)

    @model_validator(mode="after")
    def _one_change(self) -> Self:
        ways = ("add", "move", "remove")
        given = [key for key in ways if getattr(self, key) is not None]
        if len(given) != 1:
            what = " and ".join(given) + " exclude each other" if given else "nothing to do"
            raise Refusal(what, expected="one of " + ", ".join(ways))
        if self.add is not None and not self.add.name:
            raise Refusal("missing key 'name'", key="add", expected="a name of its own")
        if (self.move is None) != (self.by_m is None):
            what = "given without move" if self.move is None else "missing"
            raise Refusal(what, key="by_m", expected="move and by_m together")
        return self

    @property
    def target(self) -> str:
        """The name of the obstacle."""
        return self.add.name if self.add is not None else self.move or self.remove or ""

    @property
    def in_words(self) -> str:
        """Say what is done."""
        verb = "put up" if self.add is not None else "move" if self.move else "remove"
        return f"{verb} {self.target}"

    def applied(self, obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
        """Give the obstacles after it.

        Raises
        ------
        Refusal
            If there is no such obstacle, or one of that name already.
        """
        names = [o.name for o in obstacles if o.name]
        if self.add is not None:
            if self.add.name in names:
                raise Refusal(
                    f"there is an obstacle {self.add.name!r} already",
                    key="add.name",
                    expected="a name of its own",
                )
            return (*obstacles, self.add)
        if self.target not in names:
            hint = nearest(self.target, names) if names else "no obstacle has a name"
            key = "move" if self.move is not None else "remove"
            raise Refusal(f"no obstacle {self.target[:60]!r}, {hint}", key=key)
        if self.by_m is None:
            return tuple(o for o in obstacles if o.name != self.target)
        by = self.by_m
        after = tuple(o.moved(by) if o.name == self.target else o for o in obstacles)
        for o in after:
            places = (*o.min_m, *o.max_m) if o.kind == "box" else o.at_m
            if max(map(abs, places)) > FARTHEST_M:
                raise Refusal(
                    f"{self.target!r} would be moved too far",
                    key="by_m",
                    expected=f"places within {FARTHEST_M:g} m",
                )
        return after


class ChangeObstacle(ObstacleChange, Timing):
    """Put up an obstacle, move it or take it away; what grows where it comes is cut off."""

    kind: Literal["obstacle"] = quantity("obstacle", "kind of act", unit="")


def check_shaping(acts: Sequence[Timing], obstacles: Sequence[Obstacle]) -> None:
    """Refuse marks that no act gives, and obstacles that never stand."""
    words = {act.mark for act in acts if isinstance(act, Mark)}
    names: dict[str, int] = {}
    for i, obstacle in enumerate(obstacles):
        if obstacle.name and obstacle.name in names:
            raise Refusal(
                f"{obstacle.name!r} is the name of obstacles[{names[obstacle.name]}]",
                key=f"obstacles[{i}].name",
                expected="a name of its own",
            )
        names[obstacle.name] = i
    known = {name for name in names if name} | {
        act.add.name for act in acts if isinstance(act, ChangeObstacle) and act.add is not None
    }
    for i, act in enumerate(acts):
        word = getattr(act, "marked", None)
        if word is not None and word not in words:
            hint = nearest(word, words) if words else "no act marks trees"
            raise Refusal(f"no act marks trees {word[:60]!r}, {hint}", key=f"acts[{i}].marked")
        if isinstance(act, ChangeObstacle) and act.target not in known:
            hint = nearest(act.target, known) if known else "no obstacle has a name"
            key = "move" if act.move is not None else "remove"
            raise Refusal(f"no obstacle {act.target[:60]!r}, {hint}", key=f"acts[{i}].{key}")
