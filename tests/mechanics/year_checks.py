"""What holds of a stand's rods after every year, whatever happened to its trees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.mechanics.rods import Rods
from forest.stand import Stand
from forest.trees.table import Trees
from tests.reference.rods import matrix, rotation

#: Ten young trees bend within fractions of a second; the beeches carry fruit.
BENDING = ("mechanics={wind_m_s=8}", "species.fagus_sylvatica.mechanics.fruit_mass_kg=0.002")


def rods_of(stand: Stand, row: int) -> Rods:
    """The rods of the tree in a row of the table."""
    start, size = int(stand.rows.start[row]), int(stand.rows.size[row])
    return Rods(*(field[start : start + size] for field in stand.arena.companions))


def assert_rods_fit(stand: Stand) -> None:
    """Each metamer's rod is its own: its shape and its wood are those of the arena.

    Frames follow from the parents' frames, joints and curvatures, tips from the frames, and the
    wood is laid up to the radius.
    """
    for row in range(len(stand.rows.tree_id)):
        assert_tree_fits(stand, stand.rows, row)


def assert_tree_fits(stand: Stand, trees: Trees, row: int) -> None:
    """Check the rods of the tree in a row of a table; see `assert_rods_fit`."""
    arena = stand.arena.metamers
    here = slice(int(trees.start[row]), int(trees.start[row] + trees.size[row]))
    rods = Rods(*(field[here] for field in stand.arena.companions))
    exponent = stand.pipe_exponent[trees.species[row]]
    radius = (0.5 * arena.pipe[here].astype(np.float64) ** (1.0 / exponent)).astype(np.float32)
    np.testing.assert_allclose(rods.ringed, radius, rtol=1e-6)
    assert np.all(rods.rigidity > 0.0)
    ends: list[NDArray[np.float64]] = []
    tips: list[NDArray[np.float64]] = []
    for i, parent in enumerate(arena.parent[here]):
        length = float(arena.length[here][i])
        half = rotation(0.5 * length * rods.curvature[i].astype(np.float64))
        before = ends[parent] if parent >= 0 else np.eye(3)
        middle = before @ matrix(rods.joint[i]) @ half
        ends.append(middle @ half)
        tips.append((tips[parent] if parent >= 0 else np.zeros(3)) + length * middle[:, 0])
        np.testing.assert_allclose(matrix(rods.frame[i]), middle, atol=1e-5)
    np.testing.assert_allclose(arena.tip[here], tips, atol=1e-5)
