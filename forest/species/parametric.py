"""The parameters of a parametric tree, with the paper's names as aliases (Weber & Penn 1995)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError, model_validator

from forest.errors import InputError, nearest
from forest.species.schema import Refusal, Table, quantity, refusal
from forest.species.text import parse_toml, read_text

_FOLDER = Path(__file__).parent / "forms"
_ANGLE: dict[str, Any] = {"unit": "degree", "ge": -720.0, "le": 720.0}
_COLOUR = r"^#[0-9a-fA-F]{6}$"
_SPREAD: dict[str, Any] = {"unit": "degree", "ge": 0.0, "le": 720.0}


class Level(Table):
    """Stems of one level of recursion; 0 is the trunk."""

    length: float = quantity(
        1.0, "length as a share of the parent's (the trunk: of the scale)", ge=0.0, le=10.0
    )
    length_variation: float = quantity(0.0, "± on it", ge=0.0, le=10.0)
    taper: float = quantity(
        1.0, "0 cylinder, 1 cone, 2 round end, up to 3 a row of spheres", ge=0.0, le=3.0
    )
    splits: float = quantity(0.0, "new clones at each joint of two segments", ge=0.0, le=10.0)
    split_angle: float = quantity(0.0, "lean of stem and clones after a split", **_ANGLE)
    split_angle_variation: float = quantity(0.0, "± on it", **_SPREAD)
    segments: int = quantity(1, "straight segments of a stem", ge=1, le=200)
    curve: float = quantity(0.0, "turn over the stem, or over its first half", **_ANGLE)
    curve_back: float = quantity(0.0, "turn over the second half; 0: none of its own", **_ANGLE)
    curve_variation: float = quantity(
        0.0, "random turn over the stem; negative: a helix of this declination", **_ANGLE
    )
    down_angle: float = quantity(0.0, "angle from the parent's direction", **_ANGLE)
    down_angle_variation: float = quantity(
        0.0, "± on it; negative: spread evenly from the parent's top to its base", **_ANGLE
    )
    rotate: float = quantity(
        140.0, "turn about the parent from child to child; negative: sides alternate", **_ANGLE
    )
    rotate_variation: float = quantity(0.0, "± on it", **_SPREAD)
    branches: int = quantity(
        0, "most children that a parent bears; negative: in a fan at its end", ge=-5000, le=5000
    )


class Parameters(Table):
    """A parametric species."""

    name: str = quantity("unnamed", "name of the species", unit="")
    common_name: str = quantity("", "what people call it", unit="")
    source: str = quantity("", "where the values come from", unit="")
    evergreen: bool = quantity(False, "whether it keeps its leaves in winter")
    bark_colour: Annotated[str, Field(pattern=_COLOUR)] = quantity(
        "#75695c", "colour of the bark in pictures", unit=""
    )
    leaf_colour: Annotated[str, Field(pattern=_COLOUR)] = quantity(
        "#527f3e", "of the leaves in summer", unit=""
    )
    fall_colour: Annotated[str, Field(pattern=_COLOUR)] = quantity(
        "#b8862f", "of the leaves in fall, unless it is evergreen", unit=""
    )
    shape: int = quantity(0, "curve of the main branches' lengths, 0 to 8", ge=0, le=8)
    base_size: float = quantity(0.2, "bare share of the trunk", ge=0.0, lt=1.0)
    scale: float = quantity(10.0, "size of the tree", unit="m", gt=0.0, le=200.0)
    scale_variation: float = quantity(0.0, "± on it", unit="m", ge=0.0)
    z_scale: float = quantity(1.0, "stretch of the finished tree along z", gt=0.0, le=10.0)
    z_scale_variation: float = quantity(0.0, "± on it", ge=0.0)
    depth: int = quantity(3, "levels of stems, the trunk's included", ge=1, le=6)
    ratio: float = quantity(0.015, "radius of the trunk / its length", gt=0.0, le=1.0)
    ratio_power: float = quantity(
        1.2, "power of a child's radius on its relative length", ge=0.0, le=10.0
    )
    lobes: int = quantity(0, "peaks around the trunk", ge=0, le=100)
    lobe_depth: float = quantity(0.0, "their height, a share of the radius", ge=0.0, lt=1.0)
    flare: float = quantity(0.0, "widening of the trunk's foot", ge=0.0, le=20.0)
    trunk_scale: float = quantity(1.0, "factor on the trunk's radius", gt=0.0, le=20.0)
    trunk_scale_variation: float = quantity(0.0, "± on it", ge=0.0)
    base_splits: int = quantity(
        0, "clones of the trunk at the end of its first segment", ge=0, le=50
    )
    clone_habit: float = quantity(
        0.5, "share of its propensity to split that a stem keeps at each split", ge=0.0, le=1.0
    )
    leaves: int = quantity(
        0, "most leaves of a stem of the last level; negative: in a fan", ge=-5000, le=5000
    )
    leaf_shape: int = quantity(0, "outline of the leaves, 0 to 5", ge=0, le=5)
    leaf_scale: float = quantity(0.1, "length of a leaf", unit="m", gt=0.0, le=10.0)
    leaf_scale_x: float = quantity(1.0, "its width / its length", gt=0.0, le=10.0)
    leaf_bend: float = quantity(0.0, "turn of the leaves outwards and up", ge=0.0, le=1.0)
    attraction_up: float = quantity(
        0.0, "tendency of twigs to the vertical; negative: they droop", ge=-20.0, le=20.0
    )
    prune_ratio: float = quantity(0.0, "how far the envelope prunes", ge=0.0, le=1.0)
    prune_width: float = quantity(0.5, "widest radius of the envelope / scale", gt=0.0, le=10.0)
    prune_width_peak: float = quantity(
        0.5, "height of the widest place in the envelope", gt=0.0, lt=1.0
    )
    prune_power_low: float = quantity(0.5, "curvature below it", ge=0.0, le=10.0)
    prune_power_high: float = quantity(0.5, "curvature above it", ge=0.0, le=10.0)
    level: Annotated[tuple[Level, ...], Field(min_length=1, max_length=4)] = (Level(),)

    @model_validator(mode="after")
    def _sound(self) -> Parameters:
        if self.scale_variation > self.scale:
            raise Refusal(
                "the tree may be smaller than nothing",
                key="scale_variation",
                expected=f"at most scale, {self.scale:g}",
            )
        for key in ("z_scale", "trunk_scale"):
            if getattr(self, key + "_variation") >= getattr(self, key):
                raise Refusal(f"{key} may reach 0", key=key + "_variation", expected=f"below {key}")
        first = self.level[0]
        if first.length <= first.length_variation:
            raise Refusal("the trunk may have no length", key="level[0].length")
        if self.base_splits and first.segments == 1:
            raise Refusal(
                "the trunk is one segment, and splits where its first two meet",
                key="base_splits",
                expected="0, or level[0].segments of 2 or more",
            )
        return self

    def of_level(self, number: int) -> Level:
        """Parameters of a level; those of the last one given hold for all beyond (4.5)."""
        return self.level[min(number, len(self.level) - 1)]

    def with_changes(self, changes: Sequence[str]) -> Parameters:
        """Change parameters by name.

        Parameters
        ----------
        changes : sequence of str
            ``name=value`` each; a name of this table, ``level.1.curve``, or the paper's name,
            ``1Curve``.

        Raises
        ------
        InputError
            If a name is unknown or a value is not allowed.
        """
        table = self.model_dump()
        table["level"] = [dict(level) for level in table["level"]]
        for change in changes:
            name, equals, text = change.partition("=")
            if not equals:
                raise InputError(f"'{change}' changes nothing", expected="name=value")
            value = parse_toml(f"value = {text}", where=change)["value"]
            section, key = locate(name.strip())
            while section >= len(table["level"]):
                table["level"].append(dict(table["level"][-1]))
            target = table if section < 0 else table["level"][section]
            target[key] = float(value) if _is_float(target[key], value) else value
        return checked(table, where="--set")


#: The paper's names of the whole tree's parameters.
PAPER_NAMES = {
    "Shape": "shape",
    "BaseSize": "base_size",
    "Scale": "scale",
    "ScaleV": "scale_variation",
    "ZScale": "z_scale",
    "ZScaleV": "z_scale_variation",
    "Levels": "depth",
    "Ratio": "ratio",
    "RatioPower": "ratio_power",
    "Lobes": "lobes",
    "LobeDepth": "lobe_depth",
    "Flare": "flare",
    "0Scale": "trunk_scale",
    "0ScaleV": "trunk_scale_variation",
    "0BaseSplits": "base_splits",
    "Leaves": "leaves",
    "LeafShape": "leaf_shape",
    "LeafScale": "leaf_scale",
    "LeafScaleX": "leaf_scale_x",
    "bend": "leaf_bend",
    "AttractionUp": "attraction_up",
    "PruneRatio": "prune_ratio",
    "PruneWidth": "prune_width",
    "PruneWidthPeak": "prune_width_peak",
    "PrunePowerLow": "prune_power_low",
    "PrunePowerHigh": "prune_power_high",
}

#: The paper's names of a level's parameters, without the level's number.
PAPER_LEVEL_NAMES = {
    "Length": "length",
    "LengthV": "length_variation",
    "Taper": "taper",
    "SegSplits": "splits",
    "SplitAngle": "split_angle",
    "SplitAngleV": "split_angle_variation",
    "CurveRes": "segments",
    "Curve": "curve",
    "CurveBack": "curve_back",
    "CurveV": "curve_variation",
    "DownAngle": "down_angle",
    "DownAngleV": "down_angle_variation",
    "Rotate": "rotate",
    "RotateV": "rotate_variation",
    "Branches": "branches",
}


def locate(name: str) -> tuple[int, str]:
    """Find a parameter by its name here or in the paper: level, or -1, and key."""
    if name in PAPER_NAMES:
        return -1, PAPER_NAMES[name]
    paper = re.fullmatch(r"([0-3])(\w+)", name)
    if paper and paper[2] in PAPER_LEVEL_NAMES:
        return int(paper[1]), PAPER_LEVEL_NAMES[paper[2]]
    own = re.fullmatch(r"level\.([0-3])\.(\w+)", name)
    if own and own[2] in Level.model_fields:
        return int(own[1]), own[2]
    if name in Parameters.model_fields and name != "level":
        return -1, name
    known = [*PAPER_NAMES, *(k for k in Parameters.model_fields if k != "level")]
    known += [f"{n}{key}" for n in range(4) for key in PAPER_LEVEL_NAMES]
    known += [f"level.{n}.{key}" for n in range(4) for key in Level.model_fields]
    raise InputError(f"unknown parameter '{name}', {nearest(name, known)}")


def from_paper(values: Mapping[str, Any]) -> Parameters:
    """Make parameters from the paper's names, as ``{"Scale": 13, "1Branches": 50}``."""
    table: dict[str, Any] = {}
    levels: list[dict[str, Any]] = [{} for _ in range(4)]
    for name, value in values.items():
        section, key = locate(name)
        (table if section < 0 else levels[section])[key] = value
    rows: list[tuple[dict[str, Any], type[Table]]] = [(table, Parameters)]
    for row, model in rows + [(level, Level) for level in levels]:
        for key, value in row.items():
            if model.model_fields[key].annotation is float and isinstance(value, int):
                row[key] = float(value)
    return checked({**table, "level": levels}, where="parameters")


