"""Numbers and figures of Lefebvre & Neyret 2002 that can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from forest.surface.bark import Material, fracture_range, grow_bark, shrinking
from forest.surface.bark.equilibrium import equilibrium
from tests.benchmarks.bark import branched, paper_bark
from tests.surface.bark_cases import check, column, torn


def test_a_broken_element() -> None:
    """Figure 7: e' = e K_f / (K_s + K_f), and the fracture is as wide as e - e'."""
    stiff, soft, rest, length = 3.0, 0.5, 1.0, 1.2
    x = equilibrium(
        np.array([stiff, soft]), np.array([rest, 0.0]), np.zeros(2), np.zeros(2), length
    )
    shortened = (length - rest) * soft / (stiff + soft)
    assert x[1] - x[0] - rest == pytest.approx(shortened)
    assert length - (x[1] - x[0]) == pytest.approx(length - rest - shortened)


def test_the_range_of_s() -> None:
    """3.2.3 with R 2, l0 0.5 (K_s 4), K_f 1 and growth by 1.1: S > 1 + 0.1 / 5."""
    material = Material(stiffness=2.0, fracture_stiffness=1.0)
    assert fracture_range(material, np.array([1.1]), np.array([0.5])) == pytest.approx([1.02])


def test_threshold_at_the_growing_rate_keeps_a_density() -> None:
    """Figures 22b, 22c: as many fractures per metre, or as many on every strip."""
    girth = np.linspace(1.2, 0.6, 60)
    even = grow_bark(column(60), shrinking(girth, 0.6), Material())
    assert np.polyfit(girth, torn(even), 1)[0] > 10.0
    same = grow_bark(column(60), shrinking(girth, 0.4 / girth), Material())
    assert same.strips.rest == pytest.approx(np.full(60, 0.4))


def test_figure_24() -> None:
    """225 strips on a trunk and four branches: fractures cross the branchings."""
    bark = paper_bark()
    assert len(bark.strips.axis) == 225 and len(np.unique(bark.strips.axis)) == 5
    check(bark)
    axes = bark.strips.axis[bark.tears.strip]
    linked = bark.tears.up >= 0
    crossing = axes[linked] != axes[bark.tears.up[linked]]
    assert crossing.sum() >= 2
    assert len(branched().crossings.strip) == 12
