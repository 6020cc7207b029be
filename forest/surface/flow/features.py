"""Bark as polygons: a background of quads, with spots or ribbons on it (Hart & Baker 2003, 5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.surface.export import Material, Part, linear
from forest.surface.flow.cover import Near, cover
from forest.surface.flow.flowing import FlowRules, flow
from forest.surface.flow.presets import Colour, FeaturePreset, Ribbons, Spots, feature_preset
from forest.surface.flow.sites import Bark, Sites, chances, mesh_of, sites_of, twists
from forest.surface.flow.trails import Trails, unit_normals
from forest.surface.mesh import Mesh
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

#: Limbs thinner than this, in distances of quads, keep no features.
_THINNEST = 0.5
#: The chain flows over limbs thicker than this, in radii of the foot; others have their own grain.
_FLOWING = 0.1
#: Quads reach a little beyond the points that they must cover.
_MARGIN = 1.08
#: Points around a site at which its quad's size is measured: rings and points of each.
_RINGS = (0.25, 0.45, 0.6, 0.75, 0.9, 1.05)
_PER_RING = 16
_FAN = 12
#: Part of a ribbon's width that its bevelled side takes.
_BEVEL = 0.25


@dataclass(frozen=True)
class FlowBark:
    """The bark of a tree as polygons, by material.

    Attributes
    ----------
    pieces : dict of str to Mesh
        `background`, and `spots` or `ribbons_0`, `ribbons_1`, ... (lowest layer first).
    colours : dict of str to (red, green, blue)
        Of each material at the age of the oldest bark, sRGB from 0 to 1.
    sites : Sites
        The particles that they stand on.
    quad_m : float64 (n,)
        Half the side of each site's quad, m.
    trails : Trails or None
        The grain.
    """

    pieces: dict[str, Mesh]
    colours: dict[str, Colour]
    sites: Sites
    quad_m: _Floats
    trails: Trails | None

    def parts(self) -> list[Part]:
        """Give pieces with materials, as `forest.surface.export.write_mesh` takes them."""
        found = []
        for name, mesh in self.pieces.items():
            material = Material(f"bark_{name}", linear(self.colours[name]), double_sided=True)
            found.append(Part(mesh, material, f"bark_{name}"))
        return found


def quad_sizes(bark: Bark, sites: Sites) -> _Floats:
    """Give half the side of each site's quad so that all quads together cover the surface, m.

    A point of the surface belongs to the site nearest to it, whose quad is enlarged until it
    holds it.
    """
    turn = 2.0 * math.pi * np.arange(_PER_RING) / _PER_RING
    ring = np.column_stack((np.cos(turn), np.sin(turn)))
    offsets = np.concatenate([r * ring for r in _RINGS]) * sites.spacing_m
    points = sites.place[:, None] + (
        offsets[None, :, :1] * sites.along[:, None] + offsets[None, :, 1:] * sites.across[:, None]
    )
    points = bark.blend.project(points.reshape(-1, 3))
    owner = cKDTree(sites.place).query(points)[1]
    return np.asarray(_MARGIN * _needed(sites, points, owner))


def _needed(sites: Sites, points: _Floats, owner: NDArray[np.int64]) -> _Floats:
    away = points - sites.place[owner]
    u = np.abs(np.sum(away * sites.across[owner], axis=1))
    v = np.abs(np.sum(away * sites.along[owner], axis=1))
    half = np.full(len(sites), 0.5 * sites.spacing_m)
    np.maximum.at(half, owner, np.maximum(u, v))
    return half


def background(bark: Bark, sites: Sites, half: _Floats) -> Mesh:
    """Attach a flat quad to each site, along the grain."""
    u = np.array([-1.0, 1.0, 1.0, -1.0])
    v = np.array([-1.0, -1.0, 1.0, 1.0])
    size = half[:, None, None]
    corner = sites.place[:, None] + size * (
        u[None, :, None] * sites.across[:, None] + v[None, :, None] * sites.along[:, None]
    )
    uv = sites.uv[:, None] + size * np.stack((u, v), axis=1)[None]
    first = 4 * np.arange(len(sites), dtype=np.int32)[:, None, None]
    halves = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    triangles = (first + halves).reshape(-1, 3)
    return mesh_of(bark, corner.reshape(-1, 3), triangles, uv.reshape(-1, 2))


def spots(
    bark: Bark, sites: Sites, half: _Floats, preset: FeaturePreset, rules: Spots, seed: int
) -> Mesh:
    """Put fans of triangles on some sites: the edge on the background, the peak above it.

    A spot has the outline of a lenticel, a lens across the grain with pointed ends.
    """
    luck = chances(seed, 10, sites.number)
    has = np.flatnonzero(luck[:, 0] < preset.at(rules.density, sites.age))
    age, n = sites.age[has], len(has)
    turn = 2.0 * math.pi * np.arange(_FAN) / _FAN
    uneven = 1.0 + 0.25 * np.sin(2.0 * turn + 6.28 * luck[has, 1:2]) * luck[has, 2:3]
    size = (0.4 + 1.2 * luck[has, 3] ** 2)[:, None]  # many small, few large
    lens = np.sin(turn) * np.abs(np.sin(turn))  # two parabolas
    u = 0.5 * size * preset.at(rules.width_m, age)[:, None] * np.cos(turn)
    v = 0.5 * np.sqrt(size) * preset.at(rules.height_m, age)[:, None] * uneven * lens
    bears = preset.at(rules.density, age)
    shift = (luck[has, 0] / bears - 0.5) * sites.spacing_m  # sites stand in rows, spots do not
    middle = bark.blend.project(sites.place[has] + shift[:, None] * sites.along[has])
    edge = middle[:, None] + (
        u[..., None] * sites.across[has][:, None] + v[..., None] * sites.along[has][:, None]
    )
    edge = bark.blend.project(edge.reshape(-1, 3))
    out = unit_normals(bark.blend, edge)
    lift = _above_quads(sites, half)[has]
    raised = preset.at(rules.raise_m, age)
    low = edge + np.repeat(lift, _FAN)[:, None] * out
    high = edge + np.repeat(lift + raised, _FAN)[:, None] * out
    top = middle + (lift + raised + preset.at(rules.peak_m, age))[:, None] * unit_normals(
        bark.blend, middle
    )
    points = np.concatenate((top, high, low))
    here = sites.uv[has] + np.column_stack((np.zeros(n), shift))
    around = np.stack((u, v), axis=2) + here[:, None]
    uv = np.concatenate((here, around.reshape(-1, 2), around.reshape(-1, 2)))
    k = np.arange(n)[:, None]
    a = n + k * _FAN + np.arange(_FAN)
    b = n + k * _FAN + (np.arange(_FAN) + 1) % _FAN
    fan = np.stack((np.broadcast_to(k, a.shape), a, b), axis=2).reshape(-1, 3)
    skirt = n * _FAN
    sides = np.stack((a + skirt, b + skirt, b, a + skirt, b, a), axis=2).reshape(-1, 3)
    standing = np.repeat(raised > 0.0, 2 * _FAN)
    return mesh_of(bark, points, np.concatenate((fan, sides[standing])), uv)


def _above_quads(sites: Sites, half: _Floats) -> _Floats:
    """How far the corners of flat quads stand off the round limb, m."""
    return np.asarray(half**2 / sites.radius_m)


def ribbons(
    bark: Bark, sites: Sites, half: _Floats, preset: FeaturePreset, rules: Ribbons, seed: int
) -> list[Mesh]:
    """Lay ribbons along the grain, above and below some sites, in layers of different heights."""
    return [
        _layer(bark, sites, half, preset, rules, seed, layer) for layer in range(len(rules.layers))
    ]


def _layer(
    bark: Bark,
    sites: Sites,
    half: _Floats,
    preset: FeaturePreset,
    rules: Ribbons,
    seed: int,
    layer: int,
) -> Mesh:
    luck = chances(seed, 20 + layer, sites.number)
    has = np.flatnonzero(luck[:, 0] < preset.at(rules.density, sites.age))
    age, luck, n = sites.age[has], luck[has], len(has)
    length = preset.at(rules.length_m, age) * (0.6 + 0.8 * luck[:, 1])
    twist = np.radians(preset.at(rules.twist_deg, age)) * twists(
        seed, 20 + layer, sites.number[has]
    )
    middle = _ways(bark, sites.place[has], length / rules.segments, twist, rules.segments)
    nodes = rules.segments + 1
    out = unit_normals(bark.blend, middle.reshape(-1, 3)).reshape(n, nodes, 3)
    step = np.gradient(middle, axis=1) if n else middle
    across = np.cross(step, out)
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-12)
    reach = np.linspace(-1.0, 1.0, nodes)
    taper = np.maximum(1.0 - np.abs(reach) ** 3, 0.05)
    wide = 0.5 * preset.at(rules.width_m, age)[:, None] * taper * (0.6 + 0.8 * luck[:, 3:])
    high = preset.at(rules.height_m, age)[:, None] * rules.layers[layer] * np.sqrt(taper)
    lift = _above_quads(sites, half)[has][:, None]
    columns, texture = [], []
    along = np.cumsum(
        np.linalg.norm(np.diff(middle, axis=1, prepend=middle[:, :1]), axis=2), axis=1
    )
    for side, height in ((-1.0, 0.0), (_BEVEL - 1.0, 1.0), (1.0 - _BEVEL, 1.0), (1.0, 0.0)):
        phase = 6.28 * luck[:, 2:3] * (3.0 if side > 0.0 else 1.0)
        uneven = 1.0 + 0.2 * np.sin(6.0 * reach + phase) + 0.1 * np.sin(14.0 * reach + 2.0 * phase)
        spread = side * wide * uneven
        foot = bark.blend.project((middle + spread[..., None] * across).reshape(-1, 3))
        normal = unit_normals(bark.blend, foot).reshape(n, nodes, 3)
        columns.append(foot.reshape(n, nodes, 3) + (height * high + lift)[..., None] * normal)
        v = sites.uv[has, 1:] + along - 0.5 * along[:, -1:]
        texture.append(np.stack((sites.uv[has, :1] + spread, v), axis=2))
    points = np.stack(columns, axis=2).reshape(-1, 3)  # ribbon, node, column
    uv = np.stack(texture, axis=2).reshape(-1, 2)
    return mesh_of(bark, points, _strips(n, nodes, 4), uv)


def _ways(bark: Bark, place: _Floats, step: _Floats, twist: _Floats, segments: int) -> _Floats:
    """Follow the grain from points both ways (n, segments + 1, 3)."""
    back = segments // 2
    way = np.empty((len(place), segments + 1, 3))
    way[:, back] = place
    turned = np.cos(twist)[:, None], np.sin(twist)[:, None]
    for sign, last in ((1, segments), (-1, 0)):
        for k in range(back, last, sign):
            here = way[:, k]
            along = bark.grain(here)
            right = np.cross(along, unit_normals(bark.blend, here))
            heading = turned[0] * along + turned[1] * right
            way[:, k + sign] = bark.blend.project(here + sign * step[:, None] * heading)
    return way


def _strips(count: int, nodes: int, columns: int) -> NDArray[np.int32]:
    """Triangles of ribbons of `nodes` rows of `columns` points."""
    row, column = np.meshgrid(np.arange(nodes - 1), np.arange(columns - 1), indexing="ij")
    a = (row * columns + column).ravel()
    cell = np.stack((a, a + 1, a + columns + 1, a, a + columns + 1, a + columns), axis=1)
    first = (nodes * columns * np.arange(count))[:, None, None]
    return (first + cell.reshape(-1, 3)[None]).reshape(-1, 3).astype(np.int32)


def features(
    skeleton: Skeleton,
    preset: FeaturePreset | str,
    *,
    year: int | None = None,
    age: float | None = None,
    spacing_m: float | None = None,
    spiral_deg: float = 0.0,
    grain_of_flow: bool = True,
    near: Near | None = None,
    seed: int = 0,
) -> FlowBark:
    """Give a tree the bark of Hart & Baker 2003, section 5.4.

    Parameters
    ----------
    skeleton : Skeleton
        A tree.
    preset : FeaturePreset or str
        What its bark is made of, or the name of a preset that comes with the program.
    year : int, optional
        Calendar year in which it is seen; bark is as old as the internode that it is on. By
        default that of the youngest internode.
    age : float, optional
        One age for all bark instead, years (a tree that was not simulated has no years).
    spacing_m : float, optional
        Distance of the background's quads, m; by default the preset's.
    spiral_deg : float
        Spiral grain (see `FlowRules`).
    grain_of_flow : bool
        Whether the grain is that of the flow of particles, or simply along the limbs.
    near : Near, optional
        A ball outside which no bark is made.
    seed : int
        Of the random numbers.

    Returns
    -------
    FlowBark
        Polygons by material, with colours.

    Raises
    ------
    InputError
        If the skeleton has no surface, the preset does not exist, or the spacing is not above 0.
    """
    if isinstance(preset, str):
        preset = feature_preset(preset)
    spacing = preset.spacing_m if spacing_m is None else spacing_m
    blend = Blend.of(limbs_of(skeleton, thinnest_m=_THINNEST * max(spacing, 0.0)))
    trails = None
    if grain_of_flow:
        thick = limbs_of(
            skeleton,
            thinnest_m=max(_THINNEST * spacing, _FLOWING * float(blend.limbs.cones.low[0])),
        )
        trails = flow(Blend.of(thick), rules=FlowRules(spiral_deg=spiral_deg)).trails
    bark = Bark(skeleton, blend, trails)
    sites = sites_of(bark, cover(blend, spacing, seed=seed, near=near), year=year, age=age)
    half = quad_sizes(bark, sites)
    pieces = {"background": background(bark, sites, half)}
    if preset.pattern == "spotted" and preset.spots is not None:
        pieces["spots"] = spots(bark, sites, half, preset, preset.spots, seed)
    if preset.pattern == "ribbon" and preset.ribbons is not None:
        for k, piece in enumerate(ribbons(bark, sites, half, preset, preset.ribbons, seed)):
            pieces[f"ribbons_{k}"] = piece
    oldest = float(sites.age.max(initial=0.0))
    colours = {name: _colour(preset, name, oldest) for name in pieces}
    return FlowBark(pieces, colours, sites, half, trails)


def _colour(preset: FeaturePreset, piece: str, age: float) -> Colour:
    """Colour of a material: lower layers of ribbons are nearer to the background's."""
    under, over = preset.colour(preset.background, age), preset.colour(preset.feature, age)
    share = 1.0
    if piece == "background":
        share = 0.0
    elif preset.pattern == "ribbon" and preset.ribbons is not None:
        share = preset.ribbons.layers[int(piece.split("_")[1])]
    red, green, blue = (a + share * (b - a) for a, b in zip(under, over, strict=True))
    return red, green, blue
