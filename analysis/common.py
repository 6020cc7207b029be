"""What the scripts on run files share: their command line, and figures of one look."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import forest
from forest.record.run import Run

#: Who comes first in succession, and who passes them in the end.
LIGHT_DEMANDING = ("betula_pendula", "pinus_sylvestris")
SHADE_TOLERANT = ("fagus_sylvatica", "picea_abies")

_DPI = 150


@dataclass(frozen=True)
class Study:
    """What a script makes of a run.

    Attributes
    ----------
    figure : Figure
        To be saved.
    numbers : DataFrame
        To be printed.
    """

    figure: Figure
    numbers: pd.DataFrame


def script(
    document: str | None,
    study: Callable[..., Study],
    words: Sequence[str] | None,
    options: Mapping[str, tuple[float, str]] | None = None,
    *,
    against: bool = False,
) -> None:
    """Answer `python analysis/x.py run.h5 --to figure.png`: draw the figure, print the numbers.

    Each of `options` is a number that may be given, `--name 1.5`: its default, and what it is. The
    study is called with the run and with these by name. With `against` it may be given another
    run beside the first, by `--against`.
    """
    lines = (document or "").strip().splitlines()
    parser = argparse.ArgumentParser(description=lines[0])
    parser.add_argument("run", type=Path, help="run file")
    parser.add_argument("--to", type=Path, required=True, help="figure to write: .png, .pdf, .svg")
    for name, (default, text) in (options or {}).items():
        flag = "--" + name.replace("_", "-")
        parser.add_argument(flag, type=float, default=default, help=f"{text}; default {default:g}")
    if against:
        parser.add_argument("--against", type=Path, help="run file to compare it with")
    asked = vars(parser.parse_args(words))
    path, to, other = asked.pop("run"), asked.pop("to"), asked.pop("against", None)
    try:
        with ExitStack() as stack:
            paths = [path] if other is None else [path, other]
            runs = [stack.enter_context(forest.open_run(one)) for one in paths]
            for run in runs:
                if not len(run.years):
                    raise forest.InputError("holds no years yet", where=str(run.path))
            made = study(*runs, **asked)
        save(made.figure, to)
    except forest.InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    print(made.numbers.to_string(index=False, float_format=lambda value: f"{value:.4g}"))


def save(figure: Figure, to: Path) -> None:
    """Write a figure; the format follows the suffix."""
    formats = figure.canvas.get_supported_filetypes()
    if to.suffix.lower()[1:] not in formats:
        raise forest.InputError(
            f"unknown format '{to.suffix}'", where=str(to), expected=".png, .pdf or .svg"
        )
    try:
        figure.savefig(to, dpi=_DPI)
    except OSError as error:
        raise forest.InputError(f"cannot be written: {error.strerror}", where=str(to)) from None


def fewer_colours(picture: Path) -> None:
    """Write a .png again with 256 colours, at a third of its size; for the documentation."""
    from PIL import Image

    with Image.open(picture) as full:
        few = full.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    few.save(picture, optimize=True)


def panels(columns: int, rows: int = 1, *, size: tuple[float, float] = (4.4, 3.6)) -> Any:
    """Give a figure and its axes, (rows, columns), `size` inches each; lettered a, b, c."""
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    for letter, one in zip("abcdefgh", axes.flat, strict=False):
        one.spines[["top", "right"]].set_visible(False)
        if axes.size > 1:
            one.set_title(letter, loc="left", fontweight="bold", fontsize=10)
    return figure, axes


def plain(species: str) -> str:
    """Write a species' name as people do."""
    return species.replace("_", " ").capitalize()


def enough(rows: Any, what: str, run: Run) -> None:
    """Refuse a run that has nothing of what a study is about."""
    if not len(rows):
        raise forest.InputError(f"has no {what}", where=str(run.path), expected="an older stand")
