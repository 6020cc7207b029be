"""Films of a run's stand: its years as they go by, trees as stem cones and crown shapes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.run import Run
from forest.view.bodies_picture import Stage
from forest.view.film import FilmSettings, check_film, write_film
from forest.view.overlay import Overlay, stage_size
from forest.view.stand_years import FATES, StandYears, conifers_of
from forest.view.standing import SNAG
from forest.view.tree_colours import TreeColours

_SECONDS_PER_YEAR = 0.35
_USUAL_SECONDS = (4.0, 15.0)
_TURN_SECONDS = 6.0  # of a stand with one year on file

_Done = Callable[[int], object]


def film_stand(
    run: Run,
    to: str | Path,
    *,
    settings: FilmSettings | None = None,
    from_year: int | None = None,
    to_year: int | None = None,
    colour: str = "species",
    view: str = "side",
    overwrite: bool = False,
    begin: _Done = lambda count: None,
    done: Callable[[], object] = lambda: None,
) -> int:
    """Write a film of a run: its years go by evenly, and the last stays for a moment.

    Between the ends of two years, sizes lie on a line. Trees that die, are felled or thrown in a
    year are seen once more in that year's frames, in a colour of their own, as they go. Residual
    trees, snags and obstacles stand where they are on record.

    Parameters
    ----------
    run : Run
        An open run, finished or not.
    to : path
        An .mp4 or a .gif.
    settings : FilmSettings, optional
        Frames, length and size.
    from_year, to_year : int, optional
        First and last calendar year shown; those of the run if not given.
    colour : str
        One of `forest.view.tree_colours.COLOURS`.
    view : str
        One of `forest.view.bodies_picture.VIEWS`.
    overwrite : bool
        Whether to replace a file.
    begin, done : callable
        Told the number of frames; called after each of them.

    Returns
    -------
    int
        Number of frames.

    Raises
    ------
    InputError
        If there are no trees on file, a year is not, or a name is unknown.
    """
    settings = settings or FilmSettings()
    to = Path(to)
    check_film(to, settings.size)
    years = StandYears(run)
    first = years.check_year(from_year, "from_year", years.first)
    last = years.check_year(to_year, "to_year", years.last)
    if last < first:
        raise InputError(f"to_year {last} lies before from_year {first}")
    colours = TreeColours.of_run(run, colour)
    usual = np.clip(_SECONDS_PER_YEAR * (last - first), *_USUAL_SECONDS)
    count = settings.count(_TURN_SECONDS if first == last else float(usual))
    moments = _moments(first, last, count, settings.fps)
    overlay = Overlay(settings.size, colours, *_told(run, first, last))
    tall = run.read("trees", ["height_m"], years=(first, last))["height_m"].to_numpy(np.float64)
    others = years.others(first)["height_m"].to_numpy(np.float64)
    stage = Stage(
        run.scenario.plot.size_m,
        float(np.nanmax(np.concatenate((tall, others)), initial=0.0)),
        window=stage_size(settings.size),
        view=view,
        conifers=conifers_of(run.scenario),
    )

    def frame(k: int) -> NDArray[np.uint8]:
        since = moments[k - 1] if k else float(first)
        trees = years.at(moments[k], since)
        obstacles = years.obstacles(int(np.ceil(moments[k])))
        picture = stage.picture(trees, colours, k / count, obstacles)
        return overlay.beside(picture, moments[k])

    with stage:
        write_film(frame, count, to, fps=settings.fps, overwrite=overwrite, begin=begin, done=done)
    return count


def _moments(first: int, last: int, count: int, fps: float) -> list[float]:
    """Spread the years over the frames, and leave a second, or a tenth, for the last."""
    still = min(round(fps), count // 10)
    going = np.linspace(first, last, count - still)
    return [*going.tolist(), *[float(last)] * still]


def _told(run: Run, first: int, last: int) -> tuple[object, tuple[str, ...]]:
    """Rows for the charts, and how trees go in these years."""
    stand = None
    if "stand" in run.tables:
        stand = run.read("stand", years=(first, last))
        stand = stand[stand["species"].astype(str) == "all"]
    seen: set[str] = set()
    if "events" in run.tables and last > first:
        seen = set(run.read("events", ["kind"], years=(first + 1, last))["kind"].astype(str))
    if run.scenario.mortality.snags and "died" in seen:
        seen.add(SNAG)
    return stand, tuple(fate for fate in (*FATES, SNAG) if fate in seen)
