"""Obstacles by click: boxes and meshes become acts, with the errors of a scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError
from forest.live import LiveSession
from forest.view.scene import import_pyvista
from forest.viewer.live_source import LiveSource
from forest.viewer.picking import Hit, Ray
from tests.tiny import tiny


def test_a_mesh_is_put_where_the_ground_is_clicked(tmp_path: Path) -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    from forest.viewer.app import App
    from forest.viewer.live import LivePart

    session = LiveSession(tiny())
    app = App(LiveSource(session, "here"), (LivePart().panel,))
    tool, state = app.tools["obstacle"], app.state
    ray = Ray(np.array([3.0, 4.0, 5.0]), np.array([0.0, 0.0, -1.0]))
    ground = Hit(None, None, None, ray)
    state.obstacle_kind = "mesh"
    for file, why in (("", "no mesh is named"), (str(tmp_path / "no.stl"), "no.stl")):
        state.mesh_file = file
        with pytest.raises(InputError, match=why):
            tool.click(ground)
    assert session.pending == ()
    mesh = tmp_path / "stone.stl"
    import_pyvista().Sphere(radius=0.4, theta_resolution=8, phi_resolution=8).save(mesh)
    state.mesh_file = str(mesh)
    tool.click(ground)
    (stone,) = session.obstacles
    assert (stone.kind, stone.name, stone.at_m) == ("mesh", "mesh 1", (3.0, 4.0, 0.0))
    assert state.obstacle_names == ["mesh 1"]
    state.obstacle_kind = "box"
    tool.click(ground)  # the stone is there: it would be moved
    assert len(session.pending) == 1
    tool.click(ground._replace(ray=ray._replace(origin=np.array([7.0, 7.0, 5.0]))))
    assert [each.name for each in session.obstacles] == ["mesh 1", "box 1"]
