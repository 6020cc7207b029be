"""Bark that grows: from a girth over time to strips, elements and fractures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.bark.checks import (
    check_strips,
    check_threshold,
    checked_dilatation,
    checked_girths,
    checked_weakness,
    girths_from_birth,
)
from forest.surface.bark.events import begin_fracture, tear_all
from forest.surface.bark.fracture import room_to_break, settle, weigh_all
from forest.surface.bark.material import Material, Physics
from forest.surface.bark.rings import Rings, copied, stretch_all, turn_of, x_of
from forest.surface.bark.strips import (
    FRACTURE,
    Crossings,
    Elements,
    StripGeometry,
)
from forest.surface.bark.tables import elements_of, tables_of
from forest.surface.bark.viewed import BarkView
from forest.surface.bark.whole import even_edges, whole_rings

#: By how much the memory of a fast year fades in the next, where the threshold is the growth ratio:
#: bark strained in a fast year does not break up all over in a slow one.
FADE = 0.8


class Snapshot(NamedTuple):
    """The elements at an earlier time."""

    time: float
    girth: NDArray[np.float64]  # (strips) m
    elements: Elements


@dataclass(frozen=True, eq=False)
class Bark(BarkView):
    """Bark at one time. Its verbs give another bark; this one stays as it is.

    Memory: 49 bytes an element (two to a fracture), and inside 160 bytes a possible fracture (one
    to each `least_piece_m` of epidermis) and 12 a grain.
    """

    geometry: StripGeometry
    history: tuple[Snapshot, ...]  # one a step, where asked for
    _rings: Rings
    _pace: NDArray[np.float64]  # (strips) S - 1 where S is the growth ratio

    def grow(
        self,
        girth_by_step: NDArray[np.float64],
        *,
        dilatation: NDArray[np.float64] | None = None,
        substeps: int = 1,
        keep: bool = False,
    ) -> Bark:
        """Let the girth go on growing.

        Parameters
        ----------
        girth_by_step : float64 (steps, strips)
            Girth at the end of each step, m. It never shrinks.
        dilatation : float64 (strips, sectors) or (steps, strips, sectors), optional
            How fast each sector around the girth stretches, relative to the others (from the seam).
        substeps : int
            Into how many parts of equal ratio the loading of each step is cut; one is enough, since
            what is loaded most yields first (`forest.surface.bark.events`).
        keep : bool
            Keep a snapshot of every step in `history`.

        Returns
        -------
        Bark
        """
        rings = copied(self._rings)
        girths = checked_girths(girth_by_step, len(rings.records), rings.girth)
        spread = checked_dilatation(dilatation, len(girths), rings.edges)
        check_threshold(self.material, np.vstack([rings.girth, girths]), rings.length)
        pace, history = self._pace.copy(), list(self.history)
        time = self.time
        for step, girth in enumerate(girths):
            # The criterion is the whole step's: its parts only load the bark bit by bit.
            growth = girth / rings.girth - 1.0
            np.maximum(growth, FADE * pace, out=pace)
            threshold = self.material.threshold
            rings.limit[:] = pace if threshold is None else threshold - 1.0
            rings.limit[growth <= 0.0] = 0.0
            for part in _parts(rings.girth.copy(), girth, substeps):
                _advance(self, rings, part, spread(step), substeps, time + part.number / substeps)
            time += 1.0
            if keep:
                history.append(Snapshot(time, rings.girth.copy(), elements_of(rings)))
        return replace(_seen(self, rings, time), history=tuple(history), _pace=pace)

    def trigger(self, strip: int, x: float, gap_m: float = 0.0) -> Bark:
        """Tear the bark of a strip at x m around its girth, by hand; the fracture runs on.

        Parameters
        ----------
        strip : int
        x : float
            m around the girth.
        gap_m : float
            How far it is forced open in its middle, m, beside what the strain opens; less towards
            its ends, like an ellipse.

        Raises
        ------
        InputError
            There is no such strip, or a fracture within `least_piece_m`.
        """
        if not 0 <= strip < len(self.strips.axis):
            raise InputError(
                f"no strip {strip}", where="trigger", expected=f"0 to {len(self.strips.axis) - 1}"
            )
        rings = copied(self._rings)
        physics = Physics.of(self.material)
        lo, hi = int(rings.base[strip]), int(rings.base[strip] + rings.records[strip])
        begin = rings.left[lo]
        around = begin + (x - begin) % rings.girth[strip]
        record = lo + int(np.searchsorted(rings.left[lo:hi], around, side="right")) - 1
        part = (around - rings.left[record] - rings.open[record]) / rings.piece[record]
        end = rings.place[record + 1] if record + 1 < hi else rings.length[strip]
        place = rings.place[record] + part * (end - rings.place[record])
        least, most = room_to_break(rings, physics, np.int64(strip), np.int64(record))
        if part <= 0.0 or not least <= place <= most:
            raise InputError(
                f"no room for a fracture at {x:g} m in strip {strip}",
                where="trigger",
                expected=f"{self.material.least_piece_m:g} m or more to the next fracture",
            )
        # What has opened so far stays open; the strain that is left tears on.
        rings.rest[:] = rings.open
        rings.grip_left[:] = rings.left
        rings.grip_right[:] = rings.left + rings.open
        where = (np.int64(strip), np.int64(record), place, self.time)
        crossings = self.geometry.crossings
        fracture = begin_fracture(rings, physics, np.int64(self.seed), crossings, *where)
        if gap_m > 0.0 and fracture >= 0:
            _force_open(rings, physics, int(fracture), gap_m)
        _keep_untorn(rings, self._rings)
        return _seen(self, rings, self.time)

    def refracture(
        self,
        girth_by_step: NDArray[np.float64],
        *,
        material: Material | None = None,
        seed: int | None = None,
        dilatation: NDArray[np.float64] | None = None,
        substeps: int = 1,
        keep: bool = False,
    ) -> Bark:
        """Let the surface be the epidermis of another bark, weak where this one tore (figure 9).

        Parameters
        ----------
        girth_by_step : float64 (steps, strips)
            The girth from now on, m.
        material : Material, optional
            That of the next generation; the same unless given.
        seed : int, optional
            The next one unless given.
        dilatation, substeps, keep
            As in `grow`. The sectors lie where growth has taken them so far.

        Raises
        ------
        InputError
            As for `grow_bark`, or other sectors than those in which this bark grew unevenly.
        """
        material = material or self.material
        girth = self.strips.girth
        samples = max(int(np.ceil(girth.max() / material.grain_m)), 1)
        weakness = np.zeros((len(girth), samples))
        for strip in range(len(girth)):
            x = (np.arange(samples) + 0.5) * (girth[strip] / samples)
            rows, _ = self.elements.at(strip, x)
            weakness[strip] = self.elements.kind[rows] == FRACTURE
        edges = self._rings.edges
        if edges.shape[1] == 2:  # it grew evenly
            edges = even_edges(girth, _sectors(dilatation))
        seed = self.seed + 1 if seed is None else seed
        girths = checked_girths(girth_by_step, len(girth), girth)
        bark = _whole(self.geometry, girth, material, seed, edges, weakness)
        bark = bark.grow(girths, dilatation=dilatation, substeps=substeps, keep=keep)
        generation = self.generation + 1
        marked = np.full(len(bark.fractures.origin), generation, np.int32)
        fractures = bark.fractures._replace(generation=marked)
        return replace(bark, generation=generation, surface=self, fractures=fractures)

    def at_time(self, time: float) -> Snapshot:
        """Give the elements as they were at a time, of those kept: the last one not after it."""
        earlier = [snapshot for snapshot in self.history if snapshot.time <= time]
        if not earlier:
            raise InputError(
                f"no snapshot at or before time {time:g}", where="bark", expected="keep=True"
            )
        return earlier[-1]

    def turns(self, strip: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn m around the girth into parts of a turn from the seam (uneven where growth was)."""
        edges, girth = self._rings.edges[strip], self.strips.girth[strip]
        return np.array([turn_of(edges, girth, float(at)) for at in np.ravel(x)])

    def around(self, strip: int, turn: float) -> float:
        """Turn parts of a turn from the seam into m around the girth."""
        return float(x_of(self._rings.edges[strip], turn))


