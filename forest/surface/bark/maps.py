"""Sets of maps for renderers: colour, normal, height, roughness, occlusion."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._threads import in_threads, thread_count
from forest.errors import InputError, OutputError
from forest.surface.bark.dressing import Dress, Fold, relief_of, rows_at
from forest.surface.bark.light import normals, occlusion
from forest.surface.bark.outlines import rows_of, scratch
from forest.surface.bark.painting import Canvas, paint_all, work_for
from forest.surface.bark.presets import Preset
from forest.surface.bark.silhouettes import Silhouettes, silhouettes
from forest.surface.bark.viewed import BarkView

_NO_SURFACE = np.empty((0, 0, 5), np.float32)
_LEAST, _MOST = 16, 16384  # pixels along a side


@dataclass(frozen=True)
class BarkMaps:
    """Maps of a piece of bark. Rows run from the top down, columns around from the seam.

    Attributes
    ----------
    colour : uint8 (rows, columns, 3)
        sRGB.
    normal : uint8 (rows, columns, 3)
        As OpenGL and glTF want it: red right, green up, blue out; 127.5 (c + 1).
    height : uint16 (rows, columns)
        From `lowest_m`, 0, to `highest_m`, 65535, about the uncracked surface.
    roughness, occlusion : uint8 (rows, columns)
        0 smooth, 255 rough; 0 shut in, 255 open.
    lowest_m, highest_m : float
        m.
    width_m, length_m : float
        Size of what is shown, around (the mean girth) and along the axis.
    tileable : bool
        The top continues at the bottom. The right edge always continues at the left.
    """

    colour: NDArray[np.uint8]
    normal: NDArray[np.uint8]
    height: NDArray[np.uint16]
    roughness: NDArray[np.uint8]
    occlusion: NDArray[np.uint8]
    lowest_m: float
    highest_m: float
    width_m: float
    length_m: float
    tileable: bool

    @property
    def height_m(self) -> NDArray[np.float64]:
        """Height in m."""
        step = (self.highest_m - self.lowest_m) / 65535.0
        return np.asarray(self.lowest_m + step * self.height, np.float64)

    @property
    def occlusion_roughness_metal(self) -> NDArray[np.uint8]:
        """The three in one picture, as glTF packs them; bark is no metal."""
        none = np.zeros_like(self.occlusion)
        return np.stack((self.occlusion, self.roughness, none), axis=-1)

    def save(self, folder: str | Path) -> list[Path]:
        """Write PNGs and `bark.json` with the sizes into a folder; give their paths.

        Raises
        ------
        OutputError
            The folder or a file cannot be written.
        """
        from PIL import Image

        to = Path(folder)
        images: dict[str, NDArray[Any]] = {
            "colour": self.colour,
            "normal": self.normal,
            "height": self.height,
            "roughness": self.roughness,
            "occlusion": self.occlusion,
        }
        about = {
            "width_m": self.width_m,
            "length_m": self.length_m,
            "lowest_m": self.lowest_m,
            "highest_m": self.highest_m,
            "tileable": self.tileable,
            "normal": "OpenGL: red right, green up",
        }

        def write(name: str) -> Path:
            path = to / f"{name}.png"
            Image.fromarray(images[name]).save(path, compress_level=1)
            return path

        try:
            to.mkdir(parents=True, exist_ok=True)
            with ThreadPoolExecutor(thread_count()) as pool:
                written = list(pool.map(write, images))
            (to / "bark.json").write_text(json.dumps(about, indent=1) + "\n")
        except OSError as error:
            raise OutputError.of(error, to) from error
        return [*written, to / "bark.json"]


def bark_maps(
    bark: BarkView,
    preset: Preset | Dress,
    size: int | tuple[int, int] = 4096,
    *,
    axis: int = 0,
    girth_m: float | None = None,
    folds: Sequence[Fold] = (),
    seed: int = 0,
) -> BarkMaps:
    """Dress an axis' bark as a set of maps (Lefebvre and Neyret 3.3, 5.4).

    Bark whose strips are a ring (`grow_preset`) gives a tile; other bark gives the map of the
    whole axis, from its base to its tip.

    Parameters
    ----------
    bark : BarkView
    preset : Preset or Dress
        What it looks like; a `Dress` has its textures ready for many calls.
    size : int or (columns, rows)
        Pixels around and along.
    axis : int
        Which axis of the bark.
    girth_m : float, optional
        Girth that sets the age of the surface; that of the strips unless given (a tile stands for
        a stem that may be thicker than the tile is wide).
    folds : sequence of Fold
        Folds at the crotches of branches.
    seed : int
        Of textures (for a preset), torn borders and lichen.

    Returns
    -------
    BarkMaps

    Raises
    ------
    InputError
        A size that is not 16 to 16384 pixels, or no such axis.
    """
    columns, rows = (size, size) if isinstance(size, int) else size
    if not (_LEAST <= columns <= _MOST and _LEAST <= rows <= _MOST):
        raise InputError(
            f"maps of {columns} x {rows}", where="size", expected=f"{_LEAST} to {_MOST} pixels"
        )
    dress = preset if isinstance(preset, Dress) else Dress.of(preset, seed=seed)
    canvas, outlines = _paint(bark, dress, (rows, columns), axis, girth_m, folds, seed)
    v = rows_of(outlines.length, rows, outlines.low)
    across = outlines.at(outlines.girth, v) / columns
    along = outlines.length / rows
    lowest, highest, raised = quantised(canvas.height)
    wraps = outlines.cyclic
    return BarkMaps(
        colour=canvas.colour,
        normal=normals(canvas.height, across, along, wraps_along=wraps),
        height=raised,
        roughness=canvas.roughness,
        occlusion=occlusion(canvas.height, across, along, wraps_along=wraps),
        lowest_m=lowest,
        highest_m=highest,
        width_m=float(np.mean(outlines.girth)),
        length_m=outlines.length,
        tileable=wraps,
    )


def quantised(height: NDArray[np.float32]) -> tuple[float, float, NDArray[np.uint16]]:
    """Give the lowest and the highest of heights in m, and all as 16 bits in between."""
    lowest, highest = float(height.min()), float(height.max())
    scale = 65535.0 / max(highest - lowest, 1e-9)
    raised = (height - np.float32(lowest)) * np.float32(scale)
    return lowest, highest, np.clip(np.rint(raised), 0, 65535).astype(np.uint16)


def _paint(
    bark: BarkView,
    dress: Dress,
    shape: tuple[int, int],
    axis: int,
    girth_m: float | None,
    folds: Sequence[Fold],
    seed: int,
) -> tuple[Canvas, Silhouettes]:
    """Paint one generation of bark, the surface that it tore first."""
    outlines = silhouettes(bark, axis)
    under = _NO_SURFACE
    if bark.surface is not None:
        first, _ = _paint(bark.surface, dress, shape, axis, girth_m, (), seed)
        under = _packed(first)
    v = rows_of(outlines.length, shape[0], outlines.low)
    girth = outlines.at(outlines.girth, v)
    aged = girth if girth_m is None else np.full(len(v), float(girth_m))
    relief = relief_of(dress.preset, aged, generation=bark.generation, seed=seed)
    rows = rows_at(dress.preset, v, aged)._replace(girth=girth)
    canvas = Canvas(
        np.empty((*shape, 3), np.uint8),
        np.empty(shape, np.float32),
        np.empty(shape, np.uint8),
    )
    in_threads(
        paint_all, outlines, relief, rows, dress.surfaces(outlines), dress.extras(outlines, folds),
        under, work_for(scratch(outlines), shape[1]), canvas,
    )  # fmt: skip
    return canvas, outlines


def _packed(canvas: Canvas) -> NDArray[np.float32]:
    """A painted surface as pixels of a texture."""
    pixels = np.empty((*canvas.height.shape, 5), np.float32)
    pixels[..., :3] = canvas.colour
    pixels[..., :3] *= np.float32(1.0 / 255.0)
    pixels[..., 3] = canvas.height
    pixels[..., 4] = canvas.roughness
    pixels[..., 4] *= np.float32(1.0 / 255.0)
    return pixels
