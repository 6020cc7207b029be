"""The tables of a scenario: what a scenario file may say."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationInfo, field_validator, model_validator

from forest.scenario import files
from forest.scenario.inventory import Inventory
from forest.species.model import Species
from forest.species.schema import Refusal, Table, quantity

#: No place is farther from the plot's corner along any axis, m.
FARTHEST_M = 1e5
Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Point = tuple[Coordinate, Coordinate, Coordinate]
_Edge = Annotated[float, Field(ge=0.5, le=10000)]
_Spacing = Annotated[float, Field(ge=0.05, le=10000)]
_Extent = Annotated[float, Field(gt=0, le=1e5)]
_DiscHeight = Annotated[float, Field(gt=0, le=150)]
_Quantile = Annotated[float, Field(ge=0, le=1)]
_Id = Annotated[int, Field(ge=1, le=2**31 - 1)]
_TableName = Literal[
    "trees",
    "stand",
    "events",
    "rings",
    "carbon",
    "stability",
    "climate",
    "deadwood",
    "regeneration",
    "treatments",
    "storms",
    "residual",
]


class Plot(Table):
    """The rectangle on which trees stand; its corner is at (0, 0)."""

    size_m: tuple[_Edge, _Edge] = quantity(..., "edges along x and y", unit="m")
    boundary: Literal["periodic", "open"] = quantity(
        "open", "periodic: what leaves at one edge comes in at the opposite one", unit=""
    )


class Site(Table):
    """Where the plot lies and how good its soil is."""

    productivity: float = quantity(1.0, "factor on every tree's income", ge=0.05, le=10)
    latitude_deg: float = quantity(
        50.0, "geographic latitude; sets the sun's path", unit="degree", ge=-75, le=75
    )


class Growth(Table):
    """Which rules decide the fate of buds."""

    bud_fate: Literal["borchert_honda", "priority", "balance"] = quantity(
        "borchert_honda",
        "how buds share what there is to grow: by light and apical control (Palubicki et al. 2009, "
        "4.2), or by the growth rates that keep the tree in balance, within what its limbs can "
        "support (Hart and Baker 2003, 4.1)",
        unit="",
    )


class Mechanics(Table):
    """How trees bend and stand; nothing bends where this table is not given."""

    bending: bool = quantity(
        True,
        "branches and stems bend under their weight, and rings keep the shape (Taylor-Hell 2005)",
        unit="",
    )
    righting: Literal["strain", "beta", "none"] = quantity(
        "strain",
        "how reaction wood rights what leans: by the strain with which it matures, by rest "
        "curvature as printed (Taylor-Hell 2005, eq. 19), or not at all",
        unit="",
    )
    tolerance_rad: float = quantity(
        1e-4, "turn of a metamer that may be left to equilibrium", unit="rad", ge=1e-9, le=0.1
    )
    wind_m_s: float = quantity(
        0.0,
        "usual mean wind of a storm at the top of an open canopy, for which stresses are told",
        unit="m/s",
        ge=0,
        le=100,
    )
    wind_growth: bool = quantity(
        False,
        "stems that this wind stresses beyond wind_stress_limit thicken first and grow less long",
        unit="",
    )

    @model_validator(mode="after")
    def _wind_blows(self) -> Mechanics:
        if self.wind_growth and self.wind_m_s == 0.0:
            raise Refusal("wind_growth needs a wind", key="wind_m_s", expected="above 0, m/s")
        return self


class Shadow(Table):
    """Light near a bud: shadow propagation (Palubicki et al. 2009, 4.1)."""

    a: float = quantity(0.05, "shadow of a bud in its own voxel (a)", gt=0, le=10)
    b: float = quantity(2.0, "a shadow weakens by this factor per layer (b)", gt=1, le=100)
    q_max: int = quantity(6, "depth of the shadow (q_max)", unit="voxel", ge=0, le=16)
    full_light: float = quantity(1.0, "light of an unshaded bud (C)", gt=0, le=100)
    voxel_m: float = quantity(0.2, "edge of a voxel", unit="m", ge=0.02, le=5)
    direction: Literal["gradient", "least_shadow"] = quantity(
        "gradient",
        "best direction of growth: against the shadow's gradient, or to the least shadowed "
        "voxel of the perception volume",
        unit="",
    )


class Canopy(Table):
    """Light far above a bud: Beer-Lambert transmission through the stand's leaves."""

    voxel_m: float = quantity(
        1.0, "edge of a voxel; a whole multiple of shadow.voxel_m", unit="m", ge=0.1, le=20
    )
    extinction: float = quantity(0.5, "extinction coefficient (k)", ge=0, le=2)
    sky_directions: int = quantity(17, "directions that stand for the sky", ge=1, le=256)
    sun_positions: int = quantity(8, "positions of the sun over the season", ge=1, le=256)
    diffuse_share: float = quantity(0.5, "share of diffuse light above the canopy", ge=0, le=1)


