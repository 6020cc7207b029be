"""Views of many trees, of long rows and of places far from the origin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError
from forest.surface import frame as frames
from forest.surface.instances import Instances
from forest.view import stand_view
from forest.view.scenery import SceneFile, Scenery, build_scenery
from forest.view.stand_view import StandView

TREE = """
[[tree]]
x_m = {x}
y_m = {y}
species = "lilac"
most_leaves = 400
"""


def lone(folder: Path, x: float, y: float) -> Scenery:
    """Give a tree beside a corner of heights in an .asc grid, seen from near by."""
    rows = "\n".join(" ".join(f"{1.5 * i + j}" for i in range(4)) for j in range(4))
    head = f"ncols 4\nnrows 4\nxllcorner {x}\nyllcorner {y}\ncellsize 5\n"
    (folder / "ground.asc").write_text(head + rows)
    text = f"""
    [terrain]
    heights = "ground.asc"
    [camera]
    eye_m = [{x + 8.0}, {y + 1.0}, 1.7]
    towards_m = [{x + 9.0}, {y + 9.0}, 2.0]
    size_px = [90, 60]
    [[grass]]
    code = 1
    """
    return build_scenery(SceneFile.from_toml(text + TREE.format(x=x + 9.0, y=y + 9.0)), folder)


def test_far_from_the_origin_all_is_as_near_it(tmp_path: Path) -> None:
    near, far = lone(tmp_path, 0.0, 0.0), lone(tmp_path, 499712.0, 5496832.0)  # times 8192
    assert near.origin_m == (0.0, 0.0)
    assert far.origin_m == (499712.0, 5496832.0)
    assert far.extent == near.extent
    np.testing.assert_allclose(far.instances.place, near.instances.place, atol=1e-9)
    pictures = [StandView(scenery).picture() for scenery in (near, far)]
    np.testing.assert_array_equal(*pictures)
    odd = lone(tmp_path, 500000.0, 5500000.0)
    assert np.abs(odd.instances.place).max() < 8192.0
    assert np.abs(np.array(odd.camera().eye)).max() < 8192.0
    assert StandView(odd).picture().std() > 20.0


def row(count: int) -> Scenery:
    text = "[camera]\nsize_px = [90, 60]\neye_m = [5, -8, 2]\ntowards_m = [5, 5, 2]\n"
    trees = "".join(TREE.format(x=400.0 * k, y=10.0) for k in range(count))
    return build_scenery(SceneFile.from_toml(text + trees))


def test_a_long_row_has_shadows() -> None:
    map_ = StandView(row(50)).shadows.map  # type: ignore[union-attr]
    assert map_.depth.size <= 4_000_000
    alone = StandView(row(1)).shadows.map  # type: ignore[union-attr]
    assert alone.cell_m == 0.25


def test_drawing_in_chunks_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    view = StandView(row(2))
    whole = view.picture()
    frame = view.frame(view.scenery.camera())
    chunk = len(frame.triangles) // 3
    assert chunk > 100
    monkeypatch.setattr(stand_view, "_CHUNK", chunk)
    apart = view.picture()
    assert np.mean(np.any(whole != apart, axis=2)) < 0.01
    assert whole.std() > 20.0


def test_too_much_in_view_is_refused_before_it_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    view = StandView(row(1), shadows=False)
    frame = view.frame(view.scenery.camera())
    number = len(frame.triangles) + len(frame.lines) + len(frame.points)
    monkeypatch.setattr(frames, "MOST_PRIMITIVES", number)
    view.frame(view.scenery.camera())
    monkeypatch.setattr(frames, "MOST_PRIMITIVES", number - 1)
    with pytest.raises(InputError, match=rf"{number:,} triangles.* of 1 trees.*at most"):
        view.picture()


def test_a_quarter_of_a_million_trees_are_refused_at_once() -> None:
    scenery = row(1)
    many = Instances.of(
        np.zeros(250_000), np.tile(scenery.instances.place, (250_000, 1)), np.ones(250_000)
    )
    with pytest.raises(InputError, match="in view"):
        frames.prepare(scenery.models, many, scenery.camera())


def test_trees_without_room_are_told(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.ones((4, 4), np.uint16))
    text = """
    [features]
    map = "map.npy"
    cell_m = 5.0
    [[trees]]
    bit = 0
    species = "lilac"
    most_leaves = 100
    per_ha = 1000.0
    variants = 1
    least_distance_m = 9.0
    """
    scenery = build_scenery(SceneFile.from_toml(text), tmp_path)
    found = len(scenery.instances.model)
    assert found < 10
    assert scenery.notes == (f"trees[0]: {40 - found} of 40 found no room 9 m from each other",)


def test_from_above_the_grass_no_blade_is_in_reach() -> None:
    text = "[camera]\nsize_px = [60, 40]\neye_m = [5, -8, 90]\ntowards_m = [5, 5, 2]\n[[grass]]\n"
    assert StandView(build_scenery(SceneFile.from_toml(text))).picture().std() > 1.0


def test_widths_between_whole_pixels_are_mixed() -> None:
    place = np.random.default_rng(1).uniform(0.0, 50.0, (20_000, 3)).astype(np.float32)
    wanted = np.full(len(place), 1.6, np.float32)
    for power in (1, 2):
        found = {size: len(here) for size, here in stand_view._by_size(wanted, place, power)}
        assert set(found) == {1, 2}
        mean = sum(size**power * number for size, number in found.items()) / len(place)
        assert mean == pytest.approx(1.6**power, rel=0.02)
    wide = dict(stand_view._by_size(np.array([0.2, 99.0]), place[:2], 2))
    assert set(wide) == {1, 8}
