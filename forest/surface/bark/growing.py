"""Bark that grows: from a girth over time to strips, elements and fractures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.bark.fracture import room_to_break, weigh_all
from forest.surface.bark.material import Material, Physics, fracture_range
from forest.surface.bark.propagation import begin_fracture, tear_all
from forest.surface.bark.rings import Rings, solve_strip, stretch_all, turn_of
from forest.surface.bark.strips import (
    EPIDERMIS,
    FRACTURE,
    GRAIN_M,
    Crossings,
    Elements,
    Fractures,
    StripGeometry,
    Strips,
    Tears,
)

#: By how much the memory of a fast year fades in the next, where the threshold is the growth ratio:
#: bark strained in a fast year does not break up all over in a slow one.
FADE = 0.8

_LEAST_SITES = 8  # vertices tied to the substrate around a ring, where it grips
_MOST_SITES = 128


class Snapshot(NamedTuple):
    """The elements at an earlier time."""

    time: float
    girth: NDArray[np.float64]  # (strips) m
    elements: Elements


@dataclass(frozen=True, eq=False)
class Bark:
    """Bark at one time. Its verbs give another bark; this one stays as it is.

    Memory: 81 bytes an element (two to a fracture), and inside 104 bytes a possible fracture and
    12 a grain of epidermis.
    """

    geometry: StripGeometry
    material: Material
    seed: int
    strips: Strips
    elements: Elements
    tears: Tears
    fractures: Fractures
    time: float  # steps since the epidermis was whole
    history: tuple[Snapshot, ...]  # one a step, where asked for
    generation: int  # 0; 1 where the surface of another bark tore, ...
    surface: (
        Bark | None
    )  # that other bark: this one's place x on the epidermis is x around its girth
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
            Into how many parts of equal ratio each step is cut.
        keep : bool
            Keep a snapshot of every step in `history`.

        Returns
        -------
        Bark
        """
        rings = Rings(*(column.copy() for column in self._rings))
        girths = _girths(girth_by_step, len(rings.count), rings.girth)
        spread = _dilatation(dilatation, len(girths), len(rings.count))
        _check_threshold(self.material, np.vstack([rings.girth, girths]), rings.length, substeps)
        pace, history = self._pace.copy(), list(self.history)
        time = self.time
        for step, girth in enumerate(girths):
            for part in _parts(rings.girth.copy(), girth, substeps):
                time_now = time + (part.number / substeps)
                rings = _advance(self, rings, part.girth, spread(step), pace, substeps, time_now)
            time += 1.0
            if keep:
                history.append(Snapshot(time, rings.girth.copy(), _elements(rings)))
        return replace(_seen(self, rings, time), history=tuple(history), _pace=pace)

    def trigger(self, strip: int, x: float) -> Bark:
        """Tear the bark of a strip at x m around its girth, by hand; the fracture runs on.

        Raises
        ------
        InputError
            There is no such strip, or a fracture within `least_piece_m`.
        """
        if not 0 <= strip < len(self.strips.axis):
            raise InputError(
                f"no strip {strip}", where="trigger", expected=f"0 to {len(self.strips.axis) - 1}"
            )
        rings = Rings(*(column.copy() for column in self._rings))
        physics = Physics.of(self.material)
        lo, hi = int(rings.base[strip]), int(rings.base[strip] + rings.count[strip])
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
                expected=f"a place {self.material.least_piece_m:g} m or more from the next fracture",
            )
        # What has opened so far stays open; the strain that is left tears on.
        rings.rest[:] = rings.open
        rings.grip_left[:] = rings.left
        rings.grip_right[:] = rings.left + rings.open
        where = (np.int64(strip), np.int64(record), place, self.time)
        crossings = self.geometry.crossings
        begin_fracture(rings, physics, np.int64(self.seed), crossings, *where)
        return _seen(self, rings, self.time)

    def refracture(
        self,
        girth_by_step: NDArray[np.float64],
        *,
        material: Material | None = None,
        seed: int | None = None,
        keep: bool = False,
    ) -> Bark:
        """Let the whole surface be the epidermis of another bark, weak where this one is torn (figure 9).

        Parameters
        ----------
        girth_by_step : float64 (steps, strips)
            The girth from now on, m.
        material : Material, optional
            That of the next generation; the same unless given.
        """
        material = material or self.material
        girth = self.strips.girth
        samples = max(int(np.ceil(girth.max() / material.grain_m)), 1)
        weakness = np.zeros((len(girth), samples))
        for strip in range(len(girth)):
            x = (np.arange(samples) + 0.5) * (girth[strip] / samples)
            rows, _ = self.elements.at(strip, x)
            weakness[strip] = self.elements.kind[rows] == FRACTURE
        bark = grow_bark(
            self.geometry,
            np.vstack([girth, girth_by_step]),
            material,
            self.seed + 1 if seed is None else seed,
            weakness=weakness,
            keep=keep,
        )
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
        Shapes that do not fit, a girth that is not above 0 or shrinks, a threshold S below the
        range of 3.2.3.
    """
    material = material or Material()
    girths = np.array(girth_by_step, np.float64)
    strips = len(geometry.axis)
    if girths.ndim != 2 or girths.shape[1] != strips or len(girths) < 1:
        raise _refused(
            f"a table of {girths.shape}", f"(steps + 1, {strips}): a row a step, a column a strip"
        )
    known = ~np.isnan(girths)
    if not known.any(axis=0).all():
        raise _refused(f"strip {int(np.argmin(known.any(axis=0)))} has no girth", "one or more")
    born = np.take_along_axis(girths, known.argmax(axis=0)[None], axis=0)[0]
    girths = np.where(np.cumsum(known, axis=0) > 0, girths, born)
    map_of = np.zeros((strips, 0)) if weakness is None else np.asarray(weakness, np.float64)
    if map_of.ndim != 2 or len(map_of) != strips or not np.all((map_of >= 0) & (map_of <= 1)):
        raise InputError(
            f"a table of {map_of.shape}",
            where="bark: weakness",
            expected=f"({strips}, samples), numbers from 0 to 1",
        )
    sectors = 1 if dilatation is None else np.shape(dilatation)[-1]
    _girths(girths[:1], strips, None)
    rings = _whole(geometry, girths[0], material, sectors)
    physics = Physics.of(material)
    in_threads(weigh_all, rings, physics, np.int64(seed), map_of)
    bark = _first(geometry, material, seed, rings)
    return bark.grow(girths[1:], dilatation=dilatation, substeps=substeps, keep=keep)


def _whole(
    geometry: StripGeometry, girth: NDArray[np.float64], material: Material, sectors: int
) -> Rings:
    """Make rings of whole epidermis."""
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
        edges=girth[:, None] * np.linspace(0.0, 1.0, sectors + 1),
        limit=np.zeros(n),
        base=base[:-1],
        count=sites,
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
    girth: NDArray[np.float64],
    spread: NDArray[np.float64] | None,
    pace: NDArray[np.float64],
    substeps: int,
    time: float,
) -> Rings:
    """Lengthen all strips, solve, and let break what must (figure 8)."""
    growth = girth / rings.girth - 1.0
    np.maximum(growth, FADE ** (1.0 / substeps) * pace, out=pace)
    threshold = bark.material.threshold
    rings.limit[:] = pace if threshold is None else threshold - 1.0
    rings.limit[growth <= 0.0] = 0.0
    edges = _stretched(rings.edges, rings.girth, girth, spread)
    physics = Physics.of(bark.material, substeps)
    worst = np.zeros(len(girth))
    in_threads(stretch_all, rings, physics, girth, edges, worst)
    order = np.argsort(-worst, kind="stable")
    crossings = bark.geometry.crossings
    tear_all(rings, physics, np.int64(bark.seed), crossings, order, time)
    return rings


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


def _girths(
    girth_by_step: NDArray[np.float64], strips: int, before: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Check girths: a row a step, a column a strip, above 0, never shrinking."""
    girths = np.asarray(girth_by_step, np.float64)
    if girths.ndim != 2 or girths.shape[1] != strips:
        raise _refused(f"a table of {girths.shape}", f"(steps, {strips})")
    if not np.all(np.isfinite(girths) & (girths > 1e-6)):
        raise _refused("a girth that is not above 0", "metres")
    if before is not None:
        change = np.diff(np.vstack([before, girths]), axis=0)
        if np.any(change < 0.0):
            step, strip = (int(k[0]) for k in np.nonzero(change < 0.0))
            raise _refused(
                f"the girth of strip {strip} shrinks in step {step}", "one that grows or stays"
            )
    return girths


