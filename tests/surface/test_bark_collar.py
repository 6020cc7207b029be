"""Where a branch's bark meets its parent's."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest.surface.bark.bark_mesh import dressed_parts
from forest.surface.bark.collar import foot_of, seam_of
from forest.surface.bark.presets import Preset
from forest.surface.bark.tree_bark import bark_tree
from forest.surface.blend import blended
from tests.surface.bark_trees import forked


def _seen(colour: np.ndarray[Any, Any], uv: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Sample a map's brightness at the nearest pixels."""
    rows, columns = colour.shape[:2]
    column = np.floor(uv[:, 0] % 1.0 * columns).astype(int)
    row = np.clip(rows - 1 - np.floor(uv[:, 1] * rows).astype(int), 0, rows - 1)
    return np.asarray(colour[row, column].astype(float).mean(axis=-1))


def test_both_maps_show_the_same_where_they_meet() -> None:
    preset = Preset.load("birch")
    bark = bark_tree(forked(radius_m=0.2, thin_m=0.09), preset, 1, strip_m=0.02)
    wood = blended(bark.tree.skeleton)
    plain = {axis: maps.colour for axis, maps in bark.maps(512).items()}
    trunk, branch = dressed_parts(bark, wood, 512)[:2]
    shared = []
    for part in (trunk, branch):
        corners = part.mesh.points[part.mesh.triangles].reshape(-1, 3)
        rounded = [tuple(point) for point in np.round(corners, 9)]
        shared.append(dict(zip(rounded, part.mesh.uv.reshape(-1, 2), strict=True)))
    points = sorted(shared[0].keys() & shared[1].keys())
    assert len(points) > 20
    uv = [np.array([known[point] for point in points]) for known in shared]
    own = _seen(np.asarray(trunk.material.colour_image), uv[0])
    collar = _seen(np.asarray(branch.material.colour_image), uv[1])
    without = _seen(plain[1], uv[1])
    # Most places; fine cracks fall between pixels.
    assert np.median(np.abs(collar - own)) < 0.4 * np.median(np.abs(without - own))
    # Away from the joint the branch keeps its own bark.
    upper = np.asarray(branch.material.colour_image)[: len(plain[1]) // 4]
    assert np.array_equal(upper, plain[1][: len(plain[1]) // 4])


def test_a_collar_fades_along_the_branch() -> None:
    tree = bark_tree(forked(), Preset.load("oak"), 1, strip_m=0.02).tree
    trunk, branch = tree.paths
    v = np.linspace(branch.low - 0.03, branch.high, 40)
    collar, deep = foot_of(branch, trunk, v, 24)
    assert np.all((collar.share >= 0.0) & (collar.share <= 1.0))
    assert np.all(collar.share[deep > 0.0] == 1.0)
    assert deep[0].max() > 0.02
    assert not collar.share[-5:].any() and not deep[-5:].any()
    assert np.all(np.diff(collar.share, axis=0) <= 1e-9)


def test_parts_that_do_not_touch_have_no_collar() -> None:
    trunk, branch = bark_tree(forked(), Preset.load("oak"), 1, strip_m=0.02).tree.paths
    points = branch.points(np.full(8, branch.high), np.arange(8) / 8, np.full(8, 0.05))
    seam = np.zeros(8, np.bool_)
    assert seam_of(branch, trunk, points, seam, (64, 64), branch.low, branch.high) is None
