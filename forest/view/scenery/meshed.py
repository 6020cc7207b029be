"""From a run, a stand or a scene's file to meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from forest.errors import InputError
from forest.record.run import Run
from forest.surface.detail import Sight
from forest.surface.scene import Scene, build_scene, ground_of
from forest.trees.skeleton import Skeleton
from forest.view.scenery.from_run import scenery_of_run, scenery_of_stand
from forest.view.scenery.scenery import Scenery

if TYPE_CHECKING:
    from forest.stand import Stand

_Say = Callable[[str], object]


def scene_of(
    what: Run | Stand | Scenery,
    year: int | None = None,
    *,
    detail: str | float = "stand",
    leaves: bool = True,
    season: str | None = None,
    quality: float | None = None,
    tile: int = 1,
    ground: bool = True,
    shapes: Iterable[Skeleton] = (),
    shapes_year: int | None = None,
    say: _Say = lambda line: None,
) -> Scene:
    """Make meshes of a whole stand, each shape once, and tell where trees of it stand.

    Parameters
    ----------
    what : Run, Stand or Scenery
        A run, of which a year is taken; a stand as it stands; or what `load_scenery` read.
    year : int, optional
        Of a run: calendar year; the last one if not given.
    detail : str or float
        ``"tree"``, ``"stand"`` or ``"far"``, or the range in m from which the scene is to be
        seen (`forest.surface.scene.DETAILS`).
    leaves : bool
        Whether trees have leaves at all.
    season : str, optional
        One of `forest.surface.detail.SEASONS`; summer, or the scenery's own, if not given.
    quality : float, optional
        How far off branches are drawn, usually up to 1; 1 or the scenery's own if not given.
    tile : int
        Of a run or a stand: the plot is repeated so many times each way.
    ground : bool
        Whether there is a ground.
    shapes : iterable of Skeleton
        Of a run: more trees, e.g. those of a checkpoint.
    shapes_year : int, optional
        Their calendar year; the scene's unless given.
    say : callable
        Is told, in a line, how far it is.

    Raises
    ------
    InputError
        If the year is not on record, there is no tree, or a word or number is out of its range.
    """
    if isinstance(what, Run):
        scenery = scenery_of_run(
            what, year, shapes=shapes, shapes_year=shapes_year, tile=tile, grass=None
        )
    else:
        if year is not None:
            raise InputError("a year is given", expected="one of a run only")
        scenery = what if isinstance(what, Scenery) else scenery_of_stand(what, tile=tile)
    changes: dict[str, Any] = {"season": season, "quality": quality}
    scenery = replace(scenery, **{k: v for k, v in changes.items() if v is not None})
    for note in scenery.notes:
        say(note)
    made = build_scene(
        scenery.models,
        scenery.instances,
        detail=detail,
        sight=Sight(scenery.season, scenery.quality),
        leaves=leaves,
        census=scenery.census,
        ground=ground_of(scenery.terrain, scenery.extent, scenery.ground) if ground else None,
        say=say,
    )
    return replace(made, origin_m=scenery.origin_m)
