"""Parts of a plot, seen from above: where a gap is cut or trees are planted."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from forest.species.schema import Refusal, Table, quantity

_Place = Annotated[float, Field(ge=-10000, le=10000)]
_Length = Annotated[float, Field(gt=0, le=10000)]

#: A polygon no wider than this is a line.
_LEAST_WIDTH_M = 1e-6
#: On a periodic plot a region may reach so many edges of the plot.
_MOST_EDGES = 3.0


class _Centred(Table):
    kind: str = quantity("", "shape", unit="")
    x_m: _Place = quantity(..., "its middle, along x", unit="m")
    y_m: _Place = quantity(..., "its middle, along y", unit="m")


def _azimuth(what: str) -> float:
    azimuth: float = quantity(
        0.0, f"direction of {what}, from x (0) towards y (90)", unit="degree", ge=-360, le=360
    )
    return azimuth


class Circle(_Centred):
    """A circle."""

    kind: Literal["circle"] = quantity("circle", "shape", unit="")
    radius_m: _Length = quantity(..., "radius", unit="m")


class Ellipse(_Centred):
    """An ellipse."""

    kind: Literal["ellipse"] = quantity("ellipse", "shape", unit="")
    size_m: tuple[_Length, _Length] = quantity(
        ..., "its first and second axis, whole lengths", unit="m"
    )
    azimuth_deg: float = _azimuth("the first axis")


class Rectangle(_Centred):
    """A rectangle."""

    kind: Literal["rectangle"] = quantity("rectangle", "shape", unit="")
    size_m: tuple[_Length, _Length] = quantity(..., "its edges", unit="m")
    azimuth_deg: float = _azimuth("the first edge")


class Strip(_Centred):
    """A strip from edge to edge of the plot, such as a road; the point lies on its middle line."""

    kind: Literal["strip"] = quantity("strip", "shape", unit="")
    width_m: _Length = quantity(..., "width", unit="m")
    azimuth_deg: float = _azimuth("the strip")


class Polygon(Table):
    """A polygon."""

    kind: Literal["polygon"] = quantity("polygon", "shape", unit="")
    points_m: tuple[tuple[_Place, _Place], ...] = quantity(
        ..., "its corners in order", unit="m", min_length=3, max_length=10000
    )

    @model_validator(mode="after")
    def _has_area(self) -> Polygon:
        x0, y0 = self.points_m[0]
        sides = [(x - x0, y - y0) for x, y in self.points_m]
        dx, dy = max(sides, key=lambda side: math.hypot(*side))
        if max(abs(dx * y - dy * x) for x, y in sides) <= _LEAST_WIDTH_M * math.hypot(dx, dy):
            raise Refusal(
                "has no area", key="points_m", expected="corners that do not all lie on one line"
            )
        return self


Region = Annotated[
    Circle | Ellipse | Rectangle | Strip | Polygon,
    Field(discriminator="kind"),
]


def reach_m(region: Region) -> tuple[float, float, float, float]:
    """Give the least rectangle that surely holds a region: x and y from, x and y to, m.

    That of a strip holds its point alone.
    """
    if isinstance(region, Polygon):
        x, y = zip(*region.points_m, strict=True)
        return min(x), min(y), max(x), max(y)
    if isinstance(region, Circle):
        reach = region.radius_m
    elif isinstance(region, Ellipse | Rectangle):
        reach = 0.5 * (region.size_m[0] ** 2 + region.size_m[1] ** 2) ** 0.5
    else:
        reach = 0.0
    return region.x_m - reach, region.y_m - reach, region.x_m + reach, region.y_m + reach


def check_region(region: Region, size_m: tuple[float, float], periodic: bool, key: str) -> None:
    """Refuse a region that lies beside the plot, or wraps too often around it."""
    low_x, low_y, high_x, high_y = reach_m(region)
    width, depth = size_m
    if low_x > width or high_x < 0 or low_y > depth or high_y < 0:
        raise Refusal(
            "lies beside the plot",
            key=key,
            expected=f"a place within 0 to {width:g} and 0 to {depth:g} m",
        )
    if periodic and max((high_x - low_x) / width, (high_y - low_y) / depth) > _MOST_EDGES:
        raise Refusal(
            "is much larger than the plot",
            key=key,
            expected=f"at most {_MOST_EDGES:g} edges of a periodic plot",
        )
