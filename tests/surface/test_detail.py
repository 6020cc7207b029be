"""Shares by range and the loop over masses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.surface import Sight, fractions
from forest.surface.detail import SEASONS, drawn
from tests.reference import detail as slow

RANGES = st.floats(0.0, 5000.0)
SIGHTS = st.builds(
    Sight,
    season=st.sampled_from(SEASONS),
    quality=st.floats(0.05, 2.0),
    image_height=st.floats(100.0, 4000.0),
    field_of_view_deg=st.floats(1.0, 120.0),
)


@given(st.integers(0, 400), st.floats(0.0, 1.0), st.sampled_from([4, 8, 16]))
@settings(max_examples=100, deadline=None)
def test_the_loop_is_the_paper_s(total: int, share: float, mass: int) -> None:
    assert list(drawn(total, share, mass)) == slow.loop(total, share * mass, mass)


def test_the_paper_s_example() -> None:
    """160 cross sections and 5.3 of 16: three masses show 6, seven show 5."""
    counts = np.bincount(drawn(160, 5.3 / 16, 16) // 16)
    assert list(counts) == [6] * 3 + [5] * 7


@given(RANGES, SIGHTS, st.booleans())
@settings(max_examples=100, deadline=None)
def test_shares_are_the_twin_s(range_m: float, sight: Sight, evergreen: bool) -> None:
    found = fractions(range_m, sight, evergreen=evergreen)
    r2 = range_m * 1000.0 / sight.image_height * sight.field_of_view_deg / 60.0
    halved = evergreen or sight.season in ("summer", "fall")
    s = sight.quality / 2.0 if halved else sight.quality
    stems = np.array([slow.stem_shares(level, r2, s) for level in range(3)])
    leaves = slow.leaf_shares(r2, sight.season, evergreen)
    np.testing.assert_allclose(found.stem_polygons, stems[:, 0], atol=1e-9)
    np.testing.assert_allclose(found.stem_lines, stems[:, 1], atol=1e-9)
    np.testing.assert_allclose((found.leaf_polygons, found.leaf_points), leaves, atol=1e-9)


@given(st.lists(RANGES, min_size=2, max_size=20), SIGHTS, st.booleans(), st.integers(1, 300))
@settings(max_examples=25, deadline=None)
def test_farther_never_draws_more(
    ranges: list[float], sight: Sight, evergreen: bool, total: int
) -> None:
    """But for the trunk's line, which would be a seam on a trunk seen near by."""
    far = fractions(sorted(ranges), sight, evergreen=evergreen)
    for share, mass in (
        *((far.stem_polygons[:, k], 16) for k in range(3)),
        *((far.stem_lines[:, k], 16) for k in (1, 2)),
        (far.leaf_polygons, 4),
        (far.leaf_points, 8),
    ):
        counts = [len(drawn(total, float(f), mass)) for f in share]
        assert counts == sorted(counts, reverse=True)


@given(st.integers(0, 2000), st.floats(0.0, 1.0), st.sampled_from([4, 8, 16]))
@settings(max_examples=50, deadline=None)
def test_as_many_are_drawn_as_asked(total: int, share: float, mass: int) -> None:
    assert abs(len(drawn(total, share, mass)) - share * total) <= mass


def test_a_bigger_picture_or_a_telephoto_lens_brings_a_tree_near() -> None:
    near = fractions(100.0, evergreen=True)
    for sight in (Sight(image_height=2000.0), Sight(field_of_view_deg=30.0)):
        far = fractions(200.0, sight, evergreen=True)
        assert all(np.array_equal(a, b) for a, b in zip(near, far, strict=True))


def test_bare_trees_show_their_branches() -> None:
    bare = fractions(150.0, Sight(season="winter"), evergreen=False)
    green = fractions(150.0, Sight(season="winter"), evergreen=True)
    assert bare.leaf_points == bare.leaf_polygons == 0.0
    assert green.leaf_points == 1.0
    assert bare.stem_lines[2] > green.stem_lines[2]


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        ({"season": "sumer"}, "did you mean 'summer'"),
        ({"quality": 0.0}, "quality is 0; expected above 0 and at most 10"),
        ({"quality": 1e9}, "quality is 1e\\+09"),
        ({"image_height": np.nan}, "image_height"),
        ({"field_of_view_deg": 180.0}, "below 180"),
    ],
)
def test_wrong_sights_are_refused(wrong: dict[str, object], hint: str) -> None:
    with pytest.raises(InputError, match=hint):
        Sight(**wrong)  # type: ignore[arg-type]


def test_a_range_behind_the_eye_is_refused() -> None:
    with pytest.raises(InputError, match="below 0"):
        fractions([10.0, -1.0], evergreen=True)
