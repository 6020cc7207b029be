"""The command that draws scenes: `forest stand-view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forest.cli.shared import check_targets

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.trees.skeleton import Skeleton
    from forest.view.scenery import Scenery


def stand_view(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE.toml|RUN.h5", help="A scene's file, or a run file.")
    ],
    to: Annotated[
        Path, typer.Option("--to", metavar="FILE.png|.gif", help="The picture, or the film.")
    ],
    year: Annotated[
        int | None, typer.Option(help="Of a run: the calendar year. Default: the last one.")
    ] = None,
    tile: Annotated[
        int, typer.Option(help="Of a run: repeat the plot so many times each way, as scenery.")
    ] = 1,
    eye: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="The eye, m; Z above the ground there.")
    ] = None,
    towards: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="What it looks at, the same way.")
    ] = None,
    field_of_view: Annotated[
        float | None, typer.Option(metavar="DEG", help="Vertical angle of the picture.")
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Pixels.")] = None,
    season: Annotated[str | None, typer.Option(help="spring, summer, fall or winter.")] = None,
    quality: Annotated[
        float | None, typer.Option(help="How far off branches are drawn; usually up to 1.")
    ] = None,
    sun: Annotated[
        str | None,
        typer.Option(metavar="AZ,EL", help="Azimuth (north 0, east 90) and height, degree."),
    ] = None,
    haze: Annotated[
        float | None, typer.Option(metavar="M", help="Distance at which 1/e of a colour is left.")
    ] = None,
    shadows: Annotated[bool, typer.Option(help="Whether trees cast shadows.")] = True,
    frames: Annotated[int, typer.Option(help="Pictures of a flight around the scene.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
) -> None:
    """Draw a stand as one sees it who stands in it: a scene of trees, or a year of a run.

    Trees are drawn in the detail of their distance, with shadows, seasons, haze and grass.

    Examples:

        forest stand-view scenarios/scenery/valley.toml --to valley.png --season fall

        forest stand-view run.h5 --year 2040 --tile 3 --to stand.png --haze 150

        forest stand-view run.h5 --to stand.png --eye 20,-30,12 --towards 20,20,8 --sun 240,25

        forest stand-view run.h5 --to around.gif --frames 36 --size 480x300
    """
    from forest.errors import InputError
    from forest.view.stand_view import draw_stand_view, frame_paths

    for name, value in (("--frames", frames), ("--tile", tile)):
        if not 1 <= value <= 1000:
            raise InputError(f"{name} is {value}", expected="1 to 1000")
    if frames > 1 or to.suffix.lower() == ".gif":
        suffixes: tuple[str, ...] = (".png", ".gif")
    else:
        suffixes = (".png",)
    check_targets(*((path, suffixes) for path in frame_paths(to, frames)), force=force)
    is_run = scene.suffix.lower() != ".toml"
    if not is_run and (year is not None or tile != 1):
        raise InputError("--year and --tile are for run files", where=str(scene))
    scenery = scenery_of_path(scene, year, tile) if is_run else _of_file(scene)
    scenery = _changed(scenery, season, quality, sun, haze, size)
    scenery = _seen_from(scenery, eye, towards, field_of_view)
    for note in scenery.notes:
        typer.echo(note)
    paths = draw_stand_view(
        scenery,
        to,
        shadows=shadows,
        frames=frames,
        overwrite=force,
        say=lambda line: typer.echo(line, err=True),
    )
    typer.echo(f"{paths[0]}" + (f" to {paths[-1].name}" if len(paths) > 1 else ""))


def _of_file(scene: Path) -> Scenery:
    from forest.view.scenery import load_scenery

    return load_scenery(scene)


def scenery_of_path(path: Path, year: int | None, tile: int) -> Scenery:
    """Read a year of a run, with the shapes of the checkpoint that is nearest to it."""
    from dataclasses import replace

    from forest.record.run import open_run
    from forest.view.scenery import scenery_of_run

    with open_run(path) as run:
        if not len(run.years):
            return scenery_of_run(run, year, tile=tile)
        wanted = int(run.years[-1]) if year is None else year
        at, shapes, notes = _nearest_shapes(path, run.scenario, wanted)
        scenery = scenery_of_run(run, year, shapes=shapes, shapes_year=at, tile=tile)
        return replace(scenery, notes=scenery.notes + notes)


def _nearest_shapes(
    run_file: Path, scenario: Scenario, year: int
) -> tuple[int, list[Skeleton], tuple[str, ...]]:
    """Take all trees' shapes from the whole checkpoint nearest to a year: year, shapes, notes."""
    from forest.errors import InputError
    from forest.record.checkpoint import checkpoint_paths, read_checkpoint, step_of
    from forest.stand import Stand

    def years_off(path: Path) -> int:
        return abs(scenario.start_year + step_of(path) - 1 - year)

    notes: list[str] = []
    for path in sorted(checkpoint_paths(run_file), key=years_off):
        try:
            arrays, meta = read_checkpoint(path)
        except InputError as error:
            notes.append(f"{error}: its shapes are not used")
            continue
        stand = Stand.restore(scenario, arrays, meta)
        shapes = [stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id]
        return stand.year, shapes, tuple(notes)
    return year, [], tuple(notes)


