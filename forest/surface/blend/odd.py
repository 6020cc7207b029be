"""Skeletons whose blended surface would not be what they say: gaps, and wood under the ground."""

from __future__ import annotations

import warnings

import numpy as np

from forest.errors import InputError
from forest.surface.blend.cones import Cones
from forest.trees.skeleton import Skeleton


class GapWarning(UserWarning):
    """Limbs start off their parent: what does not touch the tree is left out or bridged."""


def tell_gaps(skeleton: Skeleton, strict: bool) -> None:
    """Tell of limbs whose wood does not touch their parent's where they start.

    Raises
    ------
    InputError
        If there are such and `strict` is set.
    """
    parent = np.maximum(skeleton.parent, 0)
    base = (skeleton.parent >= 0) & (skeleton.axis != skeleton.axis[parent])
    child, below = np.flatnonzero(base), parent[base]
    line = skeleton.end[below] - skeleton.start[below]
    off = skeleton.start[child] - skeleton.start[below]
    square = np.maximum(np.sum(line * line, axis=1), 1e-300)
    t = np.clip(np.sum(off * line, axis=1) / square, 0.0, 1.0)
    away = np.linalg.norm(off - t[:, None] * line, axis=1)
    gap = away - skeleton.radius[child] - skeleton.radius[below]
    bad = np.flatnonzero(gap > 0.0)
    if not len(bad):
        return
    first = bad[int(np.argmax(gap[bad]))]
    text = (
        f"{len(bad)} axes start off their parent, the farthest axis {skeleton.axis[child[first]]}, "
        f"{away[first]:.3g} m from internode {below[first]}"
    )
    if strict:
        raise InputError(text, where="skeleton.start", expected="axes that start in their parent")
    warnings.warn(text + "; what touches nothing is left out", GapWarning, stacklevel=3)


def refuse_buried(cones: Cones) -> None:
    """Refuse stems that lead into the ground, at which they are cut.

    Raises
    ------
    InputError
        If an axis from the ground goes below the plane that cuts it.
    """
    along = cones.along + np.linalg.norm(cones.end - cones.start, axis=1)
    plane = cones.ground[cones.axis] - np.maximum(along - 2.0 * cones.high, 0.0)
    deep = np.flatnonzero(cones.end[:, 2] < plane - 1e-9)
    if len(deep):
        i = deep[0]
        raise InputError(
            f"axis {cones.axis[i]} grows from its base at {cones.ground[cones.axis[i]]:.3g} m down "
            f"to {cones.end[i, 2]:.3g} m, and is cut at the ground",
            where="skeleton.end",
            expected="stems that rise from their base",
        )
