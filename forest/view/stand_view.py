"""Pictures of a scene as one sees it who stands in it: trees, ground, grass, sun and haze."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.export import whole_file
from forest.surface.camera import Camera
from forest.surface.frame import Frame, prepare
from forest.surface.grass import grow_grass
from forest.surface.shadow import SceneShadow, scene_shadow
from forest.view.landscape_ground import GRASS_TINT, ground, hazed, sky
from forest.view.scene import OVERSAMPLING, import_pyvista, open_plotter, pixels
from forest.view.scenery.scenery import Scenery

_SHADOW_CELL_M = 0.25  # finer edges of shadows would be harder than the sun's
_CHUNK = 2_000_000  # primitives that VTK holds at a time
_WIDEST_PX = 8  # lines and points are drawn up to this many fine pixels wide
_NEAR_M, _FAR_M = 0.15, 12_000.0
_BLADE_WIDTH_M = 0.006
_GRAIN, _FACE_GRAIN = 0.2, 0.07  # of lines and points, and of faces, which the sun tells apart

_Say = Callable[[str], object]


class StandView:
    """A scene whose shadows are cast, to be looked at from many places.

    Parameters
    ----------
    scenery : Scenery
    shadows : bool
        Whether trees cast them.
    """

    def __init__(self, scenery: Scenery, *, shadows: bool = True) -> None:
        self.scenery = scenery
        self.shadows: SceneShadow | None = None
        if shadows and len(scenery.instances.model):
            self.shadows = scene_shadow(
                scenery.models,
                scenery.instances,
                scenery.sun,
                season=scenery.season,
                finest_m=_SHADOW_CELL_M,
            )

    def frame(self, camera: Camera) -> Frame:
        """Work out what is drawn of the trees."""
        scenery = self.scenery
        return prepare(
            scenery.models,
            scenery.instances,
            camera,
            season=scenery.season,
            quality=scenery.quality,
            sun=scenery.sun,
            haze=scenery.haze.visibility_m,
            haze_colour=scenery.haze.colour,
            shadows=self.shadows,
        )

    def picture(self, camera: Camera | None = None) -> NDArray[np.uint8]:
        """Render the scene.

        Parameters
        ----------
        camera : Camera, optional
            The scene's own unless given.

        Returns
        -------
        uint8 (height, width, 3)

        Raises
        ------
        InputError
            If there is more in view than `forest.surface.frame.MOST_PRIMITIVES`.
        """
        camera = camera or self.scenery.camera()
        frame = self.frame(camera)
        plotter = open_plotter((camera.width, camera.height))
        _add_surface(plotter, *sky(self.scenery, camera))
        _add_surface(plotter, *ground(self.scenery, camera, self.shadows))
        self._add_grass(plotter, camera)
        view = plotter.camera
        view.position, view.focal_point = tuple(camera.eye), tuple(camera.towards)
        view.up = (0.0, 0.0, 1.0) if _is_upright(camera) else (0.0, 1.0, 0.0)
        view.view_angle = camera.field_of_view_deg
        view.clipping_range = (_NEAR_M, _FAR_M)
        _draw_trees(plotter, frame)
        return pixels(plotter)

    def _add_grass(self, plotter: Any, camera: Camera) -> None:
        scenery = self.scenery
        if not scenery.grasses:
            return
        blades = grow_grass(
            scenery.grasses,
            scenery.grass_at,
            scenery.terrain,
            camera,
            seed=scenery.seed,
            tint=GRASS_TINT[scenery.season],
            shade_at=self.shadows.shaded if self.shadows else None,
        )
        n, k = blades.vertices.shape[:2]
        points = blades.vertices.reshape(-1, 3).astype(np.float64)
        colour = hazed(blades.colour.reshape(-1, 3) / 255.0, points, camera, scenery)
        distance = np.linalg.norm(blades.vertices[:, 0] - np.asarray(camera.eye), axis=1)
        width = _BLADE_WIDTH_M * _pixels_per_metre(camera) / np.maximum(distance, _NEAR_M)
        for size, here in _by_size(width, blades.vertices, 1):
            pv = import_pyvista()
            mesh = pv.PolyData()
            mesh.points = blades.vertices[here].reshape(-1, 3)
            mesh.lines = _cells(len(here), k)
            mesh.point_data["rgb"] = colour.reshape(n, k, 3)[here].reshape(-1, 3)
            plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False, line_width=size)


def draw_stand_view(
    scenery: Scenery,
    to: str | Path,
    *,
    shadows: bool = True,
    frames: int = 1,
    overwrite: bool = False,
    say: _Say = lambda line: None,
) -> list[Path]:
    """Draw a scene and save the picture, or many of a flight around it.

    Parameters
    ----------
    scenery : Scenery
        From `forest.view.scenery`: `load_scenery` or `scenery_of_run`.
    to : path
        A .png file; or the .gif film of several frames, or the .png name that gets their numbers.
    shadows : bool
        Whether trees cast shadows.
    frames : int
        Pictures on the way around what the eye looks at.
    overwrite : bool
        Whether to replace files.
    say : callable
        Is told, in a line, what has been done.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        If the name ends in neither .png nor .gif, or there is too much in view.
    """
    from PIL import Image

    to = Path(to)
    if to.suffix.lower() not in (".png", ".gif"):
        raise InputError(
            f"unknown format '{to.suffix}'",
            where=str(to),
            expected="a name that ends in .png or .gif",
        )
    cameras = list(_around(scenery, frames))
    view = StandView(scenery, shadows=shadows)
    say(f"{len(scenery.instances.model)} trees of {len(scenery.models)} shapes")
    pictures = []
    written = []
    for number, camera in enumerate(cameras):
        picture = Image.fromarray(view.picture(camera))
        if to.suffix.lower() == ".gif":
            pictures.append(picture.quantize(255))
        else:
            written.append(_numbered(to, number, frames))
            with whole_file(written[-1], overwrite=overwrite) as draft:
                picture.save(draft, format="PNG", optimize=True)
        if frames > 1:
            say(f"frame {number + 1} of {frames}")
    if pictures:
        with whole_file(to, overwrite=overwrite) as draft:
            pictures[0].save(
                draft, format="GIF", save_all=True, append_images=pictures[1:], duration=80, loop=0
            )
        written.append(to)
    return written


def frame_paths(to: Path, frames: int) -> list[Path]:
    """List the files that `draw_stand_view` writes."""
    if to.suffix.lower() == ".gif":
        return [to]
    return [_numbered(to, number, frames) for number in range(frames)]


def _numbered(to: Path, number: int, frames: int) -> Path:
    return to if frames == 1 else to.with_name(f"{to.stem}_{number:03d}{to.suffix}")


def _around(scenery: Scenery, frames: int) -> Iterator[Camera]:
    """Lead the eye around what it looks at, at its height above the ground."""
    first = scenery.camera()
    eye, centre = np.asarray(first.eye), np.asarray(first.towards)
    above = float(eye[2] - scenery.terrain.at(eye[0], eye[1]))
    offset = eye[:2] - centre[:2]
    for number in range(frames):
        turn = 2.0 * np.pi * number / frames
        cos, sin = np.cos(turn), np.sin(turn)
        x = float(centre[0] + cos * offset[0] - sin * offset[1])
        y = float(centre[1] + sin * offset[0] + cos * offset[1])
        yield replace(first, eye=scenery.on_ground(x, y, above))


def _is_upright(camera: Camera) -> bool:
    ahead = np.asarray(camera.towards, np.float64) - np.asarray(camera.eye, np.float64)
    return bool(np.hypot(ahead[0], ahead[1]) > 1e-6 * np.linalg.norm(ahead))


def _pixels_per_metre(camera: Camera) -> float:
    """Fine pixels that a metre at a distance of a metre covers."""
    tall = 2.0 * np.tan(np.radians(0.5 * camera.field_of_view_deg))
    return float(OVERSAMPLING * camera.height / tall)


def _add_surface(
    plotter: Any, points: NDArray[Any], faces: NDArray[np.int64], colour: NDArray[np.uint8]
) -> None:
    mesh = import_pyvista().PolyData.from_regular_faces(points, faces)
    mesh.point_data["rgb"] = colour
    plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False)


def _draw_trees(plotter: Any, frame: Frame) -> None:
    """Draw the trees, a chunk at a time over the picture so far: memory holds no more of them.

    VTK keeps several copies of all that a renderer holds.
    """
    shown = list(plotter.actors)
    window, renderer = plotter.render_window, plotter.renderer
    for add, number in (
        (_add_triangles, len(frame.triangles)),
        (_add_lines, len(frame.lines)),
        (_add_points, len(frame.points)),
    ):
        for start in range(0, number, _CHUNK):
            add(plotter, frame, slice(start, start + _CHUNK))
            window.Render()
            renderer.SetPreserveColorBuffer(True)
            renderer.SetPreserveDepthBuffer(True)
            for name in [name for name in plotter.actors if name not in shown]:
                plotter.remove_actor(name, reset_camera=False, render=False)


def _add_triangles(plotter: Any, frame: Frame, part: slice) -> None:
    corners = frame.triangles[part]
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    mesh = import_pyvista().PolyData.from_regular_faces(corners.reshape(-1, 3), faces)
    mesh.cell_data["rgb"] = _grained(frame.triangle_colour[part], corners, _FACE_GRAIN)
    _put(plotter, mesh)


def _add_lines(plotter: Any, frame: Frame, part: slice) -> None:
    for size, here in _by_size(OVERSAMPLING * frame.line_width[part], frame.lines[part], 1):
        corners = frame.lines[part][here]
        mesh = import_pyvista().PolyData()
        mesh.points = corners.reshape(-1, 3)
        mesh.lines = _cells(len(here), 2)
        mesh.cell_data["rgb"] = _grained(frame.line_colour[part][here], corners)
        _put(plotter, mesh, line_width=size)


def _add_points(plotter: Any, frame: Frame, part: slice) -> None:
    for size, here in _by_size(OVERSAMPLING * frame.point_size[part], frame.points[part], 2):
        corners = frame.points[part][here]
        mesh = import_pyvista().PolyData()
        mesh.points = corners
        mesh.verts = _cells(len(here), 1)
        mesh.cell_data["rgb"] = _grained(frame.point_colour[part][here], corners)
        _put(plotter, mesh, point_size=size)


def _put(plotter: Any, mesh: Any, **size: int) -> None:
    """Add a mesh in its own colours, and leave the camera where it is."""
    plotter.add_mesh(
        mesh, scalars="rgb", rgb=True, lighting=False, reset_camera=False, render=False, **size
    )


def _grained(
    colour: NDArray[np.uint8], vertices: NDArray[np.float32], grain: float = _GRAIN
) -> NDArray[np.uint8]:
    """Make colours (n, 3) a little brighter or darker, by where their first corner stands.

    Leaves differ, and those of a crown's shady side would else be one even patch.
    """
    chance = _chance(vertices, 12.9898)
    grained = colour * (1.0 + grain * (2.0 * chance[:, None] - 1.0))
    return np.asarray(np.clip(grained, 0.0, 255.0), np.uint8)


def _cells(count: int, corners: int) -> NDArray[np.int64]:
    """Number the corners of lines or points that share none, as VTK wants them."""
    index = np.arange(count * corners).reshape(count, corners)
    return np.column_stack((np.full(count, corners), index)).ravel()


def _chance(vertices: NDArray[np.float32], number: float) -> NDArray[Any]:
    """Give numbers (n,) from 0 to 1 that look random, by where first corners stand."""
    x, y, z = vertices.reshape(len(vertices), prod(vertices.shape[1:]))[:, :3].T
    wave = np.abs(np.sin(x * number + y * 78.233 + z * 37.719)) * 4375.85
    return np.asarray(np.modf(wave)[0])


def _by_size(
    wanted: NDArray[Any], vertices: NDArray[np.float32], power: int
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Sort things into whole widths of fine pixels, for VTK draws one width at a time.

    Each gets the next lower or higher one, so often that the mean of their power is right: trees
    do not jump from one width to the other.
    """
    least = np.clip(np.floor(wanted), 1, _WIDEST_PX)
    share = (np.clip(wanted, 1, _WIDEST_PX) ** power - least**power) / (
        (least + 1) ** power - least**power
    )
    size = (least + (_chance(vertices, 24.3137) < share)).astype(np.int64)
    for one in np.flatnonzero(np.bincount(size)):
        yield int(one), np.flatnonzero(size == one)