class _Spread(NamedTuple):
    """How the girth's growth is shared out around it, step by step."""

    table: NDArray[np.float64] | None

    def __call__(self, step: int) -> NDArray[np.float64] | None:
        if self.table is None or self.table.ndim == 2:
            return self.table
        spread: NDArray[np.float64] = self.table[step]
        return spread


def _dilatation(table: NDArray[np.float64] | None, steps: int, strips: int) -> _Spread:
    """Check a dilatation."""
    if table is None:
        return _Spread(None)
    table = np.asarray(table, np.float64)
    shapes = ((strips,), (steps, strips))
    if table.shape[:-1] not in shapes or table.shape[-1] < 1:
        raise InputError(
            f"a table of {table.shape}",
            where="bark: dilatation",
            expected=f"({strips}, sectors) or ({steps}, {strips}, sectors)",
        )
    if not np.all(np.isfinite(table) & (table >= 0.0)) or not np.all(table.sum(axis=-1) > 0.0):
        raise InputError(
            "a number below 0, or a strip of noughts",
            where="bark: dilatation",
            expected="sectors that stretch",
        )
    return _Spread(table)


def _check_threshold(
    material: Material,
    girths: NDArray[np.float64],
    length: NDArray[np.float64],
    substeps: int,
) -> None:
    """Refuse a threshold below the range in which one fracture relieves a ring (3.2.3)."""
    threshold = material.threshold
    if threshold is None or len(girths) < 2:
        return
    growth = (girths[1:] / girths[:-1]) ** (1.0 / substeps)
    bound = fracture_range(material, growth, length)
    if np.any((growth > 1.0) & (threshold <= bound)):
        most = np.unravel_index(np.argmax(bound), bound.shape)
        raise InputError(
            f"threshold S = {threshold:g} lets the bark break without end",
            where="bark material: threshold",
            expected=f"S above {bound[most]:.6g}, and below the growth ratio {growth[most]:.6g}"
            " for any fracture in that step; or no threshold",
        )


