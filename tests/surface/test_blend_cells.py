"""Cells near the blended surface: those that a plain recursion finds."""

from __future__ import annotations

import pytest

from forest.surface.blend import blend_of
from forest.surface.blend.cells import SLOPE, _coarse, cells_near, lattice_of, unpack
from tests.reference import cells as slow
from tests.surface.branchings import branching


@pytest.mark.parametrize("angle_deg", [35.0, 90.0])
def test_cells_are_those_of_a_recursion(angle_deg: float) -> None:
    blend = blend_of(branching(angle_deg, thin=0.013, half=0.15), flare=None)
    lattice = lattice_of(blend.limbs.cones, 0.006, 2.0)
    assert lattice.levels >= 4
    coarse = _coarse(blend.limbs.cones, lattice)
    expected = {
        leaf
        for corner in unpack(coarse).tolist()
        for leaf in slow.leaves(blend, lattice, (tuple(corner), lattice.levels), 2.0, SLOPE)
    }
    uneven = len(expected)
    expected = slow.balanced(blend, lattice, expected, SLOPE)
    found = {
        (tuple(corner), level)
        for level, keys in enumerate(cells_near(blend, lattice, 2.0))
        for corner in unpack(keys).tolist()
    }
    assert found == expected
    assert len(expected) > uneven  # some were cut to be in balance
