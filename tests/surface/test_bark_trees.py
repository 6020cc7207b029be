"""Bark on whole trees: strips, branchings, girth over the years, radial projection, meshes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.surface.bark.axes import lay_strips
from forest.surface.bark.bark_mesh import displaced_parts, dressed_parts
from forest.surface.bark.girth import (
    GROWING,
    linked_girths,
    measured_girths,
    outlines_of,
    perimeter,
    radial_projection,
    recorded_girths,
    supposed_girths,
)
from forest.surface.bark.material import Material
from forest.surface.bark.measured import read_girths
from forest.surface.bark.presets import Preset, preset_names
from forest.surface.bark.strips import FRACTURE
from forest.surface.bark.tree_bark import TreeBark, bark_tree
from forest.surface.bark.usual import FALLBACK, usual_preset
from forest.surface.blend.foot import Flare
from forest.surface.mesh import Mesh
from forest.surface.tubes import tubes
from tests.surface.bark_trees import forked, pole, wood_of

STRIP = 0.02
#: Fractures that nothing stops.
FREE = Material(
    fracture_stiffness=30.0,
    grain_m=0.01,
    least_piece_m=0.012,
    inglis=0.01,
    arrest=0.0,
    run_m=5.0,
    stray_deg=0.0,
    influence=0.0,
    stand_off=0.0,
)
EVEN = 2.0 * np.pi * np.arange(96) / 96


@cache
def oak(eccentricity: float = 0.0) -> TreeBark:
    tree = forked()
    wood = wood_of(tree, eccentricity=eccentricity)
    return bark_tree(tree, Preset.load("oak"), 3, wood=wood, strip_m=STRIP)


def widths_of(bark: TreeBark) -> np.ndarray:
    e = bark.bark.elements
    return np.add.reduceat(e.width, e.offsets[:-1])


def test_strips_lie_on_axes_that_are_thick_enough() -> None:
    tree = lay_strips(forked(), STRIP)
    assert [path.axis for path in tree.paths] == [0, 1]
    trunk, branch = tree.paths
    assert (trunk.low, trunk.high) == (0.0, 2.0)
    # the branch's lower side comes out of the trunk before its axis does
    assert 0.0 < branch.low < trunk.radius_at(np.array([1.0]))[0] * np.sqrt(2.0)
    g = tree.geometry
    assert g.width[tree.strips_of(0)].sum() == pytest.approx(2.0)
    inner = g.neighbour_up >= 0
    assert np.all(g.axis[g.neighbour_up[inner]] == g.axis[inner])
    assert (~inner).sum() == 2
    assert [p.axis for p in lay_strips(forked(), STRIP, least_radius_m=0.09).paths] == [0]


def test_strips_are_narrower_inside_a_bend() -> None:
    """By 1 - r / R on an arc of radius R (5.3)."""
    stem = pole(0.1, 2.0, 40)
    angle = np.linspace(0.0, 1.0, 41)
    place = 2.0 * np.column_stack((1.0 - np.cos(angle), 0.0 * angle, np.sin(angle)))
    bent = stem.__class__(**{**stem.__dict__, "start": place[:-1], "end": place[1:]})
    tree = lay_strips(bent, STRIP)
    factor = tree.geometry.width_around[len(tree.geometry.axis) // 2]
    assert factor.min() == pytest.approx(0.95, abs=0.005)
    assert factor.max() == pytest.approx(1.05, abs=0.005)
    inner = tree.paths[0].points(
        np.array([1.0]), np.array([(np.argmin(factor) + 0.5) / 16]), np.array([0.1])
    )
    centre = np.array((2.0, 0.0, 0.0))
    assert np.linalg.norm(inner[0] - centre) == pytest.approx(1.9, abs=0.01)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.05, 1.9), st.floats(0.0, 0.999), st.floats(0.2, 1.0))
def test_places_on_an_axis_are_found_again(v: float, turn: float, share: float) -> None:
    path = lay_strips(forked(), STRIP).paths[0]
    reach = share * path.radius_at(np.array([v]))
    back = path.locate(path.points(np.array([v]), np.array([turn]), reach))
    assert back[0] == pytest.approx([v], abs=1e-9)
    assert np.cos(2 * np.pi * (back[1] - turn)) == pytest.approx([1.0], abs=1e-9)
    assert back[2] == pytest.approx(reach)


def test_the_branching_is_passed_by_places_in_space() -> None:
    tree = lay_strips(forked(), STRIP)
    g, c = tree.geometry, tree.geometry.crossings
    trunk, branch = tree.paths
    onto = g.axis[c.to] == 1
    assert onto.any() and (~onto).any()
    assert np.all(c.goes[onto] == 1)  # a branch is met at its base
    for path, other, rows in ((trunk, branch, onto), (branch, trunk, ~onto)):
        v = g.along[c.strip[rows]]
        here = path.points(v, c.angle[rows], path.radius_at(v))
        w = g.along[c.to[rows]]
        there = other.points(w, c.enters[rows], other.radius_at(w))
        # outside on its own strip, and where it goes on is near
        assert np.linalg.norm(here - there, axis=1).max() < 4.0 * STRIP
    below = c.runs[onto] == 1
    lower = np.cos(2 * np.pi * (c.angle[onto][below])) > 0.0  # the branch points along x
    assert lower.all()


def test_a_fracture_goes_from_the_trunk_onto_the_branch() -> None:
    """It stops on the trunk where the branch stands, and one fracture has links on two axes."""
    tree = lay_strips(forked(), STRIP)
    girth = supposed_girths(tree, 30).girth
    from forest.surface.bark.growing import grow_bark

    bark = grow_bark(tree.geometry, girth[-2:], Material(**{**FREE.__dict__, "threshold": 2.0}), 1)
    start = int(tree.strips_of(0)[20])  # well below the branch, in its middle line
    torn = bark.trigger(start, 0.0005)
    axes = torn.strips.axis[torn.tears.strip]
    assert set(axes.tolist()) == {0, 1}
    assert np.unique(torn.tears.fracture).tolist() == [0]
    top = torn.strips.along[torn.tears.strip[axes == 0]].max()
    assert top < 1.1  # not past the branch on the trunk
    up = torn.tears.up
    linked = np.flatnonzero(up >= 0)
    crosses = axes[linked] != axes[up[linked]]
    assert crosses.sum() == 1


@pytest.mark.parametrize("name", preset_names())
def test_widths_add_up_to_the_girth(name: str) -> None:
    tree = forked()
    grown = bark_tree(tree, Preset.load(name), 1, wood=wood_of(tree), strip_m=STRIP)
    assert widths_of(grown) == pytest.approx(grown.history.girth[-1], rel=1e-12)
    assert grown.bark.strips.girth == pytest.approx(grown.history.girth[-1])


def test_girths_are_those_of_the_rings() -> None:
    skeleton = forked()
    wood = wood_of(skeleton)
    tree = lay_strips(skeleton, 0.2 / 9.0)  # a strip in the middle of each of the internodes
    history = recorded_girths(tree, wood)
    assert history.dilatation is None
    assert history.times.tolist() == wood.years.tolist()
    path = tree.paths[0]
    strips = tree.strips_of(0)
    for v, row in zip(path.middle, path.rows, strict=True):
        strip = strips[np.argmin(np.abs(tree.geometry.along[strips] - v))]
        assert tree.geometry.along[strip] == pytest.approx(v)
        assert history.girth[:, strip] == pytest.approx(2 * np.pi * wood.radius[:, row])


def test_strips_are_there_once_their_wood_is() -> None:
    skeleton = forked()
    wood = wood_of(skeleton)
    wood.radius[:6, 5:10] = 0.0  # the upper trunk
    history = recorded_girths(lay_strips(skeleton, STRIP), wood)
    tree = lay_strips(skeleton, STRIP)
    young = np.isnan(history.girth[5, tree.strips_of(0)])
    assert np.array_equal(young, tree.geometry.along[tree.strips_of(0)] > 1.0)
    assert not np.isnan(history.girth[6]).any()
    grown = bark_tree(skeleton, Preset.load("oak"), 1, wood=wood, strip_m=STRIP)
    assert grown.at(2006).maps(64, axes=(0,))[0].length_m == pytest.approx(1.0)


def test_eccentric_rings_stretch_the_thick_side() -> None:
    tree = lay_strips(forked(), STRIP)
    even = recorded_girths(tree, wood_of(tree.skeleton))
    uneven = recorded_girths(tree, wood_of(tree.skeleton, eccentricity=0.5))
    assert uneven.girth[-1] == pytest.approx(even.girth[-1], rel=2e-3)  # circles off their pith
    assert uneven.dilatation is not None
    strip = tree.strips_of(0)[30]
    side = tree.paths[0].side[0]
    east = int(np.mod(np.arctan2(-side[1], side[0]) / (2 * np.pi), 1.0) * GROWING) % GROWING
    first = uneven.dilatation[0, strip]
    assert first[east] > 1.2 * first[(east + GROWING // 2) % GROWING]


def test_measured_girths_are_those_at_breast_height() -> None:
    """Rings are as wide everywhere: elsewhere the tree was thinner by as much."""
    tree = lay_strips(forked(), STRIP)
    years, girth = np.array([1990.0, 2000.0, 2010.0]), np.array([0.4, 0.5, 0.8])
    history = measured_girths(tree, years, girth)
    assert history.times.tolist() == years.tolist()
    now = history.girth[-1]
    trunk = tree.strips_of(0)
    breast = trunk[np.argmin(np.abs(tree.geometry.along[trunk] - 1.3))]
    assert history.girth[:, breast] == pytest.approx(now[breast] * girth / 0.8, rel=0.01)
    for row in history.girth:
        there = ~np.isnan(row)
        assert np.ptp((now - row)[there]) < 1e-9
    grown = bark_tree(forked(), Preset.load("oak"), 1, history=history, strip_m=STRIP)
    assert widths_of(grown) == pytest.approx(now)
    for wrong in (
        (years[::-1], girth),
        (years, girth[::-1]),
        (years, 0.0 * girth),
        (years, years[:2]),
    ):
        with pytest.raises(InputError, match="bark: history"):
            measured_girths(tree, *wrong)


def test_girths_are_read_or_refused(tmp_path: Path) -> None:
    file = tmp_path / "girths.csv"
    file.write_text("year,plot,girth_cm\n1990,A,40\n2000,A,52.5\n")
    years, girth = read_girths(file)
    assert years.tolist() == [1990.0, 2000.0]
    assert girth == pytest.approx([0.4, 0.525])
    for text, message in (
        ("", "is empty; expected columns year, girth_cm"),
        ("year,girth\n1990,40\n", "line 1 has no column 'girth_cm'"),
        ("year,girth_cm\n", "holds no row"),
        ("year,girth_cm\n1990,40\n", "holds one year"),
        ("year,girth_cm\n1990,40\n1990,41\n", "line 3: year 1990 after 1990"),
        ("year,girth_cm\n1990,40\n1991,39\n", "line 3: girth_cm 39 after 40"),
        ("year,girth_cm\n1990,40\n1991,-1\n", "line 3: girth_cm is '-1'"),
        ("year,girth_cm\n1990.5,40\n1991,41\n", "line 2: year is '1990.5'"),
        ("year,girth_cm\n1990,nan\n1991,41\n", "line 2: girth_cm is 'nan'"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=message):
            read_girths(file)
    with pytest.raises(InputError, match=r"no\.csv"):
        read_girths(tmp_path / "no.csv")


def test_roots_bulge() -> None:
    tree = lay_strips(forked(), STRIP)
    plain = recorded_girths(tree, wood_of(tree.skeleton))
    flared = recorded_girths(tree, wood_of(tree.skeleton), flare=Flare(lobes=4, depth=1.0))
    assert flared.girth[-1, 0] > 1.15 * plain.girth[-1, 0]
    top = tree.geometry.along > 3.0 * 0.15
    assert flared.girth[-1, top] == pytest.approx(plain.girth[-1, top])


@settings(max_examples=25, deadline=None)
@given(st.floats(0.05, 0.4), st.floats(1.0, 2.0), st.floats(1.0, 2.0))
def test_radial_projection_of_a_circle_onto_an_ellipse(r: float, a: float, b: float) -> None:
    """Sectors stretch by the arcs that the same rays cut out; the sum is the ellipse's girth."""
    cosine, sine = np.cos(EVEN), np.sin(EVEN)
    ellipse = 1.0 / np.sqrt((cosine / (a * r)) ** 2 + (sine / (b * r)) ** 2)
    growth, spread = radial_projection(np.full((1, 96), r), ellipse[None])
    t = np.linspace(0.0, 2.0 * np.pi, 4001)
    exact = np.hypot(np.diff(a * r * np.cos(t)), np.diff(b * r * np.sin(t))).sum()
    assert growth[0] * 2 * np.pi * r == pytest.approx(exact, rel=2e-3)
    if a > 1.0001 or b > 1.0001:
        mean = np.mean(spread) + 1.0
        assert mean == pytest.approx(growth[0], rel=1e-6)


