"""From a scene's file to the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, span_of
from forest.parametric import Parameters, ParametricTree, grow, load_parameters
from forest.species.text import input_error
from forest.surface.feature_map import FeatureMap, Spreading, asked_for, read_feature_map, spread
from forest.surface.grass import GRASSES, Grass
from forest.surface.instances import Instances, Model
from forest.surface.terrain import HeightField, read_heights
from forest.view.scenery.colours import colours_of, parametric_colours
from forest.view.scenery.file import GrassTable, SceneFile, Trees
from forest.view.scenery.scenery import Haze, Scenery, Viewpoint

_Array = NDArray[np.float64]

_MOVE_M = 8192.0  # scenes are moved by multiples of this, of which the grass takes no notice


def load_scenery(path: str | Path) -> Scenery:
    """Read a scene's file and all that it names.

    Raises
    ------
    InputError
        If a file cannot be read or is not right.
    """
    path = Path(path)
    return build_scenery(SceneFile.load(path), path.parent, where=path.name)


def build_scenery(scene: SceneFile, folder: str | Path = ".", *, where: str = "scene") -> Scenery:
    """Grow a scene's trees and put them in their places.

    Parameters
    ----------
    scene : SceneFile
    folder : path
        Where the files that it names are looked for.
    where : str
        Names the scene in messages.

    Raises
    ------
    InputError
        If a file that it names cannot be read or is not right.
    """
    folder = Path(folder)
    terrain = _terrain(scene, folder, where)
    features = _features(scene, folder, where)
    (x0, y0), (width, depth) = scene.terrain.origin_m, scene.terrain.size_m
    if features or scene.terrain.heights:
        (x0, y0), (width, depth) = (features or terrain).origin, (features or terrain).size_m
    scene, origin = _nearer(scene, (x0, y0))
    x0, y0 = x0 - origin[0], y0 - origin[1]
    terrain = replace(terrain, origin=_less(terrain.origin, origin))
    if features:
        features = replace(features, origin=_less(features.origin, origin))
    stock = Stock()
    instances, notes = _stand(scene, folder, where, features, terrain, stock)
    return Scenery(
        models=tuple(stock.models),
        instances=instances,
        heights=np.array(stock.heights),
        terrain=terrain,
        extent=(x0, y0, x0 + width, y0 + depth),
        grasses={table.code: _grass(table) for table in scene.grass},
        grass_at=_codes(scene, features),
        ground=scene.ground,
        season=scene.season,
        quality=scene.quality,
        sun_azimuth_deg=scene.sun.azimuth_deg,
        sun_elevation_deg=scene.sun.elevation_deg,
        haze=Haze(scene.haze.visibility_m, scene.haze.colour),
        view=Viewpoint(scene.camera.eye_m, scene.camera.towards_m, scene.camera.field_of_view_deg),
        size=scene.camera.size_px,
        seed=scene.seed,
        notes=notes,
        origin_m=origin,
    )


def _nearer(scene: SceneFile, corner: tuple[float, float]) -> tuple[SceneFile, tuple[float, float]]:
    """Count places from near the eye, or the ground's corner; single precision holds no others.

    Gives the scene with its trees and its camera moved, and the origin in the file's coordinates.
    """
    camera = scene.camera
    near = corner if camera.eye_m is None else camera.eye_m[:2]
    x0, y0 = origin = (_whole(near[0]), _whole(near[1]))
    points = {"eye_m": camera.eye_m, "towards_m": camera.towards_m}
    moved = {key: (p[0] - x0, p[1] - y0, p[2]) for key, p in points.items() if p is not None}
    trees = tuple(
        tree.model_copy(update={"x_m": tree.x_m - x0, "y_m": tree.y_m - y0}) for tree in scene.tree
    )
    changes = {"camera": camera.model_copy(update=moved), "tree": trees}
    return scene.model_copy(update=changes), origin


def _whole(place_m: float) -> float:
    """Give the multiple of `_MOVE_M` from 0 to a place; nothing near 0 is moved."""
    return float(int(place_m / _MOVE_M)) * _MOVE_M


def _less(place: tuple[float, float], origin: tuple[float, float]) -> tuple[float, float]:
    return place[0] - origin[0], place[1] - origin[1]


class Stock:
    """The models of a scene, each made once.

    Attributes
    ----------
    models : list of Model
    heights : list of float
        Their heights, m.
    """

    def __init__(self) -> None:
        self.models: list[Model] = []
        self.heights: list[float] = []
        self._known: dict[Any, int] = {}

    def number(self, key: Any, make: Callable[[], tuple[Model, float]]) -> int:
        """Give the number of a model; it is made when first asked for."""
        if key not in self._known:
            model, height = make()
            self._known[key] = len(self.models)
            self.models.append(model)
            self.heights.append(height)
        return self._known[key]


def grow_light(parameters: Parameters, seed: int, most_leaves: int) -> ParametricTree:
    """Grow a parametric tree with about `most_leaves` at most; fewer leaves are larger ones."""
    tree = grow(parameters, seed)
    leaves = len(tree.leaves.stem)
    return tree if leaves <= most_leaves else grow(parameters, seed, quality=most_leaves / leaves)


def parametric_model(tree: ParametricTree, looks_like: str = "") -> tuple[Model, float]:
    """Make the model of a parametric tree, and give its height, m.

    `looks_like` names the simulated species whose colours it takes instead of its own.
    """
    parameters = tree.parameters
    if looks_like:
        bark, foliage = colours_of(looks_like, evergreen=parameters.evergreen)
    else:
        bark, foliage = parametric_colours(parameters)
    model = Model.of(
        tree.skeleton(),
        tree.leaves,
        evergreen=parameters.evergreen,
        bark=bark,
        foliage=foliage,
        lobes=(parameters.lobes, parameters.lobe_depth),
        lobed_levels=1 if parameters.leaves else parameters.depth,  # a cactus has them everywhere
    )
    return model, float(tree.nodes.position[:, 2].max())


@contextmanager
def _told(where: str, key: str) -> Iterator[None]:
    """Put the scene's file and key before what is wrong with something that it names."""
    try:
        yield
    except InputError as error:
        raise input_error(str(error), where=f"{where}: {key}") from None


