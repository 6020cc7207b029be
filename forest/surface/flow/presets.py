"""What the bark of species is made of: spots or ribbons, by age (Hart & Baker 2003, section 5.4).

The presets stand in `presets/*.toml`. Each value is a row over the ages in `years`; between them
it is interpolated, beyond them it stays.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError, model_validator

from forest.errors import InputError, nearest
from forest.species.schema import Refusal, Table, quantity, refusal

_Floats = NDArray[np.float64]
_FOLDER = Path(__file__).parent / "presets"

Row = tuple[float, ...]
Colour = tuple[float, float, float]


class Spots(Table):
    """Fans of triangles; each row has a value for each age."""

    density: Row = quantity(..., "share of the background's quads that bear a spot")
    width_m: Row = quantity(..., "across the grain", unit="m")
    height_m: Row = quantity(..., "along the grain, at most twice the width", unit="m")
    peak_m: Row = quantity(..., "height of the peak above the spot's edge", unit="m")
    raise_m: Row = quantity(..., "height of the whole spot above the background", unit="m")


class Ribbons(Table):
    """Long, narrow, segmented ribbons; each row has a value for each age."""

    density: Row = quantity(..., "ribbons of a layer per quad of the background")
    length_m: Row = quantity(..., "along the grain", unit="m")
    width_m: Row = quantity(..., "across the grain", unit="m")
    height_m: Row = quantity(..., "height of the highest layer above the background", unit="m")
    twist_deg: Row = quantity(..., "standard deviation of the angle to the grain", unit="degree")
    layers: Row = quantity(..., "height of each layer, times `height_m`", min_length=1)
    segments: int = quantity(8, "segments of a ribbon", ge=2, le=64)


class FeaturePreset(Table):
    """The bark of a species as background and features."""

    name: str = quantity(..., "English name")
    species: tuple[str, ...] = quantity((), "species of the simulator that have this bark")
    pattern: Literal["spotted", "ribbon"] = quantity(..., "kind of features")
    source: str = quantity(..., "where the values come from")
    spacing_m: float = quantity(..., "distance of the background's quads", unit="m", gt=0.0)
    years: Row = quantity(..., "ages of the bark", unit="a", min_length=1)
    background: tuple[Colour, ...] = quantity(..., "colour at each age, sRGB 0 to 1")
    feature: tuple[Colour, ...] = quantity(..., "colour of spots or ribbons at each age")
    spots: Spots | None = quantity(None, "of spotted bark")
    ribbons: Ribbons | None = quantity(None, "of ribbon bark")

    @model_validator(mode="after")
    def _fits(self) -> FeaturePreset:
        part = self.spots if self.pattern == "spotted" else self.ribbons
        key = "spots" if self.pattern == "spotted" else "ribbons"
        if part is None:
            raise Refusal(f"{self.pattern} bark without [{key}]", key=key)
        if any(b <= a for a, b in zip(self.years, self.years[1:], strict=False)):
            raise Refusal("ages do not rise", key="years", expected="rising years")
        rows = {"background": self.background, "feature": self.feature}
        rows |= {f"{key}.{k}": v for k, v in part if isinstance(v, tuple) and k != "layers"}
        for name, row in rows.items():
            if len(row) != len(self.years):
                raise Refusal(
                    f"{len(row)} values", key=name, expected=f"one for each of {len(self.years)}"
                )
        for name, row in part:
            least = float(np.min(row))
            if least < 0.0:
                raise Refusal(f"{least:g}", key=f"{key}.{name}", expected="0 or more")
        if self.spots is not None:
            pairs = zip(self.spots.height_m, self.spots.width_m, strict=True)
            if any(h > 2.0 * w * (1.0 + 1e-9) for h, w in pairs):
                raise Refusal(
                    "a spot more than twice as high as wide",
                    key="spots.height_m",
                    expected="height per width at most 2; longer features are ribbons",
                )
        return self

    def at(self, row: Row, age: _Floats) -> _Floats:
        """Interpolate a row at ages, years."""
        return np.asarray(np.interp(age, self.years, row), np.float64)

    def colour(self, rows: tuple[Colour, ...], age: float) -> Colour:
        """Interpolate a colour at an age, years."""
        red, green, blue = (
            float(np.interp(age, self.years, part)) for part in zip(*rows, strict=True)
        )
        return red, green, blue


def preset_names() -> list[str]:
    """List the names of the presets that come with the program."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


@cache
def _shipped(name: str) -> FeaturePreset:
    return read_preset(_FOLDER / f"{name}.toml")


def feature_preset(name: str) -> FeaturePreset:
    """Give a preset by its name.

    Raises
    ------
    InputError
        If there is none of this name; the nearest is named.
    """
    if name not in preset_names():
        raise InputError(f"no flow bark {name!r}, {nearest(name, preset_names())}", where="preset")
    return _shipped(name)


def preset_for(species: str) -> FeaturePreset | None:
    """Give the preset of a species of the simulator; None where it has none."""
    for name in preset_names():
        if species in _shipped(name).species:
            return _shipped(name)
    return None


def read_preset(path: Path) -> FeaturePreset:
    """Read a preset from a file.

    Raises
    ------
    InputError
        If it is no TOML, or a value in it is out of its range.
    """
    try:
        return FeaturePreset.model_validate(tomllib.loads(path.read_text()))
    except OSError as error:
        raise InputError(str(error.strerror), where=str(path)) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"no TOML: {error}", where=str(path)) from None
    except ValidationError as error:
        raise refusal(error, FeaturePreset, where=path.name) from None
