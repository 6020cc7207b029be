"""What growth is asked to follow, checked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.bark.material import Material, fracture_range
from forest.surface.bark.strips import StripGeometry


def checked_girths(
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


class Spread(NamedTuple):
    """How the girth's growth is shared out around it, step by step."""

    table: NDArray[np.float64] | None

    def __call__(self, step: int) -> NDArray[np.float64] | None:
        if self.table is None or self.table.ndim == 2:
            return self.table
        spread: NDArray[np.float64] = self.table[step]
        return spread


def check_strips(geometry: StripGeometry) -> None:
    """Refuse strips whose width or place is no number, or whose width is not above 0."""
    wide = np.isfinite(geometry.width) & (geometry.width > 0.0)
    wide &= np.all(np.isfinite(geometry.width_around) & (geometry.width_around > 0.0), axis=1)
    wide &= np.isfinite(geometry.along)
    if not wide.all():
        raise InputError(
            f"strip {int(np.argmin(wide))} has no width or place",
            where="bark: strips",
            expected="metres, the width above 0",
        )


def checked_dilatation(
    table: NDArray[np.float64] | None, steps: int, edges: NDArray[np.float64]
) -> Spread:
    """Check a dilatation of the sectors between some edges."""
    if table is None:
        return Spread(None)
    strips, sectors = len(edges), edges.shape[1] - 1
    table = np.asarray(table, np.float64)
    shapes = ((strips,), (steps, strips))
    if table.shape[:-1] not in shapes or table.shape[-1] != sectors:
        raise InputError(
            f"a table of {table.shape}",
            where="bark: dilatation",
            expected=f"({strips}, {sectors}) or ({steps}, {strips}, {sectors})",
        )
    if not np.all(np.isfinite(table) & (table >= 0.0)) or not np.all(table.sum(axis=-1) > 0.0):
        raise InputError(
            "a number below 0, or a strip of noughts",
            where="bark: dilatation",
            expected="sectors that stretch",
        )
    return Spread(table)


def check_threshold(
    material: Material,
    girths: NDArray[np.float64],
    length: NDArray[np.float64],
) -> None:
    """Refuse a threshold below the range in which one fracture relieves a ring (3.2.3)."""
    threshold = material.threshold
    if threshold is None or len(girths) < 2:
        return
    growth = girths[1:] / girths[:-1]
    bound = fracture_range(material, growth, length)
    if np.any((growth > 1.0) & (threshold <= bound)):
        most = np.unravel_index(np.argmax(bound), bound.shape)
        raise InputError(
            f"threshold S = {threshold:g} lets the bark break without end",
            where="bark material: threshold",
            expected=f"S above {bound[most]:.6g}, and below the growth ratio {growth[most]:.6g}"
            " for any fracture in that step; or no threshold",
        )


def girths_from_birth(girth_by_step: NDArray[np.float64], strips: int) -> NDArray[np.float64]:
    """Check a table of girths; before a strip is there (NaN), it has its first one."""
    girths = np.array(girth_by_step, np.float64)
    if girths.ndim != 2 or girths.shape[1] != strips or len(girths) < 1:
        raise _refused(
            f"a table of {girths.shape}", f"(steps + 1, {strips}): a row a step, a column a strip"
        )
    known = ~np.isnan(girths)
    unknown = np.flatnonzero(~known.any(axis=0))
    if len(unknown):
        raise _refused(f"strip {unknown[0]} has no girth", "one or more")
    born = np.take_along_axis(girths, known.argmax(axis=0)[None], axis=0)[0]
    girths = np.where(np.cumsum(known, axis=0) > 0, girths, born)
    return checked_girths(girths, strips, None)


def checked_weakness(weakness: NDArray[np.float64] | None, strips: int) -> NDArray[np.float64]:
    """Check a weakness map; without one it has no samples."""
    if weakness is None:
        return np.zeros((strips, 0))
    samples = np.array(weakness, np.float64)
    if samples.ndim != 2 or len(samples) != strips or not np.all((samples >= 0) & (samples <= 1)):
        raise InputError(
            f"a table of {samples.shape}",
            where="bark: weakness",
            expected=f"({strips}, samples), numbers from 0 to 1",
        )
    return samples


def _refused(what: str, expected: str) -> InputError:
    return InputError(what, where="bark: girth_by_step", expected=expected)