def _refused(what: str, expected: str) -> InputError:
    return InputError(what, where="bark: girth_by_step", expected=expected)


def _first(geometry: StripGeometry, material: Material, seed: int, rings: Rings) -> Bark:
    """Give bark whose epidermis is whole."""
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
        _rings=rings,
        _pace=np.zeros(len(rings.girth)),
    )
    return _seen(bark, rings, 0.0)


def _sorted(crossings: Crossings) -> Crossings:
    """Order passages by strip, as the kernel looks them up."""
    order = np.argsort(crossings.strip, kind="stable")
    return Crossings(*(np.ascontiguousarray(column[order]) for column in crossings))


def _seen(bark: Bark, rings: Rings, time: float) -> Bark:
    """Show rings as tables."""
    tears, fractures = (int(k) for k in rings.totals)
    of = rings.tear_fracture[:tears]
    reach = rings.reach[:fractures].copy()
    elements = _elements(rings)
    opened = np.flatnonzero(elements.kind == FRACTURE)
    strip_of = np.repeat(np.arange(len(rings.count)), np.diff(elements.offsets))[opened]
    area = np.bincount(
        elements.fracture[opened],
        weights=elements.width[opened] * rings.width[strip_of],
        minlength=fractures,
    )
    origin = rings.origin[:fractures].copy()
    return replace(
        bark,
        strips=Strips(
            axis=rings.axis,
            along=rings.along,
            width=rings.width,
            girth=rings.girth.copy(),
            rest=rings.length,
            neighbour_up=rings.up,
            neighbour_down=rings.down,
        ),
        elements=elements,
        tears=Tears(
            strip=rings.tear_strip[:tears].copy(),
            uv0=rings.tear_place[:tears].copy(),
            up=rings.tear_up[:tears].copy(),
            down=rings.tear_down[:tears].copy(),
            fracture=of.copy(),
            born=rings.tear_born[:tears].copy(),
        ),
        fractures=Fractures(
            origin=origin,
            first=rings.first[:fractures].copy(),
            last=rings.last[:fractures].copy(),
            strips=np.bincount(of, minlength=fractures).astype(np.int32),
            length=reach,
            width=area / reach,
            born=rings.tear_born[origin],
            generation=np.full(fractures, bark.generation, np.int32),
        ),
        time=time,
        _rings=rings,
    )


