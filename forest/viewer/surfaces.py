"""What the chosen tree is shown as: its body, its branches, or a surface of its wood or bark."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from forest.errors import InputError
from forest.view.surface_picture import add_textured
from forest.viewer.picking import Ray, Vector, first_triangle

if TYPE_CHECKING:
    from forest.record.run import Run
    from forest.species import Species
    from forest.surface.bark.cracks import Crack
    from forest.surface.export import Part
    from forest.trees.skeleton import Skeleton
    from forest.viewer.app import App

#: How the chosen tree can be shown: name, label, what it is.
SHAPES = {
    "body": ("Body", "Stem and crown as measured"),
    "branches": ("Branches", "Internodes and leaves"),
    "tubes": ("Tubes", "Wood as a tube along each axis"),
    "blended": ("Skin", "Wood as one blended surface"),
    "bark": ("Bark", "Bark torn as the tree grew, on its tubes"),
}
_MADE = ("tubes", "blended", "bark")
_MOST_KEPT = 12
_LEAVES = 0.6  # of a leaf's colour that is seen on its side away from the sun
_ACROSS = 0.45  # of the light that a slope gets more or less


class _Wanted(NamedTuple):
    tree_id: int
    year: int
    shape: str
    waiting: str  # acts that change it, and wait for the next year


class Surfaces:
    """What the chosen tree is shown as; surfaces are made beside the page's work and kept.

    Parameters
    ----------
    app : App
    """

    def __init__(self, app: App) -> None:
        self._app = app
        self._kept: dict[_Wanted, list[Part]] = {}
        self._said: dict[_Wanted, tuple[str, ...]] = {}  # what is not to be seen, and why
        self._making: _Wanted | None = None
        self._shown: _Wanted | None = None
        self._refused: tuple[tuple[int, int], str] | None = None  # tree and year, and why
        app.state.update(
            {
                "shape": "branches",
                "shape_list": [
                    {"name": name, "label": label, "title": title}
                    for name, (label, title) in SHAPES.items()
                ],
                "shape_why_not": "",
                "shape_said": "",
                "shape_busy": False,
            }
        )
        app.state.change("shape")(lambda **_: app.soon(app.show_year))

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        html.H3("Shape")
        with v.VBtnToggle(
            v_model=("shape",),
            mandatory=True,
            density="compact",
            color="primary",
            variant="outlined",
            disabled=("!!shape_why_not",),
            id="shapes",
        ):
            v.VBtn(
                "{{ each.label }}",
                v_for="each in shape_list",
                key="each.name",
                value=("each.name",),
                title=("each.title",),
                size="small",
                raw_attrs=[":id=\"'shape-' + each.name\""],
            )
        v.VProgressLinear(indeterminate=True, v_if=("shape_busy",), color="primary")
        html.Div("{{ shape_why_not || shape_said }}", classes="quiet mt-1", id="shape-said")

    def refresh(self) -> None:
        """Show the chosen tree as it is asked for, or say why it has no shape."""
        app, state = self._app, self._app.state
        chosen, year = app.chosen, app.year
        if chosen is None:
            self._put(None)
            return
        known = chosen in app.source.with_branches(year)
        state.shape_why_not = "" if known else self._why_not(year)
        wanted = _Wanted(chosen, year, str(state.shape), app.source.waiting_for(chosen))
        if self._refused and self._refused[0] != wanted[:2]:
            self._refused = None
        if not known or state.shape not in _MADE:
            state.shape_said = self._refused[1] if self._refused else ""
            self._put(None)
        elif wanted in self._kept:
            self._refused = None
            self._put(wanted)
        else:
            self._put(None)
            if app.server.running:
                self._make(wanted)

    def _why_not(self, year: int) -> str:
        return f"Its branches are not on record in {year}: only those of sample trees are."

    def _put(self, wanted: _Wanted | None) -> None:
        """Let a surface stand in the scene, or none."""
        if wanted == self._shown:
            return
        self._shown = wanted
        stage = self._app.stage
        if wanted is None:
            stage.put("surface", None)
            stage.dress(None)
            return
        parts = [_unbumped(part) for part in self._kept[wanted]]
        stage.put("surface", lambda plotter: _add(plotter, parts))
        stage.dress(wanted.tree_id)
        count = sum(len(part.mesh.triangles) for part in parts)
        said = f"{SHAPES[wanted.shape][1]}: {count:,} triangles"
        self._app.state.shape_said = ". ".join((said, *self._said.get(wanted, ())))

    def bark_at(self, ray: Ray) -> Vector | None:
        """Give where a line of sight meets the bark that is shown, m; None if it meets none."""
        if self._shown is None or self._shown.shape != "bark":
            return None
        met = [
            first_triangle(part.mesh.points.astype(np.float32), part.mesh.triangles, ray)
            for part in self._kept[self._shown]
            if part.material.name.startswith("bark")
        ]
        near = [each[1] for each in met if each is not None]
        return ray.at(min(near)) if near else None

    def _make(self, wanted: _Wanted) -> None:
        if self._making is None:
            self._making, self._refused = wanted, None
            asyncio.get_running_loop().create_task(self._made(wanted))

    async def _made(self, wanted: _Wanted) -> None:
        """Make a surface in a thread, then show what is wanted by then."""
        app, state = self._app, self._app.state
        with state:
            state.shape_busy = True
            state.shape_said = f"making {SHAPES[wanted.shape][0].lower()} (seconds to a minute)"
        try:
            said: list[str] = []
            parts = await asyncio.to_thread(app.source.surface, *wanted[:3], said.append)
            self._kept = dict([*self._kept.items(), (wanted, parts)][-_MOST_KEPT:])
            self._said = {key: self._said[key] for key in self._said if key in self._kept}
            self._said[wanted] = tuple(said)
        except InputError as error:
            self._refused = wanted[:2], str(error)
        with state:
            self._making, state.shape_busy = None, False
            if self._refused and (app.chosen, app.year, state.shape) == wanted[:3]:
                state.shape = "branches"
            app.refresh()


def _add(plotter: Any, parts: list[Part]) -> None:
    """Add a surface; leaves, which are cut out of cards, let light through."""
    before = set(plotter.actors)
    add_textured(plotter, parts)
    for name in set(plotter.actors) - before:
        if plotter.actors[name].GetForceOpaque():
            plotter.actors[name].prop.ambient = _LEAVES


def _unbumped(part: Part) -> Part:
    """Paint the shade of the bark's relief into its colours: software shows them faster, and lit.

    The light comes from the left and above, as the normals of the map have it.
    """
    material = part.material
    if material.normal_image is None or material.colour_image is None:
        return part
    normal = np.asarray(material.normal_image, np.float32) / 127.5 - 1.0
    shade = 0.55 * normal[..., 2:] + _ACROSS * (normal[..., 1:2] - normal[..., :1]) + 0.45
    if material.rough_image is not None:
        shade = shade * (0.5 + 0.5 / 255.0 * np.asarray(material.rough_image)[..., :1])
    colour = np.asarray(material.colour_image)[..., :3] * shade
    image = np.asarray(np.clip(colour, 0.0, 255.0), np.uint8)
    painted = replace(material, colour_image=image, normal_image=None, rough_image=None)
    return replace(part, material=painted)


def surface_parts(
    run: Run,
    tree_id: int,
    year: int,
    shape: str,
    waiting: Sequence[Crack] = (),
    say: Callable[[str], None] = lambda line: None,
) -> list[Part]:
    """Make a sample tree's surface, as `output.sample_trees.meshes` writes it.

    Parameters
    ----------
    run : Run
    tree_id, year : int
    shape : str
        "tubes", "blended" or "bark".
    waiting : sequence of Crack, optional
        Cracks of the bark that wait for the next year.
    say : callable, optional
        Is told in a line of each crack that is not to be seen.

    Raises
    ------
    InputError
        If its shape is not on record, or it cannot be made.
    """
    from forest.surface.bark.axes import LEAST_RADIUS_M
    from forest.surface.tubes import tubes
    from forest.view.tree_mesh import barked_parts, species_of

    skeleton = run.skeleton(tree_id, year)
    parts = wood_parts(skeleton, species_of(run, skeleton), shape)
    if shape != "bark":
        return parts
    thick = float(skeleton.radius.max())
    if thick < LEAST_RADIUS_M:
        raise InputError(
            f"tree {tree_id} has no bark that could be seen: it is {200.0 * thick:.1f} cm thick",
            expected=f"{200.0 * LEAST_RADIUS_M:g} cm or more",
        )
    wood = tubes(skeleton)
    return [*barked_parts(run, skeleton, year, wood, waiting=waiting, say=say), *parts[1:]]


def wood_parts(skeleton: Skeleton, species: Species, shape: str) -> list[Part]:
    """Make a tree's wood, "blended" or else as tubes, and its leaves."""
    from forest.surface.blend import blended
    from forest.surface.tubes import tubes
    from forest.trees.leaves import leaves_of
    from forest.view.tree_mesh import too_thin, tree_parts

    if shape == "blended" and too_thin(skeleton):
        raise InputError(f"tree {skeleton.tree_id} is too thin for one skin", expected="tubes")
    wood = blended(skeleton) if shape == "blended" else tubes(skeleton)
    return tree_parts(wood, skeleton, leaves_of(skeleton, species))
