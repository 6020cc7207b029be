"""The command that makes parametric trees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forest.cli.shared import Overrides, check_targets, given_options
from forest.cli.surfacing import MESH, working, write_parts


def tree(
    context: typer.Context,
    species: Annotated[
        str | None, typer.Argument(help="A parametric species, or a TOML file of one.")
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option("--to", help="Mesh .glb, .obj, .ply, .vtp; cylinders .csv; .png; .gif."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Each seed is another tree.")] = 0,
    changes: Overrides = None,
    leaves: Annotated[
        bool | None, typer.Option("--leaves/--no-leaves", help="Default: with all but .ply.")
    ] = None,
    season: Annotated[str, typer.Option(help="spring, summer, fall or winter.")] = "summer",
    time: Annotated[float, typer.Option(help="Moment of the wind, s.")] = 0.0,
    wind: Annotated[float, typer.Option(help="Wind speed, as in the paper.")] = 0.0,
    gust: Annotated[float, typer.Option(help="Gusts above the wind speed.")] = 0.0,
    time_scale: Annotated[
        float | None,
        typer.Option(help="How much faster than printed it swings; of itself 1, in a .gif 2000."),
    ] = None,
    frames: Annotated[int, typer.Option(help="Pictures of a .gif.", min=2, max=1000)] = 24,
    seconds: Annotated[float, typer.Option(help="How long a .gif runs.", min=0.1)] = 4.0,
    quality: Annotated[float, typer.Option(help="Factor on the number of leaves.")] = 1.0,
    readings: Annotated[str, typer.Option(help="corrected or paper.")] = "corrected",
    list_: Annotated[bool, typer.Option("--list", help="List the species.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Make a tree of a parametric species (Weber & Penn 1995).

    Examples:

        forest tree --list

        forest tree quaking_aspen --seed 3 --to aspen.png

        forest tree quaking_aspen --set 1Branches=30 --wind 8 --time 2 --to aspen.glb

        forest tree quaking_aspen --wind 8 --frames 24 --seconds 4 --to sway.gif
    """
    from forest.errors import InputError, nearest
    from forest.parametric import grow, load_parameters, parametric_names

    given = [option for option in given_options(context) if option != "--list"]
    if list_ or species is None:
        if given or (list_ and species is not None):
            needs = f"{given[0]} needs a species" if given else ""
            raise InputError(
                needs or "--list takes no species",
                expected="forest tree SPECIES with options, or forest tree --list alone",
            )
        for name in parametric_names():
            typer.echo(f"{name:<22} {load_parameters(name).common_name}")
        return
    check_targets((to, (*MESH, ".csv", ".png", ".gif")), force=force)
    seasons = ("spring", "summer", "fall", "winter")
    if season not in seasons:
        raise InputError(f"unknown season '{season}', {nearest(season, seasons)}")
    parameters = load_parameters(species).with_changes(changes or [])
    moving = to is not None and to.suffix.lower() == ".gif"
    if moving and wind == 0.0 and gust == 0.0:
        raise InputError("nothing moves in a .gif", expected="--wind or --gust above 0")
    only_moving = [option for option in given if option in ("--frames", "--seconds")]
    if only_moving and not moving:
        raise InputError(f"{only_moving[0]} is for a .gif", expected="--to NAME.gif")
    still = grow(parameters, seed, readings=readings, quality=quality)  # type: ignore[arg-type]
    scale = time_scale if time_scale is not None else 2000.0 if moving else 1.0
    times = [time + k * seconds / frames for k in range(frames if moving else 1)]
    moments = list(still.frames(times, wind, gust, time_scale=scale))
    one = moments[0]
    typer.echo(
        f"{parameters.name}, seed {seed}: {one.nodes.position[:, 2].max():.1f} m, "
        f"{len(one.stems.level)} stems, {len(one.leaves.stem)} leaves"
    )
    if to is None:
        return
    if to.suffix.lower() == ".csv":
        from forest.interop.simpleforest import write_simpleforest

        write_simpleforest(one.skeleton(), to, overwrite=force)
        return
    from forest.view.parametric_picture import draw_parametric, draw_sway, mesh_parts
    from forest.view.tree_mesh import with_leaves

    shown = with_leaves(to, leaves)
    if to.suffix.lower() in MESH:
        with working(f"the surface of {len(one.stems.level):,} stems"):
            parts = mesh_parts(one, leaves=shown, season=season)
        write_parts(parts, to, "texture", force)
    elif moving:
        draw_sway(moments, to, seconds=seconds, leaves=shown, season=season, overwrite=force)
    else:
        draw_parametric(one, to, leaves=shown, season=season)
