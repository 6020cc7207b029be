"""Bark of a preset: grown as a tile, and what its outlines, relief and surfaces are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.bark.growing import Bark
from forest.surface.bark.noise import noise
from forest.surface.bark.outlines import OPENINGS, Relief, profile_of
from forest.surface.bark.painting import Extras, Rows, Surfaces
from forest.surface.bark.presets import Preset, at_girth
from forest.surface.bark.silhouettes import Silhouettes
from forest.surface.bark.textures import Texture, grow_tile

_STEPS = 14
_PATCHES = 512  # pixels along the side of the noise for lichen and stains


class Fold(NamedTuple):
    """A fold of the bark below a branch: wrinkles on hyperbolas that hang from the crotch.

    Attributes
    ----------
    turn, v_m : float
        Where the crotch is: turns from the seam, m along the axis.
    reach_m : float
        How far it is felt; about the branch's radius.
    height_m : float
        Of the ridge.
    steepness : float
        How steeply the ridge falls to either side: 1 at 45 degrees.
    """

    turn: float
    v_m: float
    reach_m: float
    height_m: float = 0.01
    steepness: float = 1.0


def grow_preset(
    preset: Preset,
    girth_m: float,
    *,
    width_m: float | None = None,
    length_m: float | None = None,
    seed: int = 0,
) -> Bark:
    """Grow a tile of a preset's bark, as it is on stems of some girth.

    Parameters
    ----------
    preset : Preset
    girth_m : float
        Of the stem that the bark stands for: its age.
    width_m, length_m : float, optional
        Size of the tile around and along the stem; the girth and the width unless given.
    seed : int
        Another seed, another tree.

    Returns
    -------
    Bark
        It continues over all four edges. Where plates have torn again, `surface` is the bark
        before.

    Raises
    ------
    InputError
        A size that is not above 0.
    """
    width = girth_m if width_m is None else width_m
    length = width if length_m is None else length_m
    for name, value in (("girth_m", girth_m), ("width_m", width), ("length_m", length)):
        if not 0.0 < value < 1000.0:
            raise InputError(f"{name} = {value}", where="bark tile", expected="metres, above 0")
    tearing = preset.tearing
    share, again = (float(at_girth(value, girth_m)) for value in (tearing.share, tearing.again))
    strips = max(4, round(length / tearing.strip_m))
    material = preset.material(girth_m)
    before = width * (1.0 - again)
    bark = grow_tile(before, length, material, 1.0 / (1.0 - share), strips, seed, _STEPS)
    if again > 0.0:
        widths = before * (width / before) ** (np.arange(1, _STEPS + 1) / _STEPS)
        widths[-1] = width
        bark = bark.refracture(np.repeat(widths[:, None], strips, axis=1))
    return bark


def relief_of(preset: Preset, girth: NDArray[np.float64], *, generation: int, seed: int) -> Relief:
    """Give the relief of fractures for points of stems of some girth (n,)."""
    carving = preset.carving
    aged = preset.aged(girth)
    return Relief(
        depth=aged["depth_m"] * carving.again_depth**generation,
        per_width=aged["per_width"],
        shoulder=aged["shoulder"],
        reach=np.full(len(girth), carving.reach_m),
        fray=aged["fray_m"],
        profile=profile_of(carving.profile),
        opening=OPENINGS.index(carving.opening),
        fray_length=carving.fray_length_m,
        seed=seed + generation,
    )


def rows_at(preset: Preset, v: NDArray[np.float64], girth: NDArray[np.float64]) -> Rows:
    """Give what changes from row to row; `girth` is that of the stem it stands for."""
    aged = preset.aged(girth)
    return Rows(
        v=v,
        girth=girth,
        old_skin=aged["old_skin"],
        old_inside=aged["old_inside"],
        grime=aged["grime"],
        stain=aged["stain"],
        depth=aged["depth_m"],
        lichen=aged["lichen"],
    )


class Dress(NamedTuple):
    """What a preset's textures look like, made once for all pictures."""

    preset: Preset
    skin: tuple[Texture, Texture]  # young and old
    inside: tuple[Texture, Texture]
    patches: NDArray[np.float32]

    @classmethod
    def of(cls, preset: Preset, *, seed: int = 0, size: int = 1024) -> Dress:
        """Make the textures of a preset: tiles of `size` pixels."""
        made = [
            [
                Texture.of(recipe, seed=seed + 101 * k + 13 * j, size=size)
                for j, recipe in enumerate(recipes)
            ]
            for k, recipes in enumerate((preset.skin, preset.inside))
        ]
        pairs = [(one[0], one[-1]) for one in made]
        return cls(preset, pairs[0], pairs[1], _ranked(seed))

    def surfaces(self, outlines: Silhouettes) -> Surfaces:
        """Lay out the textures: whole tiles around, and along where the bark continues."""
        rest = float(np.mean(outlines.rest))
        along = [_per_metre(texture.size_m[1], outlines) for texture in (*self.skin, *self.inside)]
        return Surfaces(
            skin=self.skin[0].pixels,
            skin_old=self.skin[1].pixels,
            inside=self.inside[0].pixels,
            inside_old=self.inside[1].pixels,
            around=np.array([max(1.0, np.round(rest / one.size_m[0])) for one in self.skin]),
            across=np.array([1.0 / one.size_m[0] for one in self.inside]),
            along=np.array(along),
            soft=self.preset.carving.soft_m,
        )

    def extras(self, outlines: Silhouettes, folds: Sequence[Fold] = ()) -> Extras:
        """Lay out lichen, stains and folds."""
        lichen = self.preset.lichen
        girth = float(np.mean(outlines.girth))
        tile = 8.0 * lichen.patch_m  # the noise has eight waves to a side
        return Extras(
            patches=self.patches,
            patch_around=max(1.0, float(np.round(girth / tile))),
            patch_along=_per_metre(tile, outlines),
            lichen=np.array(
                [
                    *(value / 255.0 for value in lichen.colour),
                    1e-3 * lichen.thick_mm,
                    lichen.side_turn,
                    lichen.side,
                ]
            ),
            folds=np.array(folds, np.float64).reshape(-1, 5),
        )


def _per_metre(size_m: float, outlines: Silhouettes) -> float:
    if not outlines.cyclic:
        return 1.0 / size_m
    return max(1.0, float(np.round(outlines.length / size_m))) / outlines.length


def _ranked(seed: int) -> NDArray[np.float32]:
    """Noise whose values are spread evenly over 0 to 1, so that shares are what they say."""
    raw = noise(_PATCHES, 8, 8, octaves=5, seed=seed, serial=40)
    order = np.argsort(raw, axis=None, kind="stable")
    rank = np.empty(raw.size, np.float32)
    rank[order] = (np.arange(raw.size, dtype=np.float32) + np.float32(0.5)) / np.float32(raw.size)
    return rank.reshape(raw.shape)
