"""Strokes of the procedural brush (Palubicki et al. 2009, section 5): the keys of such an act."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from forest.scenario import files
from forest.scenario.model import Environment, Plot, Point
from forest.scenario.timing import Timing
from forest.species.schema import Refusal, Table, quantity

#: Markers that a stroke may lay, all its copies together.
MOST_MARKERS = 10_000_000
_MOST_STEPS = 10_000
#: How far beyond the plot a stroke may reach, m: farther than any tree leans out of it.
BEYOND_M = 100.0
_Corner = tuple[float, float]

_Radius = Annotated[float, Field(ge=1e-3, le=1000)]
_Count = Annotated[int, Field(ge=1, le=10_000)]


class Mirror(Table):
    """A mirror: an upright plane."""

    x_m: float = quantity(..., "a place on the plane, along x", unit="m", ge=-1e5, le=1e5)
    y_m: float = quantity(..., "the same along y", unit="m", ge=-1e5, le=1e5)
    normal_deg: float = quantity(
        0.0,
        "azimuth across the plane, from x (0) towards y (90); exact at multiples of 45",
        unit="degree",
        ge=-360,
        le=360,
    )


class Rotation(Table):
    """Turns about an upright axis."""

    x_m: float = quantity(..., "place of the axis along x", unit="m", ge=-1e5, le=1e5)
    y_m: float = quantity(..., "place of the axis along y", unit="m", ge=-1e5, le=1e5)
    times: int = quantity(
        ...,
        "equal turns that make a full one; exact are quarter and half turns",
        unit="",
        ge=2,
        le=360,
    )


class Tiling(Table):
    """Copies shifted along one to three vectors."""

    shifts_m: tuple[Point, ...] = quantity(
        ..., "vectors from one copy to the next", unit="m", min_length=1, max_length=3
    )
    counts: tuple[_Count, ...] = quantity(
        ..., "copies along each, the first included", unit="", min_length=1, max_length=3
    )

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        if len(self.counts) != len(self.shifts_m):
            raise Refusal(
                f"{len(self.counts)} for {len(self.shifts_m)} shifts_m",
                key="counts",
                expected="one for each",
            )
        return self


class Stroking(Table):
    """A stroke of the brush, without its time."""

    points_m: tuple[Point, ...] = quantity(
        (),
        "path of the brush, or the name of a CSV file with columns x_m, y_m, z_m and perhaps "
        "radius_m (its points are kept here)",
        unit="m",
        max_length=100_000,
    )
    radius_m: tuple[_Radius, ...] = quantity(
        ...,
        "radius of the brush (pen pressure), one or one per point",
        unit="m",
        max_length=100_000,
    )
    spacing_m: float | None = quantity(
        None,
        "edge of the cells that get one marker each; default: markers.spacing_m",
        unit="m",
        ge=0.005,
        le=10,
    )
    markers_m3: float | None = quantity(
        None, "in place of it: markers per cubic metre", unit="1/m3", gt=0, le=8e6
    )
    steps: int = quantity(
        1,
        "years in which the brush moves along its path: part k of equal length is laid before "
        "the k-th of them",
        unit="year",
        ge=1,
        le=_MOST_STEPS,
    )
    hold_steps: int = quantity(
        0,
        "further years in which growth is constrained; needs `metamer`",
        unit="year",
        ge=0,
        le=_MOST_STEPS,
    )
    tree_id: int | None = quantity(
        None, "the tree of metamer and from_metamer", unit="", ge=1, le=2**31 - 1
    )
    metamer: int | None = quantity(
        None,
        "serial number of a metamer of the tree: while the stroke lasts its buds and what comes of "
        "them grow alone, all other buds of the tree stay dormant",
        unit="",
        ge=0,
        le=2**31 - 1,
    )
    bud: Literal["terminal", "lateral"] | None = quantity(
        None, "one of that metamer's two buds, with what comes of it; default: both", unit=""
    )
    from_metamer: int | None = quantity(
        None,
        "serial number of a metamer of the tree: the path begins at its upper end, before points_m",
        unit="",
        ge=0,
        le=2**31 - 1,
    )
    mirror: Mirror | None = quantity(None, "lay the stroke's mirror image, too", unit="")
    rotation: Rotation | None = quantity(
        None, "lay it all round an axis, its mirror image included", unit=""
    )
    tiling: Tiling | None = quantity(None, "lay all that again, shifted", unit="")

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("points_m"), str):
            return data
        try:
            points, radii = files.read_stroke(data["points_m"], info.context)
        except Refusal as error:
            raise Refusal(error.what, key="points_m", expected=error.expected) from None
        if radii is not None and "radius_m" in data:
            raise Refusal(
                f"given beside the column radius_m of {data['points_m']!r}",
                key="radius_m",
                expected="one of them",
            )
        given = {} if radii is None else {"radius_m": tuple(radii)}
        return {**data, "points_m": tuple(points), **given}

    @field_validator("radius_m", mode="before")
    @classmethod
    def _one_for_all(cls, radius: Any) -> Any:
        if isinstance(radius, int | float) and not isinstance(radius, bool):
            return (float(radius),)
        return radius

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        n = len(self.points_m)
        if not n and self.from_metamer is None:
            raise Refusal("no point", key="points_m", expected="at least one, or from_metamer")
        if len(self.radius_m) not in (1, n):
            raise Refusal(
                f"{len(self.radius_m)} for {n} points",
                key="radius_m",
                expected="one, or one per point",
            )
        if self.spacing_m is not None and self.markers_m3 is not None:
            raise Refusal("given beside spacing_m", key="markers_m3", expected="one of them")
        of_tree = [key for key in ("metamer", "from_metamer") if getattr(self, key) is not None]
        if of_tree and self.tree_id is None:
            raise Refusal("missing key 'tree_id'", expected=f"the tree of {of_tree[0]}")
        if self.tree_id is not None and not of_tree:
            raise Refusal(
                "given alone", key="tree_id", expected="metamer or from_metamer beside it"
            )
        if self.metamer is None:
            for key, idle in (("bud", None), ("hold_steps", 0)):
                if getattr(self, key) != idle:
                    raise Refusal("given without metamer", key=key, expected="metamer beside it")
        if self.steps > 1 and n + (self.from_metamer is not None) < 2:
            raise Refusal(
                f"{self.steps} for one point", key="steps", expected="1, or a path of two points"
            )
        return self

    @property
    def ids(self) -> tuple[int, ...]:
        """The tree that it names, if any."""
        return () if self.tree_id is None else (self.tree_id,)

    @property
    def ids_key(self) -> str:
        """The key that names the tree."""
        return "tree_id"

    @property
    def copies(self) -> int:
        """How often the symmetries lay the stroke."""
        n = 2 if self.mirror is not None else 1
        n *= self.rotation.times if self.rotation is not None else 1
        return n * (math.prod(self.tiling.counts) if self.tiling is not None else 1)

    def cell_m(self, default: float) -> float:
        """Edge of the cells that hold a marker each, m; `default` where it does not say."""
        if self.markers_m3 is not None:
            return float(self.markers_m3 ** (-1.0 / 3.0))
        return default if self.spacing_m is None else self.spacing_m

    @property
    def in_words(self) -> str:
        """Say what is done."""
        times = f" {self.copies} times" if self.copies > 1 else ""
        over = f" over {self.steps} years" if self.steps > 1 else ""
        held = ""
        if self.metamer is not None:
            held = f" for metamer {self.metamer} of tree {self.tree_id} alone"
        return f"lay a stroke{times}{held}{over}"


class Stroke(Stroking, Timing):
    """Lay markers along the path of a brush."""

    kind: Literal["stroke"] = quantity("stroke", "kind of act", unit="")


def check_strokes(acts: Sequence[Timing], environment: Environment, plot: Plot) -> None:
    """Refuse strokes that nothing can perceive, or of more markers than fit."""
    for i, act in enumerate(acts):
        if isinstance(act, Stroke):
            check_stroke(act, f"acts[{i}]", environment, plot)


def check_stroke(
    stroke: Stroking,
    key: str,
    environment: Environment,
    plot: Plot,
    path: Sequence[Point] | None = None,
) -> None:
    """Refuse a stroke that does not fit the environment and the plot.

    Parameters
    ----------
    stroke : Stroking
    key : str
        Where it stands.
    environment : Environment
    plot : Plot
    path : sequence of points, optional
        The whole path, m, where it is known; default: `points_m`.
    """
    if environment.markers is None:
        raise Refusal("no bud perceives markers", key=key, expected="a table environment.markers")
    start = f"{key}." if key else ""
    if stroke.copies > MOST_MARKERS:
        raise Refusal(
            f"{stroke.copies:,} copies", key=f"{start}tiling", expected=f"at most {MOST_MARKERS:,}"
        )
    path = stroke.points_m if path is None else path
    cell = stroke.cell_m(environment.markers.spacing_m)
    wide = max(max(stroke.radius_m), cell)  # a path costs its cells, if it is ever so thin
    length = sum(math.dist(a, b) for a, b in pairwise(path))
    volume = math.pi * wide**2 * (length + 4.0 / 3.0 * wide)  # of the union, at most
    markers = volume / cell**3 * stroke.copies
    if markers > MOST_MARKERS:
        name = "markers_m3" if stroke.markers_m3 is not None else "radius_m"
        raise Refusal(
            f"up to {markers:.3g} markers",
            key=f"{start}{name}",
            expected=f"at most {MOST_MARKERS:,}, by less length, volume or copies, or more spacing",
        )
    if path:
        _check_near(stroke, start, plot, path)


def _check_near(stroke: Stroking, start: str, plot: Plot, path: Sequence[Point]) -> None:
    """Refuse a stroke, or a copy of it, that no tree of the plot can reach."""
    radius = max(stroke.radius_m)
    up = 0.0
    for key, corners in _extents(stroke, path):
        for x, y in corners:
            for at, size in ((x, plot.size_m[0]), (y, plot.size_m[1])):
                if not -BEYOND_M <= at <= size + BEYOND_M:
                    raise Refusal(
                        f"reaches to ({x:g}, {y:g})",
                        key=f"{start}{key}",
                        expected=f"places on the plot, or within {BEYOND_M:g} m of it",
                    )
    if stroke.tiling is not None:
        for shift, n in zip(stroke.tiling.shifts_m, stroke.tiling.counts, strict=True):
            up += max(0.0, shift[2] * (n - 1))
    if max(z for _, _, z in path) + up + radius < 0.0:
        raise Refusal("lies below the ground", key=f"{start}points_m", expected="a place above it")


def _extents(stroke: Stroking, path: Sequence[Point]) -> Iterator[tuple[str, list[_Corner]]]:
    """List the corners, along x and y, of the path and of what each symmetry makes of it."""
    sides = [(min(v), max(v)) for v in list(zip(*path, strict=True))[:2]]
    corners = list(product(*sides))
    yield "points_m", corners
    if stroke.mirror is not None:
        m = stroke.mirror
        a = 2.0 * math.radians(m.normal_deg)
        c, s = math.cos(a), math.sin(a)
        away = [(x - m.x_m, y - m.y_m) for x, y in corners]
        corners += [(m.x_m - c * x - s * y, m.y_m - s * x + c * y) for x, y in away]
        yield "mirror", corners
    if stroke.rotation is not None:
        r = stroke.rotation
        turns = [2.0 * math.pi * k / r.times for k in range(r.times)]
        cosines = [(math.cos(a), math.sin(a)) for a in turns]
        away = [(x - r.x_m, y - r.y_m) for x, y in corners]
        corners = [
            (r.x_m + c * x - s * y, r.y_m + s * x + c * y) for c, s in cosines for x, y in away
        ]
        yield "rotation", corners
    if stroke.tiling is not None:
        for (dx, dy, _), n in zip(stroke.tiling.shifts_m, stroke.tiling.counts, strict=True):
            corners += [(x + dx * (n - 1), y + dy * (n - 1)) for x, y in corners]
        yield "tiling", corners
