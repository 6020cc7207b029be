"""The command that makes meshes of whole stands: `forest scene`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forest.cli.shared import check_targets, options_named
from forest.cli.viewing import scenery_of_path

_SUFFIXES = (".glb", ".vtm", ".vtp", ".png")


def scene(
    stand: Annotated[
        Path, typer.Argument(metavar="RUN.h5|SCENE.toml", help="A run file, or a scene's file.")
    ],
    to: Annotated[
        Path, typer.Option("--to", metavar="FILE.glb|.vtm|.vtp|.png", help="The file to write.")
    ],
    year: Annotated[
        int | None, typer.Option(help="Of a run: the calendar year. Default: the last one.")
    ] = None,
    detail: Annotated[
        str,
        typer.Option(metavar="NAME|M", help="tree, stand, far, or the range it is seen from, m."),
    ] = "stand",
    leaves: Annotated[bool, typer.Option(help="Whether trees have leaves.")] = True,
    season: Annotated[str | None, typer.Option(help="spring, summer, fall or winter.")] = None,
    quality: Annotated[
        float | None, typer.Option(help="How far off branches are drawn; usually up to 1.")
    ] = None,
    tile: Annotated[
        int, typer.Option(help="Of a run: repeat the plot so many times each way.")
    ] = 1,
    ground: Annotated[bool, typer.Option(help="Whether there is a ground.")] = True,
    instanced: Annotated[
        bool,
        typer.Option("--instanced", help="Of a .glb: leaves by EXT_mesh_gpu_instancing."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
) -> None:
    """Make meshes of a whole stand: a year of a run, or a scene of trees.

    Trees of one shape share its mesh in a .glb, with a card for each leaf. VTK's formats have a
    mesh for every tree.

    Examples:

        forest scene run.h5 --year 2060 --to stand.glb

        forest scene run.h5 --to near.glb --detail tree --season winter --no-ground

        forest scene run.h5 --to stand.vtm --detail 200

        forest scene scenarios/scenery/valley.toml --detail far --to valley.png
    """
    from forest.errors import InputError
    from forest.surface.detail import Sight
    from forest.surface.scene import scene_range
    from forest.view.scenery import load_scenery, scene_of

    if not 1 <= tile <= 100:
        raise InputError(f"--tile is {tile}", expected="1 to 100")
    check_targets((to, _SUFFIXES), force=force)
    if instanced and to.suffix.lower() != ".glb":
        raise InputError("--instanced is for .glb files", where=str(to))
    with options_named(detail="--detail", season="--season", quality="--quality"):
        scene_range(detail)
        Sight(season or "summer", 1.0 if quality is None else quality)
    is_run = stand.suffix.lower() != ".toml"
    if not is_run and (year is not None or tile != 1):
        raise InputError("--year and --tile are for run files", where=str(stand))
    made = scene_of(
        scenery_of_path(stand, year, tile) if is_run else load_scenery(stand),
        detail=detail,
        leaves=leaves,
        season=season,
        quality=quality,
        ground=ground,
        say=_say,
    )
    if to.suffix.lower() == ".png":
        from forest.view.scene_picture import draw_scene

        draw_scene(made, to, overwrite=force, say=_say)
    else:
        from forest.surface.export.scene_file import write_scene

        write_scene(made, to, instanced=instanced, overwrite=force, say=_say)
    wood, cards = made.triangles
    all_wood, all_cards = made.standing_triangles
    typer.echo(
        f"{to}: {len(made.instances.model):,} trees of {len(made.shapes):,} shapes, "
        f"{wood + cards:,} triangles once each, {all_wood + all_cards:,} as they stand, "
        f"{to.stat().st_size / 1e6:.1f} MB"
    )


def _say(line: str) -> None:
    typer.echo(line, err=True)