def checked(table: Mapping[str, Any], *, where: str) -> Parameters:
    """Check a plain table of parameters."""
    try:
        return Parameters(**table)
    except ValidationError as error:
        raise refusal(error, Parameters, where=where) from None


def parametric_names() -> list[str]:
    """List the parametric species that come with the program."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_parameters(name: str | Path) -> Parameters:
    """Read a parametric species that comes with the program, or a TOML file of one.

    Raises
    ------
    InputError
        If there is no such species, or its file is not right.
    """
    path = Path(name)
    if path.suffix != ".toml":
        if str(name) not in parametric_names():
            hint = nearest(str(name), parametric_names())
            raise InputError(f"unknown parametric species {str(name)!r}, {hint}")
        path = _FOLDER / f"{name}.toml"
    return checked(parse_toml(read_text(path, where=path.name), where=path.name), where=path.name)


def _is_float(old: Any, new: Any) -> bool:
    return isinstance(old, float) and isinstance(new, int) and not isinstance(new, bool)


_LEVEL_FIELDS = tuple(Level.model_fields)
_TREE_FIELDS = (*PAPER_NAMES.values(), "clone_habit")
LEVEL_ROW = np.dtype([(name, np.float64) for name in _LEVEL_FIELDS])
TREE_ROW = np.dtype([(name, np.float64) for name in _TREE_FIELDS])


def pack(parameters: Parameters) -> tuple[Any, Any]:
    """Put the parameters into arrays for the kernels: the tree's (1,), the levels' (depth + 1,)."""
    tree = np.zeros(1, TREE_ROW)
    for name in _TREE_FIELDS:
        tree[0][name] = float(getattr(parameters, name))
    levels = np.zeros(parameters.depth + 1, LEVEL_ROW)
    for number in range(len(levels)):
        level = parameters.of_level(number)
        for name in _LEVEL_FIELDS:
            levels[number][name] = float(getattr(level, name))
    return tree, levels
