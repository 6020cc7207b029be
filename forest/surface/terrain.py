"""The ground that trees stand on: heights on a grid, read from the usual files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.species.text import input_error, read_bytes, read_text

#: Files that heights are read from.
HEIGHT_SUFFIXES = (".npy", ".png", ".asc")

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeightField:
    """Heights of the ground on square cells, each the height of its cell's middle.

    Attributes
    ----------
    heights : float64 (rows, columns)
        m. Row 0 is the north edge, column 0 the west edge, as in pictures and ESRI grids.
    cell_m : float
        Side of a cell, m.
    origin : tuple of float
        x and y of the south-west corner of the whole, m.
    """

    heights: _Array
    cell_m: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.heights.ndim != 2 or 0 in self.heights.shape:
            raise InputError(f"heights of shape {self.heights.shape}", expected="rows and columns")
        if not np.isfinite(self.heights).all():
            raise InputError("a height is not a number", expected="metres everywhere")
        if not 0.0 < self.cell_m < np.inf:
            raise InputError(f"cell_m is {self.cell_m}", expected="metres above 0")

    @classmethod
    def flat(cls, height_m: float = 0.0) -> HeightField:
        """Make level ground; like any, it goes on beyond its edges."""
        return cls(np.full((1, 1), height_m))

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along x and along y, m."""
        rows, columns = self.heights.shape
        return columns * self.cell_m, rows * self.cell_m

    def at(self, x: ArrayLike, y: ArrayLike) -> _Array:
        """Give the height at places, m, linear between the cells' middles.

        Beyond the outermost middles the ground goes on level from them.
        """
        rows, columns = self.heights.shape
        u = (np.asarray(x, np.float64) - self.origin[0]) / self.cell_m - 0.5
        v = rows - 0.5 - (np.asarray(y, np.float64) - self.origin[1]) / self.cell_m
        u, v = np.clip(u, 0.0, columns - 1.0), np.clip(v, 0.0, rows - 1.0)
        left = np.minimum(u.astype(np.int64), max(columns - 2, 0))
        upper = np.minimum(v.astype(np.int64), max(rows - 2, 0))
        right, lower = np.minimum(left + 1, columns - 1), np.minimum(upper + 1, rows - 1)
        east, south = u - left, v - upper
        north_edge = (1.0 - east) * self.heights[upper, left] + east * self.heights[upper, right]
        south_edge = (1.0 - east) * self.heights[lower, left] + east * self.heights[lower, right]
        return np.asarray((1.0 - south) * north_edge + south * south_edge, np.float64)

    def normal(self, x: ArrayLike, y: ArrayLike) -> _Array:
        """Give the unit vector (..., 3) out of the ground, from the slope over one cell."""
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        half = 0.5 * self.cell_m
        rise_x = (self.at(x + half, y) - self.at(x - half, y)) / self.cell_m
        rise_y = (self.at(x, y + half) - self.at(x, y - half)) / self.cell_m
        up = np.stack((-rise_x, -rise_y, np.ones_like(rise_x)), axis=-1)
        return np.asarray(up / np.linalg.norm(up, axis=-1, keepdims=True), np.float64)


def read_heights(
    path: str | Path,
    *,
    cell_m: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
    height_range_m: tuple[float, float] = (0.0, 100.0),
) -> HeightField:
    """Read the heights of the ground.

    Parameters
    ----------
    path : path
        A `.npy` array of metres, a grey `.png` of 8 or 16 bits, or an ESRI ASCII grid `.asc`.
    cell_m, origin
        As in `HeightField`; an `.asc` says both itself.
    height_range_m : tuple of float
        Heights of black and of white in a `.png`, m.

    Raises
    ------
    InputError
        If the file cannot be read or holds no heights.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".asc":
        return _read_esri(path)
    if suffix == ".npy":
        heights = read_array(path)
    elif suffix == ".png":
        grey = read_grey(path)
        low, high = height_range_m
        heights = low + (high - low) * grey / float(np.iinfo(grey.dtype).max)
    else:
        raise input_error(
            f"unknown format '{path.suffix}'", where=path.name, expected=", ".join(HEIGHT_SUFFIXES)
        )
    try:
        return HeightField(heights.astype(np.float64), cell_m, origin)
    except (InputError, ValueError, TypeError) as error:
        raise input_error(str(error), where=path.name) from None


def read_array(path: Path) -> NDArray[Any]:
    """Read an array of numbers that NumPy wrote."""
    import io

    data = read_bytes(path, where=path.name)
    try:
        found = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise input_error(f"not an array: {error}", where=path.name) from None
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "iuf":
        raise input_error("not an array of numbers", where=path.name)
    return found


def read_grey(path: Path) -> NDArray[Any]:
    """Read a grey picture of 8 or 16 bits as it stands, uint8 or uint16."""
    import io

    from PIL import Image, UnidentifiedImageError

    data = read_bytes(path, where=path.name)
    try:
        with Image.open(io.BytesIO(data)) as image:
            mode, values = image.mode, np.asarray(image)
    except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
        raise input_error(f"not a picture: {error}", where=path.name) from None
    if mode == "L":
        return values.astype(np.uint8)
    if mode.startswith("I") and values.min() >= 0 and values.max() <= 65535:
        return values.astype(np.uint16)
    raise input_error(
        f"a picture of mode {mode}", where=path.name, expected="one grey channel of 8 or 16 bits"
    )


def _read_esri(path: Path) -> HeightField:
    """Read an ESRI ASCII grid; cells without data take the nearest height."""
    lines = read_text(path, where=path.name).splitlines()
    header: dict[str, float] = {}
    first = 0
    try:
        while first < len(lines) and lines[first].strip()[:1].isalpha():
            word, value = lines[first].split()
            header[word.lower()] = float(value)
            first += 1
        values = np.array(" ".join(lines[first:]).split(), np.float64)
    except ValueError as error:
        raise input_error(f"not an ESRI grid: {error}", where=path.name) from None
    for word in ("ncols", "nrows", "cellsize"):
        if word not in header:
            raise input_error(
                f"no {word} in the header", where=path.name, expected=f"{word} above 0"
            )
        size = header[word]
        whole = word == "cellsize" or size.is_integer()
        if not (np.isfinite(size) and size > 0.0 and whole):
            kind = "a number" if word == "cellsize" else "a whole number"
            raise input_error(
                f"{word} {size:g} is not allowed", where=path.name, expected=f"{kind} above 0"
            )
    rows, columns = int(header["nrows"]), int(header["ncols"])
    if len(values) != rows * columns:
        raise input_error(
            f"{len(values)} heights", where=path.name, expected=f"{rows} rows of {columns}"
        )
    cell = header["cellsize"]
    origin = tuple(
        header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", 0.5 * cell) - 0.5 * cell)
        for axis in "xy"
    )
    if not np.isfinite(origin).all():
        raise input_error(f"the corner lies at {origin}", where=path.name, expected="metres")
    heights = values.reshape(rows, columns)
    missing = (heights == header.get("nodata_value", -9999.0)) | ~np.isfinite(heights)
    if missing.all():
        raise input_error("holds no height", where=path.name)
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        heights = heights[tuple(nearest)]
    try:
        return HeightField(heights, cell, (origin[0], origin[1]))
    except InputError as error:
        raise input_error(str(error), where=path.name) from None
