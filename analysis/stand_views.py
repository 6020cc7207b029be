"""Draw the gallery's views of stands: `python analysis/stand_views.py`.

The valley in three seasons, and the Saxony spruce stand of `make demo` (out/run.h5) from its edge.
Names of pictures as arguments draw these alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from forest.record.checkpoint import latest_checkpoint  # noqa: E402
from forest.record.run import open_run  # noqa: E402
from forest.stand import Stand  # noqa: E402
from forest.view.scenery import Haze, Scenery, Viewpoint, load_scenery, scenery_of_run  # noqa: E402
from forest.view.stand_view import draw_stand_view  # noqa: E402

TO = ROOT / "docs" / "gallery"
SIZE = (640, 400)


def valley(season: str, **changes: object) -> Scenery:
    """Give the valley in a season."""
    scenery = load_scenery(ROOT / "scenarios" / "scenery" / "valley.toml")
    return replace(scenery, season=season, **changes)  # type: ignore[arg-type]


def spruce_stand() -> Scenery:
    """Give the last year of the demo's run, nine times, in the shapes of its checkpoint."""
    path = ROOT / "out" / "run.h5"
    with open_run(path) as run:
        found = latest_checkpoint(path)
        assert found is not None, "`make demo` first"
        stand = Stand.restore(run.scenario, *found)
        shapes = [stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id]
        scenery = scenery_of_run(run, stand.year, shapes=shapes, tile=3)
    return replace(scenery, haze=replace(scenery.haze, visibility_m=300.0))


PICTURES: dict[str, Callable[[], Scenery]] = {
    "valley_summer": lambda: valley("summer"),
    "valley_fall": lambda: valley(
        "fall",
        haze=Haze(350.0),
        view=Viewpoint((200.0, 30.0, 50.0), (205.0, 190.0, 0.0)),
    ),
    "valley_winter": lambda: valley("winter", sun_elevation_deg=22.0),
    "stand_view": spruce_stand,
}


def main() -> None:
    """Draw the pictures."""
    for name in sys.argv[1:] or PICTURES:
        scenery = replace(PICTURES[name](), size=SIZE)
        draw_stand_view(scenery, TO / f"{name}.png", overwrite=True)
        print(name, *scenery.notes, sep="\n  ")


if __name__ == "__main__":
    main()
