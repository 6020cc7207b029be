"""Bark cut out of bark, and bark at another scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.strips import FRACTURE, Elements
from forest.surface.bark.viewed import BarkView


def piece_of(bark: BarkView, strips: NDArray[np.int64]) -> BarkView:
    """Give the bark of some strips alone, to be dressed; links to others end (-1).

    Fractures keep their numbers, and the lengths and widths that they have on the whole bark.

    Parameters
    ----------
    bark : BarkView
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
    fractures = bark.fractures._replace(
        origin=number[bark.fractures.origin],
        first=number[bark.fractures.first],
        last=number[bark.fractures.last],
    )
    return BarkView(
        material=bark.material,
        seed=bark.seed,
        strips=cut,
        elements=elements,
        tears=nodes,
        fractures=fractures,
        time=bark.time,
        generation=bark.generation,
        surface=None if bark.surface is None else piece_of(bark.surface, strips),
        scale=bark.scale[strips],
    )


def rescaled(bark: BarkView, factor: NDArray[np.float64]) -> BarkView:
    """Show bark at another scale: the girth of each strip and all that lies around it.

    Parameters
    ----------
    bark : BarkView
    factor : float64 (strips)
        On the girth. Lengths of epidermis stay what they are: nothing of it is made or lost.
    """
    counts = np.diff(bark.elements.offsets)
    each = np.repeat(factor, counts)
    elements = bark.elements
    torn = elements.kind == FRACTURE
    sized = elements._replace(
        start=elements.start * each,
        width=elements.width * each,
        rest=np.where(torn, elements.rest * each, elements.rest),  # a width, one step ago
    )
    opened = np.flatnonzero(torn)
    strip_of = np.repeat(np.arange(len(factor)), counts)[opened]
    area = np.bincount(
        sized.fracture[opened],
        weights=sized.width[opened] * bark.strips.width[strip_of],
        minlength=len(bark.fractures.origin),
    )
    width = area / np.maximum(bark.fractures.length, 1e-12)
    return BarkView(
        material=bark.material,
        seed=bark.seed,
        strips=bark.strips._replace(girth=bark.strips.girth * factor),
        elements=sized,
        tears=bark.tears,
        fractures=bark.fractures._replace(width=width),
        time=bark.time,
        generation=bark.generation,
        surface=None if bark.surface is None else rescaled(bark.surface, factor),
        scale=bark.scale * factor,
    )
