"""Parametric trees in pictures: colours, lobes, light."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forest.errors import InputError
from forest.parametric import grow, load_parameters
from forest.view.parametric_picture import TreeScene, colour_of, leaf_colour, lobed_tube


def test_a_lobed_trunk_has_the_radius_of_the_formula() -> None:
    tree = grow(load_parameters("saguaro").with_changes(["lobes=5", "lobe_depth=0.2"]), 2)
    points, faces = lobed_tube(tree, 0)
    rows = np.flatnonzero(tree.nodes.stem == 0)
    rings = points.reshape(len(rows) + 1, -1, 3)[:-1]
    n = rings.shape[1]
    radius = tree.nodes.radius[rows][:, None]
    angle = 2.0 * np.pi * np.arange(n) / n
    out = np.linalg.norm(rings - tree.nodes.position[rows][:, None], axis=2)
    assert_allclose(out, radius * (1.0 + 0.2 * np.sin(5.0 * angle)), atol=1e-9)
    assert_allclose(points[faces.reshape(-1, 5)[:, 1:]].max(axis=(0, 1)), points.max(axis=0))


def test_lobes_replace_the_round_trunk_alone() -> None:
    aspen, cactus = grow("quaking_aspen", 1), grow("saguaro", 1)
    trunk = int((aspen.stems.level == 0).sum())
    internodes = len(aspen.nodes.stem) - len(aspen.stems.level)
    scene = TreeScene(aspen, leaves=False)
    assert scene.lobed.tolist() == list(range(trunk))
    assert len(scene.wood.radius) == internodes - (int(aspen.stems.nodes[0]) - 1)
    assert len(TreeScene(cactus).wood.radius) == 0
    assert len(TreeScene(cactus).lobed) == len(cactus.stems.level)


def test_colours_are_the_species_own() -> None:
    aspen, fir = load_parameters("quaking_aspen"), load_parameters("balsam_fir")
    assert_allclose(colour_of("#ff8000"), (1.0, 128.0 / 255.0, 0.0))
    assert_allclose(leaf_colour(aspen, "summer"), colour_of(aspen.leaf_colour))
    assert_allclose(leaf_colour(aspen, "fall"), colour_of(aspen.fall_colour))
    assert leaf_colour(aspen, "spring").sum() > leaf_colour(aspen, "summer").sum()
    for season in ("spring", "fall", "winter"):
        assert_allclose(leaf_colour(fir, season), colour_of(fir.leaf_colour))
    scene = TreeScene(grow("lilac", 1), season="fall")
    assert_allclose(scene.wood.bark, np.broadcast_to(scene.bark, scene.wood.bark.shape))


@pytest.mark.parametrize("word", ["red", "#12345", "#gg0000"])
def test_no_colour(word: str) -> None:
    with pytest.raises(InputError, match="bark_colour"):
        load_parameters("lilac").with_changes([f"bark_colour='{word}'"])
