"""What the scenario scripts share: their command line, runs on file, tables and maps."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection

import forest
from forest._threads import most_threads, using_threads
from forest.view.looks import look_of


def command_line(document: str | None, name: str) -> argparse.ArgumentParser:
    """Give the parser of a script with what all of them take: folder, seed and threads."""
    parser = argparse.ArgumentParser(description=(document or "").strip().splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out") / name, help="folder to fill")
    parser.add_argument("--seed", type=int, help="another seed than the scenario's")
    parser.add_argument("--threads", type=int, help="threads; default: all cores")
    return parser


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn what the user did wrong into one line and exit status 2."""
    try:
        yield
    except (forest.InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None


@contextmanager
def threads(wanted: int | None) -> Iterator[None]:
    """Compute with so many threads, all by default, where no run is written."""
    with using_threads(min(wanted or most_threads(), most_threads())):
        yield


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def report(table: pd.DataFrame, to: Path, heading: str = "") -> None:
    """Print a table, three digits each, and keep it as CSV."""
    print(
        ("\n" + heading + "\n" if heading else "")
        + table.to_string(index=False, float_format=_short, na_rep="–")
    )
    table.to_csv(to, index=False)


def draw_map(
    axes: Axes,
    trees: pd.DataFrame,
    size_m: tuple[float, float],
    title: str,
    thicker: float = 10.0,
) -> None:
    """Draw crowns, and stems so many times as thick as they are."""
    places = trees[["x_m", "y_m"]].to_numpy()
    colours = [look_of(name).line for name in trees["species"].astype(str)]
    for width, alpha in (
        (2.0 * trees["crown_radius_m"], 0.18),
        (0.01 * thicker * trees["dbh_cm"].fillna(0.3), 0.9),
    ):
        axes.add_collection(
            EllipseCollection(
                width,
                width,
                np.zeros(len(trees)),
                units="xy",
                offsets=places,
                offset_transform=axes.transData,
                facecolors=colours,
                alpha=alpha,
            )
        )
    axes.set(xlim=(0, size_m[0]), ylim=(0, size_m[1]), aspect="equal")
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_title(title, fontsize=10)
