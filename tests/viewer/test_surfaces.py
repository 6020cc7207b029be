"""The chosen tree as branches, surface or bark; which trees are drawn with branches unasked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError
from forest.record.run import open_run
from forest.surface.export import Material, Part
from forest.surface.mesh import Mesh
from forest.surface.tubes import tubes
from forest.viewer.source import RunSource
from forest.viewer.surfaces import _unbumped

_SAMPLE, _PLAIN = 4, 2


@pytest.fixture
def source(run_path: Path) -> Iterator[RunSource]:
    with open_run(run_path) as run:
        yield RunSource(run)


def test_surfaces_are_those_of_the_skeleton_with_its_leaves(source: RunSource) -> None:
    year = source.years[-1]
    wood, *leaves = source.surface(_SAMPLE, year, "tubes")
    own = tubes(source.skeleton(_SAMPLE, year))
    np.testing.assert_array_equal(wood.mesh.points, own.points)
    np.testing.assert_array_equal(wood.mesh.triangles, own.triangles)
    assert leaves
    with pytest.raises(InputError, match="no bark that could be seen"):
        source.surface(_SAMPLE, year, "bark")
    with pytest.raises(InputError):
        source.surface(_PLAIN, year, "tubes")


def test_relief_that_faces_the_light_is_brighter() -> None:
    normal = np.full((1, 3, 3), (128, 128, 255), np.uint8)
    normal[0, 0] = (40, 128, 200)
    normal[0, 2] = (215, 128, 200)
    colour = np.full((1, 3, 3), 100, np.uint8)
    none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3, 2)))
    part = Part(none, Material("bark", colour_image=colour, normal_image=normal))
    left, flat, right = np.asarray(_unbumped(part).material.colour_image)[0, :, 0]
    assert left > flat > right
    assert flat == 100 or abs(int(flat) - 100) <= 1


def test_the_chosen_and_the_near_have_branches(run_path: Path) -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    from forest.viewer.app import App

    with open_run(run_path) as run:
        app = App(RunSource(run))
        known = app.source.with_branches(app.year)
        assert app.stage.skeletons == ()
        app.choose(_SAMPLE)
        assert app.stage.skeletons == (_SAMPLE,)
        app.state.shape = "body"
        app.show_year()
        assert app.stage.skeletons == ()
        app.choose(_PLAIN)
        assert app.stage.skeletons == ()
        near = next(tree for tree in known if tree != _SAMPLE)
        app.state.shape = "branches"
        app.stage.look_at_tree(near)
        app.come_closer()
        assert near in app.stage.skeletons
        app.look("above")
        app.state.branches = True
        app.show_year()
        assert app.stage.skeletons == tuple(known)
