"""The command that makes parametric trees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forest.cli.shared import Overrides, check_targets


def tree(
    species: Annotated[
        str | None, typer.Argument(help="A parametric species, or a TOML file of one.")
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--to", help="A .vtp, .csv (cylinders) or .png file.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Each seed is another tree.")] = 0,
    changes: Overrides = None,
    leaves: Annotated[bool, typer.Option(help="Whether leaves are drawn.")] = True,
    season: Annotated[str, typer.Option(help="spring, summer, fall or winter.")] = "summer",
    time: Annotated[float, typer.Option(help="Moment of the wind, s.")] = 0.0,
    wind: Annotated[float, typer.Option(help="Wind speed, as in the paper.")] = 0.0,
    gust: Annotated[float, typer.Option(help="Gusts above the wind speed.")] = 0.0,
    readings: Annotated[str, typer.Option(help="corrected or paper.")] = "corrected",
    list_: Annotated[bool, typer.Option("--list", help="List the species.")] = False,
    force: Annotated[bool, typer.Option(help="Replace the file.")] = False,
) -> None:
    """Make a tree of a parametric species (Weber & Penn 1995).

    Examples:

        forest tree --list

        forest tree quaking_aspen --seed 3 --to aspen.png

        forest tree quaking_aspen --set 1Branches=30 --wind 8 --time 2 --to aspen.vtp
    """
    from forest.errors import InputError, nearest
    from forest.parametric import grow, load_parameters, parametric_names

    if list_ or species is None:
        for name in parametric_names():
            typer.echo(f"{name:<22} {load_parameters(name).common_name}")
        return
    if to is not None:
        check_targets((to, (".vtp", ".csv", ".png")), force=force)
    seasons = ("spring", "summer", "fall", "winter")
    if season not in seasons:
        raise InputError(f"unknown season '{season}', {nearest(season, seasons)}")
    parameters = load_parameters(species).with_changes(changes or [])
    one = grow(parameters, seed, readings=readings)  # type: ignore[arg-type]
    one = one.swayed(time, wind, gust)
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
    from forest.view.parametric_picture import draw_parametric, has_leaves, write_vtp

    if to.suffix.lower() == ".vtp":
        write_vtp(one, to, leaves=leaves and has_leaves(one, season), overwrite=force)
    else:
        draw_parametric(one, to, leaves=leaves, season=season)
