"""The plane in which a brush moves on a screen (Palubicki et al. 2009, section 5).

"If a stroke begins at an existing component of the tree, its depth determines the depth of the
working plane, parallel to the screen, in which the brush is assumed to move."
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.trees.skeleton import Skeleton

_PARALLEL = 1e-9


class WorkingPlane(NamedTuple):
    """A plane in space.

    Attributes
    ----------
    point : float64 (3,)
        A place on it, m: the upper end of the picked metamer.
    normal : float64 (3,)
        Unit vector across it: the direction in which the camera looks.
    """

    point: NDArray[np.float64]
    normal: NDArray[np.float64]

    @classmethod
    def at(cls, skeleton: Skeleton, metamer: int, looks: ArrayLike) -> Self:
        """Lay the plane through a metamer, parallel to the screen.

        Parameters
        ----------
        skeleton : Skeleton
            The tree.
        metamer : int
            Serial number of one of its metamers.
        looks : array_like (3,)
            Direction in which the camera looks, of any length.

        Raises
        ------
        InputError
            If there is no such metamer, or no direction.
        """
        found = np.flatnonzero(skeleton.serial == metamer)
        if not len(found):
            raise InputError(
                f"tree {skeleton.tree_id} has no metamer {metamer}",
                where="working plane",
                expected="a serial number of the tree's skeleton",
            )
        normal = np.array(looks, np.float64)
        length = float(np.linalg.norm(normal))
        if not (np.isfinite(length) and length > 0.0):
            raise InputError(
                f"{looks!r} is no direction",
                where="working plane",
                expected="a vector that is not 0",
            )
        return cls(skeleton.end[found[0]].copy(), normal / length)

    def meet(self, eye: ArrayLike, ray: ArrayLike) -> NDArray[np.float64]:
        """Give the places where rays from an eye meet the plane.

        Parameters
        ----------
        eye : array_like (3,) or (n, 3)
            Where each ray begins, m; one for all, or one each (a camera without perspective).
        ray : array_like (3,) or (n, 3)
            Direction of each, of any length.

        Returns
        -------
        float64, as `ray`
            Places, m; NaN for a ray along the plane.
        """
        start, along = np.asarray(eye, np.float64), np.asarray(ray, np.float64)
        steep = along @ self.normal
        flat = np.abs(steep) < _PARALLEL * np.linalg.norm(along, axis=-1)
        t = ((self.point - start) @ self.normal) / np.where(flat, np.nan, steep)
        return np.asarray(start + t[..., None] * along, np.float64)