def cone(low: float, high: float) -> Mesh:
    stem = pole(1.0, 1.2, 60)
    middle = (np.arange(60) + 0.5) / 60
    radius = low + (high - low) * middle
    return tubes(
        stem.__class__(**{**stem.__dict__, "radius": radius}), tolerance_m=1e-5, most_sides=192
    )


def test_two_cones_are_linked_by_radial_projection() -> None:
    stem = pole(0.1, 1.0, 10)
    tree = lay_strips(stem, 0.05)
    history = linked_girths(tree, [cone(0.1, 0.06), cone(0.2, 0.12)])
    share = tree.geometry.along / 1.2
    for row, low in ((0, 0.1), (1, 0.2)):
        expected = 2 * np.pi * low * (1.0 - 0.4 * share)
        assert history.girth[row] == pytest.approx(expected, rel=0.01)
    assert history.dilatation is not None
    assert history.dilatation == pytest.approx(1.0, rel=0.05)  # all doubled
    with pytest.raises(InputError, match="thinner"):
        linked_girths(tree, [cone(0.2, 0.12), cone(0.1, 0.06)])
    small = lay_strips(pole(0.1, 3.0, 10), 0.05)
    with pytest.raises(InputError, match="does not go around"):
        outlines_of(cone(0.1, 0.06), small)