def _terrain(scene: SceneFile, folder: Path, where: str) -> HeightField:
    ground = scene.terrain
    if ground.heights is None:
        return HeightField.flat()
    with _told(where, "terrain.heights"):
        return read_heights(
            folder / ground.heights,
            cell_m=ground.cell_m,
            origin=ground.origin_m,
            height_range_m=ground.height_range_m,
        )


def _features(scene: SceneFile, folder: Path, where: str) -> FeatureMap | None:
    if scene.features is None:
        return None
    with _told(where, "features.map"):
        return read_feature_map(
            folder / scene.features.map,
            cell_m=scene.features.cell_m,
            origin=scene.features.origin_m,
        )


def _grass(table: GrassTable) -> Grass:
    names = ("height_m", "per_m2", "curve", "foot", "tip")
    changes = {name: getattr(table, name) for name in names}
    given: dict[str, Any] = {name: value for name, value in changes.items() if value is not None}
    return replace(GRASSES[table.type], **given)


def _codes(scene: SceneFile, features: FeatureMap | None) -> Callable[[Any, Any], Any]:
    if features is not None:
        return features.grass_at
    code = scene.grass[0].code if scene.grass else 0
    return lambda x, y: np.full(np.shape(x), code, np.uint8)


def _stand(
    scene: SceneFile,
    folder: Path,
    where: str,
    features: FeatureMap | None,
    terrain: HeightField,
    stock: Stock,
) -> tuple[Instances, tuple[str, ...]]:
    """Put up all trees: those spread over the map, then the single ones; tell what had no room."""
    model: list[NDArray[np.int64]] = []
    places: list[_Array] = []
    scales: list[_Array] = []
    notes: list[str] = []
    if features is not None and scene.trees:
        variants = [
            np.array(_variants(row, folder, where, f"trees[{number}]", stock))
            for number, row in enumerate(scene.trees)
        ]
        kinds = [
            Spreading(
                row.bit,
                row.per_ha,
                len(variants[number]),
                (row.scale_min, row.scale_max),
                row.least_distance_m,
            )
            for number, row in enumerate(scene.trees)
        ]
        with _told(where, "trees"):
            trees = spread(features, kinds, scene.seed)
        for number, kind in enumerate(kinds):
            here = trees.kind == number
            asked, found = asked_for(features, kind), int(here.sum())
            if found < asked:
                notes.append(
                    f"trees[{number}]: {asked - found} of {asked} found no room "
                    f"{kind.least_distance_m:g} m from each other"
                )
            model.append(variants[number][trees.variant[here]])
            places.append(np.column_stack((trees.x[here], trees.y[here])))
            scales.append(trees.scale[here])
    for number, tree in enumerate(scene.tree):
        with _told(where, f"tree[{number}].species"):
            parameters = _parameters(tree.species, folder)
        one = stock.number(
            (tree.species, tree.seed, tree.most_leaves),
            _growth(parameters, tree.seed, tree.most_leaves),
        )
        factor = 1.0 if tree.height_m is None else tree.height_m / stock.heights[one]
        model.append(np.array([one]))
        places.append(np.array([[tree.x_m, tree.y_m]]))
        scales.append(np.array([factor]))
    x, y = np.concatenate((np.empty((0, 2)), *places)).T
    instances = Instances.of(
        np.concatenate((np.empty(0, np.int64), *model)),
        np.column_stack((x, y, terrain.at(x, y))),
        np.concatenate((np.empty(0), *scales)),
    )
    return instances, tuple(notes)


