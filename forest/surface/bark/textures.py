"""Tiles of epidermis and of the inside of fractures: procedural, or a user's picture.

A tile repeats in both directions. Noise, fibres, flakes, scattered marks and micro-fractures of a
`Recipe` make its relief, and the relief makes its colour.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.bark.growing import Bark, grow_bark
from forest.surface.bark.material import Material
from forest.surface.bark.noise import draws, flakes, noise
from forest.surface.bark.outlines import Relief, fields, profile_of, rows_of
from forest.surface.bark.recipes import Cracks, Flaking, Marks, Recipe
from forest.surface.bark.silhouettes import silhouettes
from forest.surface.bark.strips import StripGeometry

_Pixels = NDArray[np.float32]
_RED, _GREEN, _BLUE, HEIGHT, ROUGHNESS = range(5)
_STRIPS = 96  # of a tile of micro-fractures
_STEPS = 10


class Texture(NamedTuple):
    """A tile of surface that repeats.

    Attributes
    ----------
    pixels : float32 (n, m, 5)
        Red, green, blue (sRGB, 0 to 1), height (m, about 0), roughness. Rows from the bottom up,
        columns around the stem.
    size_m : tuple of float
        Width and height of the tile, m.
    """

    pixels: _Pixels
    size_m: tuple[float, float]

    @classmethod
    def of_image(
        cls,
        path: str | Path,
        size_m: float,
        *,
        depth_m: float = 0.001,
        roughness: float = 0.85,
    ) -> Texture:
        """Take a picture as a tile; light is high.

        Parameters
        ----------
        path : path
            A picture that Pillow reads. For no seams to be seen it must itself repeat.
        size_m : float
            How wide the pictured surface is, m.
        depth_m : float
            Height of white above black, m.
        roughness : float
            Of all of it.

        Raises
        ------
        InputError
            There is no such picture, or it cannot be read.
        """
        from PIL import Image, UnidentifiedImageError

        try:
            with Image.open(path) as image:
                rgb = np.asarray(image.convert("RGB"), np.float32)[::-1] / np.float32(255.0)
        except (OSError, UnidentifiedImageError) as error:
            raise InputError(
                "no picture to be read", where=str(path), expected="PNG, JPEG or TIFF"
            ) from error
        rows, columns = rgb.shape[:2]
        light = rgb @ np.array([0.2126, 0.7152, 0.0722], np.float32)
        pixels = np.empty((rows, columns, 5), np.float32)
        pixels[..., :3] = rgb
        pixels[..., HEIGHT] = depth_m * (light - light.mean())
        pixels[..., ROUGHNESS] = roughness
        return cls(pixels, (size_m, size_m * rows / columns))

    @classmethod
    def of(cls, recipe: Recipe, *, seed: int = 0, size: int = 1024) -> Texture:
        """Make the tile that a recipe describes; the same seed gives the same bits."""
        if recipe.image:
            return cls.of_image(
                recipe.image,
                recipe.size_m,
                depth_m=1e-3 * recipe.image_depth_mm,
                roughness=recipe.roughness,
            )
        return cls(_paint(recipe, seed, size), (recipe.size_m, recipe.size_m))


@lru_cache(maxsize=4)  # those of one preset: axes, years and trees are dressed one by one
def _paint(recipe: Recipe, seed: int, n: int) -> _Pixels:
    side = 1e3 * recipe.size_m

    def waves(size_mm: float) -> int:
        return max(1, round(side / size_mm))

    grain = noise(n, waves(recipe.grain_mm), waves(recipe.grain_mm), octaves=5, seed=seed, serial=1)
    fibre = noise(
        n, waves(recipe.fibre_mm), waves(recipe.fibre_length_mm), octaves=3, seed=seed, serial=2
    )
    height = recipe.grain_depth_mm * grain + recipe.fibre_depth_mm * fibre
    share = recipe.fibre_colour
    pattern = 0.5 + 0.45 * recipe.contrast * ((1.0 - share) * grain + share * fibre)
    pixels = np.empty((n, n, 5), np.float32)
    if recipe.flakes is not None:
        pattern, height, gap = _flake(recipe.flakes, pattern, height, seed, n, side)
        pixels[..., :3] = _ramp(recipe.colours, pattern)
        _mix(pixels, recipe.flakes.rim, gap)
    else:
        pixels[..., :3] = _ramp(recipe.colours, pattern)
    pixels[..., ROUGHNESS] = np.clip(recipe.roughness - 0.06 * grain, 0.05, 1.0)
    for k, marks in enumerate(recipe.marks):
        _scatter(pixels, height, marks, recipe.size_m, seed, 5 + k)
    pixels[..., HEIGHT] = 1e-3 * height
    for k, cracks in enumerate(recipe.cracks):
        _crack(pixels, cracks, recipe.size_m, seed + 7919 * (k + 1))
    pixels[..., HEIGHT] -= pixels[..., HEIGHT].mean()
    return pixels


def _ramp(colours: tuple[Any, ...], pattern: NDArray[Any]) -> NDArray[Any]:
    """Colours along a row of colours, 0 to 1."""
    at = np.linspace(0.0, 1.0, len(colours))
    table = np.array(colours, np.float64) / 255.0
    return np.stack([np.interp(pattern, at, table[:, k]) for k in range(3)], axis=-1)


def _mix(pixels: _Pixels, colour: tuple[int, int, int], cover: NDArray[Any]) -> None:
    """Paint a colour over where `cover` is 1."""
    paint = np.array(colour, np.float32) / np.float32(255.0)
    pixels[..., :3] += cover[..., None].astype(np.float32) * (paint - pixels[..., :3])


def _flake(
    flaking: Flaking, pattern: NDArray[Any], height: NDArray[Any], seed: int, n: int, side: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    around, along = round(side / flaking.wide_mm), round(side / flaking.high_mm)
    warp = np.stack(
        [noise(n, around, along, octaves=4, seed=seed, serial=3 + k) for k in range(2)], axis=-1
    )
    found = flakes(n, around, along, np.float32(flaking.ragged) * warp, seed=seed, serial=20)
    pattern = pattern + flaking.tint * (found.tint - np.float32(0.5))
    height = height + flaking.depth_mm * found.height * (0.4 + 0.6 * np.sqrt(found.edge))
    gap = 0.8 * np.clip(1.0 - found.edge / 0.16, 0.0, 1.0) ** 2
    return pattern, height, gap


def _eye(x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Give how far from an eye's lines points are: a ringed oval, and brows that fall from it."""
    oval = np.abs(np.hypot(x / 0.35, (y + 0.35) / 0.5) - 0.8) / 0.45
    brow = np.abs(y - 0.75 + 1.3 * np.abs(x) ** 1.3) / 0.22
    away: NDArray[Any] = np.minimum(oval, np.maximum(brow, np.abs(x) / 0.95))
    return away