def test_a_cone_and_an_ellipse() -> None:
    tree = lay_strips(pole(0.1, 1.0, 10), 0.05)
    round_one = cone(0.1, 0.1)
    flat = Mesh(
        round_one.points * (3.0, 1.0, 1.0), round_one.triangles, round_one.uv, round_one.data
    )
    history = linked_girths(tree, [round_one, flat])
    assert perimeter(outlines_of(flat, tree)) == pytest.approx(1.3365, rel=5e-3)  # Ramanujan
    assert history.dilatation is not None
    spread = history.dilatation[0, 5].reshape(4, -1).mean(axis=1)
    side = tree.paths[0].side[0]
    assert abs(side[0]) == pytest.approx(1.0)
    assert history.dilatation[0, 5].min() < 0.2
    assert history.dilatation[0, 5].max() > 2.0 * spread.min()


def bulged(factor: float) -> np.ndarray:
    """Widen one side of a round stem."""
    return 0.1 * (1.0 + factor * np.maximum(np.cos(EVEN), 0.0)) * np.ones((50, 1))


def test_two_shapes_become_bark() -> None:
    """Shapes linked by radial projection tear where the second one bulges."""
    stem = pole(0.1, 1.0, 10)
    tree = lay_strips(stem, STRIP)
    history = linked_girths(tree, [bulged(0.0), 1.05 * bulged(0.0), 1.2 * bulged(1.0)])
    grown = bark_tree(stem, Preset.load("oak"), 1, history=history, law="conserved", strip_m=STRIP)
    assert grown.time == 2.0
    assert widths_of(grown) == pytest.approx(perimeter(1.2 * bulged(1.0)))
    e = grown.bark.elements
    strip = np.repeat(np.arange(50), np.diff(e.offsets))
    rows = e.kind == FRACTURE
    turn = (e.start + 0.5 * e.width)[rows] / grown.bark.strips.girth[strip[rows]]
    opened = e.width[rows] * (np.cos(2.0 * np.pi * turn) > 0.0)
    assert opened.sum() > 0.6 * e.width[rows].sum()
    assert grown.at(1.0).bark.elements.width.sum() < e.width.sum()
    assert grown.maps(64)[0].width_m == pytest.approx(history.girth[-1].mean())
    meshes = linked_girths(tree, [cone(0.1, 0.1), cone(0.2, 0.18)])
    by_preset = bark_tree(stem, Preset.load("oak"), 1, history=meshes, strip_m=STRIP)
    assert len(by_preset.bark.tears.strip) > 20
    assert widths_of(by_preset) == pytest.approx(meshes.girth[-1])