def _variants(row: Trees, folder: Path, where: str, key: str, stock: Stock) -> list[int]:
    """Make the models of one kind of trees."""
    if row.species is None:
        take = (row.run, row.sample, row.year)
        return [stock.number(take, lambda: _sample(row, folder, where, key))]
    with _told(where, f"{key}.species"):
        parameters = _parameters(row.species, folder)
    return [
        stock.number(
            (row.species, seed, row.most_leaves), _growth(parameters, seed, row.most_leaves)
        )
        for seed in range(row.seed, row.seed + row.variants)
    ]


def _growth(
    parameters: Parameters, seed: int, most_leaves: int
) -> Callable[[], tuple[Model, float]]:
    return lambda: parametric_model(grow_light(parameters, seed, most_leaves))


def _parameters(species: str, folder: Path) -> Parameters:
    return load_parameters(folder / species if species.endswith(".toml") else species)


def _sample(row: Trees, folder: Path, where: str, key: str) -> tuple[Model, float]:
    """Take a sample tree out of a run; `key` names the kind of trees in messages."""
    from forest.record.run import open_run
    from forest.view.scenery.from_run import simulated_model

    assert row.run is not None and row.sample is not None
    with ExitStack() as stack:
        with _told(where, f"{key}.run"):
            run = stack.enter_context(open_run(folder / row.run))
        if row.sample not in run.samples:
            expected = ", ".join(map(str, run.samples)) or "none, for this run has no sample trees"
            raise input_error(
                f"tree {row.sample} is no sample tree",
                where=f"{where}: {key}.sample",
                expected=expected,
            )
        years = [int(year) for year in run.sample_years(row.sample)]
        year = years[-1] if row.year is None else row.year
        if year not in years:
            raise input_error(
                f"tree {row.sample} is not on record in {year}",
                where=f"{where}: {key}.year",
                expected=span_of(years[0], years[-1]),
            )
        return simulated_model(run.skeleton(row.sample, year), run.scenario.species)
