"""The command that grows bark on a tree."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forest.cli.shared import check_targets, endings, given_options
from forest.cli.surfacing import MESH, check_metres, check_sample, working

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from forest.record.wood import YearlyWood
    from forest.surface.bark.cracks import Crack
    from forest.surface.bark.presets import Preset
    from forest.surface.bark.tree_bark import TreeBark
    from forest.surface.blend.foot import Flare
    from forest.trees.skeleton import Skeleton

_SIZES = (256, 512, 1024, 2048, 4096)
_BREAST_HEIGHT_M = 1.3
_PARAMETRIC_AGE = 30.0  # years; a parametric tree has none
_FEW_M = 2.0  # of the trunk that a picture shows

# Options that a tile, and flow bark, know of.
_OF_FLOW = ("--to", "--tree", "--parametric", "--year", "--preset", "--seed", "--model", "--force")
_OF_TILE = (*_OF_FLOW, "--tile", "--size")


def bark(
    context: typer.Context,
    run_file: Annotated[
        Path | None, typer.Argument(metavar="RUN.h5", help="A run file, finished or not.")
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option("--to", help="A folder for maps; a mesh .glb, .obj, .ply, .vtp; or .png."),
    ] = None,
    tree: Annotated[int | None, typer.Option(metavar="ID", help="A sample tree.")] = None,
    parametric: Annotated[
        str | None, typer.Option(metavar="NAME", help="A parametric species instead of a run.")
    ] = None,
    year: Annotated[
        int | None, typer.Option(help="Default: the last in which it is on record.")
    ] = None,
    preset: Annotated[
        str | None, typer.Option(help="See --list, or a file; default: by the tree's species.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Each seed is other cracks.")] = 1,
    size: Annotated[int, typer.Option(help="Pixels of maps: 256 to 4096.")] = 1024,
    low: Annotated[
        float | None, typer.Option("--from", metavar="M", help="A part of the trunk: from where.")
    ] = None,
    height: Annotated[
        float | None, typer.Option(metavar="M", help="How much of the trunk from there.")
    ] = None,
    cell: Annotated[
        float | None, typer.Option(metavar="M", help="In a mesh: bark as geometry, so fine.")
    ] = None,
    kind: Annotated[str, typer.Option(help="Surface of a mesh: blended, or tubes.")] = "blended",
    film: Annotated[
        str | None, typer.Option(metavar="YEARS", help="In a .png: years, as 1960,1980,2000.")
    ] = None,
    tile: Annotated[
        bool, typer.Option("--tile", help="A tile of the trunk's bark that repeats, as maps.")
    ] = False,
    history: Annotated[
        Path | None,
        typer.Option(
            metavar="GIRTHS.csv", help="Measured girths drive the cracks: columns year, girth_cm."
        ),
    ] = None,
    shrink: Annotated[
        bool, typer.Option("--shrink", help="Shrink the bark of the finished tree instead.")
    ] = False,
    law: Annotated[
        str, typer.Option(help="What tears as girth grows: preset, or conserved as in the paper.")
    ] = "preset",
    model: Annotated[
        str, typer.Option(help="fracture; or flow: spots and ribbons along the grain, as a mesh.")
    ] = "fracture",
    least_radius: Annotated[
        float, typer.Option(metavar="M", help="Thinner wood has no cracks.")
    ] = 0.03,
    list_: Annotated[bool, typer.Option("--list", help="List the presets.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Grow bark that tears as the stem thickens (Lefebvre & Neyret 2002).

    The girth of the trunk and of main branches, year by year, drives the cracks.

    Examples:

        forest bark --list

        forest bark run.h5 --tree 12 --to bark/

        forest bark run.h5 --tree 12 --from 0.5 --height 2 --to trunk.png

        forest bark run.h5 --tree 12 --film 1960,1980,2000,2020 --to ages.png

        forest bark run.h5 --tree 12 --kind tubes --to tree.glb

        forest bark --parametric quaking_aspen --to aspen.glb

        forest bark --parametric quaking_aspen --history girths.csv --to aspen.png
    """
    from forest.errors import InputError, nearest
    from forest.surface.bark.measured import read_girths
    from forest.surface.bark.presets import Preset, preset_names
    from forest.surface.bark.tree_bark import LAWS
    from forest.surface.bark.usual import usual_preset

    if list_:
        for name in preset_names():
            known = Preset.load(name)
            typer.echo(f"{name:<10} {known.latin}")
        return
    if to is None:
        raise InputError("nothing to write", where="--to", expected="a folder, a mesh or a .png")
    choices = _Choices(to, size, low, height, cell, kind, film, tile, force)
    choices.check()
    check_metres("--least-radius", least_radius)
    if law not in LAWS:
        raise InputError(f"unknown law '{law}', {nearest(law, LAWS)}", where="--law")
    if model not in ("fracture", "flow") or (model == "flow" and to.suffix.lower() not in MESH):
        raise InputError(f"--model {model}", expected="fracture, or flow with --to NAME.glb")
    given = given_options(context)
    for asked, what, fitting in (
        (model == "flow", "--model flow", _OF_FLOW),
        (tile, "--tile", _OF_TILE),
    ):
        idle = [option for option in given if option not in fitting]
        if asked and idle:
            raise InputError(f"{idle[0]} does not go with {what}", expected="one of the two")
    if shrink and history is not None:
        raise InputError("--history does not go with --shrink", expected="one of the two")
    girths = None if history is None else read_girths(history)
    chosen = _tree(run_file, tree, parametric, year, seed)
    wood = None if shrink or girths is not None else chosen.wood
    years = None if wood is None else wood.years
    choices.check_years(years if girths is None else girths[0])
    if model == "flow":
        _write_flow(chosen, preset, year, seed, choices)
        return
    name = preset or usual_preset(chosen.skeleton.species)
    kept = Preset.load(name)
    if tile:
        _write_tile(chosen.skeleton, kept, seed, choices)
        return
    from forest.surface.bark.axes import lay_strips
    from forest.surface.bark.girth import measured_girths
    from forest.surface.bark.tree_bark import bark_tree

    with working(f"{kept.name} bark on {chosen.name}"):
        measured, round_foot = None, kind == "tubes" and to.suffix.lower() in MESH
        if girths is not None:
            strips = lay_strips(chosen.skeleton, kept.tearing.strip_m, least_radius_m=least_radius)
            measured, round_foot = measured_girths(strips, *girths), True
        grown = bark_tree(
            chosen.skeleton,
            kept,
            seed,
            wood=wood,
            history=measured,
            shrink=shrink,
            law=law,
            flare=None if round_foot else chosen.flare,
            least_radius_m=least_radius,
            cracks=() if shrink else chosen.cracks,
        )
    written = _write(grown, chosen.skeleton, choices)
    for missed in grown.missed:
        typer.echo(f"{chosen.name}: {missed}")
    rings, cracks = len(grown.bark.strips.axis), len(grown.bark.fractures.origin)
    typer.echo(
        f"{written}: {kept.name} bark of {chosen.name}, {len(grown.axes)} axes, "
        f"{rings:,} strips, {cracks:,} cracks"
    )


