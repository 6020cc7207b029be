"""Space colonization in a shared, procedural marker set (Palubicki et al. 2009, section 4.1).

Space is represented by marker points. A bud takes those within its occupancy radius; each marker
left belongs to the nearest bud whose perception cone holds it. The marker set is one jittered
marker per cell of a grid, its place a hash of seed and cell, so that no coordinates are stored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment import marker_directions, marker_kernels, marker_tiles
from forest.environment.dormant import Hold, dormant_buds
from forest.environment.marker_buds import Buds, BudSpace, list_buds
from forest.environment.marker_tiles import (
    CELLS,
    EDGE,
    Cloud,
    Envelopes,
    Gone,
    Lattice,
    Rows,
    Sites,
)
from forest.environment.standing import StandingSites
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

_SHAPES = {
    "ellipsoid": marker_tiles.ELLIPSOID,
    "cylinder": marker_tiles.CYLINDER,
    "box": marker_tiles.BOX,
}
_GROW_TILES = 8  # spare room when the box of tiles that were ever reached grows


class MarkerSpecies(NamedTuple):
    """How the buds of each species use space: float32 arrays of one entry per species.

    Attributes
    ----------
    occupancy_radius_m : float32 (n,)
        Radius rho of the zone in which a bud takes all markers.
    perception_distance_m : float32 (n,)
        Length r of the perception cone.
    cos_half_angle : float32 (n,)
        Cosine of half the cone's opening angle: the paper's theta of about 90 degrees is read as
        the full angle, so that markers up to 45 degrees off the bud's heading are perceived.
    """

    occupancy_radius_m: NDArray[np.float32]
    perception_distance_m: NDArray[np.float32]
    cos_half_angle: NDArray[np.float32]


class Envelope(NamedTuple):
    """A region of procedural markers: outside all envelopes there are none.

    Attributes
    ----------
    shape : {"ellipsoid", "cylinder", "box"}
        A cylinder is upright.
    center_m, size_m : tuple of 3 floats
        Centre and full extents along x, y, z.
    """

    shape: str
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]


class Laid(NamedTuple):
    """Markers that were laid: places, m; steps since which they are there; taken for good?"""

    point: NDArray[np.float64]
    due: NDArray[np.int32]
    gone: NDArray[np.bool_]


class MarkerSpace:
    """The markers of a plot and the state they are in.

    Parameters
    ----------
    seed : int
        Seed of the markers' places.
    spacing_m : float
        Edge of the cell that holds one marker. On a periodic plot the edges along x and y are
        adjusted to the nearest ones that divide the plot into whole cells.
    size_m : tuple of 2 floats
        Size of the plot.
    periodic : bool
        Whether space wraps at the plot's edges; if not, markers also exist outside the plot.
    release : bool
        Whether a marker is free again when the bud that took it is gone. The paper deletes
        markers for good (False).
    envelopes : sequence of Envelope
        If given, procedural markers exist only inside these (and above ground).
    clouds : float64 (n, 3), optional
        Explicit markers, present wherever they are (on a periodic plot, wrapped into it).
    everywhere : bool
        Whether there are procedural markers where there is no envelope; if not, explicit markers
        are all there are.
    """

    def __init__(
        self,
        seed: int,
        spacing_m: float,
        size_m: tuple[float, float],
        periodic: bool,
        release: bool,
        envelopes: Sequence[Envelope] = (),
        clouds: NDArray[np.float64] | None = None,
        everywhere: bool = True,
    ) -> None:
        size = np.array(size_m, np.float64)
        self._seed = np.uint64(seed)
        self._cell = np.full(3, spacing_m, np.float64)
        self._cells = np.zeros(2, np.int64)
        self._size = size
        if periodic:
            self._cells = np.maximum(np.rint(size / spacing_m), 1.0).astype(np.int64)
            self._cell[:2] = size / self._cells
            envelopes = _with_copies(envelopes, size)
        self._release = release
        self._envelopes = Envelopes(
            np.array([_SHAPES[e.shape] for e in envelopes], np.int64),
            np.array([e.center_m for e in envelopes], np.float64).reshape(-1, 3),
            np.array([e.size_m for e in envelopes], np.float64).reshape(-1, 3),
        )
        self._explicit_alone = not everywhere and not envelopes
        if self._explicit_alone:  # an envelope that nothing lies in
            nowhere = np.full((1, 3), -np.inf)
            self._envelopes = Envelopes(np.zeros(1, np.int64), nowhere, np.ones((1, 3)))
        self._gone = np.zeros((0, 0, 0), np.uint64)
        self._gone_low = np.zeros(3, np.int64)
        self._points = np.zeros((0, 3))
        self._due = np.zeros(0, np.int32)
        self._cloud_gone = np.zeros(0, np.uint8)
        self._fresh: list[tuple[NDArray[np.float64], NDArray[np.int32]]] = []
        self._clouds = 0
        if clouds is not None and len(clouds):
            self.lay(clouds, np.zeros(len(clouds), np.int32))
            self._gather()
            self._clouds = len(self._points)

    @property
    def cell_m(self) -> NDArray[np.float64]:
        """Edges of a cell along x, y and z, m."""
        return self._cell.copy()

    @property
    def cells(self) -> NDArray[np.int64]:
        """Cells along x and y of a periodic plot; 0 where there is no end."""
        return self._cells.copy()

    @property
    def seed(self) -> np.uint64:
        """Seed of the markers' places in their cells."""
        return self._seed

    @property
    def envelopes(self) -> Envelopes:
        """Regions outside which there are no procedural markers."""
        return self._envelopes

    @property
    def cloud(self) -> NDArray[np.float64]:
        """Explicit markers, float64 (n, 3), m."""
        self._gather()
        return self._points.copy()

    def lay(self, points: NDArray[np.float64], due: NDArray[np.int32]) -> None:
        """Add explicit markers.

        Parameters
        ----------
        points : float64 (n, 3)
            Their places, m; on a periodic plot they are wrapped into it.
        due : int32 (n,)
            Step from which on each is there.
        """
        new = np.array(points, np.float64).reshape(-1, 3)
        if self._cells[0]:
            new[:, :2] %= self._size
            new[:, :2][new[:, :2] >= self._size] = 0.0  # a rounded-up remainder
        self._fresh.append((new, due.astype(np.int32)))

    def _gather(self) -> None:
        """Put what was laid since the last time behind the rest: one copy for many strokes."""
        if self._fresh:
            points, due = zip(*self._fresh, strict=True)
            self._fresh = []
            self._points = np.concatenate((self._points, *points))
            self._due = np.concatenate((self._due, *due))
            none = np.zeros(len(self._due) - len(self._cloud_gone), np.uint8)
            self._cloud_gone = np.concatenate((self._cloud_gone, none))

    @property
    def laid(self) -> Laid:
        """The markers that were laid since the start, in the order in which they were."""
        self._gather()
        n = self._clouds
        return Laid(self._points[n:], self._due[n:], self._cloud_gone[n:] != 0)

    @property
    def release(self) -> bool:
        """Whether a marker is free again when the bud that took it is gone."""
        return self._release

    def claim(
        self,
        metamers: Metamers,
        trees: Trees,
        species: MarkerSpecies,
        standing: StandingSites | None = None,
        *,
        step: int = 0,
        holds: Sequence[Hold] = (),
    ) -> BudSpace:
        """Take the markers near living buds and share out the others.

        Parameters
        ----------
        metamers, trees
            The stand; not changed.
        species : MarkerSpecies
            Parameters of each species in the table.
        standing : StandingSites, optional
            Points that take markers beside the buds, and perceive none.
        step : int
            Explicit markers that are due later are not there yet.
        holds : sequence of Hold
            What may grow of trees that are held: their other buds take markers near them, but
            perceive none.

        Returns
        -------
        BudSpace
            What each living bud found. `marker_buds.apply_space` writes it into the arena.
        """
        self._gather()
        buds = list_buds(metamers, trees)
        sites = _sites(species)
        n = len(buds.species)
        competitors = buds
        if holds:
            competitors, sites = _with_dormant(
                buds, sites, dormant_buds(buds, metamers, trees, holds)
            )
        if standing is not None:
            competitors, sites = _with_standing(competitors, sites, standing)
        found = np.zeros(n, np.int32)
        direction = np.zeros((n, 3), np.float32)
        lattice = self._lattice(competitors, sites)
        if lattice is not None:
            found, direction = self._share_out(lattice, competitors, sites, step)
            found, direction = found[:n], direction[:n]
        return BudSpace(
            buds.first_of_tree, buds.tree_row, buds.metamer, buds.kind, found, direction
        )

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Give the arrays that the next year needs beside the stand (empty with `release`)."""
        self._gather()
        state: dict[str, NDArray[np.generic]] = {
            "gone": self._gone.copy(),
            "gone_low": self._gone_low.copy(),
            "cloud_gone": self._cloud_gone.copy(),
        }
        if len(self._points) > self._clouds:
            state["laid"] = self._points[self._clouds :].copy()
            state["due"] = self._due[self._clouds :].copy()
        return state

    def restore(self, state: Mapping[str, NDArray[np.generic]]) -> None:
        """Take back what `state` gave."""
        self._gather()
        if "laid" in state:
            n = self._clouds
            self._points = np.concatenate((self._points[:n], np.array(state["laid"], np.float64)))
            self._due = np.concatenate((self._due[:n], np.array(state["due"], np.int32)))
        self._gone = np.array(state["gone"], np.uint64)
        self._gone_low = np.array(state["gone_low"], np.int64)
        self._cloud_gone = np.array(state["cloud_gone"], np.uint8)

    def _share_out(
        self, lattice: Lattice, buds: Buds, sites: Sites, step: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Count the markers of each bud and find its best direction."""
        entries = marker_tiles.sort_buds(buds, sites, lattice)
        near = _rows(lattice, float(sites.occupancy.max()))
        far = _rows(lattice, max(float(sites.perception.max()), float(sites.occupancy.max())))
        gone = self._cover(lattice)
        cloud = self._cloud(lattice, step)
        flags = marker_tiles.reached_tiles(
            lattice, entries.first, far, gone, not self._release and not len(self._points)
        )
        tiles = np.flatnonzero(flags)
        room = CELLS + (int(np.diff(cloud.first).max()) if len(cloud.first) else 0)
        winner, cloud_winner = marker_kernels.compete(
            lattice,
            entries,
            near,
            far,
            sites,
            buds,
            self._envelopes,
            cloud,
            gone,
            self._release,
            tiles,
            room,
        )
        first, won = marker_directions.sort_won(
            winner, cloud_winner, entries.bud, len(buds.species)
        )
        direction = marker_directions.directions(
            lattice, entries, cloud, tiles, winner, cloud_winner, first, won
        )
        return np.diff(first).astype(np.int32), direction

    def _lattice(self, buds: Buds, sites: Sites) -> Lattice | None:
        """Find the box of tiles that markers within reach of buds can lie in."""
        if len(buds.species) == 0:
            return None
        reach = float(max(sites.perception.max(), sites.occupancy.max()))
        low = buds.position.min(axis=0) - reach
        high = buds.position.max(axis=0) + reach
        if not len(self._points):
            low[2] = max(low[2], 0.0)
        for axis in range(2):
            if self._cells[axis]:
                low[axis] = 0.0
                high[axis] = self._cells[axis] * self._cell[axis]
        if self._explicit_alone:
            if not len(self._points):
                return None
            low = np.maximum(low, self._points.min(axis=0))
            high = np.minimum(high, self._points.max(axis=0))
        elif len(self._envelopes.shape):
            half = 0.5 * self._envelopes.size
            floor = np.vstack((self._envelopes.centre - half, self._points)).min(axis=0)
            top = np.vstack((self._envelopes.centre + half, self._points)).max(axis=0)
            low = np.maximum(low, floor)
            high = np.minimum(high, top)
        if np.any(high < low):
            return None
        tile = EDGE * self._cell
        low_tile = np.floor(low / tile).astype(np.int64)
        shape = np.floor(high / tile).astype(np.int64) - low_tile + 1
        for axis in range(2):
            if self._cells[axis]:
                last = (self._cells[axis] - 1) // EDGE
                shape[axis] = min(shape[axis], last - low_tile[axis] + 1)
        bins = np.ceil(reach / tile).astype(np.int64)
        return Lattice(self._seed, self._cell, self._cells, low_tile, shape, bins)

    def _cover(self, lattice: Lattice) -> Gone:
        """Give the "gone" bits, which grow where needed to cover the box of tiles."""
        if self._release:
            return Gone(self._gone, self._gone_low)
        low, shape = lattice.low[::-1], lattice.shape[::-1]
        if self._gone.size == 0:
            self._gone_low, old_end = low.copy(), low.copy()
        else:
            old_end = self._gone_low + self._gone.shape
        if np.any(low < self._gone_low) or np.any(low + shape > old_end):
            new_low = np.where(low < self._gone_low, low - _GROW_TILES, self._gone_low)
            new_end = np.where(low + shape > old_end, low + shape + _GROW_TILES, old_end)
            grown = np.zeros(tuple(new_end - new_low), np.uint64)
            if self._gone.size:
                z, y, x = self._gone_low - new_low
                nz, ny, nx = self._gone.shape
                grown[z : z + nz, y : y + ny, x : x + nx] = self._gone
            self._gone, self._gone_low = grown, new_low
        return Gone(self._gone, low - self._gone_low)

    def _cloud(self, lattice: Lattice, step: int) -> Cloud:
        """Sort the explicit markers by tile; those outside the box or due later are left out."""
        if not len(self._points):
            none = np.zeros(0, np.int64)
            return Cloud(self._points, none, none, self._cloud_gone)
        place = np.floor(self._points / (EDGE * self._cell)).astype(np.int64) - lattice.low
        there = np.all((place >= 0) & (place < lattice.shape), axis=1) & (self._due <= step)
        within = np.flatnonzero(there)
        nx, ny, nz = lattice.shape
        tile = (place[:, 2] * ny + place[:, 1]) * nx + place[:, 0]
        order = within[np.argsort(tile[within], kind="stable")]
        first = np.searchsorted(tile[order], np.arange(nx * ny * nz + 1)).astype(np.int64)
        return Cloud(self._points, order, first, self._cloud_gone)


