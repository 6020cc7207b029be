"""Simulated trees beside measured ones: branch orders, lengths, angles and bud fates.

    python analysis/compare_architecture.py run.h5 measured/*.csv --to architecture.png

takes the sample trees of a run, in its last year or the one given, and cylinder models of measured
trees: SimpleForest's .csv, TreeQSM's .txt. It draws both and prints how far apart they are.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import forest
from forest.interop import read_simpleforest, read_treeqsm
from forest.interop.architecture import FATES, axes_of, bud_fates, distances, distributions, orders
from forest.trees.skeleton import Skeleton

if TYPE_CHECKING:
    import pandas as pd

_READERS = {".csv": read_simpleforest, ".txt": read_treeqsm}
_COLOURS = ("tab:green", "tab:brown", "tab:blue", "tab:gray")
_STYLES = {1: "-", 2: "--", 3: ":"}  # of the branching orders that are drawn


def simulated(path: Path, year: int | None = None) -> list[Skeleton]:
    """Give the sample trees of a run that lived in a year; the run's last if none is given."""
    with forest.open_run(path) as run:
        at = int(run.years[-1]) if year is None else year
        events = run.read("events", ["year", "tree_id", "kind"], years=(int(run.years[0]), at))
        gone = set(events.tree_id[events.kind.isin(["died", "felled", "windthrown"])])
        return [run.skeleton(tree_id, at) for tree_id in run.samples if tree_id not in gone]


def measured(paths: Sequence[Path]) -> list[Skeleton]:
    """Read cylinder models; the suffix names the format."""
    trees = []
    for k, path in enumerate(paths):
        reader = _READERS.get(path.suffix.lower())
        if reader is None:
            raise forest.InputError(
                f"unknown format '{path.suffix}'", where=str(path), expected=".csv or .txt"
            )
        trees.append(reader(path, tree_id=k + 1))
    return trees


def draw_architecture(sets: Mapping[str, pd.DataFrame], to: str | Path) -> None:
    """Draw orders, lengths, branching angles and bud fates of some sets of trees.

    Parameters
    ----------
    sets : mapping of name to DataFrame
        Axes from `forest.interop.architecture.axes_of`.
    to : path
        Picture file to write; the format follows the suffix.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 7.4), layout="constrained")
    FigureCanvasAgg(figure)
    ((of_orders, of_lengths), (of_angles, of_fates)) = figure.subplots(2, 2)
    shares = orders(sets)
    table = distributions(sets)
    width = 0.8 / len(sets)
    for k, name in enumerate(sets):
        colour = _COLOURS[k % len(_COLOURS)]
        mine = shares[shares["set"] == name]
        of_orders.bar(mine["order"] + k * width, mine["share"], width, color=colour, label=name)
        for order, style in _STYLES.items():
            cells = table[(table["set"] == name) & (table["order"] == order)]
            lengths = cells[cells["quantity"] == "length_m"]
            angles = cells[cells["quantity"] == "angle_deg"]
            label = f"{name}, order {order}"
            of_lengths.plot(lengths["high"], lengths["share"].cumsum(), style, color=colour)
            middle = 0.5 * (angles["low"] + angles["high"])
            of_angles.plot(middle, angles["share"], style, color=colour, label=label)
    _draw_fates(of_fates, sets)
    of_orders.set(xlabel="branching order", ylabel="share of branches")
    of_orders.legend(frameon=False)
    of_lengths.set(xlabel="length of branch, m", ylabel="share not longer", ylim=(0, 1))
    of_angles.set(xlabel="branching angle, degrees", ylabel="share of branches")
    of_angles.legend(frameon=False, fontsize=8)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(to, dpi=110)


def _draw_fates(axes: Any, sets: Mapping[str, pd.DataFrame]) -> None:
    """Stack the known fates of lateral buds on first-order branches and the trunk."""
    places, labels = [], []
    for name, of_set in sets.items():
        fates = bud_fates(of_set)
        for order in (0, 1):
            bottom = 0.0
            for fate, shade in zip(FATES, ("0.25", "0.6", "0.85"), strict=True):
                share = fates.loc[(fates["order"] == order) & (fates["fate"] == fate), "share"]
                height = float(share.iloc[0]) if len(share) else np.nan
                if np.isfinite(height):
                    axes.bar(len(places), height, 0.7, bottom, color=shade, edgecolor="k", lw=0.4)
                    bottom += height
            places.append(len(places))
            labels.append(f"{name}\norder {order}")
    axes.set_xticks(places, labels, fontsize=8)
    axes.set(ylabel="share of nodes", ylim=(0, 1))
    axes.set_title("lateral buds: grown (dark), living, dead (light)", fontsize=9)


def main(words: Sequence[str] | None = None) -> None:
    """Read both sets, draw them and print their distances."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="run file with sample trees")
    parser.add_argument("measured", type=Path, nargs="+", help="cylinder models, .csv or .txt")
    parser.add_argument("--year", type=int, help="year of the run; default: its last")
    parser.add_argument("--to", type=Path, required=True, help="picture to write")
    asked = parser.parse_args(words)
    sets = {
        "simulated": axes_of(simulated(asked.run, asked.year)),
        "measured": axes_of(measured(asked.measured)),
    }
    draw_architecture(sets, asked.to)
    apart = distances(sets["simulated"], sets["measured"])
    print(apart.to_string(index=False, float_format=lambda value: f"{value:.3g}"))


if __name__ == "__main__":
    main()
