"""Bark of known trees: how it tears, how deep, and what it looks like, by the stem's girth.

A value that ages with the stem is a number or a list of pairs [girth in m, value], straight between
them and flat beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError, model_validator

from forest.errors import InputError, nearest
from forest.species.schema import Refusal, Table, quantity, refusal
from forest.species.text import parse_toml, read_text
from forest.surface.bark.material import Material
from forest.surface.bark.recipes import Colour, Recipe

_FOLDER = Path(__file__).with_name("presets")

#: A number, or pairs of girth (m) and number.
Ageing = float | tuple[tuple[float, float], ...]


def at_girth(value: Ageing, girth_m: ArrayLike) -> NDArray[np.float64]:
    """Evaluate a value that ages at some girths."""
    girth = np.asarray(girth_m, np.float64)
    if not isinstance(value, tuple):
        return np.full(girth.shape, float(value))
    at, values = np.array(value, np.float64).T
    return np.asarray(np.interp(girth, at, values), np.float64)


def _check(table: Table, limits: dict[str, tuple[float, float]]) -> None:
    """Refuse values that age out of their range, and girths that do not rise."""
    for key, (least, most) in limits.items():
        value = getattr(table, key)
        pairs = value if isinstance(value, tuple) else ((0.0, value),)
        girths = [girth for girth, _ in pairs]
        if not pairs or any(b <= a for a, b in pairwise(girths)):
            raise Refusal(f"{value}", key=key, expected="pairs [girth in m, value], girths rising")
        for _, number in pairs:
            if not least <= number <= most:
                raise Refusal(f"{number}", key=key, expected=f"{least:g} to {most:g}")


class Tearing(Table):
    """How the bark tears: what its `Material` and its girth's growth are made of."""

    share: Ageing = quantity(..., "share of the girth that is torn open")
    again: Ageing = quantity(0.0, "share torn open in the surface of old fractures and plates")
    spacing_m: Ageing = quantity(..., "about how far fractures lie apart", unit="m")
    threshold_jitter: float = quantity(0.3, "how unevenly it breaks", ge=0, le=2)
    attachment: float = quantity(0.0, "grip of the wood on the bark, K_a", unit="N/m3", ge=0)
    inglis: float = quantity(6.0, "length over width beyond which fractures run on", gt=0, le=1000)
    arrest: float = quantity(0.6, "load that stops them, share of what breaks bark", ge=0, le=2)
    run_m: float = quantity(
        0.02, "how far an end runs on in a fourteenth of the growth: short, and it tapers",
        unit="m", gt=0, le=100,
    )  # fmt: skip
    influence: float = quantity(3.0, "reach of a fracture on the course of others", ge=0, le=50)
    stand_off: float = quantity(0.5, "how near they come, in widths", ge=0, le=50)
    stray_deg: float = quantity(15.0, "how much their course strays", unit="degree", ge=0, le=80)
    wander_m: float = quantity(0.05, "length over which it strays one way", unit="m", gt=0, le=2)
    least_piece_m: float = quantity(0.006, "no two lie nearer", unit="m", gt=0, le=1)
    flaw_m: float = quantity(0.02, "the shortest of them", unit="m", gt=0, le=5)
    strip_m: float = quantity(0.01, "width of the strips", unit="m", gt=0.0005, le=0.5)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        _check(self, {"share": (0.0, 0.9), "again": (0.0, 0.8), "spacing_m": (1e-4, 10.0)})
        return self


class Carving(Table):
    """How fractures sink in, and what age does to the surface."""

    depth_m: Ageing = quantity(..., "depth of wide fractures", unit="m")
    per_width: Ageing = quantity(1.0, "depth over opening of narrow ones")
    again_depth: float = quantity(0.5, "depth of a later generation, share of depth_m", ge=0, le=2)
    profile: tuple[tuple[float, float], ...] = quantity(
        ((0.0, 0.0), (0.4, 0.8), (1.0, 1.0)),
        "pairs: share of the way from border to middle, share of the depth", min_length=2,
    )  # fmt: skip
    opening: Literal["axis", "one side", "both sides"] = quantity(
        "axis", "where a fracture's new surface appears"
    )
    shoulder: Ageing = quantity(0.2, "how far edges of the epidermis sink; below 0 they curl up")
    reach_m: float = quantity(0.005, "how far from the edge that is felt", unit="m", gt=0, le=1)
    fray_m: Ageing = quantity(0.0, "how ragged the torn borders are", unit="m")
    fray_length_m: float = quantity(0.02, "length of their largest waves", unit="m", gt=0, le=2)
    soft_m: float = quantity(
        0.002, "distance over which epidermis gives way to the inside", unit="m", gt=0, le=0.2
    )
    grime: Ageing = quantity(0.3, "how much the deepest places are darkened")
    stain: Ageing = quantity(0.05, "how much large patches differ in brightness")
    old_skin: Ageing = quantity(0.0, "share of the old epidermis")
    old_inside: Ageing = quantity(0.0, "share of the old inside")

    @model_validator(mode="after")
    def _sound(self) -> Self:
        _check(
            self,
            {
                "depth_m": (0.0, 0.3),
                "per_width": (0.0, 20.0),
                "shoulder": (-1.0, 1.0),
                "fray_m": (0.0, 0.1),
                "grime": (0.0, 1.0),
                "stain": (0.0, 1.0),
                "old_skin": (0.0, 1.0),
                "old_inside": (0.0, 1.0),
            },
        )
        way = np.array(self.profile)
        if way[0, 0] != 0.0 or way[-1, 0] != 1.0 or np.any(np.diff(way[:, 0]) <= 0):
            raise Refusal(f"{self.profile}", key="profile", expected="shares rising from 0 to 1")
        return self