def _changed(
    scenery: Scenery,
    season: str | None,
    quality: float | None,
    sun: str | None,
    haze: float | None,
    size: str | None,
) -> Scenery:
    """Put what the command line says in place of what the scene says."""
    from dataclasses import replace

    from forest.errors import InputError
    from forest.surface.detail import Sight

    changes: dict[str, Any] = {}
    if season is not None or quality is not None:
        given = {"season": season, "quality": quality}
        changes |= {key: value for key, value in given.items() if value is not None}
        Sight(**changes)
    if sun is not None:
        changes["sun_azimuth_deg"], changes["sun_elevation_deg"] = _numbers(sun, "--sun", 2)
    if haze is not None:
        if not 0.0 < haze < float("inf"):
            raise InputError(f"--haze is {haze:g}", expected="metres above 0")
        changes["haze"] = replace(scenery.haze, visibility_m=haze)
    if size is not None:
        changes["size"] = pixels_of(size)
    return replace(scenery, **changes)


def pixels_of(size: str) -> tuple[int, int]:
    """Read --size: width and height, pixels."""
    from forest.errors import InputError

    sides = size.lower().split("x")
    whole = len(sides) == 2 and all(side.isascii() and side.isdigit() for side in sides)
    if not whole or not all(16 <= int(side[:9]) <= 16384 for side in sides):
        raise InputError(
            f"--size is {size!r}", expected="WxH, 16 to 16384 pixels each, e.g. 1200x750"
        )
    return int(sides[0]), int(sides[1])


def _seen_from(
    scenery: Scenery, eye: str | None, towards: str | None, field_of_view: float | None
) -> Scenery:
    """Look from elsewhere."""
    from dataclasses import replace

    from forest.errors import InputError

    changes: dict[str, Any] = {}
    for name, text in (("eye", eye), ("towards", towards)):
        if text is not None:
            x, y, above = _numbers(text, f"--{name}", 3)
            changes[name] = (x - scenery.origin_m[0], y - scenery.origin_m[1], above)
    if field_of_view is not None:
        if not 0.0 < field_of_view < 170.0:
            raise InputError(
                f"--field-of-view is {field_of_view:g}", expected="degrees above 0, below 170"
            )
        changes["field_of_view_deg"] = field_of_view
    return replace(scenery, view=replace(scenery.view, **changes))


def _numbers(text: str, option: str, count: int) -> tuple[float, ...]:
    """Read numbers between commas."""
    from math import isfinite

    from forest.errors import InputError

    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count or not all(isfinite(number) for number in found):
        raise InputError(f"{option} is {text!r}", expected=f"{count} numbers between commas")
    return found
