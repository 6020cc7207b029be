"""The file of a scene: a TOML table, checked when it is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, model_validator

from forest.species.schema import Refusal, Table, quantity, refusal
from forest.species.text import parse_toml, read_text
from forest.surface.feature_map import TREE_BITS

_Part = Annotated[float, Field(ge=0.0, le=1.0)]
_RGB = tuple[_Part, _Part, _Part]
_Length = Annotated[float, Field(gt=0.0, le=1e6)]
_Coordinate = Annotated[float, Field(ge=-1e8, le=1e8)]  # metres of any national grid
_Place = tuple[_Coordinate, _Coordinate]
_Point = tuple[_Coordinate, _Coordinate, _Coordinate]
_Pixels = Annotated[int, Field(ge=16, le=16384)]


class Terrain(Table):
    """The ground; level unless a file says otherwise."""

    heights: str | None = quantity(
        None,
        "file of heights beside the scene: .npy, .png or .asc; row 0 is the north edge",
        unit="",
    )
    size_m: tuple[_Length, _Length] = quantity(
        (100.0, 100.0), "width and depth of level ground", unit="m"
    )
    cell_m: float = quantity(1.0, "side of a cell of the file", unit="m", gt=0.0, le=1e5)
    origin_m: _Place = quantity((0.0, 0.0), "its south-west corner", unit="m")
    height_range_m: _Place = quantity(
        (0.0, 100.0), "heights of black and white in a .png", unit="m"
    )


class Features(Table):
    """The map of what may stand where."""

    map: str = quantity(
        ..., "file of 16 bits a cell: .png, .tif or .npy; row 0 is the north edge", unit=""
    )
    cell_m: float = quantity(1.0, "side of a cell", unit="m", gt=0.0, le=1e5)
    origin_m: _Place = quantity((0.0, 0.0), "its south-west corner", unit="m")


class Trees(Table):
    """Trees of one kind, spread over the cells of the map where their bit is set."""

    bit: int = quantity(..., "bit of the map", ge=0, lt=TREE_BITS)
    species: str | None = quantity(
        None, "parametric species, or a TOML file of one beside the scene", unit=""
    )
    run: str | None = quantity(None, "instead: a run file beside the scene", unit="")
    sample: int | None = quantity(None, "the sample tree of the run", ge=0)
    year: int | None = quantity(None, "its year; the last one if not given", unit="")
    per_ha: float = quantity(..., "trees per hectare of such cells", unit="1/ha", ge=0.0, le=1e6)
    least_distance_m: float = quantity(
        0.0, "no two of these trees stand nearer", unit="m", ge=0.0, le=1000.0
    )
    variants: int = quantity(3, "trees of other seeds that are mixed", ge=1, le=100)
    seed: int = quantity(0, "seed of the first variant", ge=0, le=2**62)
    most_leaves: int = quantity(
        20_000, "leaves of a tree at most; fewer are larger, their area in all stays", ge=1
    )
    scale_min: float = quantity(0.8, "least factor on the size", gt=0.0, le=100.0)
    scale_max: float = quantity(1.1, "greatest factor on the size", gt=0.0, le=100.0)

    @model_validator(mode="after")
    def _sound(self) -> Trees:
        if (self.species is None) == (self.run is None):
            raise Refusal("needs either species or run", key="species")
        if (self.run is None) != (self.sample is None):
            raise Refusal("run and sample belong together", key="sample")
        if self.scale_max < self.scale_min:
            raise Refusal("scale_max is less than scale_min", key="scale_max")
        return self


class Tree(Table):
    """A single tree."""

    x_m: float = quantity(..., "place", unit="m", ge=-1e8, le=1e8)
    y_m: float = quantity(..., "place", unit="m", ge=-1e8, le=1e8)
    species: str = quantity(..., "parametric species, or a TOML file of one", unit="")
    height_m: float | None = quantity(None, "height; its own if not given", unit="m", gt=0, le=300)
    seed: int = quantity(0, "each seed is another tree", ge=0, le=2**62)
    most_leaves: int = quantity(
        20_000, "leaves of a tree at most; fewer are larger, their area in all stays", ge=1
    )


class GrassTable(Table):
    """Grass of one code of the map; everywhere if there is no map."""

    code: int = quantity(1, "code of the map", ge=1, le=3)
    type: Literal["lawn", "meadow", "tall"] = quantity("meadow", "kind of grass", unit="")
    height_m: float | None = quantity(None, "length of blades", unit="m", gt=0.0, le=5.0)
    per_m2: float | None = quantity(None, "blades near the eye", unit="1/m2", ge=0.0, le=4000.0)
    curve: float | None = quantity(None, "how far tips hang out / length", ge=0.0, le=1.0)
    foot: _RGB | None = quantity(None, "colour at the foot", unit="")
    tip: _RGB | None = quantity(None, "colour at the tip", unit="")


class Sun(Table):
    """The sun."""

    azimuth_deg: float = quantity(
        225.0, "direction, from north clockwise", unit="degree", ge=-360.0, le=360.0
    )
    elevation_deg: float = quantity(42.0, "above the horizon", unit="degree", gt=0.0, le=90.0)


class HazeTable(Table):
    """The air."""

    visibility_m: float | None = quantity(
        None, "distance at which 1/e of a colour is left; clear air if not given",
        unit="m", gt=0.0, le=1e7,
    )  # fmt: skip
    colour: _RGB = quantity((0.78, 0.84, 0.90), "its colour, and the sky's at the horizon", unit="")


class CameraTable(Table):
    """The view; from before the south edge inwards if not given."""

    eye_m: _Point | None = quantity(
        None, "x and y of the eye, and its height above the ground", unit="m"
    )
    towards_m: _Point | None = quantity(None, "the same of what it looks at", unit="m")
    field_of_view_deg: float = quantity(50.0, "vertical angle", unit="degree", gt=0.0, lt=170.0)
    size_px: tuple[_Pixels, _Pixels] = quantity(
        (1200, 750), "width and height of the picture", unit="px"
    )


class SceneFile(Table):
    """A scene."""

    title: str = quantity("", "what it shows", unit="")
    seed: int = quantity(1, "of the places of trees and blades", ge=0, le=2**62)
    season: Literal["spring", "summer", "fall", "winter"] = quantity("summer", "season", unit="")
    quality: float = quantity(1.0, "how far off branches are drawn", gt=0.0, le=10.0)
    ground: _RGB = quantity((0.36, 0.33, 0.20), "colour of the ground between grass", unit="")
    terrain: Terrain = Terrain()
    features: Features | None = None
    trees: tuple[Trees, ...] = ()
    tree: tuple[Tree, ...] = ()
    grass: tuple[GrassTable, ...] = ()
    sun: Sun = Sun()
    haze: HazeTable = HazeTable()
    camera: CameraTable = CameraTable()

    @model_validator(mode="after")
    def _sound(self) -> SceneFile:
        if self.trees and self.features is None:
            raise Refusal("trees are spread over no map", key="trees", expected="[features] map")
        codes = [grass.code for grass in self.grass]
        if len(set(codes)) < len(codes):
            raise Refusal("two kinds of one code", key="grass", expected="a code for each")
        if self.grass and self.features is None and len(self.grass) > 1:
            raise Refusal("two kinds of grass without a map", key="grass", expected="one, or a map")
        return self

    @classmethod
    def load(cls, path: str | Path) -> SceneFile:
        """Read a scene's file.

        Raises
        ------
        InputError
            If it cannot be read or is no scene; the files that it names are not read yet.
        """
        path = Path(path)
        return cls.from_toml(read_text(path, where=path.name), where=path.name)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "scene") -> SceneFile:
        """Read a scene's text; `where` names it in messages."""
        table = parse_toml(text, where=where)
        try:
            return cls(**table)
        except ValidationError as error:
            raise refusal(error, cls, where=where) from None