class Lichen(Table):
    """Patches of lichen."""

    cover: Ageing = quantity(0.0, "share of the surface on the side they like")
    colour: Colour = quantity((158, 168, 140), "sRGB, 0 to 255")
    thick_mm: float = quantity(0.6, "thickness", unit="mm", ge=0, le=20)
    patch_m: float = quantity(0.12, "size of patches", unit="m", gt=0, le=5)
    side_turn: float = quantity(0.25, "the moist side, turns from the seam", ge=0, le=1)
    side: float = quantity(0.6, "how much they keep to it: 0 all around, 1 on it alone", ge=0, le=1)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        _check(self, {"cover": (0.0, 1.0)})
        return self


class Preset(Table):
    """The bark of a kind of tree."""

    name: str = quantity(..., "short name")
    latin: str = quantity("", "botanical name")
    source: str = quantity(..., "where the values come from")
    tearing: Tearing = quantity(..., "how it tears")
    carving: Carving = quantity(..., "how fractures sink in")
    skin: tuple[Recipe, ...] = quantity(
        ..., "the epidermis; with two, young and old", min_length=1, max_length=2
    )
    inside: tuple[Recipe, ...] = quantity(
        ..., "the inside of fractures; with two, young and old", min_length=1, max_length=2
    )
    lichen: Lichen = quantity(Lichen(), "lichen")

    @classmethod
    def load(cls, name_or_path: str | Path) -> Self:
        """Read a preset that is shipped, by name, or one of your own, by its file.

        Raises
        ------
        InputError
            No such preset or file, or a value that it may not have.
        """
        path = Path(name_or_path)
        if path.suffix != ".toml":
            path = _FOLDER / f"{name_or_path}.toml"
            if not path.is_file():
                hint = nearest(str(name_or_path), preset_names())
                raise InputError(f"no bark preset '{name_or_path}', {hint} (or a file, *.toml)")
        try:
            return cls.model_validate(parse_toml(read_text(path, where=str(path)), where=path.name))
        except ValidationError as error:
            raise refusal(error, cls, where=path.name) from None

    def material(self, girth_m: float) -> Material:
        """Give the material of stems of some girth."""
        tearing = self.tearing
        spacing = float(at_girth(tearing.spacing_m, girth_m))
        return Material(
            fracture_stiffness=1.0 / spacing,
            threshold_jitter=tearing.threshold_jitter,
            attachment=tearing.attachment,
            grain_m=0.25 * tearing.least_piece_m,
            grain_along_m=tearing.wander_m,
            least_piece_m=tearing.least_piece_m,
            flaw_m=tearing.flaw_m,
            inglis=tearing.inglis,
            arrest=tearing.arrest,
            run_m=tearing.run_m,
            influence=tearing.influence,
            stand_off=tearing.stand_off,
            stray_deg=tearing.stray_deg,
        )

    def remains(self, girth_m: ArrayLike) -> NDArray[np.float64]:
        """Share of the girth that is epidermis, for `shrinking`."""
        return 1.0 - at_girth(self.tearing.share, girth_m)

    def aged(self, girth_m: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """All of `carving` that ages, and the cover of lichen, at some girths."""
        names = (
            "depth_m", "per_width", "shoulder", "fray_m", "grime", "stain", "old_skin", "old_inside"
        )  # fmt: skip
        found: dict[str, Any] = {
            name: at_girth(getattr(self.carving, name), girth_m) for name in names
        }
        found["lichen"] = at_girth(self.lichen.cover, girth_m)
        return found


def preset_names() -> Sequence[str]:
    """Name the presets that are shipped."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))
