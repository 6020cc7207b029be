"""Odd skeletons: what the blended surface makes of them, or why it refuses them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forest.errors import InputError
from forest.surface.blend import GapWarning, blended
from forest.surface.tubes import tubes
from tests.surface.branchings import branching, stem, tree


@pytest.mark.parametrize("thin", [0.06, 0.01])
def test_a_limb_off_its_parent_is_told(thin: float) -> None:
    whole = branching(90.0, thin=thin, half=0.5)
    shift = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    off = dataclasses.replace(whole, start=whole.start + shift, end=whole.end + shift)
    with pytest.warns(GapWarning, match=r"1 axes start off .* axis 1, 0\.3 m from internode 0"):
        assert blended(off, cell_m=0.02, flare=None).is_watertight
    with pytest.raises(InputError, match=r"axis 1, 0\.3 m"):
        blended(off, cell_m=0.02, flare=None, strict=True)


def test_a_stem_that_grows_down_is_refused_and_one_that_lies_is_not() -> None:
    down = tree([-1], [(0, 0, 0), (0, 0, -1.0)], [0.1], [True])
    with pytest.raises(InputError, match=r"axis 0 grows from its base at 0 m down to -1 m"):
        blended(down, cell_m=0.03)
    lies = tree([-1], [(0, 0, 0), (1.0, 0, 0)], [0.1], [True])
    assert blended(lies, cell_m=0.03).volume == pytest.approx(0.1**2 * np.pi, rel=0.1)


def test_wood_without_a_radius_is_as_thin_as_that_of_tubes() -> None:
    bare = dataclasses.replace(branching(thin=0.02, half=0.3), radius=np.array([0.1, 0.1, 0.0]))
    mesh = blended(bare, cell_m=0.03, flare=None)
    assert mesh.is_watertight and set(mesh.data["axis"]) == {0, 1}
    assert tubes(bare).is_watertight
    negative = dataclasses.replace(stem(), radius=np.array([-0.1]))
    for surface in (tubes, blended):
        with pytest.raises(InputError, match="radius"):
            surface(negative)


def test_far_from_joints_a_limb_has_its_volume() -> None:
    """The part of a limb between two heights, against the cylinder's."""
    mesh = blended(branching(90.0, half=0.6), cell_m=0.02, flare=None)
    corner = mesh.points[mesh.triangles]
    far = np.all((corner[..., 0] > 0.45) & (corner[..., 0] < 0.6), axis=1)
    normal = 0.5 * mesh.face_normals()[far]
    middle = corner[far].mean(axis=1) - (0.0, 0.0, 0.6)
    # A cylinder's mantle encloses half of the flow of its cross-wise offset through it; the ratio
    # to its area is the radius, whatever its ragged ends are.
    radius = np.sum(normal[:, 1:] * middle[:, 1:]) / np.linalg.norm(normal, axis=1).sum()
    assert radius == pytest.approx(0.06, rel=0.005)
