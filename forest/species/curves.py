"""Curves in species files: points that a piecewise linear function goes through."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator, Field

from forest.species.schema import Refusal


def _ascending(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    for (before, _), (after, _) in pairwise(points):
        if after <= before:
            raise Refusal("the x of a curve does not rise", expected="points [x, y], x ascending")
    return points


_Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
#: A piecewise linear curve: points (x, y), x ascending; constant beyond its ends; empty = off.
Curve = Annotated[tuple[tuple[_Coordinate, _Coordinate], ...], AfterValidator(_ascending)]
_Factor = Annotated[float, Field(ge=0.05, le=20)]
#: A curve of factors that must not vanish.
FactorCurve = Annotated[tuple[tuple[_Coordinate, _Factor], ...], AfterValidator(_ascending)]
_Share = Annotated[float, Field(ge=0, le=5)]
#: A curve of shares of a mean year; they may vanish.
ShareCurve = Annotated[tuple[tuple[_Coordinate, _Share], ...], AfterValidator(_ascending)]