def test_a_history_that_does_not_fit_is_refused() -> None:
    stem, oak_bark = pole(), Preset.load("oak")
    tree = lay_strips(stem, STRIP)
    history = linked_girths(tree, [bulged(0.0), bulged(0.5)])
    with pytest.raises(InputError, match="beside wood"):
        bark_tree(stem, oak_bark, history=history, wood=wood_of(stem), strip_m=STRIP)
    with pytest.raises(InputError, match="girths of"):
        bark_tree(stem, oak_bark, history=history, strip_m=0.1)
    spread = history.dilatation
    assert spread is not None
    for wrong, message in (
        (history._replace(times=np.array([1.0, 1.0])), "do not rise"),
        (history._replace(dilatation=spread[:, :9]), "dilatation of"),
        (history._replace(girth=history.girth * [[1.0], [np.nan]]), "no girth at the end"),
    ):
        with pytest.raises(InputError, match=message):
            bark_tree(stem, oak_bark, history=wrong, strip_m=STRIP)
    with pytest.raises(InputError, match="no outline"):
        linked_girths(tree, [bulged(0.0), bulged(0.5)[:, :50]])


def test_cracks_only_widen() -> None:
    """Time goes on without jumps: what is torn stays, at its place, and opens (shares of turns)."""
    grown = oak()
    before, opened, places = set(), {}, {}
    for year in (2004, 2006, 2008, 2010, 2012):
        moment = grown.at(year).bark
        e, strips = moment.elements, moment.strips
        strip = np.searchsorted(e.offsets, np.arange(len(e.kind)), side="right") - 1
        rows = np.flatnonzero(e.kind == FRACTURE)
        assert before <= set(e.tear[rows].tolist())
        before = set(e.tear[rows].tolist())
        for row in rows:
            name = int(e.tear[row])
            place = e.uv0[row] / strips.rest[strip[row]]
            assert places.setdefault(name, place) == pytest.approx(place, abs=1e-9)
            assert e.width[row] >= opened.get(name, 0.0) * (1.0 - 1e-12)
            opened[name] = e.width[row]
    assert len(before) > 50
    last, now = grown.at(2012).bark, grown.bark
    assert np.array_equal(last.elements.width, now.elements.width)


