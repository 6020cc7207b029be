"""The state of fracture bark: strips around stem and branches, their elements, and the tears.

A *strip* is a ring of bark across an axis. Around it epidermis and fractures alternate (Lefebvre
and Neyret 2002, 3.2.2). Fractures of neighbouring strips that were torn one from another are one
*fracture*; the links between them are the paper's fracture skeleton (3.2.4).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError

#: Kinds of elements.
EPIDERMIS = 0
FRACTURE = 1

#: Where the epidermis may tear, m: multiples of it, about a nanometre. Rest lengths are then
#: differences of such multiples, and any sum of them below 4000 km is exact in float64.
GRAIN_M = 2.0**-30


class Crossings(NamedTuple):
    """Where fractures leave one axis for another: one row per passage.

    A fracture that would run on from strip `strip` in the direction `runs` (+1 towards the tip, -1
    towards the base) at an angle within `half` of `angle` stops on its axis and goes on in strip
    `to`, at the angle `enters + scale * (its angle - angle)`, in the direction `goes`. Angles are
    parts of a turn from the strip's seam.
    """

    strip: NDArray[np.int32]
    runs: NDArray[np.int8]
    angle: NDArray[np.float64]
    half: NDArray[np.float64]
    to: NDArray[np.int32]
    enters: NDArray[np.float64]
    scale: NDArray[np.float64]  # -1 and the like where the seams turn the other way
    goes: NDArray[np.int8]

    @classmethod
    def none(cls) -> Crossings:
        """Give no passages."""
        i, b, f = np.empty(0, np.int32), np.empty(0, np.int8), np.empty(0)
        return cls(i, b, f, f, i, f, f, b)


class StripGeometry(NamedTuple):
    """Where the strips lie: one row per strip, base to tip, axis after axis."""

    axis: NDArray[np.int32]  # which axis (source limb)
    along: NDArray[np.float64]  # v of the strip's middle, m from the base of its axis
    width: NDArray[np.float64]  # along the axis, m
    neighbour_up: NDArray[np.int32]  # the strip above on the same axis; -1 none
    neighbour_down: NDArray[np.int32]  # the strip below; -1 none
    width_around: NDArray[np.float64]  # (strips, sectors) factor on `width` around the girth: less
    # than 1 on the concave side of a curved axis; (strips, 1) of ones for straight axes
    crossings: Crossings

    @classmethod
    def column(cls, strips: int, width_m: float) -> StripGeometry:
        """Give the strips of one straight axis.

        Raises
        ------
        InputError
            A width that is not above 0, or no strip.
        """
        if strips < 1 or not 0.0 < width_m < np.inf:
            raise InputError(
                f"{strips} strips of {width_m:g} m",
                where="bark: strips",
                expected="one or more, of metres above 0",
            )
        k = np.arange(strips, dtype=np.int32)
        return cls(
            axis=np.zeros(strips, np.int32),
            along=np.asarray((k + 0.5) * width_m, np.float64),
            width=np.full(strips, width_m),
            neighbour_up=np.where(k + 1 < strips, k + 1, -1).astype(np.int32),
            neighbour_down=(k - 1).astype(np.int32),
            width_around=np.ones((strips, 1)),
            crossings=Crossings.none(),
        )


class Strips(NamedTuple):
    """The strips as they are now: one row per strip, base to tip, axis after axis."""

    axis: NDArray[np.int32]
    along: NDArray[np.float64]  # v of its middle, m
    width: NDArray[np.float64]  # along the axis, m
    girth: NDArray[np.float64]  # now, m
    rest: NDArray[np.float64]  # the epidermis' own length L0, m: a multiple of GRAIN_M
    neighbour_up: NDArray[np.int32]
    neighbour_down: NDArray[np.int32]


class Elements(NamedTuple):
    """The elements of all strips, strip after strip, in order around the girth.

    Those of strip s are rows `offsets[s]:offsets[s + 1]`. A strip without fractures is one element
    of epidermis; one with n has 2 n elements, epidermis first, then fracture, in turn. The last
    fracture stands before the first epidermis: strips are rings.
    """

    offsets: NDArray[np.int64]  # (strips + 1)
    kind: NDArray[np.int8]  # EPIDERMIS or FRACTURE
    start: NDArray[np.float64]  # its left edge, m around the girth from the seam; rises along a
    # strip from the first element; may be below 0 or beyond the girth (take it modulo the girth)
    width: NDArray[np.float64]  # now, m: their sum over a strip is the girth
    rest: NDArray[
        np.float64
    ]  # epidermis: its own length; fracture: its width one step ago, 0 at birth
    uv0: NDArray[np.float64]  # epidermis: where on the original epidermis [0, L0) it begins, going
    # on past L0 to 0; fracture: where it was torn
    fracture: NDArray[np.int32]  # row of `Fractures`; -1 for epidermis
    tear: NDArray[np.int32]  # row of `Tears`; -1 for epidermis
    born: NDArray[
        np.float64
    ]  # time it was torn (epidermis: of the younger of its edges; 0 at first)

    def of(self, strip: int) -> Elements:
        """Give one strip's elements (views)."""
        a, b = int(self.offsets[strip]), int(self.offsets[strip + 1])
        rest: list[Any] = [column[a:b] for column in self[1:]]
        return Elements(np.array([0, b - a]), *rest)

    def at(
        self, strip: int, x: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Find what lies at x m around the girth of a strip.

        Returns
        -------
        (int64, float64)
            Rows of the elements, and which part of the element (0 to 1) lies to the left.
        """
        a, b = int(self.offsets[strip]), int(self.offsets[strip + 1])
        begin, girth = self.start[a], float(np.sum(self.width[a:b]))
        around = begin + np.mod(np.asarray(x, np.float64) - begin, girth)
        rows = a + np.searchsorted(self.start[a:b], around, side="right") - 1
        part = np.clip((around - self.start[rows]) / np.maximum(self.width[rows], 1e-300), 0.0, 1.0)
        return rows, part


class Tears(NamedTuple):
    """The nodes of the fracture skeleton: one row per fracture element, in order of birth."""

    strip: NDArray[np.int32]
    uv0: NDArray[np.float64]  # where on the epidermis, m
    up: NDArray[np.int32]  # the tear it goes on in, towards the tip (or across a branching); -1
    down: NDArray[np.int32]  # the same towards the base
    fracture: NDArray[np.int32]
    born: NDArray[np.float64]


class Fractures(NamedTuple):
    """The fractures: one row per connected part of the skeleton."""

    origin: NDArray[np.int32]  # tear it began with; `Tears.strip[origin]` is the strip
    first: NDArray[np.int32]  # tear at its lower end
    last: NDArray[np.int32]  # tear at its upper end
    strips: NDArray[np.int32]  # over how many strips it runs
    length: NDArray[np.float64]  # m, the widths of these strips
    width: NDArray[np.float64]  # mean opening, m
    born: NDArray[np.float64]
    generation: NDArray[np.int32]  # 0; 1 where the surface of generation 0 tore again, ...