class Rendered(Table):
    """Light as in pictures taken from the sun or the sky (Hart and Baker 2003, 4.1)."""

    pixel_m: float = quantity(
        0.05, "edge of a picture's pixel on the ground", unit="m", ge=0.005, le=5
    )
    directions: int = quantity(1, "pictures a year, each from its own direction", ge=1, le=256)
    sun_share: float = quantity(
        0.8, "probability that a picture is taken from the sun, else from the sky", ge=0, le=1
    )
    lowest_deg: float = quantity(
        10.0, "least height of sun and sky above the horizon", unit="degree", ge=1, le=30
    )
    response: Literal["linear", "flat_above_20"] = quantity(
        "linear", "flat_above_20: a fifth of full light is as good as all of it", unit=""
    )
    clearing_radius_m: float | None = quantity(
        None,
        "light comes only through a clearing of this radius around the plot's centre; "
        "default: from everywhere",
        unit="m",
        gt=0,
        le=1e5,
    )
    clearing_height_m: float | None = quantity(
        None, "height of the wall around the clearing", unit="m", gt=0, le=1000
    )

    @model_validator(mode="after")
    def _clearing_is_whole(self) -> Rendered:
        if (self.clearing_radius_m is None) != (self.clearing_height_m is None):
            key = "clearing_radius_m" if self.clearing_radius_m is None else "clearing_height_m"
            raise Refusal("not given", key=key, expected="radius and height of a clearing, or none")
        return self


class Envelope(Table):
    """A volume to which markers are confined."""

    shape: Literal["ellipsoid", "cylinder", "box"] = quantity(
        ..., "shape; a cylinder stands upright", unit=""
    )
    center_m: Point = quantity(..., "centre", unit="m")
    size_m: tuple[_Extent, _Extent, _Extent] = quantity(
        ..., "whole extents along x, y and z", unit="m"
    )


class Markers(Table):
    """Space colonization: markers of free space (Palubicki et al. 2009, 4.1)."""

    spacing_m: float = quantity(
        0.2, "edge of the cells that hold one jittered marker each", unit="m", ge=0.01, le=10
    )
    release: bool = quantity(
        True,
        "a marker is free again when the site that took it dies; false where it is not given "
        "in paper mode",
        unit="",
    )
    envelope: tuple[Envelope, ...] = quantity(
        (),
        "procedural markers exist only inside these volumes; empty = as `everywhere` says",
        unit="",
        max_length=1000,
    )
    everywhere: bool = quantity(
        True,
        "without an envelope procedural markers are everywhere; false: there are only those "
        "of envelopes, clouds and strokes",
        unit="",
    )
    clouds: tuple[Point, ...] = quantity(
        (),
        "further markers as points, or names of CSV files with columns x_m, y_m, z_m (their "
        "points are kept here)",
        unit="m",
        max_length=10_000_000,
    )

    @field_validator("clouds", mode="before")
    @classmethod
    def _read_clouds(cls, clouds: Any, info: ValidationInfo) -> Any:
        if not isinstance(clouds, tuple | list):
            return clouds
        points: list[Any] = []
        for cloud in clouds:
            points += files.read_cloud(cloud, info.context) if isinstance(cloud, str) else [cloud]
        return tuple(points)


