"""The gallery's views of stands."""

from __future__ import annotations

import tomllib

from analysis import stand_views


def test_each_view_has_a_caption_and_a_picture() -> None:
    captions = tomllib.loads((stand_views.TO / "captions.toml").read_text())
    for name in stand_views.PICTURES:
        assert name in captions
        assert (stand_views.TO / f"{name}.png").exists()