def grow_bark(
    geometry: StripGeometry,
    girth_by_step: NDArray[np.float64],
    material: Material | None = None,
    seed: int = 0,
    *,
    dilatation: NDArray[np.float64] | None = None,
    weakness: NDArray[np.float64] | None = None,
    substeps: int = 1,
    keep: bool = False,
) -> Bark:
    """Grow bark over strips whose girth is given (Lefebvre and Neyret 2002).

    Parameters
    ----------
    geometry : StripGeometry
        Where the strips lie, n of them.
    girth_by_step : float64 (steps + 1, n)
        Girth over time, m; the first row is when the epidermis is whole. Where a strip does not
        exist yet, NaN: its epidermis is made with its first girth. `shrinking` gives that of a
        finished tree whose epidermis shrinks.
    material : Material, optional
    seed : int
    dilatation : float64 (n, sectors) or (steps, n, sectors), optional
        How fast each sector around the girth stretches, relative to the others (from the seam).
    weakness : float64 (n, samples), optional
        The weakness map: 0 strong to 1 weak, evenly around the original epidermis from the seam.
    substeps, keep
        As in `Bark.grow`.

    Returns
    -------
    Bark

    Raises
    ------
    InputError
        Shapes that do not fit, a strip without width, a girth that is not above 0 or shrinks, a
        threshold S below the range of 3.2.3.
    """
    material = material or Material()
    check_strips(geometry)
    strips = len(geometry.axis)
    girths = girths_from_birth(girth_by_step, strips)
    map_of = checked_weakness(weakness, strips)
    edges = even_edges(girths[0], _sectors(dilatation))
    bark = _whole(geometry, girths[0], material, seed, edges, map_of)
    return bark.grow(girths[1:], dilatation=dilatation, substeps=substeps, keep=keep)