class Environment(Table):
    """How buds learn of light and space; at least one of the tables."""

    shadow: Shadow | None = None
    canopy: Canopy | None = None
    markers: Markers | None = None
    rendered: Rendered | None = None

    @model_validator(mode="after")
    def _some_fit_together(self) -> Environment:
        if all(part is None for _, part in self):
            raise Refusal("empty", expected="a table shadow, canopy, markers or rendered")
        if self.rendered is not None and (self.shadow is not None or self.canopy is not None):
            other = "shadow" if self.shadow is not None else "canopy"
            raise Refusal(
                f"a leaf would be shaded twice, by rendered and by {other}",
                key="rendered",
                expected="rendered alone or with markers",
            )
        if self.shadow is not None and self.canopy is not None:
            ratio = self.canopy.voxel_m / self.shadow.voxel_m
            if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
                nearest_fit = max(round(ratio), 1) * self.shadow.voxel_m
                raise Refusal(
                    f"{self.canopy.voxel_m:g} is not a whole multiple of shadow.voxel_m = "
                    f"{self.shadow.voxel_m:g}",
                    key="canopy.voxel_m",
                    expected=f"for example {nearest_fit:g}",
                )
        return self


class SpeciesUse(Species):
    """A species of the scenario: a shipped one, its overrides and its share of the mix."""

    share: float = quantity(1.0, "weight in the mix of regular and random planting", ge=0, le=1e6)
    base: str = quantity("", "shipped species it is made from; default: its own name", unit="")


class PlantedTree(Table):
    """One tree of an explicit planting."""

    x_m: float = quantity(..., "position along x", unit="m", ge=0, le=10000)
    y_m: float = quantity(..., "position along y", unit="m", ge=0, le=10000)
    species: str = quantity(
        "", "a species of the scenario; may be left out where there is one", unit=""
    )
    lean_deg: float = quantity(
        0.0, "angle between the seedling's stem and the vertical", unit="degree", ge=0, le=85
    )
    lean_azimuth_deg: float = quantity(
        0.0, "direction towards which it leans, from x to y", unit="degree", ge=-360, le=360
    )


class Explicit(Table):
    """Trees at given places."""

    kind: Literal["explicit"] = quantity("explicit", "kind of planting", unit="")
    trees: tuple[PlantedTree, ...] = quantity(
        ...,
        "the trees; none = bare ground, where a table regeneration brings seeds",
        unit="",
        max_length=1_000_000,
    )


class StemMap(Table):
    """Trees at the places of a CSV file; becomes an explicit planting when it is read."""

    kind: Literal["stem_map"] = quantity("stem_map", "kind of planting", unit="")
    file: str = quantity(
        ..., "CSV with columns x_m, y_m and perhaps species; relative to the scenario", unit=""
    )
    species: str = quantity("", "species of rows that name none", unit="")


class Regular(Table):
    """Trees in rows; the species are drawn by share."""

    kind: Literal["regular"] = quantity("regular", "kind of planting", unit="")
    spacing_m: tuple[_Spacing, _Spacing] = quantity(..., "spacing along x and y", unit="m")


class Random(Table):
    """Trees at random; the species are drawn by share."""

    kind: Literal["random"] = quantity("random", "kind of planting", unit="")
    density_ha: float = quantity(..., "trees per hectare", unit="1/ha", gt=0, le=1e7)
    min_distance_m: float = quantity(
        0.0, "least distance between two trees", unit="m", ge=0, le=100
    )


Planting = Annotated[Explicit | StemMap | Regular | Random | Inventory, Field(discriminator="kind")]


