"""Branches that earn too little for their size are dropped: Palubicki et al. 2009, section 4.4.

The light gathered by a branch is compared with its size in internodes (Takenaka 1994). In
mass-balance mode and where trees bend a part without a living site is dropped as well, whatever its
light: in paper mode it only loses them below the ground.
"""

from __future__ import annotations

import numpy as np

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.bud_fate import lit_buds
from forest.growth.dealing import BINS, FLOATS, INTEGERS, Deal, Scratch
from forest.growth.parameters import SpeciesTraits
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL, Arena, close_ranks
from forest.trees.table import Trees


@njit
def mark_shed(  # type: ignore[no-untyped-def]
    parent, state, light, sapwood, order, threshold, drop_bare, branch_pipe, gathered, loss, ints
):
    """Mark what a tree sheds, tell the nodes that bore it, and take its pipes out of the sapwood.

    Parameters
    ----------
    threshold : float
        Light per internode below which a branch is shed; 0 sheds nothing.
    drop_bare : bool
        Whether parts without a living site are dropped.
    branch_pipe : float
        Thickness of a pipe along branches relative to the stem (kappa).
    gathered, loss : float64 (n,)
        Scratch: light of each part; sapwood (as on the stem) that served what was shed.
    ints : int32 (3, n)
        Scratch; `ints[2]` is filled with 1 for metamers that go, 0 for those that stay.

    Returns
    -------
    int
        Metamers that go.
    """
    n = len(parent)
    internodes, sites, gone = ints[0], ints[1], ints[2]
    for i in range(n):
        s = state[i]
        buds = (1 if s & TERMINAL else 0) + (1 if s & LATERAL else 0)
        gathered[i] = lit_buds(s) * np.float64(light[i])
        sites[i] = buds
        internodes[i] = 1
        loss[i] = 0.0
        gone[i] = 0
    for i in range(n - 1, 0, -1):
        p = parent[i]
        gathered[p] += gathered[i]
        sites[p] += sites[i]
        internodes[p] += internodes[i]
    shed = 0
    for i in range(1, n):
        p = parent[i]
        if gone[p]:
            gone[i] = 1
            shed += 1
            continue
        poor = not state[i] & MAIN and gathered[i] < threshold * internodes[i]
        if poor or (drop_bare and sites[i] == 0):
            gone[i] = 1
            shed += 1
            loss[p] += np.float64(sapwood[i]) / (branch_pipe if order[i] > 0 else 1.0)
            if state[i] & MAIN:
                state[p] &= np.uint8(255 - CONTINUED)
            else:
                state[p] &= np.uint8(255 - BRANCHED)
    if shed > 0:
        for i in range(n - 1, -1, -1):
            if gone[i]:
                continue
            here = loss[i] * (branch_pipe if order[i] > 0 else 1.0)
            sapwood[i] = np.float32(max(0.0, np.float64(sapwood[i]) - here))
            if i > 0:
                loss[parent[i]] += loss[i]
    return shed


@njit
def _shed_tree(arena, fields, trees, row, t, drop_bare, work, ints):  # type: ignore[no-untyped-def]
    """Drop the poor and bare branches of one tree."""
    sp = trees.species[row]
    s = trees.start[row]
    n = np.int64(trees.size[row])
    e = s + n
    gone = mark_shed(
        arena.parent[s:e],
        arena.state[s:e],
        arena.light[s:e],
        arena.sapwood[s:e],
        arena.order[s:e],
        t.of[sp].shed_below,
        drop_bare,
        t.of[sp].branch_pipe,
        work[0],
        work[1],
        ints,
    )
    if gone > 0:
        trees.size[row] = close_ranks(arena.parent[s:e], fields, s, n, ints[2], ints[0])


@driver
def _shed_chunks(first, step, arena, fields, trees, shared, scratch, traits, drop_bare):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            n = np.int64(trees.size[row])
            f = shared.place[b] * FLOATS
            g = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            ints = scratch.integers[g : g + INTEGERS * n].reshape((INTEGERS, n))
            _shed_tree(arena, fields, trees, row, traits, drop_bare, work, ints)


def shed(
    arena: Arena,
    trees: Trees,
    shared: Deal,
    scratch: Scratch,
    traits: SpeciesTraits,
    drop_bare: bool,
) -> None:
    """Drop the branches of all trees that earn too little, and compact what stays."""
    in_threads(
        _shed_chunks, arena.metamers, arena.fields, trees, shared, scratch, traits, drop_bare
    )
