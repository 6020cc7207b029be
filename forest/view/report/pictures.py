"""Pictures of a report: the stand in several years, its sample trees and their discs."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.run import Run
from forest.trees.skeleton import Skeleton
from forest.view.bodies_picture import Stage
from forest.view.disc_picture import draw_disc
from forest.view.looks import look_of
from forest.view.report.parts import Picture
from forest.view.stand_years import StandYears, conifers_of
from forest.view.tree_colours import TreeColours
from forest.view.tree_picture import draw_tree

_YEARS_SHOWN = 4
_WINDOW = (640, 440)
_MAP = (440, 440)
_TREE = (300, 420)
_DISC_PX = 420
_DISC_M = 1.3
_COLOURS = 255  # of a picture's palette: a third of the bytes

_Image = Any


def _png(picture: _Image) -> bytes:
    """Write a picture in a palette that has the colours of small trees too."""
    from PIL import Image

    to = BytesIO()
    few = picture.convert("RGB").quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
    few.save(to, format="PNG", optimize=True)
    return to.getvalue()


def _from_file(path: Path, width: int | None = None) -> bytes:
    from PIL import Image

    with Image.open(path) as opened:
        picture: _Image = opened
        if width is not None:
            picture = picture.resize((width, round(width * picture.height / picture.width)))
        return _png(picture)


def years_shown(years: NDArray[np.int32]) -> list[int]:
    """Choose a few years, evenly spread, the last one among them."""
    place = np.linspace(0, len(years) - 1, _YEARS_SHOWN + 1)[1:].round().astype(int)
    return list(dict.fromkeys(years[place].tolist()))


def stand_pictures(run: Run) -> tuple[list[Picture], list[Picture]]:
    """Draw the stand in a few years, from the side and from above, at one scale."""
    from PIL import Image

    stands = StandYears(run)
    years = years_shown(run.years)
    colours = TreeColours.of_run(run, "species")
    size_m = run.scenario.plot.size_m
    frames = {year: stands.at(float(year), float(year)) for year in years}
    tall = max((float(f["height_m"].max()) for f in frames.values() if len(f)), default=0.0)
    made: list[list[Picture]] = []
    for view, window in (("side", _WINDOW), ("above", _MAP)):
        pictures = []
        with Stage(
            size_m, tall, window=window, view=view, conifers=conifers_of(run.scenario)
        ) as stage:
            for year, trees in frames.items():
                shown = stage.picture(trees, colours, obstacles=stands.obstacles(year))
                image = Image.fromarray(shown)
                grown = trees[(trees["tree_id"] > 0) & (trees["fate"] == "")]
                counts = grown["species"].astype(str).value_counts()
                of = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in counts.items() if n)
                where = "from the side" if view == "side" else "from above"
                pictures.append(
                    Picture(
                        _png(image),
                        "png",
                        f"The stand {where} at the end of {year}: {of or 'no trees'}",
                        f"{year}: {len(grown)} trees",
                    )
                )
        made.append(pictures)
    return made[0], made[1]


def species_key(run: Run) -> list[tuple[str, str]]:
    """Give each species' name and the colour of its crowns, as CSS writes it."""
    return [
        (
            name.replace("_", " "),
            "#" + "".join(f"{round(255 * part):02x}" for part in look_of(name).line),
        )
        for name in run.species_names
    ]


def tree_picture(skeleton: Skeleton, year: int) -> Picture:
    """Draw a sample tree with its leaves."""
    with TemporaryDirectory() as folder:
        to = Path(folder) / "tree.png"
        draw_tree(skeleton, to, leaves=True, window=_TREE)
        data = _from_file(to)
    alt = f"Tree {skeleton.tree_id}, {skeleton.species}, at the end of {year}"
    return Picture(data, "png", alt, f"at the end of {year}")


def disc_picture(run: Run, tree_id: int, year: int) -> Picture | None:
    """Draw a disc at 1.3 m; None of a tree that has none there."""
    try:
        disc = run.disc(tree_id, _DISC_M, year=year)
    except InputError:
        return None
    with TemporaryDirectory() as folder:
        to = Path(folder) / "disc.png"
        draw_disc(disc, to, conifer=disc.species in conifers_of(run.scenario))
        data = _from_file(to, _DISC_PX)
    rings = int(np.count_nonzero(disc.ring_widths))
    thick = 200.0 * (disc.radius + disc.bark_thickness)
    told = f"disc at {_DISC_M:g} m: {rings} rings, {thick:.1f} cm over bark"
    return Picture(data, "png", f"Tree {tree_id}, {told}", told)
