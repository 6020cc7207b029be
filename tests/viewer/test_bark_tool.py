"""A click on bark that is shown becomes an act, and the bark is made anew."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.live import LiveSession
from forest.surface.export import Material, Part
from forest.surface.tubes import tubes
from forest.viewer.bark_tool import CrackTool
from forest.viewer.live_source import LiveSource
from forest.viewer.picking import Hit, Ray
from forest.viewer.surfaces import _Wanted
from tests.tiny import tiny


def test_a_click_on_bark_cracks_it_there() -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    from forest.viewer.app import App
    from forest.viewer.live import LivePart

    session = LiveSession(tiny("years=6", "output={sample_trees={ids=[4]}}"))
    for _ in range(6):
        session.step()
    source, part = LiveSource(session, "here"), LivePart()
    app = App(source, (part.panel,))
    tool = app.tools["crack"]
    assert isinstance(tool, CrackTool)
    shape = source.skeleton(4, source.now)
    foot = shape.start[0]
    ray = Ray(foot + np.array([0.0, 5.0, 0.05]), np.array([0.0, -1.0, 0.0]))
    app.choose(4)
    with pytest.raises(InputError, match="no bark"):
        tool.click(Hit(4, 0, None, ray))
    shown = _Wanted(4, source.now, "bark", "")
    app.surfaces._kept[shown] = [Part(tubes(shape), Material("bark_0"))]
    app.surfaces._shown = shown
    tool.click(Hit(4, 0, None, ray))
    (act,) = session.pending
    assert (act["kind"], act["tree_id"]) == ("crack", 4)
    assert act["height_m"] == pytest.approx(0.05, abs=0.01)
    assert act["azimuth_deg"] == pytest.approx(90.0, abs=10.0)
    assert source.waiting_for(4) and not source.waiting_for(3)  # its bark is another now
    with pytest.raises(InputError, match="no sample tree"):
        source.surface(3, source.now, "bark")
    with pytest.raises(InputError, match="no bark that could be seen"):
        source.surface(4, source.now, "bark")  # it is too thin yet: its rings are there
