"""This year's ring: the rigidity it adds, the shape it keeps, and how older wood stiffens.

Taylor-Hell 2005, sections 4.2, 6.1 and 6.2. A metamer's section is an ellipse with its semi-axes
along L and U. It is not stored: the radius `ringed` gives its area, and the ratio of the two
bending rigidities the ratio of its semi-axes, exactly so while all wood has one modulus.

Wood matures: each year the rigidity goes a share 1/years of its way to that of a section all of
mature wood. Every ring then approaches E_mature from E_juv with its own age, since the sum over
rings is linear; no ring needs to be remembered. Wood does not mature later in the shade of bark or
heartwood than elsewhere. What stiffens does so in the shape it has then, as a new ring does
(eq. 9), so that ageing alone never lifts a loaded branch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import BINS, Deal
from forest.mechanics.righting import (
    BETA,
    NONE,
    answer_to_deviation,
    answer_to_lean,
    strained_turn,
    thick_side,
)
from forest.species import Species
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

if TYPE_CHECKING:
    from forest.mechanics.rods import Rods

_GIGA = 1e9
_DEGREE = math.pi / 180.0
#: Numbers of a species: name -> (key of its `mechanics` table, factor to Pa, rad, 1).
_FROM_TABLE = {
    "juvenile": ("modulus_juvenile_gpa", _GIGA),
    "mature": ("modulus_mature_gpa", _GIGA),
    "reaction": ("modulus_reaction_gpa", _GIGA),
    "shear": ("shear_ratio", 1.0),
    "stem_angle": ("stem_angle_deg", _DEGREE),
    "branch_angle": ("branch_angle_deg", _DEGREE),
    "righting_from": ("righting_from_deg", _DEGREE),
    "righting_span": ("righting_span_deg", _DEGREE),
    "strain": ("ring_strain", 1.0),
    "strain_difference": ("ring_strain_difference", 1.0),
    "swell": ("ring_swell", 1.0),
    "deviation_limit": ("deviation_limit_rad_m", 1.0),
    "rest_share": ("rest_share", 1.0),
}


def wood_traits(species: Sequence[Species], pipe_exponent: NDArray[np.float64]) -> NDArray[Any]:
    """Pack what kernels know of the wood of each species.

    Parameters
    ----------
    species : sequence of Species
    pipe_exponent : float64 (species,)
        n of the run: diameter = pipe^(1/n).

    Returns
    -------
    structured float64 array (species,)
        Moduli in Pa, angles in rad; `maturing` is the share of its way that wood matures in a
        year, `conifer` is 1 or 0.
    """
    names = [*_FROM_TABLE, "maturing", "conifer", "pipe_exponent"]
    traits = np.zeros(len(species), [(name, np.float64) for name in names])
    for name, (key, factor) in _FROM_TABLE.items():
        traits[name] = [factor * getattr(s.mechanics, key) for s in species]
    traits["maturing"] = [1.0 / s.mechanics.maturing_years for s in species]
    traits["conifer"] = [s.group == "conifer" for s in species]
    traits["pipe_exponent"] = pipe_exponent
    return traits


@njit
def section(radius, about_l, about_u):  # type: ignore[no-untyped-def]
    """Give the semi-axes along L and U, m, of an ellipse of area pi radius^2.

    Its moments about L and U are as the rigidities: EI_U / EI_L = (along_l / along_u)^2.
    """
    slender = math.sqrt(math.sqrt(about_u / about_l))
    return radius * slender, radius / slender


@njit
def stiffness_per_modulus(along_l, along_u, shear):  # type: ignore[no-untyped-def]
    """Give (G/E) J and the moments of area about L and U of an ellipse, m4 (eq. 16)."""
    area = math.pi * along_l * along_u
    ll, uu = along_l * along_l, along_u * along_u
    return shear * area * ll * uu / (ll + uu), 0.25 * area * uu, 0.25 * area * ll


@njit
def widen(along_l, along_u, swell_l, swell_u, grown):  # type: ignore[no-untyped-def]
    """Grow an ellipse by widths that are as `swell_l` to `swell_u`.

    Parameters
    ----------
    along_l, along_u : float
        Semi-axes, m.
    swell_l, swell_u : float
        Relative widths of the ring along L and along U.
    grown : float
        Area of the ring per pi, m2.

    Returns
    -------
    along_l, along_u : float
        Semi-axes of the ring's outer edge, m.
    """
    linear = along_l * swell_u + along_u * swell_l
    root = math.sqrt(linear * linear + 4.0 * swell_l * swell_u * grown)
    width = 2.0 * grown / (linear + root)
    return along_l + swell_l * width, along_u + swell_u * width


@njit
def _lay(rods, k, radius, sought, w, righting, ring):  # type: ignore[no-untyped-def]
    """Age the wood of metamer k and lay its ring up to `radius`."""
    inner = np.float64(rods.ringed[k])
    rods.ringed[k] = np.float32(radius)
    ring[k, 0] = np.float32(0.0)
    ring[k, 1] = np.float32(0.0)
    if inner == 0.0:  # its first wood has the shape that it was made with
        first = stiffness_per_modulus(radius, radius, w.shear)
        for j in range(3):
            rods.rigidity[k, j] = np.float32(w.juvenile * first[j])
        return
    strength, turn_l, turn_u = 0.0, 0.0, 0.0
    if radius > inner and righting != NONE:
        if righting == BETA:
            strength, turn_l, turn_u = answer_to_deviation(
                rods.curvature[k], rods.rest[k], w.deviation_limit
            )
        else:
            strength, turn_l, turn_u = answer_to_lean(
                rods.frame[k], sought, w.righting_from, w.righting_span
            )
    swell_l, swell_u, rest_share, bent = 1.0, 1.0, 0.0, 0.0
    about_l = np.float64(rods.rigidity[k, 1])
    about_u = np.float64(rods.rigidity[k, 2])
    along_l, along_u = section(inner, about_l, about_u)
    modulus = w.juvenile + 0.5 * strength * (w.reaction - w.juvenile)  # eq. 18
    core = stiffness_per_modulus(along_l, along_u, w.shear)
    if strength > 0.0:
        eccentricity = strength * (w.swell - 1.0)
        ring[k, 0] = np.float32(eccentricity)
        ring[k, 1] = np.float32(thick_side(turn_l, turn_u, w.conifer > 0.0))
        if righting == BETA:
            rest_share = w.rest_share
            if abs(turn_l) >= abs(turn_u):  # it bends about L: wider along U
                swell_u = w.swell
            else:
                swell_l = w.swell
        else:
            aged = 0.5 * (about_l + about_u)
            aged += w.maturing * (w.mature * 0.5 * (core[1] + core[2]) - aged)
            strain = 0.5 * strength * w.strain_difference + w.strain * eccentricity
            bent = strained_turn(inner, radius, aged, modulus, strain)
    along_l, along_u = widen(along_l, along_u, swell_l, swell_u, radius**2 - inner**2)
    whole = stiffness_per_modulus(along_l, along_u, w.shear)
    for j in range(3):
        old = np.float64(rods.rigidity[k, j])
        rest = np.float64(rods.rest[k, j])
        shape = np.float64(rods.curvature[k, j])
        aged = w.maturing * (w.mature * core[j] - old)
        new = modulus * (whole[j] - core[j])
        kept = (1.0 - rest_share) * shape + rest_share * rest  # eqs 9, 19
        total = old + aged + new
        rods.rigidity[k, j] = np.float32(total)
        rods.rest[k, j] = np.float32((old * rest + aged * shape + new * kept) / total)  # eq. 8
    rods.rest[k, 1] = np.float32(rods.rest[k, 1] + bent * turn_l)
    rods.rest[k, 2] = np.float32(rods.rest[k, 2] + bent * turn_u)


@driver
def _lay_chunks(first, step, arena, trees, shared, rods, woods, righting, ring):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for t in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[t]
            w = woods[trees.species[row]]
            inverse = 1.0 / w.pipe_exponent
            start = trees.start[row]
            for k in range(start, start + trees.size[row]):
                # Rounded as it is stored: a metamer that did not grow has no ring.
                pipe = np.float64(arena.pipe[k])
                diameter = math.sqrt(pipe) if inverse == 0.5 else pipe**inverse
                radius = np.float64(np.float32(0.5 * diameter))
                sought = w.stem_angle if arena.order[k] == 0 else w.branch_angle
                _lay(rods, k, radius, sought, w, righting, ring)


def lay_wood(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    rods: Rods,
    woods: NDArray[Any],
    righting: np.int64,
    ring: NDArray[np.float32],
) -> None:
    """Age all wood by a year and lay the ring of every metamer in its present shape.

    Called once a year, after the pipes have thickened and while `rods.curvature` and
    `rods.frame` are those of the summer. A metamer's first wood leaves its rest curvature as it is
    (Taylor-Hell 2005, eqs 8, 9, 16-19; ring rigidity E_juv * I_ring).

    Parameters
    ----------
    rods : Rods
        `rest`, `rigidity` and `ringed` are changed.
    woods : structured array (species,)
        From `wood_traits`.
    righting : np.int64
        NONE, BETA or STRAIN of `forest.mechanics.righting`.
    ring : float32 (capacity of the arena, 2)
        Filled for every metamer: the ring's eccentricity e, 0 to 1 (its width goes as
        1 + e cos theta), and its thick side, the angle about H from L towards U, rad. Both are 0
        where there is no reaction wood.
    """
    in_threads(_lay_chunks, arena, trees, shared, rods, woods, righting, ring)
