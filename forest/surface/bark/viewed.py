"""Bark to look at: tables without the rings that grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.material import Material
from forest.surface.bark.strips import Elements, Fractures, Strips, Tears


@dataclass(frozen=True, eq=False)
class BarkView:
    """Bark at one time, to be measured and drawn; it has no verbs.

    Attributes
    ----------
    material : Material
    seed : int
    strips, elements, tears, fractures
        See `forest.surface.bark.strips`.
    time : float
        Steps since the epidermis was whole.
    generation : int
        0; 1 where the surface of another bark tore, ...
    surface : BarkView or None
        That other bark: this one's place x on the epidermis is x around its girth (before both
        are scaled).
    scale : float64 (strips)
        At which the girth, the elements' edges and the fractures' widths are given; 1 as grown.
        The epidermis' own lengths and places (`rest`, `uv0`) are never scaled: it is conserved.
    """

    material: Material
    seed: int
    strips: Strips
    elements: Elements
    tears: Tears
    fractures: Fractures
    time: float
    generation: int
    surface: BarkView | None
    scale: NDArray[np.float64]