def _sectors(dilatation: NDArray[np.float64] | None) -> int:
    shape = () if dilatation is None else np.shape(dilatation)
    return shape[-1] if shape else 1


class _Part(NamedTuple):
    number: int
    girth: NDArray[np.float64]


def _parts(
    before: NDArray[np.float64], girth: NDArray[np.float64], substeps: int
) -> Iterator[_Part]:
    """Cut a step into parts of equal ratio."""
    for k in range(1, substeps):
        yield _Part(k, before * (girth / before) ** (k / substeps))
    yield _Part(substeps, girth)


def _advance(
    bark: Bark,
    rings: Rings,
    part: _Part,
    spread: NDArray[np.float64] | None,
    substeps: int,
    time: float,
) -> None:
    """Lengthen all strips, solve, and let break what must (figure 8)."""
    girth = part.girth
    edges = _stretched(rings.edges, rings.girth, girth, spread)
    physics = Physics.of(bark.material, begins=part.number == 1, ends=part.number == substeps)
    in_threads(stretch_all, rings, physics, girth, edges)
    tear_all(rings, physics, np.int64(bark.seed), bark.geometry.crossings, time)


def _force_open(rings: Rings, physics: Physics, fracture: int, gap_m: float) -> None:
    """Give the tears of a fracture rest widths, an ellipse along it, and settle their strips."""
    nodes = np.flatnonzero(rings.tear_fracture[: rings.totals[0]] == fracture)
    nodes = nodes[np.argsort(rings.tear_strip[nodes], kind="stable")]
    off = (np.arange(len(nodes)) + 0.5) / len(nodes) * 2.0 - 1.0
    for node, gap in zip(nodes, gap_m * np.sqrt(1.0 - off**2), strict=True):
        strip = int(rings.tear_strip[node])
        begin = int(rings.base[strip])
        here = rings.tear[begin : begin + int(rings.records[strip])]
        rings.rest[begin + int(np.flatnonzero(here == node)[0])] = gap
        settle(rings, physics, np.int64(strip))


def _keep_untorn(rings: Rings, before: Rings) -> None:
    """Give strips that did not tear their springs back: they still lie at equilibrium."""
    strip_of = np.searchsorted(rings.base, np.arange(len(rings.rest)), side="right") - 1
    same = (rings.records == before.records)[strip_of]
    for name in ("rest", "grip_left", "grip_right"):
        getattr(rings, name)[same] = getattr(before, name)[same]


def _stretched(
    edges: NDArray[np.float64],
    before: NDArray[np.float64],
    girth: NDArray[np.float64],
    spread: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Share the growth of the girth among the sectors."""
    if spread is None:
        stretched = edges * (girth / before)[:, None]
    else:
        arcs = np.diff(edges, axis=1)
        gains = arcs * spread
        arcs = arcs + gains * ((girth - before) / gains.sum(axis=1))[:, None]
        stretched = np.concatenate([np.zeros((len(girth), 1)), np.cumsum(arcs, axis=1)], axis=1)
    stretched[:, -1] = girth
    return stretched


def _whole(
    geometry: StripGeometry,
    girth: NDArray[np.float64],
    material: Material,
    seed: int,
    edges: NDArray[np.float64],
    weakness: NDArray[np.float64],
) -> Bark:
    """Give bark whose epidermis is whole."""
    rings = whole_rings(geometry, girth, material, edges)
    in_threads(weigh_all, rings, Physics.of(material), np.int64(seed), weakness)
    empty: Any = None
    bark = Bark(
        geometry=geometry._replace(crossings=_sorted(geometry.crossings)),
        material=material,
        seed=seed,
        strips=empty,
        elements=empty,
        tears=empty,
        fractures=empty,
        time=0.0,
        history=(),
        generation=0,
        surface=None,
        scale=np.ones(len(rings.girth)),
        _rings=rings,
        _pace=np.zeros(len(rings.girth)),
    )
    return _seen(bark, rings, 0.0)


def _sorted(crossings: Crossings) -> Crossings:
    """Order passages by strip, as the kernel looks them up."""
    order = np.argsort(crossings.strip, kind="stable")
    columns: list[Any] = [np.ascontiguousarray(column[order]) for column in crossings]
    return Crossings(*columns)


def _seen(bark: Bark, rings: Rings, time: float) -> Bark:
    """Show rings as tables."""
    strips, elements, tears, fractures = tables_of(rings, bark.generation)
    return replace(
        bark,
        strips=strips,
        elements=elements,
        tears=tears,
        fractures=fractures,
        time=time,
        _rings=rings,
    )
