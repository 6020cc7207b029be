"""The near field: shadow propagation (Palubicki et al. 2009, section 4.1, Figure 5).

A bud in voxel (I, J, K) adds a b^-q to the (2q + 1) x (2q + 1) voxels of the layer q below it,
q = 0..q_max. Here the buds of each voxel are counted first and the pyramids of all voxels are
laid at once: each layer's running totals (an integral image) give the sum of any square of
voxels from four look-ups. Counts and weights are integers, so that the order of summation does
not matter and a stand moved by whole voxels has exactly the moved field.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.voxels import wrap

#: Count that stands for a bud of shade factor 1.
UNIT = 16
#: Rows of a strip: its integral images of q_max + 1 layers stay in the second-level cache.
STRIP = 32
#: Grids that must grow do so by this many voxels at a time.
STEP = 16


class ShadowField(NamedTuple):
    """The near field as kernels take it; grids are indexed [iz, iy, ix].

    Attributes
    ----------
    counts : uint16 (nz, ny, nx)
        Buds in each voxel times their shade factor, in units of 1/16, at most `limit`.
    shadow : int32 (nz, ny, nx)
        Shadow s of each voxel, in units of `unit`; valid in the layers `layers`.
    weights : int32 (q_max + 1,)
        Weight of the layer q below a bud.
    origin : int64 (3,)
        Voxel (ix, iy, iz) of the grid's first voxel.
    layers : int64 (2,)
        First and one past the last layer of the grid that can hold shadow; 0 elsewhere.
    limit : int
        Largest count (counts saturate).
    unit : float
        Shadow s that one unit of `shadow` stands for.
    periodic : int
        1 on a torus: x and y wrap at the grid's size.
    """

    counts: NDArray[np.uint16]
    shadow: NDArray[np.int32]
    weights: NDArray[np.int32]
    origin: NDArray[np.int64]
    layers: NDArray[np.int64]
    limit: int
    unit: float
    periodic: int


@njit
def _total_layer(layer: Any, first_row: Any, margin: Any, periodic: Any, integral: Any) -> Any:
    """Fill the integral image of one layer's strip with its margins; tell if it holds buds.

    Totals may wrap around 2**32: differences of them are still right.
    """
    ny, nx = layer.shape
    rows = integral.shape[0] - 1
    occupied = False
    for r in range(rows):
        y = first_row - margin + r
        if periodic:
            y %= ny
        if y < 0 or y >= ny:
            continue
        found = np.uint16(0)
        counts = layer[y]
        for x in range(nx):
            found |= counts[x]
        if found:
            occupied = True
            break
    if not occupied:
        return False
    for r in range(rows):
        y = first_row - margin + r
        if periodic:
            y %= ny
        above = integral[r]
        row = integral[r + 1]
        if y < 0 or y >= ny:
            row[:] = above
            continue
        counts = layer[y]
        total = np.int32(0)
        for x in range(margin):
            if periodic:
                total += np.int32(counts[(x - margin) % nx])
            row[x + 1] = above[x + 1] + total
        inner = row[margin + 1 : margin + 1 + nx]
        inner_above = above[margin + 1 : margin + 1 + nx]
        for x in range(nx):
            total += np.int32(counts[x])
            inner[x] = inner_above[x] + total
        for x in range(margin):
            if periodic:
                total += np.int32(counts[x % nx])
            row[margin + nx + x + 1] = above[margin + nx + x + 1] + total
    return True


@njit
def _add_squares(out: Any, integral: Any, row: Any, q: Any, q_max: Any, weight: Any) -> None:
    """Add weight times the sum of the (2q + 1)-wide squares around a row's voxels."""
    nx = len(out)
    high = integral[row + q_max + q + 1]
    low = integral[row + q_max - q]
    right = q_max + q + 1
    left = q_max - q
    high_right = high[right : right + nx]
    high_left = high[left : left + nx]
    low_right = low[right : right + nx]
    low_left = low[left : left + nx]
    for x in range(nx):
        out[x] += np.int32(
            weight * np.int32(high_right[x] - high_left[x] - low_right[x] + low_left[x])
        )


@njit
def _shade_strip(field: Any, first_row: Any, last_row: Any) -> None:
    """Rebuild the shadow of a strip of rows, from the top layer down."""
    q_max = len(field.weights) - 1
    nx = field.counts.shape[2]
    rows = last_row - first_row
    integral = np.zeros((q_max + 1, rows + 2 * q_max + 1, nx + 2 * q_max + 1), np.int32)
    occupied = np.zeros(q_max + 1, np.bool_)
    for z in range(field.layers[1] - 1, field.layers[0] - 1, -1):
        slot = z % (q_max + 1)
        occupied[slot] = _total_layer(
            field.counts[z], first_row, q_max, field.periodic, integral[slot]
        )
        for row in range(rows):
            out = field.shadow[z, first_row + row]
            out[:] = 0
            for q in range(q_max + 1):
                slot = (z + q) % (q_max + 1)
                if occupied[slot]:
                    _add_squares(out, integral[slot], row, q, q_max, field.weights[q])


