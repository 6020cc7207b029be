"""Rings of epidermis that is whole: where bark begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.material import Material, Physics
from forest.surface.bark.rings import Rings, solve_strip
from forest.surface.bark.strips import GRAIN_M, StripGeometry

_LEAST_SITES = 8  # vertices tied to the substrate around a ring, where it grips
_MOST_SITES = 128


def even_edges(girth: NDArray[np.float64], sectors: int) -> NDArray[np.float64]:
    """Give sectors of growth that are as wide all around, (strips, sectors + 1) m."""
    return girth[:, None] * np.linspace(0.0, 1.0, max(sectors, 1) + 1)


def whole_rings(
    geometry: StripGeometry,
    girth: NDArray[np.float64],
    material: Material,
    edges: NDArray[np.float64],
) -> Rings:
    """Make rings of whole epidermis; `edges` are those of the sectors of growth."""
    n = len(girth)
    length = np.floor(girth / GRAIN_M) * GRAIN_M
    sites = np.ones(n, np.int64)
    if material.attachment > 0.0:
        # Displacements fade over sqrt(R / K_a); two vertices to each such length.
        fading = np.sqrt(material.stiffness / material.attachment)
        sites = np.clip(np.ceil(2.0 * length / fading), _LEAST_SITES, _MOST_SITES).astype(np.int64)
    most = np.floor(length / material.least_piece_m).astype(np.int64) + 2
    base = np.concatenate([[0], np.cumsum(sites + most)])
    grains = np.ceil(length / material.grain_m).astype(np.int64)
    cell = np.concatenate([[0], np.cumsum(grains)])
    tears = int(most.sum())

    def records() -> NDArray[np.float64]:
        return np.zeros(base[-1])

    rings = Rings(
        axis=np.array(geometry.axis, np.int32),
        along=np.array(geometry.along, np.float64),
        width=np.array(geometry.width, np.float64),
        up=np.array(geometry.neighbour_up, np.int32),
        down=np.array(geometry.neighbour_down, np.int32),
        factor=np.array(geometry.width_around, np.float64),
        length=length,
        girth=girth.copy(),
        edges=edges.copy(),
        limit=np.zeros(n),
        base=base[:-1],
        records=sites,
        cell=cell,
        spot=np.zeros(cell[-1], np.float32),
        drawn=np.zeros(cell[-1], np.float32),
        weakness=np.zeros(cell[-1], np.float32),
        **{name: records() for name in _RECORDS},
        tear=np.full(base[-1], -1, np.int32),
        tear_strip=np.zeros(tears, np.int32),
        tear_place=np.zeros(tears),
        tear_up=np.zeros(tears, np.int32),
        tear_down=np.zeros(tears, np.int32),
        tear_fracture=np.zeros(tears, np.int32),
        tear_born=np.zeros(tears),
        origin=np.zeros(tears, np.int32),
        first=np.zeros(tears, np.int32),
        last=np.zeros(tears, np.int32),
        reach=np.zeros(tears),
        area=np.zeros(tears),
        kept=np.zeros(tears),
        ran=np.zeros((tears, 2)),
        totals=np.zeros(2, np.int64),
    )
    physics = Physics.of(material)
    rings.weak[:] = np.nan
    for s in range(n):
        rows = slice(base[s], base[s] + sites[s])
        at = np.round(np.arange(sites[s]) * (length[s] / sites[s]) / GRAIN_M) * GRAIN_M
        rings.place[rows] = at
        rings.left[rows] = rings.grip_left[rows] = rings.grip_right[rows] = at * (
            girth[s] / length[s]
        )
        solve_strip(rings, physics, np.int64(s))
    return rings


_RECORDS = ("place", "rest", "open", "left", "piece", "grip_left", "grip_right", "weak", "tough")
