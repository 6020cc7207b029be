"""Shadow maps: which parts of trees, and which ground, the sun does not reach.

Weber and Penn 1995, section 6: "a standard shadow map ... can be used to mark which geometric
components will be shadowed before rendering takes place". A map is a picture of the trees as the
sun sees them, which holds the depth of what is nearest to it. What lies behind is in the shade.

Each model has a fine map of itself, in which its own elements are marked once for all instances.
The map of a scene is made of these, moved and scaled to every instance: a cell takes what the
model's map shows at its middle. So the gaps of a crown let light through in the right share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.detail import SEASONS
from forest.surface.instances import Instances, Model

_OWN_CELLS = 512  # along the longer side of a model's own map
_OWN_BIAS = 3.0  # cells by which an element must lie behind another
_BANDS = 32  # of rows; fixed, so that nothing depends on the number of threads
_MOST_CELLS = 60_000_000


class ShadowMap(NamedTuple):
    """What the sun sees; a plain tuple that kernels read.

    Attributes
    ----------
    axes : float64 (3, 3)
        Unit vectors to the map's right, up the map, and towards the sun.
    corner : float64 (2,)
        Lower left corner of the map along the first two, m.
    cell_m : float
        Size of a cell, m.
    depth : float32 (rows, cols)
        Place along the third of what is nearest to the sun, m; -inf where there is nothing.
    owner : int32 (rows, cols)
        Its instance, -1 for none.
    """

    axes: NDArray[np.float64]
    corner: NDArray[np.float64]
    cell_m: float
    depth: NDArray[np.float32]
    owner: NDArray[np.int32]


class ModelShadow(NamedTuple):
    """A model's shadow on itself.

    Attributes
    ----------
    map : ShadowMap
        What the sun sees of it, from the model's foot.
    shaded : tuple of bool (e,)
        For each item, which of its elements lie behind others.
    """

    map: ShadowMap
    shaded: tuple[NDArray[np.bool_], ...]


@dataclass(frozen=True)
class SceneShadow:
    """The shade of all trees of a scene.

    Attributes
    ----------
    sun : float64 (3,)
        Unit vector towards the sun.
    season : str
        Whose leaves cast it.
    own : tuple of ModelShadow
        Each model's shadow on itself.
    map : ShadowMap
        What the sun sees of all trees.
    """

    sun: NDArray[np.float64]
    season: str
    own: tuple[ModelShadow, ...]
    map: ShadowMap

    def shaded(self, points: ArrayLike) -> NDArray[np.float64]:
        """Give how much of the sun trees take from points of the ground.

        Parameters
        ----------
        points : array_like (n, 3)
            Points on the ground or a little above, m.

        Returns
        -------
        float64 (n,)
            0 in the sun, 1 in the shade; between them at the edges of shadows, over one cell.
        """
        points = np.ascontiguousarray(np.asarray(points, np.float64).reshape(-1, 3))
        found = np.empty(len(points))
        in_threads(_shade_points, self.map, points, found)
        return found


def own_shadows(
    models: Sequence[Model], sun: ArrayLike, *, season: str = "summer"
) -> tuple[ModelShadow, ...]:
    """Work out each model's shadow on itself; it serves as long as sun and season do.

    Raises
    ------
    InputError
        If the sun is not above the horizon or the season unknown.
    """
    raise NotImplementedError


def scene_shadow(
    models: Sequence[Model],
    instances: Instances,
    sun: ArrayLike,
    cell_m: float = 0.5,
    *,
    season: str = "summer",
    own: tuple[ModelShadow, ...] | None = None,
) -> SceneShadow:
    """Cast the shade of all trees of a scene.

    Parameters
    ----------
    models, instances
        The trees.
    sun : array_like (3,)
        Direction towards the sun; above the horizon.
    cell_m : float
        Size of a cell of the scene's map, m.
    season : str
        One of `forest.surface.detail.SEASONS`; bare trees cast the shade of their branches.
    own : tuple of ModelShadow, optional
        From `own_shadows` for the same models, sun and season; worked out unless given.

    Raises
    ------
    InputError
        If the sun is not above the horizon, the season unknown, or the map too large.
    """
    raise NotImplementedError