#: How far points are from a mark's middle, or its lines, in shares of its size: 1 at its edge.
_OUTLINES: dict[str, Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]]] = {
    "oval": np.hypot,
    "diamond": lambda x, y: np.abs(x) + np.abs(y),
    "eye": _eye,
}


def _scatter(
    pixels: _Pixels, height: NDArray[Any], marks: Marks, size_m: float, seed: int, serial: int
) -> None:
    """Paint marks at random places."""
    n = len(pixels)
    count = round(marks.per_m2 * size_m**2)
    drawn = draws(seed, serial * 16, max(count, 1), 2)
    paint = np.array(marks.colour, np.float32) / np.float32(255.0)
    per_mm = n / (1e3 * size_m)
    for spot in drawn[:count]:
        grown = np.exp(marks.spread * (2.0 * spot[0, 2:] + 2.0 * spot[1, :2] - 2.0))
        wide, high = 0.5 * per_mm * np.array([marks.wide_mm, marks.high_mm]) * grown
        centre = n * spot[0, :2]
        rows = np.arange(np.floor(centre[1] - high), np.ceil(centre[1] + high) + 1)
        columns = np.arange(np.floor(centre[0] - wide), np.ceil(centre[0] + wide) + 1)
        y = (rows - centre[1])[:, None] / max(high, 0.7)
        x = (columns - centre[0])[None, :] / max(wide, 0.7)
        away = _OUTLINES[marks.shape](x, y)
        inside = np.clip((1.0 - away) / 0.35, 0.0, 1.0).astype(np.float32)
        where = np.ix_(rows.astype(np.int64) % n, columns.astype(np.int64) % n)
        ground = pixels[..., :3][where]
        pixels[..., :3][where] = ground + (marks.cover * inside)[..., None] * (paint - ground)
        height[where] -= np.float32(marks.depth_mm) * inside


def _crack(pixels: _Pixels, cracks: Cracks, size_m: float, seed: int) -> None:
    """Tear the tile by the fracture model: a bark of its own whose relief is cut into this one."""
    n = len(pixels)
    spacing = 1e-3 * cracks.spacing_mm
    opening = cracks.opening * spacing
    material = Material(
        fracture_stiffness=1.0 / spacing,
        threshold_jitter=0.25,
        place_jitter=1.0,
        grain_m=0.08 * spacing,
        grain_along_m=0.3 * spacing,
        least_piece_m=0.3 * spacing,
        flaw_m=2.0 * opening,
        inglis=cracks.length,
        stray_deg=cracks.stray_deg,
    )
    bark = grow_tile(size_m, size_m, material, 1.0 / (1.0 - cracks.opening), _STRIPS, seed)
    relief = Relief(
        depth=np.full(n, 1e-3 * cracks.depth_mm),
        per_width=np.full(n, cracks.steepness),
        shoulder=np.full(n, 0.25),
        reach=np.full(n, 0.1 * spacing),
        fray=np.full(n, 1e-3 * cracks.fray_mm),
        profile=profile_of(((0.0, 0.0), (0.4, 0.8), (1.0, 1.0))),
        opening=0,
        fray_length=0.6 * spacing,
        seed=seed,
    )
    found = fields(silhouettes(bark), relief, rows_of(size_m, n)[::-1], n)
    depth, inside = found.depth, found.inside
    if cracks.across:
        depth, inside = depth.T, inside.T
    pixels[..., HEIGHT] -= depth
    dark = np.clip(depth / max(0.7e-3 * cracks.depth_mm, 1e-9), 0.0, 1.0) * (inside > 0)
    _mix(pixels, cracks.colour, dark)


def grow_tile(
    width_m: float,
    length_m: float,
    material: Material,
    ratio: float,
    strips: int,
    seed: int,
    steps: int = _STEPS,
) -> Bark:
    """Grow bark that continues over its upper and lower end as it does around (section 4).

    Parameters
    ----------
    width_m, length_m : float
        Size of the tile as it is now, around and along the stem.
    material : Material
    ratio : float
        Its width over that of its epidermis.
    strips : int
        Into how many strips it is cut.
    seed : int
    steps : int
        In how many steps it grows.

    Returns
    -------
    Bark
    """
    straight = StripGeometry.column(strips, length_m / strips)
    k = np.arange(strips, dtype=np.int32)
    ring = straight._replace(
        neighbour_up=((k + 1) % strips).astype(np.int32),
        neighbour_down=((k - 1) % strips).astype(np.int32),
    )
    girths = width_m * ratio ** (np.arange(steps + 1) / steps - 1.0)
    return grow_bark(ring, np.repeat(girths[:, None], strips, axis=1), material, seed)