def test_bark_of_an_earlier_time_is_to_look_at() -> None:
    """Widths are drawn at that time's scale; the epidermis stays as long as it is, to the bit."""
    moment = oak().at(2006)
    bark, cut = moment.bark, moment.piece(0, 0.5, 1.0)
    assert not hasattr(bark, "grow") and not hasattr(cut, "trigger")
    assert bark.scale.max() < 1.0 and (oak().bark.scale == 1.0).all()
    for view in (bark, cut):
        e = view.elements
        own = np.where(e.kind == FRACTURE, 0.0, e.rest)
        assert np.array_equal(np.add.reduceat(own, e.offsets[:-1]), view.strips.rest)
        assert np.add.reduceat(e.width, e.offsets[:-1]) == pytest.approx(view.strips.girth)
    assert np.array_equal(bark.strips.rest, oak().bark.strips.rest)
    began = cut.fractures.origin
    assert (cut.tears.fracture[began[began >= 0]] == np.flatnonzero(began >= 0)).all()


def test_same_bits_again() -> None:
    one, two = oak(), oak.__wrapped__()
    for a, b in zip(one.bark.elements, two.bark.elements, strict=True):
        assert np.array_equal(a, b)
    tree = forked()
    other = bark_tree(tree, Preset.load("oak"), 4, wood=wood_of(tree), strip_m=STRIP)
    assert len(other.bark.elements.width) != len(one.bark.elements.width)


