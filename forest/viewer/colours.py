"""What colours of trees stand for, and their legends."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.view.looks import look_of
from forest.view.stand_years import FATES
from forest.view.standing import SNAG
from forest.view.tree_colours import FATE_COLOURS, RESIDUAL, SCALES, Scale, on_scale

if TYPE_CHECKING:
    import pandas as pd

    from forest.viewer.source import Source

Colours = NDArray[np.float64]

_UNKNOWN = (0.72, 0.72, 0.69)
_DEAD = (0.47, 0.39, 0.32)
_LIVES_ON = (0.72, 0.77, 0.70)
_STOPS = 24

#: What trees can be coloured by: name, label.
CHOICES = {
    "species": "Species",
    "dbh": "Diameter (dbh)",
    "height": "Height",
    "light": "Light",
    "vigour": "Vigour",
    "cause": "Cause of death",
    "age": "Age",
}

_SCALES = {**SCALES, "vigour": Scale("vigour", "Basal area growth per leaf area", "cm²/m²", "YlGn")}
_DECIMALS = {"light": 1, "vigour": 1}

_CAUSES = {
    "suppression": (0.35, 0.40, 0.60),
    "no_buds": (0.55, 0.50, 0.65),
    "age": (0.60, 0.45, 0.30),
    "background": (0.45, 0.45, 0.45),
    "buckling": (0.75, 0.55, 0.25),
    "wind": (0.20, 0.60, 0.75),
    "fire": (0.80, 0.25, 0.15),
    "insects": (0.60, 0.65, 0.20),
    "disease": (0.55, 0.25, 0.55),
    "browsing": (0.80, 0.60, 0.55),
    "drought": (0.90, 0.70, 0.30),
    "thinning": (0.85, 0.45, 0.20),
    "harvest": (0.70, 0.20, 0.30),
    "tending": (0.90, 0.60, 0.45),
    "other": (0.30, 0.30, 0.30),
}


@dataclass(frozen=True)
class Legend:
    """What the page shows beside coloured trees.

    Attributes
    ----------
    title, unit : str
    entries : list of (name, CSS colour)
        Of kinds; empty for a scale.
    ends : (str, str)
        Of a scale: its least and largest value.
    gradient : str
        Of a scale: a CSS gradient from left to right.
    """

    title: str
    unit: str = ""
    entries: list[tuple[str, str]] = field(default_factory=list)
    ends: tuple[str, str] = ("", "")
    gradient: str = ""

    def with_more(self, entries: list[tuple[str, str]]) -> Legend:
        """Give it with more entries."""
        return replace(self, entries=[*self.entries, *entries])

    def as_state(self) -> dict[str, Any]:
        """Give what a page can hold."""
        entries = [{"name": name, "colour": colour} for name, colour in self.entries]
        return {
            "title": self.title,
            "unit": self.unit,
            "entries": entries,
            "low": self.ends[0],
            "high": self.ends[1],
            "gradient": self.gradient,
        }


def css(colour: Any) -> str:
    """Give a colour (0 to 1) as CSS takes it."""
    red, green, blue = (round(255 * float(part)) for part in tuple(colour)[:3])
    return f"rgb({red},{green},{blue})"


def species_label(name: str) -> str:
    """Give a species' name as people write it."""
    return name.replace("_", " ").capitalize()


def colour_trees(source: Source, trees: pd.DataFrame, by: str) -> tuple[Colours, Legend]:
    """Colour the trees of a year.

    Scales reach over all years of the source, so that a colour means the same in each.

    Parameters
    ----------
    source : Source
    trees : DataFrame
        Its trees in a year.
    by : str
        One of `CHOICES`.

    Returns
    -------
    float64 (n, 3)
        Red, green, blue of each tree, 0 to 1.
    Legend
    """
    dead = (trees["status"].astype(str) == "dead").to_numpy()
    if by == "species":
        return _by_species(source, trees, dead)
    if by == "cause":
        return _by_cause(source, trees)
    scale = _SCALES[by]
    most = 1.0 if by == "light" else source.largest.get(scale.column, 0.0) or 1.0
    values = vigour(trees) if by == "vigour" else trees[scale.column].to_numpy(np.float64)
    colours = on_scale(values / most, scale.colours)
    colours[dead] = _DEAD
    stops = map(css, on_scale(np.linspace(0.0, 1.0, _STOPS + 1), scale.colours))
    gradient = f"linear-gradient(to right, {', '.join(stops)})"
    ends = "0", f"{most:.{_DECIMALS.get(by, 0)}f}"
    return colours, Legend(scale.title, scale.unit, _dead_entry(dead), ends, gradient)


def colours_of_others(others: pd.DataFrame) -> Colours:
    """Colour residual trees and snags, (n, 3), 0 to 1."""
    snag = (others["fate"] == SNAG).to_numpy(np.bool_)
    return np.where(snag[:, None], FATE_COLOURS[SNAG], RESIDUAL)


def legend_of_others(others: pd.DataFrame) -> list[tuple[str, str]]:
    """Name what of residual trees and snags is there."""
    snag = (others["fate"] == SNAG).to_numpy(np.bool_)
    named = [("residual tree", ~snag, RESIDUAL), ("snag", snag, FATE_COLOURS[SNAG])]
    return [(name, css(colour)) for name, here, colour in named if here.any()]


def vigour(trees: pd.DataFrame) -> NDArray[np.float64]:
    """Growth of the basal area in the year per leaf area, cm2/m2, NaN if not known.

    A growth efficiency as Waring (1983), of the section at 1.3 m in place of the whole stem.
    """
    width_cm = 0.1 * trees["ring_width_mm"].to_numpy(np.float64)
    dbh_cm = trees["dbh_cm"].to_numpy(np.float64)
    grown = np.pi * width_cm * np.maximum(dbh_cm - width_cm, 0.0)
    leaves = trees["leaf_area_m2"].to_numpy(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(leaves > 0.0, grown / leaves, np.nan)


def fates(source: Source) -> dict[int, str]:
    """Why each tree that is gone went, as far as the source knows: its id to the cause."""
    events = source.events
    gone = events[events["kind"].astype(str).isin(FATES)]
    causes = gone["cause"].astype(str)
    return dict(zip(gone["tree_id"].astype(int), causes, strict=True))


def _by_species(
    source: Source, trees: pd.DataFrame, dead: NDArray[np.bool_]
) -> tuple[Colours, Legend]:
    names = trees["species"].astype(str)
    looks = {name: look_of(name).line for name in names.unique()}
    colours = np.array([looks[name] for name in names], np.float64).reshape(-1, 3)
    colours[dead] = _DEAD
    known = [species.name for species in source.scenario.species_list]
    entries = [(species_label(name), css(look_of(name).line)) for name in known]
    return colours, Legend("Species", entries=entries + _dead_entry(dead))


def _by_cause(source: Source, trees: pd.DataFrame) -> tuple[Colours, Legend]:
    fate = fates(source)
    causes = [fate.get(int(tree_id), "") for tree_id in trees["tree_id"]]
    colours = np.array(
        [_CAUSES.get(cause, _UNKNOWN) if cause else _LIVES_ON for cause in causes], np.float64
    ).reshape(-1, 3)
    present = [cause for cause in _CAUSES if cause in set(fate.values())]
    entries = [(cause.replace("_", " "), css(_CAUSES[cause])) for cause in present]
    return colours, Legend("Dies later of", entries=[*entries, ("lives on", css(_LIVES_ON))])


def _dead_entry(dead: NDArray[np.bool_]) -> list[tuple[str, str]]:
    return [("died this year", css(_DEAD))] if dead.any() else []
