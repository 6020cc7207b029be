"""Bark for tests: columns of strips, random materials, checks that always hold."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import strategies as st

from forest.surface.bark import EPIDERMIS, FRACTURE, Bark, Material, StripGeometry, grow_bark


def column(strips: int = 40, width_m: float = 0.02) -> StripGeometry:
    return StripGeometry.column(strips, width_m)


def grown(
    strips: int = 40,
    first: float = 0.4,
    last: float = 0.8,
    steps: int = 12,
    seed: int = 1,
    width_m: float = 0.02,
    keep: bool = False,
    substeps: int = 1,
    **material: Any,
) -> Bark:
    """Grow a column by the same ratio every step."""
    girth = np.geomspace(first, last, steps + 1)[:, None] * np.ones(strips)
    geometry = column(strips, width_m)
    return grow_bark(geometry, girth, Material(**material), seed, keep=keep, substeps=substeps)


def strip_of(bark: Bark) -> np.ndarray[Any, Any]:
    """Which strip each element is in."""
    return np.repeat(np.arange(len(bark.strips.axis)), np.diff(bark.elements.offsets))


def torn(bark: Bark) -> np.ndarray[Any, Any]:
    """Fractures of each strip."""
    is_torn = bark.elements.kind == FRACTURE
    return np.bincount(strip_of(bark)[is_torn], minlength=len(bark.strips.axis))


def statistics(bark: Bark) -> dict[str, float]:
    """What an onlooker would count."""
    f, area = bark.fractures, float(np.sum(bark.strips.girth * bark.strips.width))
    opened = f.length * f.width
    return {
        "fractures across a girth": float(torn(bark).mean()),
        "fractures per m2": len(f.length) / area,
        "length": float(np.average(f.length, weights=opened)),
        "share": float(opened.sum() / area),
        "width": float(opened.sum() / f.length.sum()),
    }


def check(bark: Bark) -> None:
    """Check all that holds for any bark."""
    e, strips = bark.elements, bark.strips
    for s in range(len(strips.axis)):
        one = e.of(s)
        n = len(one.kind)
        assert n == 1 or n % 2 == 0
        assert (one.kind == np.arange(n) % 2).all()  # they alternate
        assert abs(one.width.sum() - strips.girth[s]) < 1e-12
        assert np.allclose(np.diff(one.start), one.width[:-1], atol=1e-12)
        # The epidermis is conserved, to the bit and in exact numbers.
        skin = one.kind == EPIDERMIS
        assert one.rest[skin].sum() == strips.rest[s]
        assert sum(map(Fraction, one.rest[skin])) == Fraction(strips.rest[s])
        assert (one.rest[skin] > 0).all() and (one.width >= one.rest - 1e-12).all()
        begins = np.mod(one.uv0[skin] + one.rest[skin], strips.rest[s])
        assert n == 1 or (begins == np.roll(one.uv0[skin], -1)).all()
    _check_skeleton(bark)


def _check_skeleton(bark: Bark) -> None:
    """Check that every fracture is one path of tears, linked both ways, over adjacent strips."""
    t, f, strips = bark.tears, bark.fractures, bark.strips
    for k in range(len(f.origin)):
        own = np.flatnonzero(t.fracture == k)
        assert len(own) == f.strips[k] and f.origin[k] in own
        assert abs(strips.width[t.strip[own]].sum() - f.length[k]) < 1e-9
        links = np.concatenate([t.up[own], t.down[own]])
        links = links[links >= 0]
        assert len(links) == 2 * (len(own) - 1) and np.isin(links, own).all()
    for node in np.flatnonzero(t.up >= 0):
        above = t.up[node]
        assert node in (t.down[above], t.up[above])
        if strips.axis[t.strip[node]] == strips.axis[t.strip[above]]:
            assert strips.neighbour_up[t.strip[node]] == t.strip[above]


@st.composite
def materials(draw) -> Material:  # type: ignore[no-untyped-def]
    """Any sound material."""
    soft: Any = draw(st.sampled_from([5.0, 20.0, 80.0, ((0.0, 40.0), (0.01, 8.0))]))
    return Material(
        fracture_stiffness=soft,
        threshold_jitter=draw(st.sampled_from([0.0, 0.3, 1.0])),
        attachment=draw(st.sampled_from([0.0, 10.0, 1e4])),
        place_jitter=draw(st.sampled_from([0.0, 1.0])),
        least_piece_m=draw(st.sampled_from([0.002, 0.02])),
        inglis=draw(st.sampled_from([0.0, 4.0, 40.0])),
        arrest=draw(st.sampled_from([0.0, 0.5, 1.0])),
        run_m=draw(st.sampled_from([0.02, np.inf])),
        stray_deg=draw(st.sampled_from([0.0, 10.0, 60.0])),
        stand_off=draw(st.sampled_from([0.0, 1.0])),
    )
