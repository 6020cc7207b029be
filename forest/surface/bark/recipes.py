"""What the skin and the inside of bark look like close up: recipes for small textures.

Lengths in mm, since that is how one measures bark; colours as in a painter's program (sRGB,
0 to 255).
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from forest.species.schema import Refusal, Table, quantity

Colour = tuple[int, int, int]


class Marks(Table):
    """Spots scattered over the surface: lenticels, diamond scars, corky warts, eyes."""

    per_m2: float = quantity(..., "how many", unit="1/m2", ge=0, le=100_000)
    wide_mm: float = quantity(..., "mean size around the stem", unit="mm", gt=0, le=500)
    high_mm: float = quantity(..., "mean size along it", unit="mm", gt=0, le=500)
    spread: float = quantity(0.4, "standard deviation of the logarithm of sizes", ge=0, le=2)
    shape: Literal["oval", "diamond", "eye"] = quantity(
        "oval", "outline; an eye is the scar of a branch below two drooping brows"
    )
    depth_mm: float = quantity(
        0.0, "how deep they lie; below 0 they stand out", unit="mm", ge=-20, le=20
    )
    colour: Colour = quantity(..., "sRGB, 0 to 255")
    cover: float = quantity(0.9, "how much of the ground's colour they hide", ge=0, le=1)


class Cracks(Table):
    """Micro-fractures: the surface torn again by the fracture model, smaller (section 7)."""

    across: bool = quantity(False, "they run around the stem, not along it")
    spacing_mm: float = quantity(..., "mean distance between them", unit="mm", gt=0, le=500)
    opening: float = quantity(..., "share of the surface they take up", gt=0, le=0.6)
    depth_mm: float = quantity(..., "depth of wide ones", unit="mm", ge=0, le=100)
    steepness: float = quantity(2.0, "depth over opening of narrow ones", gt=0, le=20)
    length: float = quantity(8.0, "length over opening beyond which they run on", gt=0, le=1000)
    stray_deg: float = quantity(25.0, "how much they wander", unit="degree", ge=0, le=80)
    fray_mm: float = quantity(1.0, "how ragged their borders are", unit="mm", ge=0, le=50)
    colour: Colour = quantity(..., "of their depth; sRGB, 0 to 255")


class Flaking(Table):
    """Flakes or scales that overlap."""

    wide_mm: float = quantity(..., "mean size around the stem", unit="mm", gt=0, le=500)
    high_mm: float = quantity(..., "mean size along it", unit="mm", gt=0, le=500)
    depth_mm: float = quantity(..., "height of the pile", unit="mm", ge=0, le=50)
    tint: float = quantity(0.5, "how much they differ in colour, 0 to 1", ge=0, le=1)
    ragged: float = quantity(0.3, "how far outlines stray, in flakes", ge=0, le=1)
    rim: Colour = quantity((40, 30, 25), "colour in the gaps between them; sRGB, 0 to 255")


class Recipe(Table):
    """A surface without large fractures."""

    size_m: float = quantity(0.25, "size of the tile before it repeats", unit="m", gt=0, le=5)
    colours: tuple[Colour, ...] = quantity(
        ..., "from the hollows to the heights, two or more; sRGB, 0 to 255", min_length=2
    )
    contrast: float = quantity(1.0, "how far noise moves along the colours", ge=0, le=5)
    grain_mm: float = quantity(10.0, "size of the largest grains", unit="mm", gt=0, le=500)
    grain_depth_mm: float = quantity(0.4, "relief of the grain", unit="mm", ge=0, le=50)
    fibre_mm: float = quantity(3.0, "distance between fibres", unit="mm", gt=0, le=500)
    fibre_length_mm: float = quantity(40.0, "their length along the stem", unit="mm", gt=0, le=5000)
    fibre_depth_mm: float = quantity(0.0, "relief of fibres", unit="mm", ge=0, le=50)
    fibre_colour: float = quantity(0.5, "share of fibres in the colour's pattern", ge=0, le=1)
    roughness: float = quantity(0.85, "0 a mirror, 1 chalk", ge=0, le=1)
    flakes: Flaking | None = quantity(None, "overlapping flakes")
    cracks: tuple[Cracks, ...] = quantity((), "micro-fractures, the largest first")
    marks: tuple[Marks, ...] = quantity((), "scattered spots")
    image: str = quantity("", "picture of the surface to be used instead of all this")
    image_depth_mm: float = quantity(
        1.0, "relief from black to white of that picture", unit="mm", ge=0, le=50
    )

    @model_validator(mode="after")
    def _sound(self) -> Self:
        for colour in self.colours:
            if not all(0 <= value <= 255 for value in colour):
                raise Refusal(f"colour {colour}", key="colours", expected="numbers 0 to 255")
        return self
