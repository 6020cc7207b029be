"""Films of a sample tree: once around it, as it stands in a year or as it grows up."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.record.run import Run
from forest.surface.blend import blended
from forest.surface.tubes import tubes
from forest.trees.leaves import leaves_of
from forest.trees.skeleton import Skeleton
from forest.view.film import FilmSettings, check_film, write_film
from forest.view.overlay import font
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, shoot
from forest.view.surface_picture import add_textured
from forest.view.tree_mesh import species_of, too_thin, tree_parts

#: How a tree is drawn: as its internodes, or as one surface (`forest.surface`).
SHAPES = ("skeleton", "mesh")

_SECONDS_AROUND = 8.0
_SECONDS_PER_YEAR = 0.3
_GROWING = 0.85  # share of the film in which a tree grows up; then its last year stays
_ABOVE_DEG = 6.0
_BEARING_DEG = -75.0
_LEAST_WIDTH = 0.0007  # radius of the thinnest wood, as a share of the tree's height
_TEXT = 0.034  # height of letters, as a share of the frame's
_INK = (30, 34, 30)
_BEHIND = (0.84, 0.88, 0.90)  # pale bark must be seen
_LAMP = (-0.5, 0.6, 1.0)


def film_tree(
    run: Run,
    tree_id: int,
    to: str | Path,
    *,
    settings: FilmSettings | None = None,
    year: int | None = None,
    grow: bool = False,
    shape: str = "skeleton",
    leaves: bool = True,
    overwrite: bool = False,
    begin: Callable[[int], object] = lambda count: None,
    done: Callable[[], object] = lambda: None,
) -> int:
    """Write a film that goes once around a sample tree.

    Parameters
    ----------
    run : Run
        An open run.
    tree_id : int
        One of its sample trees.
    to : path
        An .mp4 or a .gif.
    settings : FilmSettings, optional
        Frames, length and size.
    year : int, optional
        Calendar year; the tree's last on record if not given. With `grow` the last one shown.
    grow : bool
        Whether the tree is shown in all its years, one after another.
    shape : str
        One of `SHAPES`. A tree that is too thin to blend has tubes for a surface.
    leaves : bool
        Whether it has its leaves.
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
        If the tree or the year is not on record, or there is no such shape.
    """
    settings = settings or FilmSettings()
    to = Path(to)
    check_film(to, settings.size)
    if shape not in SHAPES:
        raise InputError(f"no shape '{shape}', {nearest(shape, SHAPES)}")
    recorded = run.sample_years(tree_id).tolist() if tree_id in run.samples else []
    last = (recorded or [0])[-1] if year is None else year
    whole = run.skeleton(tree_id, last)  # refuses a tree or a year that is not on record
    if grow and len(recorded) < 2:
        raise InputError(
            f"tree {tree_id} is on record in {last} alone",
            where=str(run.path),
            expected="a tree of output.sample_trees.ids, whose whole life is on record",
        )
    shown = [y for y in recorded if y <= last] if grow else [last]
    usual = max(_SECONDS_AROUND, _SECONDS_PER_YEAR * len(shown))
    count = settings.count(usual)
    growing = max(1, round(_GROWING * count))
    at = [shown[min(k * len(shown) // growing, len(shown) - 1)] for k in range(count)]
    stage = _TreeStage(run, whole, settings.size, shape, leaves)

    def frame(k: int) -> NDArray[np.uint8]:
        return stage.picture(at[k], k / count)

    with closing(stage):
        write_film(frame, count, to, fps=settings.fps, overwrite=overwrite, begin=begin, done=done)
    return count


class _TreeStage:
    """A tree of one year at a time, seen from all sides from the same distance."""

    def __init__(
        self, run: Run, whole: Skeleton, window: tuple[int, int], shape: str, leaves: bool
    ) -> None:
        self.run, self.tree_id, self.window = run, whole.tree_id, window
        self.shape, self.leaves = shape, leaves
        points = np.concatenate((whole.start, whole.end))
        base = whole.start[0]
        reach = float(np.hypot(*(points[:, :2] - base[:2]).T).max())
        angle = 2.0 * np.pi * np.arange(24) / 24
        rim = base[:2] + max(reach, 0.05) * np.column_stack((np.cos(angle), np.sin(angle)))
        ends = (min(0.0, float(points[:, 2].min())), float(points[:, 2].max()))
        self.space = np.concatenate([np.column_stack((rim, np.full(24, z))) for z in ends])
        self.thin = _LEAST_WIDTH * (ends[1] - ends[0])
        self._year = 0
        self._plotter: Any = None
        self._shown = False

    def picture(self, year: int, turn: float) -> NDArray[np.uint8]:
        """Show the tree of a year, from a share `turn` of the way around it."""
        if year != self._year:
            self._put_up(year)
        look_at(
            self._plotter,
            self.space,
            bearing_deg=_BEARING_DEG + 360.0 * turn,
            above_deg=_ABOVE_DEG,
            aspect=self.window[0] / self.window[1],
        )
        shown, self._shown = self._shown, True
        return self._named(shoot(self._plotter, again=shown), year)

    def close(self) -> None:
        """Give back what the plotter holds."""
        if self._plotter is not None:
            self._plotter.close()

    def _put_up(self, year: int) -> None:
        self.close()
        self._plotter, self._shown, self._year = open_plotter(self.window), False, year
        self._plotter.set_background(_BEHIND)
        skeleton = self.run.skeleton(self.tree_id, year)
        if self.shape == "skeleton":
            Scene([skeleton], leaves=self.leaves, least_radius_m=self.thin).add_to(self._plotter)
            return
        self._plotter.remove_all_lights()
        lamp = import_pyvista().Light(position=_LAMP, light_type="camera light")
        self._plotter.add_light(lamp)  # goes around with the eye
        species = species_of(self.run, skeleton)
        wood = tubes(skeleton) if too_thin(skeleton) else blended(skeleton)
        cards = leaves_of(skeleton, species) if self.leaves else None
        add_textured(self._plotter, tree_parts(wood, skeleton, cards))

    def _named(self, picture: NDArray[np.uint8], year: int) -> NDArray[np.uint8]:
        from PIL import Image, ImageDraw

        frame = Image.fromarray(picture)
        size = _TEXT * self.window[1]
        text = f"{year}, tree {self.tree_id}"
        ImageDraw.Draw(frame).text((size, 0.7 * size), text, font=font(size), fill=_INK)
        return np.asarray(frame)