def test_plates_tear_again_over_the_years() -> None:
    tree = forked(radius_m=0.2)
    pine = Preset.load("pine")
    grown = bark_tree(tree, pine, 1, wood=wood_of(tree, 16), strip_m=STRIP)
    assert grown.bark.surface is not None
    moments = [grown.at(year) for year in (2006, 2010, 2016)]
    elements = [moment.bark.elements for moment in moments]
    share = [e.width[e.kind == FRACTURE].sum() for e in elements]
    assert share[0] <= share[1] <= share[2]
    moments[1].maps(64, axes=(0,))


def test_plates_tear_more_on_the_thick_side() -> None:
    """Rings thick to one side open pine's second fractures there too."""
    tree = forked(radius_m=0.2)
    pine = Preset.load("pine")
    share = []
    for eccentricity in (0.0, 0.8):
        wood = wood_of(tree, 16, eccentricity=eccentricity)
        grown = bark_tree(tree, pine, 1, wood=wood, strip_m=STRIP)
        e = grown.bark.elements
        assert grown.bark.surface is not None
        strip = np.repeat(np.arange(len(e.offsets) - 1), np.diff(e.offsets))
        turn = (e.start + 0.5 * e.width) / grown.bark.strips.girth[strip]
        side = grown.tree.paths[0].side[0]
        east = np.arctan2(-side[1], side[0]) / (2.0 * np.pi)
        rows = (e.kind == FRACTURE) & (grown.bark.strips.axis[strip] == 0)
        near = np.cos(2.0 * np.pi * (turn - east)) > 0.0
        share.append(e.width[rows & near].sum() / e.width[rows].sum())
    assert share[0] == pytest.approx(0.5, abs=0.05)
    assert share[1] > share[0] + 0.03


@pytest.mark.parametrize("settings_", [{"shrink": True}, {"law": "conserved"}, {"years": 20}])
def test_other_ways_to_grow(settings_: dict) -> None:  # type: ignore[type-arg]
    grown = bark_tree(forked(), Preset.load("oak"), 1, strip_m=STRIP, **settings_)
    assert widths_of(grown) == pytest.approx(grown.bark.strips.girth)
    assert len(grown.bark.tears.strip) > 20
    maps = grown.maps(64)
    assert set(maps) == {0, 1}
    assert maps[1].colour.shape[1] <= maps[0].colour.shape[1]


