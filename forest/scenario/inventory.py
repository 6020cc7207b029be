"""Measured trees that a stand starts from: what a scenario says of them, and their height curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from forest.species.schema import Refusal, Table, quantity

#: Height at which dbh is measured, m.
BREAST_HEIGHT_M = 1.3
#: A height curve is fitted to this many trees at least.
LEAST_FOR_CURVE = 3

_Parameter = Annotated[float, Field(ge=-1e3, le=1e3)]


class InventoryTree(Table):
    """One measured tree."""

    x_m: float = quantity(..., "position along x", unit="m", ge=0, le=10000)
    y_m: float = quantity(..., "position along y", unit="m", ge=0, le=10000)
    species: str = quantity(
        "", "a species of the scenario; may be left out where there is one", unit=""
    )
    dbh_cm: float | None = quantity(
        None, "diameter over bark at 1.3 m; none for a tree below that height", unit="cm", gt=0
    )
    height_m: float | None = quantity(
        None, "height; default: from the height curve", unit="m", ge=0.05, le=150
    )
    crown_base_m: float | None = quantity(
        None,
        "height of the lowest living leaves; default: whatever such trees have",
        unit="m",
        ge=0,
    )
    age: int | None = quantity(
        None, "years since it germinated; default: as the model needs", unit="year", ge=1, le=5000
    )
    line: int = quantity(0, "line of the file that it was read from", unit="", ge=0)

    @model_validator(mode="after")
    def _is_a_tree(self) -> InventoryTree:
        if self.height_m is None and self.dbh_cm is None:
            raise Refusal("neither dbh nor height", key="height_m", expected="one of them")
        if self.height_m is None:
            return self
        if self.dbh_cm is not None and self.height_m < BREAST_HEIGHT_M:
            raise Refusal(
                f"{self.dbh_cm:g} cm, but the tree of {self.height_m:g} m does not reach 1.3 m",
                key="dbh_cm",
                expected="none below 1.3 m",
            )
        if self.dbh_cm is None and self.height_m > BREAST_HEIGHT_M:
            raise Refusal(
                f"none, but the tree is {self.height_m:g} m high",
                key="dbh_cm",
                expected="a dbh of every tree above 1.3 m",
            )
        if self.crown_base_m is not None and self.crown_base_m > self.height_m:
            raise Refusal(
                f"{self.crown_base_m:g} is above the tree, which is {self.height_m:g} m high",
                key="crown_base_m",
            )
        return self


class Inventory(Table):
    """Measured trees; the model builds trees of that size and goes on from there."""

    kind: Literal["inventory"] = quantity("inventory", "kind of planting", unit="")
    file: str = quantity(
        "",
        "CSV with columns x_m, y_m, dbh_cm and height_m, perhaps species, crown_base_m and age; "
        "relative to the scenario; its trees are kept here",
        unit="",
    )
    species: str = quantity("", "species of trees that name none", unit="")
    height_curve: dict[str, tuple[_Parameter, _Parameter]] = quantity(
        {},
        "a and b of h = 1.3 + (d / (a + b d))^2, d in cm, by species; default: fitted to the trees "
        "whose height is known",
        unit="",
        max_length=200,
    )
    trees: tuple[InventoryTree, ...] = quantity(
        (),
        "the trees; they are read from the file if there are none",
        unit="",
        max_length=1_000_000,
    )


def fit_height_curve(
    dbh_cm: Sequence[float], height_m: Sequence[float]
) -> tuple[float, float] | None:
    """Fit Näslund's height curve to measured trees by least squares of its straight form.

    h = 1.3 + (d / (a + b d))^2, so that d / sqrt(h - 1.3) = a + b d (Näslund 1936).

    Parameters
    ----------
    dbh_cm, height_m : sequences of float
        Trees above 1.3 m.

    Returns
    -------
    (a, b) or None
        None if there are fewer than three trees or two diameters, or if the curve that fits best
        does not rise towards a greatest height.
    """
    d = np.asarray(dbh_cm, np.float64)
    h = np.asarray(height_m, np.float64)
    if len(d) < LEAST_FOR_CURVE or np.ptp(d) == 0.0:
        return None
    b, a = np.polyfit(d, d / np.sqrt(h - BREAST_HEIGHT_M), 1)
    return (float(a), float(b)) if a > 0.0 and b > 0.0 else None


def curve_height(dbh_cm: float, curve: tuple[float, float]) -> float:
    """Give the height of a tree of some dbh on Näslund's curve, m."""
    a, b = curve
    return BREAST_HEIGHT_M + float((dbh_cm / (a + b * dbh_cm)) ** 2)


def inventory_places(
    trees: Sequence[InventoryTree], names: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Give x, y and the index of the species of each tree."""
    return (
        np.array([tree.x_m for tree in trees]),
        np.array([tree.y_m for tree in trees]),
        np.array([names.index(tree.species) for tree in trees], np.int64),
    )
