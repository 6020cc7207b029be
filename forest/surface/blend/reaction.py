"""How much reaction wood each limb of a skeleton needs (Hart & Baker 2003, section 5.1)."""

from __future__ import annotations

import numpy as np

from forest.growth.parameters import support
from forest.mechanics.branch_points import support_offset, widening
from forest.species import Species
from forest.surface.blend.cones import sound
from forest.surface.blend.limbs import Reaction
from forest.trees.skeleton import Skeleton


def reaction_wood(skeleton: Skeleton, species: Species) -> Reaction:
    """Find delta and Delta r of each axis from the weight that it carries (eqs 23 to 25).

    Parameters
    ----------
    skeleton : Skeleton
        The tree; leaves are taken to hang where it is leafy.
    species : Species
        Its wood and leaves; conifers are thick below, others above.

    Returns
    -------
    Reaction
        By axis, for `blended`. An upright limb has none.

    Notes
    -----
    As `forest.mechanics.branch_points.reaction_rings` for a tree in the arena, except that here
    each leafy node bears the leaves of one site.
    """
    skeleton = sound(skeleton)
    density = species.mechanics.green_density_kg_m3
    strength = float(support([species], np.array([density]))[0]) * density
    leaf = species.leaves.area_m2 / species.leaves.sla_m2_kg * species.mechanics.leaf_water_factor
    length = skeleton.length
    wood = np.pi * skeleton.radius**2 * length * density
    leaves = leaf * skeleton.leafy
    mass = wood + leaves
    moment = wood[:, None] * 0.5 * (skeleton.start + skeleton.end) + leaves[:, None] * skeleton.end
    axes = int(skeleton.axis.max()) + 1
    whole = np.bincount(skeleton.axis, length, minlength=axes)
    for i in range(len(skeleton) - 1, 0, -1):
        p = skeleton.parent[i]
        if p >= 0:
            mass[p] += mass[i]
            moment[p] += moment[i]
    base, tip = np.full(axes, -1), np.full(axes, -1)
    index = np.arange(len(skeleton))
    base[skeleton.axis[::-1]] = index[::-1]
    tip[skeleton.axis] = index
    reach, wide = np.zeros(axes), np.zeros(axes)
    for a in np.flatnonzero(base >= 0):
        i = base[a]
        centre = moment[i] / mass[i] - skeleton.start[i]
        along = skeleton.end[tip[a]] - skeleton.start[i] if skeleton.parent[i] >= 0 else centre
        flat = float(np.hypot(along[0], along[1]))
        span = float(np.hypot(flat, along[2]))
        lean = flat / span if span > 0.0 else 0.0
        arm = float(centre[:2] @ along[:2]) / flat if flat > 0.0 else 0.0
        held = strength * float(skeleton.radius[i]) ** 2
        reach[a] = support_offset(float(mass[i]), arm, held, lean, float(whole[a]))
        wide[a] = widening(float(skeleton.radius[i]), lean)
    wide[reach <= 0.0] = 0.0
    return Reaction(reach, wide, below=species.group == "conifer")
