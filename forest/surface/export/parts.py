"""What a file of a tree holds: meshes, each with the material it is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.mesh import POINT_DATA, Mesh
from forest.trees.leaves import LEAF_SHAPES, OUTLINES, SPRAY, Leaves, outline_area

Image = NDArray[np.uint8] | Path

_LEAF_PIXELS = 256
_NEEDLES, _NEEDLE_RISE = 22, 0.16  # pairs; how far a needle's tip is above its foot
_FINER = 4  # pixels of the outline before it is averaged, along each side


def linear(colour: Sequence[float]) -> tuple[float, float, float]:
    """Give an sRGB colour, 0 to 1, as the linear one that materials have (IEC 61966-2-1)."""
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in colour
    )
    return red, green, blue


@dataclass(frozen=True)
class Material:
    """A surface as viewers of glTF draw it (metallic-roughness).

    Attributes
    ----------
    name : str
        Its name in the file.
    colour : (float, float, float)
        Base colour, linear, 0 to 1; a factor on `colour_image` where there is one.
    roughness, metallic : float
        0 to 1; factors on the channels of `rough_image`.
    colour_image : uint8 (h, w, 3 or 4) or path
        Base colour, sRGB, with opacity as fourth channel; its lower edge is at v = 0.
    normal_image : uint8 (h, w, 3) or path
        Normals; x along u, y along v (the convention of OpenGL and glTF).
    rough_image : uint8 (h, w, 3) or path
        Occlusion, roughness and metal as red, green and blue.
    tile_m : (float, float)
        Width along u and height along v that one image covers, m.
    cut_out : bool
        Whether what is less than half opaque is left out.
    double_sided : bool
        Whether its back is seen too.
    """

    name: str
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    roughness: float = 0.9
    metallic: float = 0.0
    colour_image: Image | None = None
    normal_image: Image | None = None
    rough_image: Image | None = None
    tile_m: tuple[float, float] = (1.0, 1.0)
    cut_out: bool = False
    double_sided: bool = False

    @property
    def images(self) -> dict[str, Image]:
        """Its images by what they show: colour, normal, rough."""
        found = {
            "colour": self.colour_image,
            "normal": self.normal_image,
            "rough": self.rough_image,
        }
        return {name: image for name, image in found.items() if image is not None}


#: Plain wood and plain leaves, where nothing else is known.
WOOD = Material("wood", colour=(0.20, 0.14, 0.09))
LEAF_COLOUR = (0.10, 0.22, 0.05)


@dataclass(frozen=True)
class Part:
    """A mesh of a file.

    Attributes
    ----------
    mesh : Mesh
        Its points and what is known of them.
    material : Material
        What it is made of.
    name : str
        Its name in the file.
    places : float64 (k, 4, 4), optional
        Where it stands, if more than once or elsewhere: matrices from its own coordinates to the
        plot's, m, z up. .glb keeps the mesh once; other files repeat it.
    """

    mesh: Mesh
    material: Material = WOOD
    name: str = "wood"
    places: NDArray[np.float64] | None = None

    def placed(self) -> Mesh:
        """Give one mesh of all its places."""
        if self.places is None:
            return self.mesh
        moved = [
            replace(self.mesh, points=self.mesh.points @ place[:3, :3].T + place[:3, 3])
            for place in self.places
        ]
        return Mesh.together(moved)


def leaf_parts(
    leaves: Leaves, *, tree_id: int = 0, colour: tuple[float, float, float] = LEAF_COLOUR
) -> list[Part]:
    """Make cards of a tree's leaves: one part for each outline that occurs.

    Parameters
    ----------
    leaves : Leaves
        `forest.trees.leaves.leaves_of` makes those of a simulated tree.
    tree_id : int
        Number of the tree.
    colour : (float, float, float)
        Linear, 0 to 1.

    Returns
    -------
    list of Part
        A rectangle from the petiole along each blade, as wide as it; the outline is cut out of it
        by the opacity of a small image. Its points carry the axis of the branch (see `POINT_DATA`)
        and 0 for its radius, order and birth year.
    """
    parts = []
    for code in np.unique(leaves.shape):
        here = np.flatnonzero(leaves.shape == code)
        name = f"leaves_{LEAF_SHAPES[code]}"
        material = Material(
            name,
            colour=colour,
            roughness=0.6,
            colour_image=leaf_image(int(code)),
            cut_out=True,
            double_sided=True,
        )
        parts.append(Part(_cards(leaves, here, tree_id), material, name))
    return parts


def leaf_image(shape: int) -> NDArray[np.uint8]:
    """Draw a leaf's outline, (h, w, 4): white, lighter along the midrib, opaque within.

    A spray is a comb of needles, which cover as much of the picture as the outline would.

    Parameters
    ----------
    shape : int
        Its outline, an index into `LEAF_SHAPES`; the petiole is at the middle of the lower edge.
    """
    alpha = _comb() if shape == SPRAY else _outlined(shape)
    off = np.abs(np.linspace(-1.0, 1.0, _LEAF_PIXELS))[None, :]
    shade = np.broadcast_to(225.0 - 25.0 * off + 30.0 * np.exp(-((off / 0.03) ** 2)), alpha.shape)
    grey = shade.round().astype(np.uint8)
    return np.stack((grey, grey, grey, alpha), axis=2)


def _outlined(shape: int) -> NDArray[np.uint8]:
    along, across = OUTLINES[shape].T
    mask, draw = _sheet()
    draw.polygon(_pixels(along, across), fill=255)
    return _averaged(mask)


def _comb() -> NDArray[np.uint8]:
    """Draw needles on both sides of a shoot, as thick as it takes to cover the outline's area."""
    foot = np.linspace(0.0, 1.0 - _NEEDLE_RISE, _NEEDLES)
    reach = 0.5 * np.minimum(1.0, 0.3 + 3.0 * (1.0 - _NEEDLE_RISE - foot))
    alpha = np.zeros((1, 1), np.uint8)
    thick = _FINER
    while alpha.mean() < 255.0 * outline_area(OUTLINES[SPRAY]):
        thick += 1
        mask, draw = _sheet()
        for a, b in zip(foot, reach, strict=True):
            ways = np.array([a + _NEEDLE_RISE, a, a + _NEEDLE_RISE]), np.array([-b, 0.0, b])
            draw.line(_pixels(*ways), fill=255, width=thick)
        draw.line(_pixels(np.array([0.0, 0.95]), np.zeros(2)), fill=255, width=2 * thick)
        alpha = _averaged(mask)
    return alpha


