"""One tree's wood and leaves as parts of a mesh file, in its species' colours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from forest.errors import InputError
from forest.record.run import Run
from forest.record.wood import yearly_wood
from forest.species import Species
from forest.surface.bark.axes import LEAST_RADIUS_M
from forest.surface.bark.bark_mesh import dressed_parts
from forest.surface.bark.cracks import Crack, recorded_cracks
from forest.surface.bark.presets import Preset
from forest.surface.bark.tree_bark import bark_tree
from forest.surface.bark.usual import usual_preset
from forest.surface.blend.whole import THINNEST, blended, usual_cell
from forest.surface.export import Material, Part, leaf_parts, linear, write_mesh
from forest.surface.mesh import Mesh
from forest.surface.tubes import tubes
from forest.trees.leaves import Leaves, leaves_of
from forest.trees.skeleton import Skeleton
from forest.view.looks import look_of

_WITHOUT_LEAVES = (".ply",)  # for measuring closed wood


def with_leaves(to: Path, wanted: bool | None = None) -> bool:
    """Tell whether a file shows leaves: as wanted, else all formats but .ply."""
    return to.suffix.lower() not in _WITHOUT_LEAVES if wanted is None else wanted


def species_of(run: Run, skeleton: Skeleton) -> Species:
    """Find the species of a run's tree."""
    return next(s for s in run.scenario.species_list if s.name == skeleton.species)


def tree_parts(wood: Mesh, skeleton: Skeleton, leaves: Leaves | None) -> list[Part]:
    """Put a tree's wood and leaves together, coloured as its species is in pictures.

    Parameters
    ----------
    wood : Mesh
        The surface of its wood.
    skeleton : Skeleton
        The tree.
    leaves : Leaves, optional
        Its leaves, if they are to be seen.
    """
    look = look_of(skeleton.species)
    parts = [Part(wood, Material("wood", colour=linear(look.bark)))]
    if leaves is not None:
        parts += leaf_parts(leaves, tree_id=skeleton.tree_id, colour=linear(look.leaf))
    return parts


def too_thin(skeleton: Skeleton) -> bool:
    """Tell whether usual cells are too large to blend a tree: a seedling of a few mm."""
    return float(skeleton.radius.max()) < THINNEST * usual_cell(skeleton)


def write_samples(
    run: Run,
    suffix: str,
    *,
    bark: bool = False,
    surface: str = "tubes",
    say: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Write the surfaces of all sample trees of a run, each in its last year on record.

    Parameters
    ----------
    run : Run
        The run, finished or not.
    suffix : str
        Format, one of `forest.surface.export.SUFFIXES`.
    bark : bool
        Whether trees that are thick enough have bark with maps (`barked_parts`).
    surface : "tubes" or "blended"
        What wood is; trees that cannot be blended (too thin, too large for the memory) have tubes.
    say : callable
        Is told of each such tree in a line.

    Returns
    -------
    list of Path
        ``tree_ID_YEAR`` in the folder ``RUN_meshes`` beside the run file; files of these names
        are replaced.
    """
    folder = meshes_folder(run.path)
    folder.mkdir(exist_ok=True)
    written = []
    for tree_id in run.samples:
        year = int(run.sample_years(tree_id)[-1])
        skeleton = run.skeleton(tree_id, year)
        to = folder / f"tree_{tree_id}_{year}{suffix}"
        leaves = leaves_of(skeleton, species_of(run, skeleton)) if with_leaves(to) else None
        wood = _blended_or_tubes(skeleton, say) if surface == "blended" else tubes(skeleton)
        parts = tree_parts(wood, skeleton, leaves)
        if bark and skeleton.radius.max() >= LEAST_RADIUS_M:
            parts[:1] = barked_parts(run, skeleton, year, wood, say=say)
        written.append(write_mesh(parts, to, overwrite=True))
    return written


def _blended_or_tubes(skeleton: Skeleton, say: Callable[[str], None]) -> Mesh:
    """Blend a tree if it can be; one that cannot must not keep the others from their files."""
    try:
        return blended(skeleton)
    except InputError as refused:
        say(f"tree {skeleton.tree_id} is written as tubes: {refused}")
        return tubes(skeleton)


def barked_parts(
    run: Run,
    skeleton: Skeleton,
    year: int,
    wood: Mesh,
    *,
    least_radius_m: float = LEAST_RADIUS_M,
    waiting: Sequence[Crack] = (),
    say: Callable[[str], None] = lambda line: None,
) -> list[Part]:
    """Put the usual bark of a sample tree's species on its wood, torn as the tree grew.

    Its cracks are those of the run's acts up to the year, and any that wait for the next; `say`
    is told of each that is not to be seen in a line.
    """
    preset = Preset.load(usual_preset(skeleton.species))
    rings = yearly_wood(run, skeleton, year)
    cracks = (*recorded_cracks(run, skeleton.tree_id, year), *waiting)
    grown = bark_tree(skeleton, preset, 1, wood=rings, least_radius_m=least_radius_m, cracks=cracks)
    for missed in grown.missed:
        say(f"tree {skeleton.tree_id}: {missed}")
    return dressed_parts(grown, wood)


def meshes_folder(run_file: Path) -> Path:
    """Name the folder for meshes of a run's sample trees: ``run_meshes`` beside ``run.h5``."""
    return run_file.with_name(f"{run_file.stem}_meshes")
