"""Rings shown as tables."""

from __future__ import annotations

import numpy as np

from forest.surface.bark.rings import Rings
from forest.surface.bark.strips import (
    EPIDERMIS,
    FRACTURE,
    Elements,
    Fractures,
    Strips,
    Tears,
)


def elements_of(rings: Rings) -> Elements:
    """Show records as elements: what lies between two fractures is one piece of epidermis."""
    n = len(rings.records)
    strip_of = np.repeat(np.arange(n), rings.records)
    first = np.concatenate([[0], np.cumsum(rings.records)])[:-1]
    record = rings.base[strip_of] + np.arange(len(strip_of)) - first[strip_of]
    is_torn = rings.tear[record] >= 0
    record, strip = record[is_torn], strip_of[is_torn]
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


def tables_of(rings: Rings, generation: int) -> tuple[Strips, Elements, Tears, Fractures]:
    """Show rings as strips, elements, tears and fractures (copies of what changes)."""
    tears, fractures = (int(k) for k in rings.totals)
    of = rings.tear_fracture[:tears]
    reach = rings.reach[:fractures].copy()
    elements = elements_of(rings)
    opened = np.flatnonzero(elements.kind == FRACTURE)
    strip_of = np.repeat(np.arange(len(rings.records)), np.diff(elements.offsets))[opened]
    area = np.bincount(
        elements.fracture[opened],
        weights=elements.width[opened] * rings.width[strip_of],
        minlength=fractures,
    )
    origin = rings.origin[:fractures].copy()
    return (
        Strips(
            axis=rings.axis,
            along=rings.along,
            width=rings.width,
            girth=rings.girth.copy(),
            rest=rings.length,
            neighbour_up=rings.up,
            neighbour_down=rings.down,
        ),
        elements,
        Tears(
            strip=rings.tear_strip[:tears].copy(),
            uv0=rings.tear_place[:tears].copy(),
            up=rings.tear_up[:tears].copy(),
            down=rings.tear_down[:tears].copy(),
            fracture=of.copy(),
            born=rings.tear_born[:tears].copy(),
        ),
        Fractures(
            origin=origin,
            first=rings.first[:fractures].copy(),
            last=rings.last[:fractures].copy(),
            strips=np.bincount(of, minlength=fractures).astype(np.int32),
            length=reach,
            width=area / reach,
            born=rings.tear_born[origin],
            generation=np.full(fractures, generation, np.int32),
        ),
    )
