"""Bark cut out of bark, and bark at another scale."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.growing import Bark
from forest.surface.bark.strips import Elements


def piece_of(bark: Bark, strips: NDArray[np.int64]) -> Bark:
    """Give the bark of some strips alone, to be dressed; links to others end.

    Parameters
    ----------
    bark : Bark
    strips : int64 (k,)
        Rows of `bark.strips`, rising.
    """
    place = np.full(len(bark.strips.axis) + 1, -1, np.int32)  # the last for no strip, -1
    place[strips] = np.arange(len(strips), dtype=np.int32)
    first, last = bark.elements.offsets[strips], bark.elements.offsets[strips + 1]
    counts = last - first
    offsets = np.concatenate(([0], np.cumsum(counts))).astype(np.int64)
    rows = np.repeat(first - offsets[:-1], counts) + np.arange(offsets[-1])
    tears = np.unique(bark.elements.tear[rows])
    tears = tears[tears >= 0]
    number = np.full(len(bark.tears.strip) + 1, -1, np.int32)  # the last for no tear, -1
    number[tears] = np.arange(len(tears), dtype=np.int32)
    columns: list[Any] = [column[rows] for column in bark.elements[1:]]
    elements = Elements(offsets, *columns)
    elements = elements._replace(tear=number[elements.tear])
    old: list[Any] = [column[tears] for column in bark.tears]
    nodes = bark.tears.__class__(*old)
    nodes = nodes._replace(
        strip=place[nodes.strip],
        up=number[nodes.up],
        down=number[nodes.down],
    )
    kept: list[Any] = [column[strips] for column in bark.strips]
    cut = bark.strips.__class__(*kept)
    cut = cut._replace(
        neighbour_up=place[cut.neighbour_up],
        neighbour_down=place[cut.neighbour_down],
    )
    surface = None if bark.surface is None else piece_of(bark.surface, strips)
    return replace(bark, strips=cut, elements=elements, tears=nodes, surface=surface, history=())


def rescaled(bark: Bark, girth: NDArray[np.float64]) -> Bark:
    """Give the same bark on strips of other girths: all that lies around them scales."""
    factor = girth / bark.strips.girth
    counts = np.diff(bark.elements.offsets)
    each = np.repeat(factor, counts)
    elements = bark.elements
    sized = elements._replace(
        start=elements.start * each,
        width=elements.width * each,
        rest=elements.rest * each,
        uv0=elements.uv0 * each,
    )
    strips = bark.strips._replace(girth=girth, rest=bark.strips.rest * factor)
    tears = bark.tears._replace(uv0=bark.tears.uv0 * factor[bark.tears.strip])
    opened = np.flatnonzero(sized.fracture >= 0)
    strip_of = np.repeat(np.arange(len(girth)), counts)[opened]
    area = np.bincount(
        sized.fracture[opened],
        weights=sized.width[opened] * strips.width[strip_of],
        minlength=len(bark.fractures.origin),
    )
    fractures = bark.fractures._replace(width=area / np.maximum(bark.fractures.length, 1e-12))
    surface = None
    if bark.surface is not None:
        surface = rescaled(bark.surface, strips.rest)
    return replace(
        bark, strips=strips, elements=sized, tears=tears, fractures=fractures, surface=surface
    )
