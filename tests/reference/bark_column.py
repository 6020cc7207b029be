"""Slow twin of the events of fracture bark: a straight column of rings in plain Python.

At each turn all that could yield is looked at, and what is loaded most does. Nothing holds the
rings, fractures do not influence each other's course, and there is no weakness map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from forest.surface.bark import Material
from tests.reference.bark import Grain

_GRAIN = 2.0**-30  # own lengths are whole multiples, m


@dataclass
class Record:
    """A fracture with the epidermis behind it; the first of a ring is none, but its seam."""

    place: float
    fracture: int = -1
    kept: float = 0.0
    open: float = 0.0
    left: float = 0.0
    anchors: tuple[float, float] = (0.0, 0.0)


@dataclass
class Ring:
    """One strip."""

    length: float
    girth: float
    grains: list[Grain]
    records: list[Record] = field(default_factory=lambda: [Record(0.0)])
    strain: float = 0.0

    def rest(self, i: int) -> float:
        """Own length of the piece behind a record."""
        places = [record.place for record in self.records] + [self.length]
        return places[i + 1] - places[i]

    def settle(self, spacing: float) -> None:
        """Let tension be the same all around, and the vertices on the whole where they were tied.

        Vertices are weighed by the own lengths beside them.
        """
        torn = [record for record in self.records if record.fracture >= 0]
        kept = sum(record.kept for record in torn)
        self.strain = (self.girth - self.length - kept) / (self.length + spacing * len(torn))
        at = moved = weights = 0.0
        for i, record in enumerate(self.records):
            before, behind = self.rest(i - 1 if i else len(self.records) - 1), self.rest(i)
            record.left = at
            record.open = record.kept + spacing * self.strain if record.fracture >= 0 else 0.0
            ends = [(at, record.anchors[0], before + record.kept)]
            if record.fracture >= 0:
                ends.append((at + record.open, record.anchors[1], record.kept + behind))
            else:
                ends[0] = (at, record.anchors[0], before + behind)
            moved += sum((x - anchor) * weight for x, anchor, weight in ends)
            weights += sum(weight for *_, weight in ends)
            at += record.open + behind * (1.0 + self.strain)
        for record in self.records:
            record.left -= moved / weights

    def room(self, i: int, least: float) -> tuple[float, float]:
        """From where to where the piece behind a record may break."""
        lo, hi = self.records[i].place, self.records[i].place + self.rest(i)
        for record in self.records:
            for turn in (-self.length, 0.0, self.length):
                at = record.place + turn
                if record.fracture >= 0 and at <= self.records[i].place:
                    lo = max(lo, at + least)
                elif record.fracture >= 0:
                    hi = min(hi, at - least)
        return lo, hi

    def weakest(self, i: int, least: float) -> Grain | None:
        """Weakest grain where the piece behind a record may break."""
        lo, hi = self.room(i, least)
        free = [grain for grain in self.grains if lo < grain.place < hi]
        return min(free, key=lambda grain: grain.drawn, default=None)

    def tear(self, i: int, place: float, fracture: int) -> Record:
        """Break the piece behind a record."""
        own, rest = self.records[i], self.rest(i)
        place = own.place + min(
            max(round(place / _GRAIN) * _GRAIN - own.place, _GRAIN), rest - _GRAIN
        )
        last = i + 1 == len(self.records)
        next_ = self.records[0].anchors[0] + self.girth if last else self.records[i + 1].anchors[0]
        here = own.anchors[1 if own.fracture >= 0 else 0]
        here += (place - own.place) / rest * (next_ - here)
        self.records.insert(i + 1, Record(place, fracture, anchors=(here, here)))
        return self.records[i + 1]


class Event(NamedTuple):
    """Something that may yield."""

    load: float
    what: int  # - 1 - s: a new fracture in strip s; 2 f + upper: an end of fracture f runs on
    strip: int
    record: int
    place: float


@dataclass
class Column:
    """Rings one above the other, and their fractures as paths of (strip, record) from below."""

    material: Material
    width: float
    rings: list[Ring]
    paths: list[list[tuple[int, Record]]] = field(default_factory=list)
    ran: dict[int, float] = field(default_factory=dict)
    limit: float = 0.0
    moment: float = 0.0

    def grow(self, girths: list[float]) -> None:
        """Let the girth grow, the same all along."""
        pace = 0.0
        for before, girth in pairwise(girths):
            pace = max(girth / before - 1.0, 0.8 * pace)
            self.limit, self.moment = pace, 0.0
            self.ran = {}
            for ring in self.rings:
                for record in ring.records:
                    record.kept = record.open
                    ratio = girth / before
                    right = record.left + record.open
                    record.anchors = (record.left * ratio, right * ratio)
                ring.girth = girth
                ring.settle(self.material.spacing_m)
            while True:
                events = [*self.breaks(), *self.runs()]
                if not events:
                    break
                self.happen(min(events, key=lambda event: (-event.load, event.what)))

    def breaks(self) -> list[Event]:
        """List pieces that bear more than their weakest grain."""
        found = []
        for s, ring in enumerate(self.rings):
            for i in range(len(ring.records)):
                grain = ring.weakest(i, self.material.least_piece_m)
                if grain is not None:
                    tough = math.exp(self.material.threshold_jitter * grain.drawn)
                    load = ring.strain / self.limit / tough
                    found.append(Event(load, -1 - s, s, i, grain.place))
        return [event for event in found if event.load > 1.0 + 1e-9]

    def runs(self) -> list[Event]:
        """List ends of fractures that can run into the next strip."""
        both = [
            self.ahead(fracture, upper) for fracture in range(len(self.paths)) for upper in (0, 1)
        ]
        return [event for event in both if event is not None and event.load >= 1.0]

    def ahead(self, fracture: int, upper: int) -> Event | None:
        """Find where an end would run on."""
        path, own = self.paths[fracture], self.material
        reach = len(path) * self.width
        area = sum(
            (record.kept + self.moment * (record.open - record.kept)) * self.width
            for _, record in path
        )
        is_flaw = reach < own.flaw_m
        what = 2 * fracture + upper
        if not is_flaw and (self.ran.get(what, 0.0) > own.run_m or reach**2 <= own.inglis * area):
            return None
        s, record = path[-1 if upper else 0]
        to = s + 1 if upper else s - 1
        if not 0 <= to < len(self.rings):
            return None
        ring = self.rings[to]
        x = record.left + 0.5 * record.open  # as large a girth: the same x
        begin = ring.records[0].left
        x = begin + (x - begin) % ring.girth
        i = max(k for k, other in enumerate(ring.records) if other.left <= x)
        other, rest = ring.records[i], ring.rest(i)
        if x < other.left + other.open:
            return None
        place = other.place + (x - other.left - other.open) / (1.0 + ring.strain)
        for near in ring.records:
            apart = (near.place - place + 0.5 * ring.length) % ring.length - 0.5 * ring.length
            if near.fracture >= 0 and abs(apart) < own.least_piece_m:
                return None
        assert other.place <= place <= other.place + rest + 1e-9
        load = math.inf
        if not is_flaw and own.arrest > 0.0:
            grain = ring.weakest(i, own.least_piece_m)
            tough = 1.0 if grain is None else math.exp(own.threshold_jitter * grain.drawn)
            load = ring.strain / self.limit / (own.arrest * tough)
        return Event(load, what, to, i, place)

    def happen(self, event: Event) -> None:
        """Let something yield, and settle its strip."""
        self.moment = max(self.moment, 1.0 / event.load)
        fracture = len(self.paths) if event.what < 0 else event.what // 2
        ring = self.rings[event.strip]
        torn = (event.strip, ring.tear(event.record, event.place, fracture))
        if event.what < 0:
            self.paths.append([torn])
        else:
            self.paths[fracture].insert(len(self.paths[fracture]) if event.what % 2 else 0, torn)
            self.ran[event.what] = self.ran.get(event.what, 0.0) + self.width
        ring.settle(self.material.spacing_m)