@dataclass(frozen=True)
class _Choices:
    """What is asked for."""

    to: Path
    size: int
    low: float | None
    height: float | None
    cell: float | None
    kind: str
    film: str | None
    tile: bool
    force: bool

    @property
    def suffix(self) -> str:
        return self.to.suffix.lower()

    @property
    def part(self) -> tuple[float | None, float | None]:
        """From where to where on the trunk."""
        if self.low is None and self.height is None:
            return None, None
        low = self.low or 0.0
        return low, low + (_FEW_M if self.height is None else self.height)

    @property
    def years(self) -> list[float]:
        """The years of a film.

        Raises
        ------
        InputError
            They are no numbers.
        """
        from forest.errors import InputError

        try:
            return [float(word) for word in (self.film or "").split(",") if word.strip()]
        except ValueError:
            raise InputError(
                f"'{self.film}'", where="--film", expected="years, as 1960,1980"
            ) from None

    def check(self) -> None:
        """Refuse what cannot be, before anything is grown."""
        from forest.errors import InputError, OutputError, nearest
        from forest.record.export import check_folder

        if self.size not in _SIZES:
            raise InputError(f"--size {self.size}", expected=" or ".join(map(str, _SIZES)))
        if self.kind not in ("tubes", "blended"):
            hint = nearest(self.kind, ("tubes", "blended"))
            raise InputError(f"unknown kind '{self.kind}', {hint}", where="--kind")
        check_metres("--from", self.low, least_too=True)
        check_metres("--height", self.height)
        check_metres("--cell", self.cell)
        if self.film is not None and (self.suffix != ".png" or not self.years):
            raise InputError("--film draws years", expected="--to NAME.png --film 1960,1980")
        if self.cell is not None and self.suffix not in MESH:
            raise InputError("--cell is for a mesh", expected=f"a name that ends in {MESH[0]}")
        if self.tile and self.suffix:
            raise InputError("--tile gives maps", where=str(self.to), expected="a folder")
        if self.suffix and self.suffix not in (*MESH, ".png"):
            expected = f"a folder, or {endings((*MESH, '.png'))}"
            raise InputError(
                f"unknown format '{self.suffix}'", where=str(self.to), expected=expected
            )
        if self.suffix:
            check_targets((self.to, (*MESH, ".png")), force=self.force)
            return
        check_folder(self.to.parent, where=self.to)
        if self.to.is_dir() and any(self.to.iterdir()) and not self.force:
            raise InputError(
                "is not empty", where=str(self.to), expected="a new folder, or --force"
            )
        elif self.to.exists() and not self.to.is_dir():
            raise OutputError("is a file", where=str(self.to), expected="a folder")

    def check_years(self, known: NDArray[Any] | None) -> None:
        """Refuse a film of years in which the tree was not, before bark is grown."""
        from forest.errors import InputError, span_of

        if self.film is None:
            return
        if known is None:
            raise InputError(
                "--film needs a tree with a history", expected="a run's, or --history; no --shrink"
            )
        first, last = int(known[0]), int(known[-1])
        for year in self.years:
            if not first <= year <= last:
                raise InputError(f"no year {year:g}", where="--film", expected=span_of(first, last))