class Box(Table):
    """A box that blocks growth and casts shade."""

    kind: Literal["box"] = quantity("box", "kind of obstacle", unit="")
    name: str = quantity("", "by which acts can move it or take it away", unit="", max_length=60)
    min_m: Point = quantity(..., "lower corner", unit="m")
    max_m: Point = quantity(..., "upper corner", unit="m")

    @model_validator(mode="after")
    def _has_volume(self) -> Box:
        if any(low >= high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise Refusal(
                f"{list(self.max_m)} is not above min_m",
                key="max_m",
                expected="every coordinate above that of min_m",
            )
        if self.max_m[2] <= 0.0:
            raise Refusal("lies below the ground", key="max_m", expected="a top above 0")
        return self

    def moved(self, by_m: Point) -> Box:
        """Give it in another place."""
        low = tuple(a + b for a, b in zip(self.min_m, by_m, strict=True))
        high = tuple(a + b for a, b in zip(self.max_m, by_m, strict=True))
        return self.model_copy(update={"min_m": low, "max_m": high})


class Mesh(Table):
    """A closed surface that blocks growth and casts shade."""

    kind: Literal["mesh"] = quantity("mesh", "kind of obstacle", unit="")
    name: str = quantity("", "by which acts can move it or take it away", unit="", max_length=60)
    at_m: Point = quantity((0.0, 0.0, 0.0), "where the file's origin stands", unit="m")
    file: str = quantity(
        ..., "surface file (.stl, .obj, .ply or .vtp); relative to the scenario", unit=""
    )
    sha256: str = quantity("", "hash of the file; filled in when the scenario is read", unit="")

    @field_validator("file")
    @classmethod
    def _exists(cls, file: str, info: ValidationInfo) -> str:
        return files.find_mesh(file, info.context)

    @field_validator("sha256")
    @classmethod
    def _is_the_same(cls, digest: str, info: ValidationInfo) -> str:
        if "file" not in info.data:
            return digest  # refused for its file
        found = files.digest(info.data["file"])
        if digest not in ("", found):
            raise Refusal(
                f"{info.data['file']!r} has changed", expected="the mesh that the scenario had"
            )
        return found

    def moved(self, by_m: Point) -> Mesh:
        """Give it in another place."""
        at = tuple(a + b for a, b in zip(self.at_m, by_m, strict=True))
        return self.model_copy(update={"at_m": at})


Obstacle = Annotated[Box | Mesh, Field(discriminator="kind")]


class SampleTrees(Table):
    """Trees whose whole life is recorded."""

    ids: tuple[_Id, ...] = quantity(
        (), "tree ids, counted from 1 in the order of planting", unit="", max_length=100_000
    )
    dbh_quantiles: tuple[_Quantile, ...] = quantity(
        (), "quantiles of dbh among the trees that live at `at_year`", max_length=1000
    )
    at_year: int | None = quantity(
        None, "calendar year of the quantiles; default: the last year", unit="year"
    )
    meshes: Literal["glb", "obj", "ply", "vtp"] | None = quantity(
        None,
        "format in which each tree's surface is written when the run is done, as it was in its "
        "last year, into the folder RUN_meshes beside the run file",
        unit="",
    )
    surface: Literal["tubes", "blended"] = quantity(
        "tubes",
        "what these are: tubes, one for each axis, or blended, one whole, flared at the foot "
        "(slow; a tree that cannot be blended has tubes); needs `meshes`",
        unit="",
    )
    bark: bool = quantity(
        False,
        "whether these surfaces have bark that tears as the tree grew; needs `meshes`",
        unit="",
    )

    @model_validator(mode="after")
    def _has_meshes(self) -> SampleTrees:
        if self.meshes is None:
            if self.bark:
                raise Refusal("true", key="bark", expected='meshes = "glb" beside it')
            if self.surface != "tubes":
                raise Refusal(self.surface, key="surface", expected='meshes = "glb" beside it')
        return self


class Output(Table):
    """What the run file holds."""

    tables: tuple[_TableName, ...] = quantity(
        get_args(_TableName),
        "tables to write; stability only has rows where there is a table mechanics, deadwood "
        "where there are snags, regeneration where there is a table of that name, treatments "
        "where there are acts, storms where the wind blew; residual is written where there are "
        "residual trees",
        unit="",
        max_length=len(get_args(_TableName)),
    )
    sample_trees: SampleTrees = SampleTrees()
    ring_heights_m: tuple[_DiscHeight, ...] = quantity(
        (0.3, 1.3, 5.0, 10.0), "heights of the stem whose rings are told", unit="m", max_length=8
    )
    ring_crown_base: bool = quantity(True, "tell the ring where the crown begins as well", unit="")
    checkpoint_every_years: int = quantity(
        10, "years between two checkpoints", unit="year", ge=1, le=10000
    )

    @model_validator(mode="after")
    def _each_table_once(self) -> Output:
        if len(set(self.tables)) < len(self.tables):
            raise Refusal("a table is named twice", key="tables", expected="each table once")
        return self