def _sheet() -> tuple[Any, Any]:
    from PIL import Image as Picture
    from PIL import ImageDraw

    mask = Picture.new("L", (_LEAF_PIXELS * _FINER,) * 2)
    return mask, ImageDraw.Draw(mask)


def _pixels(along: NDArray[np.float64], across: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Give places on the blade, shares of its length and width, as those on the sheet."""
    size = _LEAF_PIXELS * _FINER
    # A pixel of room all around, so that mipmaps and repeats do not bleed over the edges.
    inner = 1.0 - 2.0 / _LEAF_PIXELS
    x = (0.5 + inner * across) * size
    y = (0.5 - inner * (along - 0.5)) * size
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _averaged(mask: Any) -> NDArray[np.uint8]:
    return np.asarray(mask.reduce(_FINER))


def encoded(image: Image) -> bytes:
    """Give an image as the bytes of a PNG; a file's as they are.

    Raises
    ------
    InputError
        If the file cannot be read or is neither PNG nor JPEG.
    """
    if not isinstance(image, Path):
        from PIL import Image as Picture

        out = BytesIO()
        Picture.fromarray(np.ascontiguousarray(image)).save(out, format="PNG")
        return out.getvalue()
    try:
        content = image.read_bytes()
    except OSError as error:
        reason = (error.strerror or "failed").lower()
        raise InputError(
            f"cannot be read: {reason}", where=str(image), expected="an image"
        ) from None
    mime_type(content, str(image))
    return content


def mime_type(content: bytes, where: str = "") -> str:
    """Tell from an image's first bytes what it is: PNG or JPEG."""
    if content.startswith(b"\x89PNG\r\n\x1a\n"):
        return "image/png"
    if content.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    raise InputError("is no PNG or JPEG", where=where, expected="an image of one of them")


def _cards(leaves: Leaves, here: NDArray[np.int64], tree_id: int) -> Mesh:
    n = len(here)
    foot = leaves.position[here].astype(np.float64)
    direction, normal = (a[here].astype(np.float64) for a in (leaves.direction, leaves.normal))
    along = direction * leaves.length[here, None]
    # Seen from the upper face with the tip up, `across` points to the right.
    across = np.cross(direction, normal) * leaves.width[here, None]
    square = np.array([(-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0)])
    points = foot[:, None] + square[:, :1] * across[:, None] + square[:, 1:] * along[:, None]
    two = np.array([(0, 1, 2), (0, 2, 3)])
    triangles = (4 * np.arange(n)[:, None, None] + two).reshape(-1, 3).astype(np.int32)
    uv = np.tile((square + np.array([0.5, 0.0]))[two], (n, 1, 1))
    data = {name: np.zeros(4 * n, kind) for name, kind in POINT_DATA.items()}
    data["tree_id"][:] = tree_id
    data["axis"] = np.repeat(leaves.stem[here].astype(np.int32), 4)
    return Mesh(points.reshape(-1, 3), triangles, uv, data)