@dataclass(frozen=True)
class _Chosen:
    """A tree, and what is known of its years."""

    skeleton: Skeleton
    wood: YearlyWood | None
    flare: Flare | None
    name: str
    cracks: tuple[Crack, ...] = ()


def _tree(
    run_file: Path | None, tree: int | None, parametric: str | None, year: int | None, seed: int
) -> _Chosen:
    from forest.errors import InputError
    from forest.surface.blend.foot import usual_flare

    if (run_file is None) == (parametric is None):
        raise InputError("which tree?", expected="RUN.h5 --tree ID, or --parametric NAME")
    if parametric is not None:
        if tree is not None or year is not None:
            raise InputError("--tree and --year are for a run", expected="--parametric alone")
        from forest.parametric import grow, load_parameters

        shape = grow(load_parameters(parametric), seed).skeleton()
        return _Chosen(shape, None, None, f"{parametric}, seed {seed}")
    assert run_file is not None
    from forest.record.run import open_run
    from forest.record.wood import yearly_wood
    from forest.surface.bark.cracks import recorded_cracks

    with open_run(run_file) as run:
        if tree is None:
            known = ", ".join(map(str, run.samples[:8])) or "none, it has no sample trees"
            raise InputError("which tree?", where="--tree", expected=f"one of {known}")
        check_sample(run, tree)
        at = int(run.sample_years(tree)[-1]) if year is None else year
        skeleton = run.skeleton(tree, at)
        wood, cracks = yearly_wood(run, skeleton, at), recorded_cracks(run, tree, at)
    return _Chosen(skeleton, wood, usual_flare(skeleton), f"tree {tree} in {at}", cracks)