def test_maps_of_a_part_of_the_trunk() -> None:
    whole, part = (
        oak().maps((64, 200), axes=(0,))[0],
        oak().maps((64, 64), axes=(0,), low_m=0.5, high_m=1.14)[0],
    )
    assert part.length_m == pytest.approx(0.64, abs=STRIP)
    assert part.width_m < whole.width_m * 1.1
    with pytest.raises(InputError, match="no bark from"):
        oak().maps(64, low_m=5.0, high_m=6.0)
    with pytest.raises(InputError, match="axis 9"):
        oak().maps(64, axes=(9,))


def test_maps_lie_on_the_wood() -> None:
    grown = oak()
    wood = tubes(grown.tree.skeleton)
    parts = dressed_parts(grown, wood, 64)
    assert sum(len(part.mesh.triangles) for part in parts) == len(wood.triangles)
    assert {part.name for part in parts} >= {"bark_0", "bark_1"}
    together = Mesh.together([part.mesh for part in parts])
    assert together.volume == pytest.approx(wood.volume)
    trunk = parts[0].mesh
    assert trunk.uv[..., 1].min() >= -0.2
    assert trunk.uv[..., 1].max() <= 1.2
    assert np.ptp(trunk.uv[..., 0], axis=1).max() <= 0.5 + 1e-9  # none spans the seam


def test_bark_as_geometry_is_closed() -> None:
    grown = oak()
    parts = displaced_parts(grown, 0.02)
    for part in parts:
        assert part.mesh.is_watertight
        assert part.mesh.volume > 0.0
        assert set(part.mesh.genus().tolist()) == {0}
    skeleton = grown.tree.skeleton
    trunk = np.pi * np.sum(skeleton.radius[:10] ** 2) * 0.2
    assert parts[0].mesh.volume < trunk  # cracks are carved out of it
    assert parts[0].mesh.volume > 0.8 * trunk
    relief = np.linalg.norm(parts[0].mesh.points[:, :2], axis=1)
    assert relief.std() > 0.002
    with pytest.raises(InputError, match="cells"):
        displaced_parts(grown, 1e-5)


def test_folds_hang_in_the_crotch() -> None:
    (fold,) = oak().folds(0)
    path = oak().tree.paths[0]
    point = path.points(
        np.array([fold.v_m]), np.array([fold.turn]), path.radius_at(np.array([fold.v_m]))
    )
    assert point[0, 0] > 0.1  # on the branch's side
    assert 1.0 < fold.v_m < 1.4  # above its axis


def test_refusals() -> None:
    preset = Preset.load("oak")
    with pytest.raises(InputError, match="no wood thicker"):
        bark_tree(pole(0.01), preset)
    with pytest.raises(InputError, match="law 'none'"):
        bark_tree(pole(), preset, law="none")
    with pytest.raises(InputError, match="strips of no width"):
        lay_strips(pole(), 0.0)
    with pytest.raises(InputError, match="no axis of a radius"):
        lay_strips(pole(0.1, 1.0), 0.5)
    for column in ("radius", "start", "end"):
        values = getattr(pole(), column).copy()
        values[3] = np.nan
        stem = replace(pole(), **{column: values})
        with pytest.raises(InputError, match=f"internode 3 of tree .* has a {column} that is no"):
            bark_tree(stem, preset)
    with pytest.raises(InputError, match="no girth at 1990"):
        oak().at(1990)
    with pytest.raises(InputError, match="two or more"):
        linked_girths(lay_strips(pole(), 0.1), [cone(0.1, 0.1)])


def test_usual_presets() -> None:
    known = preset_names()
    names = ("quercus_robur", "betula_pendula", "quaking_aspen", "balsam_fir", "queen_palm")
    found = [usual_preset(name) for name in names]
    assert found == ["oak", "birch", "aspen", "spruce", FALLBACK]
    assert set(found) <= set(known)
