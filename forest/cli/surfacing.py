"""The command that writes the surface of a tree for other programs."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forest.cli.shared import RunFile, check_targets, options_named

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from forest.species import Species
    from forest.surface.export import Part
    from forest.surface.mesh import Mesh
    from forest.trees.skeleton import Skeleton

#: Formats of meshes that commands write.
MESH = (".glb", ".obj", ".ply", ".vtp")
_KINDS = ("blended", "tubes")
#: Tubes may be off by this, m.
_COARSEST_M = 1.0


def mesh(
    run_file: RunFile,
    tree: Annotated[int, typer.Option(metavar="ID", help="A sample tree.")],
    to: Annotated[
        Path, typer.Option(metavar="FILE", help=".glb, .obj, .ply, .vtp, or .png for a picture.")
    ],
    year: Annotated[
        int | None, typer.Option(help="Default: the last in which it is on record.")
    ] = None,
    kind: Annotated[
        str, typer.Option(help="blended: one surface; tubes: one for each axis, fast.")
    ] = "blended",
    cell: Annotated[
        float | None,
        typer.Option(metavar="M", help="Smallest cell of a blended surface; default: by size."),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(metavar="M", help="How far tubes may be off; default: 0.001.")
    ] = None,
    reaction: Annotated[
        bool | None,
        typer.Option(
            "--reaction/--no-reaction",
            help="Blended limbs swell by reaction wood, as their weight asks; default: no.",
        ),
    ] = None,
    flare: Annotated[
        bool | None,
        typer.Option(
            "--flare/--no-flare",
            help="Root flare of a blended stem; default: from 5 cm of radius at the ground on.",
        ),
    ] = None,
    readings: Annotated[
        str | None,
        typer.Option(
            metavar="WORD",
            help="How limbs blend: corrected, or paper (as printed); default: corrected.",
        ),
    ] = None,
    leaves: Annotated[
        bool | None,
        typer.Option("--leaves/--no-leaves", help="Leaf cards; default: with all but .ply."),
    ] = None,
    colour: Annotated[
        str | None,
        typer.Option(help="Of a .png: texture, radius_m, order or birth_year; default: texture."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write the wood of a sample tree as a closed surface, and its leaves as cards.

    A .glb is for viewers and game engines, an .obj for modelling programs, a .ply for measuring,
    a .vtp for ParaView; their points carry radius, branching order and year of birth.

    Examples:

        forest mesh run.h5 --tree 12 --to tree.glb

        forest mesh run.h5 --tree 12 --year 2040 --to wood.ply --cell 0.01

        forest mesh run.h5 --tree 12 --to fast.glb --kind tubes

        forest mesh run.h5 --tree 12 --to limbs.glb --reaction --no-flare

        forest mesh run.h5 --tree 12 --to orders.png --colour order
    """
    from forest.errors import InputError, nearest
    from forest.record.run import open_run
    from forest.surface.tubes import tubes
    from forest.trees.leaves import leaves_of
    from forest.view.tree_mesh import species_of, too_thin, tree_parts, with_leaves

    check_targets((to, (*MESH, ".png")), force=force)
    if kind not in _KINDS:
        raise InputError(f"unknown kind '{kind}', {nearest(kind, _KINDS)}", where="--kind")
    blend = _Blend(cell, reaction, flare, readings)
    blend.check(kind)
    check_metres("--cell", cell)
    if tolerance is not None and kind != "tubes":
        raise InputError("only tubes have a tolerance", where="--tolerance", expected="--cell")
    check_metres("--tolerance", tolerance, least_too=True, most=_COARSEST_M)
    if colour is not None:
        check_colour(to, colour)
    with open_run(run_file) as run:
        check_sample(run, tree)
        at = int(run.sample_years(tree)[-1]) if year is None else year
        skeleton = run.skeleton(tree, at)
        species = species_of(run, skeleton)
    with working(f"the surface of {len(skeleton):,} internodes"), options_named(cell_m="--cell"):
        thin = kind == "blended" and cell is None and too_thin(skeleton)
        wood = (
            tubes(skeleton, tolerance_m=0.001 if tolerance is None else tolerance)
            if thin or kind == "tubes"
            else blend.surface(skeleton, species)
        )
        cards = leaves_of(skeleton, species) if with_leaves(to, leaves) else None
        parts = tree_parts(wood, skeleton, cards)
    write_parts(parts, to, colour or "texture", force)
    if thin:
        typer.echo(f"tree {tree} is too thin to blend without --cell: tubes", err=True)
    triangles = sum(len(part.mesh.triangles) for part in parts)
    typer.echo(f"{to}: {triangles:,} triangles, tree {tree} in {at}, {wood.volume:.4g} m3 of wood")