def _write(grown: TreeBark, skeleton: Skeleton, choices: _Choices) -> str:
    """Write maps, a mesh or a picture."""
    if choices.suffix == ".png":
        from forest.view.tree_bark_picture import draw_trunk

        low, high = choices.part
        with working(f"drawing {choices.to.name}"):
            draw_trunk(
                grown,
                choices.to,
                years=choices.years,
                low_m=low or 0.0,
                high_m=high or _FEW_M,
                overwrite=choices.force,
            )
    elif choices.suffix:
        from forest.surface.export import write_mesh

        with working(f"the surface of {len(skeleton):,} internodes with bark"):
            parts = _parts(grown, skeleton, choices)
        with working(f"writing {choices.to.name}"):
            write_mesh(parts, choices.to, overwrite=choices.force)
    else:
        _write_maps(grown, choices)
    return str(choices.to)


def _parts(grown: TreeBark, skeleton: Skeleton, choices: _Choices) -> Any:
    from forest.surface.bark.bark_mesh import displaced_parts, dressed_parts

    low, high = choices.part
    if choices.cell is not None or low is not None:
        axes = None if low is None else (grown.tree.paths[0].axis,)
        cell = choices.cell or 0.005
        return displaced_parts(grown, cell, axes=axes, low_m=low, high_m=high)
    if choices.kind == "blended":
        from forest.surface.blend import blended

        return dressed_parts(grown, blended(skeleton), choices.size)
    from forest.surface.tubes import tubes

    return dressed_parts(grown, tubes(skeleton), choices.size)


def _write_flow(
    chosen: _Chosen, preset: str | None, year: int | None, seed: int, choices: _Choices
) -> None:
    """Write the bark of Hart and Baker's section 5.4."""
    from forest.errors import InputError
    from forest.surface.export import write_mesh
    from forest.surface.flow import features
    from forest.surface.flow.presets import preset_for, preset_names

    kept = preset or preset_for(chosen.skeleton.species)
    if kept is None:
        known = ", ".join(preset_names())
        raise InputError(f"which bark has {chosen.name}?", where="--preset", expected=known)
    age = _PARAMETRIC_AGE if chosen.wood is None else None
    with working(f"flow bark on {chosen.name}"):
        made = features(chosen.skeleton, kept, year=year, age=age, seed=seed)
        write_mesh(made.parts(), choices.to, overwrite=choices.force)
    typer.echo(f"{choices.to}: flow bark of {chosen.name}")


def _write_maps(grown: TreeBark, choices: _Choices) -> None:
    """Write a folder for each axis."""
    from forest.record.export import whole_folder

    low, high = choices.part
    trunk = grown.tree.paths[0].axis
    axes = grown.axes if low is None else (trunk,)
    with working(f"maps of {len(axes)} axes"), whole_folder(choices.to) as draft:
        for axis, maps in grown.maps(choices.size, axes=axes, low_m=low, high_m=high).items():
            maps.save(draft / ("trunk" if axis == trunk else f"branch_{axis}"))


def _write_tile(skeleton: Skeleton, preset: Preset, seed: int, choices: _Choices) -> None:
    """Write a tile of the bark at breast height."""
    import numpy as np

    from forest.record.export import whole_folder
    from forest.surface.bark.dressing import grow_preset
    from forest.surface.bark.maps import bark_maps

    trunk = np.flatnonzero(skeleton.axis == 0)
    tall = skeleton.end[trunk, 2] - skeleton.start[0, 2] >= _BREAST_HEIGHT_M
    row = trunk[int(np.argmax(tall))] if tall.any() else trunk[0]
    girth = 2.0 * np.pi * float(skeleton.radius[row])
    with working(f"a tile of {preset.name} bark"), whole_folder(choices.to) as draft:
        maps = bark_maps(grow_preset(preset, girth, seed=seed), preset, choices.size, seed=seed)
        maps.save(draft)
    typer.echo(f"{choices.to}: a tile of {preset.name} bark, {girth:.2f} m around")
