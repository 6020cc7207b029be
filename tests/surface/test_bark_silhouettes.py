"""Outlines of fractures and the rows drawn from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface.bark import Bark, Material, StripGeometry, grow_bark, shrinking
from forest.surface.bark.outlines import Relief, fields, fields_at, profile_of, rows_of
from forest.surface.bark.silhouettes import Silhouettes, silhouettes
from forest.surface.bark.textures import grow_tile
from tests.reference.silhouettes import field_at

MATERIAL = Material(fracture_stiffness=20.0, least_piece_m=0.01, grain_m=0.004, stray_deg=15.0)


def tile(seed: int = 0, ratio: float = 1.4, strips: int = 40) -> Bark:
    return grow_tile(0.5, 0.4, MATERIAL, ratio, strips, seed, 6)


def plain_relief(rows: int, **changed: float) -> Relief:
    values = {"depth": 0.02, "per_width": 1.5, "shoulder": 0.2, "reach": 0.005, "fray": 0.0}
    values |= changed
    columns = {name: np.full(rows, value) for name, value in values.items()}
    return Relief(
        **columns, profile=profile_of(((0.0, 0.0), (1.0, 1.0))), opening=0, fray_length=0.05, seed=1
    )


def test_rows_through_the_middle_of_strips_are_the_strips() -> None:
    bark = tile(3)
    v = bark.strips.along
    found = fields(silhouettes(bark), plain_relief(len(v)), v, 4000)
    torn = np.where(bark.elements.kind == 1, bark.elements.width, 0.0)
    share = np.add.reduceat(torn, bark.elements.offsets[:-1]) / bark.strips.girth
    np.testing.assert_allclose((found.fracture >= 0).mean(axis=1), share, atol=30 / 4000)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 1000), ratio=st.floats(1.05, 2.0))
def test_epidermis_is_neither_lost_nor_made(seed: int, ratio: float) -> None:
    """What of the epidermis is seen in a row, added up, is its own length in every row."""
    bark = tile(seed, ratio)
    outlines = silhouettes(bark)
    n = 3000
    v = rows_of(outlines.length, 25, outlines.low)
    found = fields(outlines, plain_relief(25), v, n)
    e = found.epidermis.astype(np.float64)
    step = np.diff(np.column_stack((e, e[:, :1] + 1.0)), axis=1)
    np.testing.assert_allclose(step.sum(axis=1), 1.0, atol=1e-6)
    whole = found.fracture >= 0
    both = whole & np.roll(whole, -1, axis=1) & (found.fracture == np.roll(found.fracture, -1, 1))
    np.testing.assert_allclose(step[both], 0.0, atol=1e-6)
    # On epidermis it advances by no more than bark that was never stretched.
    assert step[~both].min() > -0.02
    opened = 1.0 - whole.mean()
    assert opened * bark.strips.girth[0] >= 0.97 * bark.strips.rest[0]


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 1000),
    turn=st.floats(0.0, 1.0),
    up=st.floats(0.0, 1.0),
    fray=st.sampled_from((0.0, 0.004)),
)
def test_points_as_the_slow_twin_has_them(seed: int, turn: float, up: float, fray: float) -> None:
    bark = tile(seed)
    outlines = silhouettes(bark)
    v = outlines.low + up * 0.999 * outlines.length
    relief = plain_relief(1, fray=fray)
    found = fields_at(outlines, relief, np.array([turn]), np.array([v]))
    depth, epidermis, inside = field_at(outlines, relief, turn, v)
    assert float(found.depth[0, 0]) == pytest.approx(depth, abs=1e-6)
    assert bool(found.fracture[0, 0] >= 0) == inside
    off = float(found.epidermis[0, 0]) - epidermis
    assert off - round(off) == pytest.approx(0.0, abs=1e-5)


def test_tiles_continue_over_their_edges() -> None:
    """Rows just above the top are rows just above the bottom, and columns go on around."""
    outlines = silhouettes(tile(7))
    assert outlines.cyclic
    step = outlines.length / 500
    v = np.array([outlines.low + 1e-9, outlines.low + outlines.length - 1e-9, outlines.low + step])
    depth = fields(outlines, plain_relief(3, fray=0.003), v, 800).depth
    np.testing.assert_allclose(depth[0], depth[1], atol=1e-5)
    assert np.abs(depth[0] - depth[2]).max() > 1e-4


def test_turned_bark_gives_a_turned_picture() -> None:
    bark = tile(5)
    turned = bark.elements._replace(start=bark.elements.start + 0.5 * bark.strips.girth[0])
    other = silhouettes(type(bark)(**{**vars(bark), "elements": turned}))
    v = rows_of(0.4, 30)
    one = fields(silhouettes(bark), plain_relief(30), v, 512)
    two = fields(other, plain_relief(30), v, 512)
    np.testing.assert_allclose(np.roll(one.depth, 256, axis=1), two.depth, atol=1e-6)


def test_threads_do_not_matter() -> None:
    outlines = silhouettes(tile(2))
    v = rows_of(0.4, 70)
    with using_threads(1):
        one = fields(outlines, plain_relief(70, fray=0.002), v, 333)
    with using_threads(3):
        three = fields(outlines, plain_relief(70, fray=0.002), v, 333)
    for a, b in zip(one, three, strict=True):
        assert np.array_equal(a, b)


def test_openings_measure_from_where_the_surface_is_old() -> None:
    """New surface on the axis: the borders are old; at both borders: the axis is (figure 13)."""
    outlines = silhouettes(tile(4))
    v = rows_of(outlines.length, 20, outlines.low)
    near = []
    for opening in range(3):
        found = fields(outlines, plain_relief(20)._replace(opening=opening), v, 2000)
        edge = (found.fracture >= 0) & (found.inside < 3e-4)
        near.append(np.abs(found.across[edge]))
    assert near[0].max() < 1e-3  # old at both borders
    assert np.percentile(near[1], 75) > 1e-3  # one border is old, the other is not
    assert np.percentile(near[1], 25) < 3e-4
    assert np.median(near[2]) > 1e-3  # neither


def test_a_whole_axis_is_open_at_its_ends() -> None:
    geometry = StripGeometry.column(30, 0.02)
    bark = grow_bark(geometry, shrinking(np.linspace(0.8, 0.5, 30), 0.7), MATERIAL, 1)
    outlines = silhouettes(bark)
    assert isinstance(outlines, Silhouettes)
    assert not outlines.cyclic
    assert (outlines.low, outlines.length) == pytest.approx((0.0, 0.6))
    v = rows_of(0.6, 64)
    assert outlines.at(outlines.girth, v)[0] == pytest.approx(0.5, abs=0.01)
    found = fields(outlines, plain_relief(64), v, 1500)
    assert (found.fracture[0] >= 0).mean() == pytest.approx(0.3, abs=0.06)
    with pytest.raises(InputError, match="no axis 3"):
        silhouettes(bark, 3)


def test_whole_bark_is_one_epidermis() -> None:
    bark = grow_bark(StripGeometry.column(5, 0.1), np.full((2, 5), 0.7), MATERIAL, 1)
    found = fields(silhouettes(bark), plain_relief(4), rows_of(0.5, 4), 32)
    assert (found.fracture == -1).all()
    np.testing.assert_allclose(np.diff(found.epidermis, axis=1), 1 / 32, atol=1e-6)


def test_fractures_that_met_head_on_are_one_opening() -> None:
    bark = tile(11)
    outlines = silhouettes(bark)
    names = np.unique(outlines.fracture)
    assert 0 < len(names) < len(bark.fractures.origin)
    for k in range(len(outlines.offsets) - 1):
        rows = slice(outlines.offsets[k], outlines.offsets[k + 1])
        ends = outlines.half[rows, :2]
        assert ends.min() >= 0.0
        assert ends.max(axis=1).min() > 0.0  # no piece is nothing
    tips = (
        outlines.half[: outlines.offsets[-2], :2] == 0.0
    )  # without the interval that is there twice
    assert tips.sum() < 2 * len(bark.fractures.origin)