def _with_copies(envelopes: Sequence[Envelope], size: NDArray[np.float64]) -> list[Envelope]:
    """Add the copies of envelopes that reach into a periodic plot over its edges."""
    copies = []
    for shape, centre, extent in envelopes:
        for dy in (0.0, -size[1], size[1]):
            for dx in (0.0, -size[0], size[0]):
                x, y = centre[0] + dx, centre[1] + dy
                reaches_x = -0.5 * extent[0] < x < size[0] + 0.5 * extent[0]
                reaches_y = -0.5 * extent[1] < y < size[1] + 0.5 * extent[1]
                if reaches_x and reaches_y:
                    copies.append(Envelope(shape, (x, y, centre[2]), extent))
    return copies


def _sites(species: MarkerSpecies) -> Sites:
    cosine = species.cos_half_angle.astype(np.float64)
    return Sites(
        species.occupancy_radius_m.astype(np.float64),
        species.perception_distance_m.astype(np.float64),
        cosine,
        np.sqrt(np.maximum(1.0 - cosine**2, 0.0)),
    )


def _with_dormant(buds: Buds, sites: Sites, dormant: NDArray[np.bool_]) -> tuple[Buds, Sites]:
    """Let dormant buds take markers but perceive none: each species has a blind one of its own."""
    n = len(sites.occupancy)
    species = (buds.species + np.where(dormant, n, 0)).astype(np.int16)
    blind = Sites(sites.occupancy, np.zeros(n), np.ones(n), np.zeros(n))
    both = Sites(*(np.concatenate(pair) for pair in zip(sites, blind, strict=True)))
    return buds._replace(species=species), both