def _elements(rings: Rings) -> Elements:
    """Show records as elements: what lies between two fractures is one piece of epidermis."""
    n = len(rings.count)
    strip_of = np.repeat(np.arange(n), rings.count)
    first = np.concatenate([[0], np.cumsum(rings.count)])[:-1]
    record = rings.base[strip_of] + np.arange(len(strip_of)) - first[strip_of]
    record = record[rings.tear[record] >= 0]
    strip = strip_of[
        rings.tear[rings.base[strip_of] + np.arange(len(strip_of)) - first[strip_of]] >= 0
    ]
    torn = np.bincount(strip, minlength=n)
    offsets = np.concatenate([[0], np.cumsum(np.maximum(2 * torn, 1))]).astype(np.int64)
    # The fracture before each one around its ring: for the first, the last one a turn back.
    begins = np.concatenate([[0], np.cumsum(torn)])
    k = np.arange(len(record))
    wraps = k == begins[strip]
    before = record[np.where(wraps, begins[strip + 1] - 1, k - 1)]
    start = rings.left[before] + rings.open[before] - wraps * rings.girth[strip]
    epidermis = offsets[strip] + 2 * (k - begins[strip])
    tear = rings.tear[record]

    size = int(offsets[-1])
    kind = np.full(size, EPIDERMIS, np.int8)
    columns = {name: np.zeros(size) for name in ("start", "width", "rest", "uv0", "born")}
    fracture, tears = np.full(size, -1, np.int32), np.full(size, -1, np.int32)
    whole = np.flatnonzero(torn == 0)
    columns["start"][offsets[whole]] = rings.left[rings.base[whole]]
    columns["width"][offsets[whole]] = rings.girth[whole]
    columns["rest"][offsets[whole]] = rings.length[whole]
    columns["start"][epidermis] = start
    columns["width"][epidermis] = rings.left[record] - start
    columns["rest"][epidermis] = rings.place[record] - (
        rings.place[before] - wraps * rings.length[strip]
    )
    columns["uv0"][epidermis] = rings.place[before]
    columns["born"][epidermis] = np.maximum(
        rings.tear_born[tear], rings.tear_born[rings.tear[before]]
    )
    kind[epidermis + 1] = FRACTURE
    columns["start"][epidermis + 1] = rings.left[record]
    columns["width"][epidermis + 1] = rings.open[record]
    columns["rest"][epidermis + 1] = rings.rest[record]
    columns["uv0"][epidermis + 1] = rings.place[record]
    columns["born"][epidermis + 1] = rings.tear_born[tear]
    fracture[epidermis + 1] = rings.tear_fracture[tear]
    tears[epidermis + 1] = tear
    return Elements(offsets=offsets, kind=kind, fracture=fracture, tear=tears, **columns)
