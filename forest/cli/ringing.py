"""The command that shows wood: discs, cores, ring series, trunks."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forest.cli.shared import RunFile, check_targets

if TYPE_CHECKING:
    from forest.dendro import RingSeries

_SERIES = (".rwl", ".csv")
_OF_A_TREE = (".png", ".svg", ".vtp")
_BREAST_HEIGHT_M = 1.3
_OPPOSITE = (0.0, 180.0)


def rings(
    run_file: RunFile,
    to: Annotated[
        Path,
        typer.Option(
            metavar="FILE", help=".png, .svg: a disc. .rwl, .csv: ring series. .vtp: a trunk."
        ),
    ],
    tree: Annotated[
        int | None, typer.Option(metavar="ID", help="A tree; series of all trees if none.")
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            metavar="METRES", help="Height of the stem; default: 1.3, a trunk's: its top."
        ),
    ] = None,
    year: Annotated[
        int | None, typer.Option(help="The year at whose end it is cut; default: the last.")
    ] = None,
    azimuth: Annotated[
        list[float] | None,
        typer.Option(
            metavar="DEGREES", help="Side of a core, from x towards y; may be given often: 0, 180."
        ),
    ] = None,
    dominant: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Two cores of each of the N thickest.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Show the rings of a tree or a stand: a disc, increment cores, mean series, a trunk.

    Of a tree's cores, or of all trees' mean widths, .rwl and .csv hold a series each.

    Examples:

        forest rings run.h5 --tree 12 --height 1.3 --to disc.png

        forest rings run.h5 --tree 12 --azimuth 90 --to core.rwl

        forest rings run.h5 --dominant 10 --to campaign.rwl

        forest rings run.h5 --tree 12 --to trunk.vtp
    """
    from forest.errors import InputError
    from forest.record.run import open_run

    check_targets((to, (*_OF_A_TREE, *_SERIES)), force=force)
    suffix = to.suffix.lower()
    if suffix in _OF_A_TREE and tree is None:
        raise InputError(f"no tree for a {suffix}", expected="--tree ID")
    if dominant is not None and (tree is not None or suffix not in _SERIES):
        raise InputError("--dominant takes cores of many trees", expected=".rwl or .csv, no --tree")
    if azimuth and (tree is None or suffix not in _SERIES):
        raise InputError("--azimuth is of a tree's cores", expected="--tree ID and .rwl or .csv")
    at = _BREAST_HEIGHT_M if height is None else height
    with open_run(run_file) as run:
        if tree is None:
            _write_series(_of_stand(run, at, year, dominant), to, force)
        elif suffix in _SERIES:
            _write_series(_cores(run, tree, at, year, azimuth or _OPPOSITE), to, force)
        elif suffix == ".vtp":
            from forest.record.export import whole_file
            from forest.view.trunk_mesh import write_trunk

            life = run.stem(tree, year=year)
            with whole_file(to, overwrite=force) as draft:
                cells = write_trunk(life, draft, height_m=height)
            typer.echo(f"{to}: {cells:,} cells, tree {tree}")
            if len(life.years) == 1:
                typer.echo(
                    f"tree {tree} is on record in {life.years[0]} only, so all wood has that year; "
                    "name it in output.sample_trees.ids to have its rings"
                )
        else:
            _draw(run, tree, at, year, to, force)


def _draw(run: Any, tree: int, height: float, year: int | None, to: Path, force: bool) -> None:
    from forest.record.export import whole_file
    from forest.view.disc_picture import draw_disc

    disc = run.disc(tree, height, year=year)
    groups = {species.name: species.group for species in run.scenario.species_list}
    with whole_file(to, overwrite=force) as draft:
        draw_disc(disc, draft, conifer=groups[disc.species] == "conifer")
    typer.echo(f"{to}: {len(disc.years)} rings of tree {tree}, {disc.years[0]} to {disc.years[-1]}")


def _cores(run: Any, tree: int, height: float, year: int | None, azimuths: Any) -> RingSeries:
    from forest.dendro.series import assemble

    return assemble(
        [run.core(tree, height, azimuth, year=year).as_radius() for azimuth in azimuths]
    )


def _of_stand(run: Any, height: float, year: int | None, dominant: int | None) -> RingSeries:
    import numpy as np

    from forest.dendro import campaign, ring_series
    from forest.dendro.stems import at_height
    from forest.errors import InputError, span_of

    if not len(run.years):
        raise InputError("holds no years yet", where=str(run.path))
    last = int(run.years[-1]) if year is None else year
    if last not in run.years:
        raise InputError(
            f"no year {last}",
            where=str(run.path),
            expected=span_of(run.years[0], run.years[-1]),
        )
    rings = run.rings
    rings = rings[(rings["place"] == "height") & (rings["year"] <= last)]
    here = rings[at_height(rings, height)]
    if not len(here):
        known = ", ".join(f"{h:g}" for h in np.unique(rings["stem_height_m"].round(3)))
        raise InputError(
            f"no rings at {height:g} m", where=str(run.path), expected=f"one of {known or 'none'} m"
        )
    if dominant is None:
        return ring_series(here)
    return campaign(here, run.trees, year=last, n_trees=dominant, stem_height_m=height)


def _write_series(series: RingSeries, to: Path, force: bool) -> None:
    """Write series, dated earlier if their years would lie after the present.

    What the series are (tree, height, azimuth, pith offset, cambial age, years moved) goes into a
    file beside them.
    """
    from forest.dendro import write_csv, write_rwl
    from forest.record.export import whole_file

    late = int(series.widths.index[-1]) - datetime.date.today().year
    dated = series.moved(-late) if late > 0 else series
    write = write_rwl if to.suffix.lower() == ".rwl" else write_csv
    write(dated.widths, to, overwrite=force)
    about = to.with_name(f"{to.stem}_about.csv")
    with whole_file(about, overwrite=True) as draft:
        dated.about.to_csv(draft)
    first, last = dated.widths.index[0], dated.widths.index[-1]
    typer.echo(f"{to}: {dated.widths.shape[1]} series, {first} to {last}; {about.name} tells which")
    if late > 0:
        typer.echo(
            f"all years are {late} earlier than in the run: "
            "readers of ring files refuse years after the present"
        )