@driver
def _propagate_strips(first: Any, step: Any, field: Any) -> None:
    ny = field.counts.shape[1]
    strips = (ny + STRIP - 1) // STRIP
    for strip in range(first, strips, step):
        _shade_strip(field, strip * STRIP, min((strip + 1) * STRIP, ny))


def propagate(field: ShadowField) -> None:
    """Rebuild `shadow` from `counts` in the layers that can hold shadow."""
    in_threads(_propagate_strips, field)


class Window(NamedTuple):
    """Where a field's grid lies: first voxel, extent, layers that hold shadow, boundary."""

    x: Any
    y: Any
    z: Any
    nx: Any
    ny: Any
    first_layer: Any
    last_layer: Any
    periodic: Any


@njit
def window_of(field: Any) -> Any:
    """Take a field's place out of its arrays, for use in loops."""
    return Window(
        field.origin[0],
        field.origin[1],
        field.origin[2],
        field.counts.shape[2],
        field.counts.shape[1],
        field.layers[0],
        field.layers[1],
        field.periodic,
    )


@njit
def place_in(window: Any, ix: Any, iy: Any, iz: Any) -> Any:
    """Find a voxel of the plot in the grid, as (z, y, x); z is -1 where there is no shadow.

    The caller reads the grid itself: handing an array to a function in a loop would count
    references to it, with atomic operations on which the threads collide.
    """
    z = iz - window.z
    y = iy - window.y
    x = ix - window.x
    if window.periodic:
        y = wrap(y, window.ny)
        x = wrap(x, window.nx)
    elif y < 0 or y >= window.ny or x < 0 or x >= window.nx:
        z = -1
    if z < window.first_layer or z >= window.last_layer:
        z = -1
    return z, y, x


class ShadowGrid:
    """The near field of one stand: its grids, kept from year to year, and their extent.

    Parameters
    ----------
    shape : (int, int)
        Voxels of the plot along x and y.
    periodic : bool
        Whether the plot is a torus.
    a, b : float
        Shadow of a bud in its own layer, a > 0, and its decrease per layer, b > 1.
    q_max : int
        Depth of the pyramid, voxels.
    full_light : float
        Light of an unshaded bud (the paper's C).
    """

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        periodic: bool,
        a: float,
        b: float,
        q_max: int,
        full_light: float,
    ) -> None:
        decrease = b ** -np.arange(q_max + 1.0)
        squares = (2 * np.arange(q_max + 1) + 1) ** 2
        # Counts saturate where a voxel alone is twice as dark as needed, and at 255 buds or
        # more; the weights are as fine as that allows without leaving int32.
        enough = int(np.ceil(2 * full_light * UNIT / a))
        self.limit = min(max(enough, 255 * UNIT), 65535)
        scale = 2.0**30
        while self.limit * int((squares * np.rint(decrease * scale)).sum()) >= 2**31:
            scale /= 2
        self.weights = np.rint(decrease * scale).astype(np.int32)
        #: Shadow that one unit of the field stands for.
        self.unit = a / UNIT / scale
        self.periodic = periodic
        self.q_max = q_max
        self._shape = shape
        self._allocate(np.zeros(3, np.int64), np.array([*shape, 0] if periodic else [0, 0, 0]))

    def _allocate(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        shape = tuple(int(n) for n in np.maximum(high - low, 1)[::-1])
        self.origin = low.astype(np.int64)
        self.counts = np.zeros(shape, np.uint16)
        self.shadow = np.zeros(shape, np.int32)
        self._layers = np.zeros(2, np.int64)

    @property
    def field(self) -> ShadowField:
        """The grids as kernels take them."""
        return ShadowField(
            self.counts,
            self.shadow,
            self.weights,
            self.origin,
            self._layers,
            self.limit,
            self.unit,
            int(self.periodic),
        )

    def clear(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Empty the counts and make room for buds in the voxels `low` to `high` (x, y, z).

        `high` is included; low above high means that there are none. An open grid also holds
        the margin that their shadows reach, outside of which there is none.
        """
        self._layers[:] = 0
        if np.any(low > high):
            self.counts[...] = 0
            return
        low = low - self.q_max
        high = high + self.q_max + 1
        high[2] -= self.q_max
        if self.periodic:
            low[:2] = 0
            high[:2] = self._shape
        end = self.origin + self.counts.shape[::-1]
        if np.any(low < self.origin) or np.any(high > end):
            grown_low = low // STEP * STEP
            grown_high = -(-high // STEP) * STEP
            if self.counts.size > 1:
                grown_low = np.minimum(grown_low, self.origin)
                grown_high = np.maximum(grown_high, end)
            if self.periodic:
                grown_low[:2] = 0
                grown_high[:2] = self._shape
            self._allocate(grown_low, grown_high)
        else:
            self.counts[...] = 0
        self._layers[:] = low[2] - self.origin[2], high[2] - self.origin[2]
