"""What a stand's buds know of light and space: the environments that a scenario names.

Light fills `metamers.light` (Q); marker space marks the buds that have no room (their Q is 0).
Where both are given a bud needs light and room, and grows towards its markers. Rendered light takes
the place of the grids' light. A picture has no gradient, so buds then have no direction of most
light, unless markers give one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.environment.canopy import Canopy
from forest.environment.dormant import Hold
from forest.environment.exposure import CanopySpec, Light, LightSpecies, ShadowSpec
from forest.environment.marker_buds import BudSpace, apply_space
from forest.environment.marker_places import occupied
from forest.environment.markers import Envelope, MarkerSpace, MarkerSpecies
from forest.environment.obstacles import Box, Mesh, Solid, solid_places
from forest.environment.plant_area import PlantArea
from forest.environment.rendered_kernels import Looks
from forest.environment.rendered_light import IndexPicture, RenderedLight, RenderedSpec
from forest.environment.standing import Standing
from forest.trees.buds import Shoots
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.scenario.model import Obstacle


class Surroundings:
    """The environments of one stand.

    Parameters
    ----------
    scenario : Scenario
    pipe_exponent : float64 (species,)
        Pipe exponent n of each species, as used in this run.

    Attributes
    ----------
    voxel_m : float
        Edge of the near-field voxels in which trees' bases are given, m.
    full_light : float
        Light Q of an unshaded bud.
    standing : Standing or None
        Trees that shade and take room, but do not grow.
    """

    standing: Standing | None = None

    def __init__(self, scenario: Scenario, pipe_exponent: NDArray[np.float64]) -> None:
        spec = scenario.environment
        species = scenario.species_list
        periodic = scenario.plot.boundary == "periodic"
        size_m = scenario.plot.size_m
        internode = np.array([s.architecture.internode_length_m for s in species])
        reach = internode * [s.shoots.perception_distance_internodes for s in species]
        angle = np.array([s.shoots.perception_angle_deg for s in species])
        if spec.shadow is not None:
            self.voxel_m = spec.shadow.voxel_m
        elif spec.canopy is not None:
            self.voxel_m = spec.canopy.voxel_m
        else:
            self.voxel_m = min(size_m) / max(1, round(min(size_m) / float(internode.min())))
        self.full_light = spec.shadow.full_light if spec.shadow else 1.0
        self._make_light = partial(
            Light,
            ShadowSpec(**spec.shadow.model_dump()) if spec.shadow else None,
            CanopySpec(**spec.canopy.model_dump()) if spec.canopy else None,
            size_m=size_m,
            periodic=periodic,
            voxel_m=self.voxel_m,
            species=LightSpecies(
                shade_factor=np.array([s.leaves.shade_factor for s in species]),
                leaf_area_m2=np.array([s.leaves.area_m2 for s in species]),
                perception_angle_deg=angle,
                perception_distance_m=reach,
            ),
            latitude_deg=scenario.site.latitude_deg,
        )
        self._is_rendered = spec.rendered is not None
        self._make_rendered = partial(
            RenderedLight,
            RenderedSpec(**spec.rendered.model_dump()) if spec.rendered else RenderedSpec(),
            size_m=size_m,
            periodic=periodic,
            latitude_deg=scenario.site.latitude_deg,
            seed=scenario.seed,
            looks=Looks(np.array([s.leaves.area_m2 for s in species]), pipe_exponent),
            voxel_m=self.voxel_m,
            full_light=self.full_light,
        )
        self._wraps_m = size_m if periodic else None
        self.build(scenario.obstacles)
        self._markers: MarkerSpace | None = None
        if spec.markers is not None:
            self._markers = MarkerSpace(
                scenario.seed,
                spec.markers.spacing_m,
                size_m,
                periodic,
                spec.markers.release,
                [Envelope(e.shape, e.center_m, e.size_m) for e in spec.markers.envelope],
                np.array(spec.markers.clouds, np.float64).reshape(-1, 3),
                spec.markers.everywhere,
            )
            occupancy = internode * [s.shoots.occupancy_radius_internodes for s in species]
            self._marker_species = MarkerSpecies(
                occupancy.astype(np.float32),
                reach.astype(np.float32),
                np.cos(0.5 * np.radians(angle)).astype(np.float32),
            )
        self._space: tuple[NDArray[np.int64], NDArray[np.float32]] | None = None

    def build(self, obstacles: Sequence[Obstacle]) -> None:
        """Let these obstacles stand, in place of all that stood.

        Raises
        ------
        InputError
            If a mesh cannot be used, or obstacles are too large or too far away.
        """
        self._light = self._make_light(obstacles=shapes_of(obstacles))
        self._rendered: RenderedLight | None = None
        if self._is_rendered:
            self._rendered = self._make_rendered(solid=self._light.solid)

    def solid_of(self, obstacles: Sequence[Obstacle]) -> Solid:
        """Give the voxels that other obstacles would fill; raises as `build` does."""
        light: Light = self._make_light(obstacles=shapes_of(obstacles))
        return light.solid

    @property
    def solid(self) -> Solid:
        """The voxels that obstacles fill."""
        return self._light.solid

    def blocked(
        self, x: NDArray[Any], y: NDArray[Any], solid: Solid | None = None
    ) -> NDArray[np.bool_]:
        """Tell at which places, m, no tree can stand: its foot would lie in an obstacle.

        `solid` is what obstacles that are to come fill; default: those that stand.
        """
        solid = self.solid if solid is None else solid
        feet = np.column_stack((x, y, np.zeros(len(x))))
        return solid_places(solid, np.zeros(3, np.int64), feet, self.voxel_m)

    def expose(
        self,
        metamers: Metamers,
        trees: Trees,
        step: int,
        others: PlantArea | None = None,
        holds: Sequence[Hold] = (),
    ) -> None:
        """Tell every bud how much light and room it has in the given step.

        Parameters
        ----------
        metamers, trees : Metamers, Trees
        step : int
        others : PlantArea, optional
            What shades beside living trees, in the far field.
        holds : sequence of Hold
            What alone may grow of some trees (Palubicki et al. 2009, section 5).
        """
        standing = self.standing
        if self._rendered is not None:
            self._rendered.expose(metamers, trees, step)
        else:
            if standing is not None:
                others = standing.leaves.plant_area.joined(others)
            leaves = None if standing is None else standing.leaves
            self._light.expose(metamers, trees, others, leaves)
        if self._markers is not None:
            space = self._markers.claim(
                metamers,
                trees,
                self._marker_species,
                None if standing is None else standing.sites,
                step=step,
                holds=holds,
            )
            apply_space(metamers, trees, space)
            self._space = _by_serial(metamers, trees, space)

    def directions(self, metamers: Metamers, trees: Trees, shoots: Shoots) -> NDArray[np.float32]:
        """Give the optimal direction V of each shooting bud, float32 (n, 3); zero without one."""
        if self._space is None:
            return self._light.directions(metamers, trees, shoots)
        keys, direction = self._space
        row = np.repeat(np.arange(len(trees.tree_id)), np.diff(shoots.first))
        serial = metamers.serial[trees.start[row] + shoots.metamer]
        wanted = _key(trees.tree_id[row], serial, shoots.bud)
        return direction[np.searchsorted(keys, wanted)]

    def picture(self, metamers: Metamers, trees: Trees, step: int, number: int = 0) -> IndexPicture:
        """Show the stand as the light of a step sees it, with rendered light or without it.

        See `RenderedLight.picture`; where the scenario has no rendered light, with its defaults.
        """
        rendered = self._rendered or self._make_rendered(solid=self._light.solid)
        return rendered.picture(metamers, trees, step, number)

    def occupied(
        self, points: NDArray[np.float64], metamers: Metamers, trees: Trees
    ) -> NDArray[np.bool_]:
        """Tell which places of markers (n, 3), m, lie in a living bud's occupancy zone now."""
        return occupied(
            points, metamers, trees, self._marker_species.occupancy_radius_m, self._wraps_m
        )

    @property
    def markers(self) -> MarkerSpace | None:
        """The marker space, where the scenario has one."""
        return self._markers

    @property
    def canopy(self) -> Canopy | None:
        """The far field, where the scenario has one."""
        return self._light.canopy

    def floor_light(self) -> float:
        """Mean relative irradiance at the ground, 0..1; NaN without a far field."""
        return self._light.floor_light()

    def state(self) -> dict[str, NDArray[Any]]:
        """What the next year needs of the environment, for a checkpoint."""
        if self._markers is None:
            return {}
        return {f"markers_{name}": value for name, value in self._markers.state().items()}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        if self._markers is not None:
            start = "markers_"
            self._markers.restore(
                {k[len(start) :]: v for k, v in arrays.items() if k.startswith(start)}
            )


def shapes_of(obstacles: Sequence[Obstacle]) -> list[Box | Mesh]:
    """Give a scenario's obstacles as light and growth know them."""
    return [
        Box(o.min_m, o.max_m) if o.kind == "box" else Mesh(Path(o.file), o.at_m) for o in obstacles
    ]


def _key(
    tree_id: NDArray[np.int32], serial: NDArray[np.int32], bud: NDArray[np.uint8]
) -> NDArray[np.int64]:
    """Name a bud by one number that rises with tree, metamer and bud."""
    key = (tree_id.astype(np.int64) << 32) + (serial.astype(np.int64) << 1)
    return key + bud.astype(np.int64)


def _by_serial(
    metamers: Metamers, trees: Trees, space: BudSpace
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Key each bud's direction by serial, so that it is found after shedding moved metamers."""
    serial = metamers.serial[trees.start[space.tree_row] + space.metamer]
    return _key(trees.tree_id[space.tree_row], serial, space.kind), space.direction