def check_metres(
    option: str, value: float | None, *, least_too: bool = False, most: float = math.inf
) -> None:
    """Refuse what is no length above 0, or of 0 or more; None was not said."""
    from forest.errors import InputError

    if value is not None and not (
        math.isfinite(value) and (value > 0.0 or (least_too and value == 0.0)) and value <= most
    ):
        expected = "metres, 0 or more" if least_too else "metres, above 0"
        if math.isfinite(most):
            expected += f", at most {most:g}"
        raise InputError(f"{option} is {value:g}", expected=expected)


def check_colour(to: Path, colour: str) -> None:
    """Refuse what a picture cannot be coloured by, before a surface is made."""
    from forest.errors import InputError, nearest
    from forest.view.surface_picture import COLOURS, TEXTURE

    if to.suffix.lower() != ".png":
        raise InputError(
            "--colour is for a .png", where=str(to), expected="a picture, or no --colour"
        )
    if colour not in (TEXTURE, *COLOURS):
        hint = nearest(colour, (TEXTURE, *COLOURS))
        raise InputError(f"cannot colour by '{colour}', {hint}", where="--colour")


def write_parts(parts: Sequence[Part], to: Path, colour: str, force: bool) -> None:
    """Write a mesh's file, or draw it."""
    with working(f"writing {to.name}"):
        if to.suffix.lower() == ".png":
            from forest.view.surface_picture import draw_mesh

            draw_mesh(parts, to, colour_by=colour, overwrite=force)
            return
        from forest.surface.export import write_mesh

        write_mesh(parts, to, overwrite=force)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show on a terminal what is being done, while it is, and that kernels must be compiled."""
    from rich.console import Console

    from forest._jit import announce_compiling

    with Console(stderr=True).status(what) as status:
        compiling = f"{what}; compiling kernels that this machine has not run yet (up to a minute)"
        with announce_compiling(lambda: status.update(compiling)):
            yield


@dataclass(frozen=True)
class _Blend:
    """What was said of a blended surface; None: nothing."""

    cell: float | None
    reaction: bool | None
    flare: bool | None
    readings: str | None

    def check(self, kind: str) -> None:
        """Refuse unknown readings, and what tubes know nothing of."""
        from forest.errors import InputError, nearest
        from forest.surface.blend.whole import READINGS

        said = [name for name, value in vars(self).items() if value is not None]
        if said and kind == "tubes":
            raise InputError(
                f"tubes have no {said[0]}", where=f"--{said[0]}", expected="--kind blended with it"
            )
        if self.readings not in (None, *READINGS):
            hint = nearest(str(self.readings), READINGS)
            raise InputError(f"unknown readings '{self.readings}', {hint}", where="--readings")

    def surface(self, skeleton: Skeleton, species: Species) -> Mesh:
        """Blend a tree."""
        from forest.surface.blend import blended, reaction_wood

        return blended(
            skeleton,
            cell_m=self.cell,
            reaction=reaction_wood(skeleton, species) if self.reaction else None,
            flare=None if self.flare is False else "usual",
            readings=self.readings or "corrected",
        )


def check_sample(run: Any, tree: int) -> None:
    from forest.errors import InputError

    if tree not in run.samples:
        near = min(run.samples, key=lambda known: abs(known - tree), default=None)
        expected = "a run with output.sample_trees"
        if near is not None:
            expected = f"one of its {len(run.samples)} sample trees, the nearest number is {near}"
        raise InputError(f"tree {tree} is no sample tree", where=str(run.path), expected=expected)
