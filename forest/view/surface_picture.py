"""Pictures of meshes, rendered off screen: by what is known of their points, or as they look."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from forest.errors import InputError, nearest
from forest.record.export import whole_file
from forest.surface.export import Material, Part
from forest.surface.export.glb import tangents
from forest.surface.export.parts import encoded
from forest.surface.export.vtp import polydata
from forest.surface.mesh import Mesh
from forest.view.scene import import_pyvista, look_at, open_plotter, pixels

#: What a picture may be coloured by, and what its scale says.
COLOURS = {"radius_m": "radius, m", "order": "branching order", "birth_year": "year of birth"}
TEXTURE = "texture"

#: Where the light of a picture comes from unless told otherwise: over the viewer's left shoulder.
LIGHT = (-0.6, -0.5, 0.7)

_AMBIENT = 0.35
_DISCARD = "//VTK::Light::Impl\n  if (opacity < 0.5) discard;\n"


def draw_mesh(
    what: Mesh | Sequence[Part],
    to: str | Path,
    *,
    colour_by: str = TEXTURE,
    window: tuple[int, int] = (900, 1100),
    light: tuple[float, float, float] = LIGHT,
    bearing_deg: float = -75.0,
    above_deg: float = 4.0,
    overwrite: bool = True,
) -> None:
    """Draw meshes on white and save the picture.

    Parameters
    ----------
    what : Mesh or sequence of Part
        What is drawn.
    to : path
        PNG file to write.
    colour_by : str
        An array of the points, one of `COLOURS`, which leaves leaf cards away; or ``texture`` for
        the materials with their images.
    window : (int, int)
        Width and height of the picture, pixels.
    light : (float, float, float)
        Direction to the light; z up, x to the east.
    bearing_deg, above_deg : float
        From where it is seen: counted from the x axis, and above the horizon.
    overwrite : bool
        Whether to replace a file.

    Raises
    ------
    InputError
        If `colour_by` is unknown, a mesh lacks that array, or nothing is left to draw.
    """
    if colour_by != TEXTURE and colour_by not in COLOURS:
        hint = nearest(colour_by, (*COLOURS, TEXTURE))
        raise InputError(f"cannot colour by '{colour_by}', {hint}")
    parts = [Part(what)] if isinstance(what, Mesh) else list(what)
    if colour_by != TEXTURE:
        parts = [part for part in parts if not part.material.cut_out]
    meshes = [part.placed() for part in parts]
    if not any(len(mesh.triangles) for mesh in meshes):
        raise InputError("nothing to draw", where=str(to), expected="a mesh with triangles")
    plotter = open_plotter(window)
    plotter.set_background("white")
    plotter.remove_all_lights()
    plotter.add_light(import_pyvista().Light(position=light, light_type="scene light"))
    if colour_by == TEXTURE:
        add_textured(plotter, parts)
    else:
        _add_coloured(plotter, Mesh.together(meshes), colour_by)
    points = np.concatenate([mesh.points for mesh in meshes])
    aspect = window[0] / window[1]
    look_at(plotter, points, bearing_deg=bearing_deg, above_deg=above_deg, aspect=aspect)
    from PIL import Image

    picture = Image.fromarray(pixels(plotter))
    with whole_file(to, overwrite=overwrite) as draft:
        picture.save(draft)


def add_textured(plotter: Any, parts: Sequence[Part]) -> None:
    """Put parts into a plotter as they look, each in its material."""
    for part in parts:
        mesh = part.placed()
        if len(mesh.triangles):
            _add_textured(plotter, mesh, part.material)


def _add_coloured(plotter: Any, mesh: Mesh, colour_by: str) -> None:
    if colour_by not in mesh.data:
        known = ", ".join(mesh.data) or "a mesh made of a skeleton"
        raise InputError(f"the mesh has no '{colour_by}'", expected=known)
    values = mesh.data[colour_by].astype(np.float64)
    whole = mesh.data[colour_by].dtype.kind == "i"
    steps = int(values.max() - values.min()) + 1
    made = polydata(mesh)
    made.point_data.clear()
    made[COLOURS[colour_by]] = values
    plotter.add_mesh(
        made,
        log_scale=not whole,
        cmap="viridis",
        n_colors=min(steps, 256) if whole else 256,
        ambient=_AMBIENT,
        scalar_bar_args={
            "fmt": "%.0f" if whole else "%.2g",
            "n_labels": min(steps, 5) if whole else 5,
            "color": "black",
            "title_font_size": 40,
            "label_font_size": 32,
            "vertical": True,
            "height": 0.3,
            "width": 0.08,
            "position_x": 0.03,
            "position_y": 0.03,
        },
    )


def _add_textured(plotter: Any, mesh: Mesh, material: Material) -> None:
    pv = import_pyvista()
    split = mesh.split_at_seams()
    normals = mesh.normals()[split.source]
    n = len(split.triangles)
    made = pv.PolyData(
        mesh.points[split.source], np.column_stack((np.full(n, 3), split.triangles)).ravel()
    )
    made.point_data["Normals"] = normals
    made.GetPointData().SetActiveNormals("Normals")
    made.active_texture_coordinates = (split.uv / material.tile_m).astype(np.float32)
    bumpy = material.normal_image is not None
    if bumpy:
        made.point_data["Tangents"] = tangents(mesh, split, normals)
        made.GetPointData().SetActiveTangents("Tangents")
    colour = np.asarray(material.colour)
    srgb = np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * colour ** (1 / 2.4) - 0.055)
    image = material.colour_image
    actor = plotter.add_mesh(
        made,
        color=srgb.tolist(),
        texture=None if image is None else pv.Texture(_pixels(image)),
        pbr=bumpy,
        roughness=material.roughness,
        metallic=material.metallic,
        ambient=_AMBIENT,
        specular=0.0,
    )
    if bumpy:
        actor.prop.SetNormalTexture(pv.Texture(_pixels(material.normal_image)))
    if material.cut_out:  # what is not opaque is left out, not mixed, so that order has no say
        actor.ForceOpaqueOn()
        actor.GetShaderProperty().AddFragmentShaderReplacement(
            "//VTK::Light::Impl", True, _DISCARD, False
        )


def _pixels(image: Any) -> Any:
    from PIL import Image

    return np.asarray(Image.open(BytesIO(encoded(image))))
