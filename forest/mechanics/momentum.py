"""The wind within a canopy: what momentum the crowns above leave of it.

A closed stand cannot take more out of the wind than turbulence brings down to it: at the canopy's
top the wind u_h exerts the stress rho (b u_h)^2 on the ground below, with b = 0.3 however dense the
crowns are (Raupach 1994). The crowns share it. Each takes F = rho/2 C_d S(u) A u^2, what is left
below it is the stress tau = rho (b u)^2 of a weaker wind (Finnigan & Belcher 2004), and so

    d(ln tau) = -C_d S(u) / (2 b^2) da,     a: area shown per ground, counted from the top.

A sparse stand hardly weakens the wind; in a dense one the sum of all drags tends to rho (b u_h)^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.mechanics.fetch import HALF_WIDTH, Ways, first_from
from forest.mechanics.stems import StemSpecies
from forest.mechanics.stress import PROJECTION, streamlining, wind_profile
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

#: Friction velocity of closed stands per wind at the canopy's top (Raupach 1994).
FRICTION = 0.3
#: Layers into which a canopy is cut, from the ground to the top of its tallest tree.
LAYERS = 32

_BINS = 32  # fixed, so that results do not depend on the number of threads


class Crowns(NamedTuple):
    """What trees show to a wind of one direction, in the canopy's layers.

    Attributes
    ----------
    thick : float
        Height of a layer, m.
    share : float64 (n, LAYERS)
        Area shown per area of the leaves.
    drag : float64 (n, LAYERS)
        Area shown times the drag coefficient, m2.
    """

    thick: float
    share: NDArray[np.float64]
    drag: NDArray[np.float64]


@njit
def layer_of(height, thick):  # type: ignore[no-untyped-def]
    """The layer of the canopy at a height, m."""
    return min(max(int(height / thick), 0), LAYERS - 1)


@njit
def draw_crown(arena, trees, row, leaf_area, along_x, along_y, thick, layers):  # type: ignore[no-untyped-def]
    """Find how much of its leaves' area a crown shows to the wind, layer by layer.

    A layer of the area A of leaves, dz high and w wide across the wind, shows
    w dz (1 - exp(-A / (2 w dz))): leaves behind leaves are not seen. Its width is four standard
    deviations of the leaves' places, as of a disc that is filled evenly, and a leaf's own.

    Parameters
    ----------
    leaf_area : float
        Of a site, m2.
    along_x, along_y : float
        Unit vector towards which the wind blows.
    thick : float
        Height of a layer, m.
    layers : float64 (4, LAYERS)
        The first row becomes the area shown per area of the leaves, the second the area shown, m2.
    """
    s = trees.start[row]
    layers[:] = 0.0
    for i in range(s, s + np.int64(trees.size[row])):
        state = arena.state[i]
        sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
        aside = np.float64(arena.tip[i, 1]) * along_x - np.float64(arena.tip[i, 0]) * along_y
        k = layer_of(np.float64(arena.tip[i, 2]), thick)
        layers[0, k] += sites
        layers[2, k] += sites * aside
        layers[3, k] += sites * aside * aside
    for k in range(LAYERS):
        sites = layers[0, k]
        if sites > 0.0:
            mean = layers[2, k] / sites
            spread = np.sqrt(max(layers[3, k] / sites - mean * mean, 0.0))
            section = (4.0 * spread + np.sqrt(leaf_area)) * thick
            shown = section * (1.0 - np.exp(-PROJECTION * sites * leaf_area / section))
            layers[0, k] = shown / (sites * leaf_area)
            layers[1, k] = shown


@driver
def _draw(first, step, arena, trees, species, along, thick, scratch, out):  # type: ignore[no-untyped-def]
    share, drag = out
    n = len(trees.size)
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            sp = trees.species[row]
            draw_crown(
                arena, trees, row, species.leaf_area[sp], along[0], along[1], thick, scratch[b]
            )
            for k in range(LAYERS):
                share[row, k] = scratch[b, 0, k]
                drag[row, k] = species.drag[sp] * scratch[b, 1, k]


def draw_crowns(
    metamers: Metamers, trees: Trees, species: StemSpecies, along: tuple[float, float], top: float
) -> Crowns:
    """Find what each tree shows to a wind.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and tree table.
    species : StemSpecies
        One entry per species.
    along : (float, float)
        Unit vector towards which the wind blows.
    top : float
        Height of the tallest tree, m.
    """
    n = len(trees.size)
    thick = max(top, 0.1) / LAYERS
    share, drag = np.zeros((n, LAYERS)), np.zeros((n, LAYERS))
    scratch = np.zeros((_BINS, 4, LAYERS))
    in_threads(_draw, metamers, trees, species, along, thick, scratch, (share, drag))
    return Crowns(thick, share, drag)


@njit
def _gather_around(row, standing, drag, ways, sides, density):  # type: ignore[no-untyped-def]
    """Fill the crowns around a tree per ground, from the side where there are more of them.

    So the canopy is as dense at an edge as behind it.
    """
    reach = HALF_WIDTH * ways.canopy_height
    u = ways.along[row]
    v = ways.across[row]
    strip = int((v - ways.low) / reach)
    sides[:] = 0.0
    density[:] = drag[row]
    for at in range(max(strip - 1, 0), min(strip + 2, len(ways.first) - 1)):
        end = ways.first[at + 1]
        for k in range(first_from(ways.other_along, ways.first[at], end, u - reach), end):
            du = ways.other_along[k] - u
            dv = ways.other_across[k] - v
            if du > reach:
                break
            square = du * du + dv * dv
            other = ways.other[k]
            if not standing[other] or not 0.0 < square <= reach * reach:
                continue
            for j in range(LAYERS):
                if du == 0.0:
                    density[j] += drag[other, j]
                else:
                    sides[1 if du > 0.0 else 0, j] += drag[other, j]
    more = 1 if np.sum(sides[1]) > np.sum(sides[0]) else 0
    for j in range(LAYERS):
        density[j] = (density[j] + 2.0 * sides[more, j]) / (np.pi * reach * reach)


@driver
def _gather(first, step, standing, drag, ways, sides, density):  # type: ignore[no-untyped-def]
    n = len(standing)
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            if standing[row]:
                _gather_around(row, standing, drag, ways, sides[b], density[row])


def canopies(standing: NDArray[np.bool_], crowns: Crowns, ways: Ways) -> NDArray[np.float64]:
    """Find the canopy in which each tree stands.

    Parameters
    ----------
    standing : bool (n,)
    crowns : Crowns
        Of the same trees.
    ways : Ways
        Of the same trees.

    Returns
    -------
    float64 (n, LAYERS)
        Area shown times drag coefficient per ground, by layers, of the trees within half a canopy
        height before or behind each tree, whichever are more; NaN for the fallen.
    """
    density = np.full((len(standing), LAYERS), np.nan)
    sides = np.zeros((_BINS, 2, LAYERS))
    in_threads(_gather, standing, crowns.drag, ways, sides, density)
    return density


@njit
def fill_winds(speed, canopy_height, thick, density, edge, wind):  # type: ignore[no-untyped-def]
    """Fill the mean wind in each layer, and what it presses far within the stand and here.

    Parameters
    ----------
    speed : float
        At the canopy's top, m/s.
    canopy_height, thick : float
        m; above the canopy's top the wind is logarithmic.
    density : float64 (LAYERS,)
        See `canopies`.
    edge : float
        E, 0 (far within) to 1; the wind blows into an edge at all heights, so that the share w of
        its square that crowns leave is there w^(1 - E).
    wind : float64 (3, LAYERS)
        Filled: the wind u, m/s; S(u) u^2; the same for E = 0.

    Notes
    -----
    In a layer that takes the share 1 - exp(-k) of the momentum, the mean of w is
    (1 - exp(-k)) / k of that at its top, so that the drags add up to what is lost.
    """
    left = 1.0
    for j in range(LAYERS - 1, -1, -1):
        above = max(wind_profile((j + 0.5) * thick, canopy_height, 0.0), 1.0)
        top = speed * above
        streams = streamlining(top * np.sqrt(left))
        k = 0.5 * streams * above * above * density[j] / FRICTION**2
        mean = left * (1.0 - np.exp(-k)) / k if k > 1e-9 else left
        wind[2, j] = streams * top * top * mean
        here = mean ** (1.0 - edge)
        wind[0, j] = top * np.sqrt(here)
        wind[1, j] = streamlining(top * left ** (0.5 * (1.0 - edge))) * top * top * here
        left *= np.exp(-k)


@njit
def press(speed, canopy_height, thick, density, exposure, wind):  # type: ignore[no-untyped-def]
    """Scale what presses on crowns so that the canopy's moment is that of gusts at an edge.

    Parameters
    ----------
    exposure : (float, float)
        E, and the moment of gusts per that far within the stand.
    wind : float64 (3, LAYERS)
        The first row becomes the mean wind, m/s, the second the force on a crown per
        rho/2 C_d A, m2/s2.
    """
    edge, gusts = exposure
    fill_winds(speed, canopy_height, thick, density, edge, wind)
    inside = 0.0
    here = 0.0
    for j in range(LAYERS):
        inside += density[j] * wind[2, j] * (j + 0.5)
        here += density[j] * wind[1, j] * (j + 0.5)
    scale = gusts * inside / here if here > 0.0 else gusts
    for j in range(LAYERS):
        wind[1, j] *= scale