def _with_standing(buds: Buds, sites: Sites, standing: StandingSites) -> tuple[Buds, Sites]:
    """Enter points as buds that look nowhere, each kind of them as a species of its own."""
    n, kinds = len(standing.kind), len(standing.radius_m)
    more = buds._replace(
        tree_row=np.full(n, len(buds.first_of_tree) - 1, np.int32),
        metamer=np.zeros(n, np.int32),
        kind=np.zeros(n, np.uint8),
        serial=np.arange(n, dtype=np.int32),
        species=(len(sites.occupancy) + standing.kind).astype(np.int16),
        position=standing.point,
        heading=np.zeros((n, 3), np.float32),
    )
    both: Any = zip(buds[1:], more[1:], strict=True)
    blind = (standing.radius_m, np.zeros(kinds), np.ones(kinds), np.zeros(kinds))
    return (
        Buds(buds.first_of_tree, *(np.concatenate(pair) for pair in both)),
        Sites(*(np.concatenate(pair) for pair in zip(sites, blind, strict=True))),
    )


def _rows(lattice: Lattice, distance: float) -> Rows:
    """List the rows of bins within a distance of a tile, the nearest first."""
    tile = EDGE * lattice.cell
    half = np.ceil(distance / tile).astype(np.int64)
    offsets = []
    for dz in range(-half[2], half[2] + 1):
        for dy in range(-half[1], half[1] + 1):
            gap = np.hypot(max(abs(dy) - 1, 0) * tile[1], max(abs(dz) - 1, 0) * tile[2])
            if gap <= distance:
                half_x = int(np.sqrt(distance**2 - gap**2) / tile[0]) + 1
                offsets.append((float(gap), abs(dy) + abs(dz), dy, dz, min(half_x, half[0])))
    return Rows(np.array([o[2:] for o in sorted(offsets)], np.int64).reshape(-1, 3))
