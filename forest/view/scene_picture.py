"""A picture of a scene's meshes, rendered off screen, each shape sent to the renderer once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from forest.record.export import whole_file
from forest.surface.export.scene_vtk import leaf_cells, wood_cells
from forest.surface.scene import Scene
from forest.view.scene import import_pyvista, look_at, open_plotter, save
from forest.view.shading import SUN

_AMBIENT, _SUN, _SKY = 0.3, 0.6, 0.2
_THROUGH = 0.4  # light that comes through leaves, so that they are not black from below
_SKY_COLOUR = "#dfe8ef"
_Say = Callable[[str], object]


def draw_scene(
    scene: Scene,
    to: str | Path,
    *,
    window: tuple[int, int] = (1200, 750),
    bearing_deg: float = -65.0,
    above_deg: float = 22.0,
    overwrite: bool = False,
    say: _Say = lambda line: None,
) -> Path:
    """Draw a scene from aslant and save the picture.

    Parameters
    ----------
    scene : Scene
    to : path
        The .png file.
    window : (int, int)
        Width and height, pixels.
    bearing_deg, above_deg : float
        Whence it is seen: direction from the x axis anticlockwise, and height above the horizon.
    overwrite : bool
        Whether to replace a file.
    say : callable
        Is told, in a line, how far it is.
    """
    pv = import_pyvista()
    with whole_file(to, overwrite=overwrite) as draft:
        plotter = open_plotter(window)
        plotter.set_background(_SKY_COLOUR)
        plotter.remove_all_lights()
        for way, strength in ((SUN, _SUN), (np.array([0.0, 0.0, 1.0]), _SKY)):
            light = pv.Light(position=tuple(way), intensity=strength, light_type="scenelight")
            plotter.add_light(light)
        if scene.ground is not None:
            ground = pv.PolyData(*wood_cells(scene.ground.mesh))
            plotter.add_mesh(ground, color=scene.ground.colour, ambient=_AMBIENT)
        for number in range(len(scene.shapes)):
            _add_shape(plotter, scene, number)
        tops = [shape.wood.points[:, 2].max() for shape in scene.shapes]
        upper = scene.instances.place.copy()
        upper[:, 2] += scene.instances.scale * np.array(tops)[scene.instances.model]
        seen = [scene.instances.place, upper]
        if scene.ground is not None:
            seen.append(scene.ground.mesh.points)
        look_at(
            plotter,
            np.concatenate(seen),
            bearing_deg=bearing_deg,
            above_deg=above_deg,
            aspect=window[0] / window[1],
        )
        say(f"drawing {sum(scene.standing_triangles):,} triangles")
        save(plotter, draft)
    return Path(to)


def _add_shape(plotter: Any, scene: Scene, number: int) -> None:
    """Let the renderer repeat a shape's wood and leaves at the places of its trees."""
    from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper

    pv = import_pyvista()
    shape, here = scene.shapes[number], scene.instances.model == number
    if not here.any():
        return
    places = pv.PolyData(scene.instances.place[here])
    places.point_data["scale"] = scene.instances.scale[here]
    parts = [(wood_cells(shape.wood), shape.bark, _AMBIENT)]
    parts += [(cells, shape.foliage, _THROUGH) for cells in leaf_cells(shape.leaves)]
    for (points, cells), colour, ambient in parts:
        mapper = vtkGlyph3DMapper()
        mapper.SetInputData(places)
        mapper.SetSourceData(pv.PolyData(points.astype(np.float32), cells))
        mapper.SetScaleArray("scale")
        mapper.SetScaleModeToScaleByMagnitude()
        mapper.OrientOff()
        mapper.ScalarVisibilityOff()
        actor = vtkActor()
        actor.SetMapper(mapper)
        look = actor.GetProperty()
        look.SetColor(*colour)
        look.SetAmbient(ambient)
        plotter.add_actor(actor, reset_camera=False, render=False)
