"""What a year must touch at least: each phase's own arrays, once.

A phase that costs little more than this is bound by memory; one that costs many times as much is
bound by arithmetic, by its scratch, or by jumps between metamers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from forest.stand import Stand
from forest.trees.metamers import FIELDS

_ALL = tuple(FIELDS)


class Touched(NamedTuple):
    """Fields of every metamer that a phase reads and writes, and bytes per near-field voxel."""

    reads: tuple[str, ...]
    writes: tuple[str, ...]
    voxel_bytes: int = 0


#: Phase -> what it touches. Fields of new metamers alone are left out; so is scratch memory.
#: Phases that touch no metamers (deal, record) have no entry.
PHASES: dict[str, Touched] = {
    # Voxels: bud counts (2 bytes) are cleared and read, the shadow (4 bytes) is written.
    "expose": Touched(("tip", "state"), ("light",), voxel_bytes=2 + 2 + 4),
    "allocate": Touched(
        ("parent", "state", "order", "length", "sapwood", "light", "deficit", "resource"),
        ("state", "deficit", "resource"),
    ),
    # A tree that sheds closes its ranks, and nearly every tree sheds something: all fields move.
    "shed": Touched(_ALL, _ALL),
    "extend": Touched(("state", "resource"), ()),
    "thicken": Touched(
        ("parent", "order", "length", "state", "birth", "light", "pipe", "sapwood"),
        ("pipe", "sapwood"),
    ),
    "measure": Touched(("parent", "serial", "tip", "length", "pipe", "light", "state"), ()),
}


def metamer_bytes(phase: str) -> int:
    """Bytes of each metamer that a phase reads and writes."""
    touched = PHASES[phase]
    sizes = {name: np.dtype(dtype).itemsize * k for name, (dtype, k, _) in FIELDS.items()}
    return sum(sizes[name] for name in touched.reads + touched.writes)


def near_voxels(stand: Stand) -> int:
    """Count the voxels of the plot from the ground to the highest tip."""
    shadow = stand.scenario.environment.shadow
    assert shadow is not None
    width, depth = stand.scenario.plot.size_m
    height = float(np.max(stand.measure().height_m, initial=0.0))
    columns = round(width / shadow.voxel_m) * round(depth / shadow.voxel_m)
    return columns * int(np.ceil(height / shadow.voxel_m))


def touch_seconds(phase: str, metamers: int, voxels: int, bandwidth: float) -> float:
    """Time to touch a phase's arrays once at the bandwidth of copying."""
    touched = PHASES[phase]
    return (metamer_bytes(phase) * metamers + touched.voxel_bytes * voxels) / bandwidth
