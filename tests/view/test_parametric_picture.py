"""Parametric trees in pictures: colours, lobes, light."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forest.errors import InputError
from forest.parametric import grow, load_parameters
from forest.view.parametric_picture import TreeScene, colour_of, leaf_colour, lobed_trunk


def test_lobes_replace_round_stems() -> None:
    aspen, cactus = grow("quaking_aspen", 1), grow("saguaro", 1)
    internodes = len(aspen.nodes.stem) - len(aspen.stems.level)
    trunk = int(aspen.stems.nodes[0])
    assert len(TreeScene(aspen, leaves=False).wood.radius) == internodes - (trunk - 1)
    assert len(lobed_trunk(aspen)[0]) == 12 * 5 * trunk
    # A cactus, which has no leaves, has ribs on its arms too.
    assert len(TreeScene(cactus).wood.radius) == 0
    assert len(lobed_trunk(cactus)[0]) == 12 * 15 * len(cactus.nodes.stem)


def test_colours_are_the_species_own() -> None:
    aspen, fir = load_parameters("quaking_aspen"), load_parameters("balsam_fir")
    assert_allclose(colour_of("#ff8000"), (1.0, 128.0 / 255.0, 0.0))
    assert_allclose(leaf_colour(aspen, "summer"), colour_of(aspen.leaf_colour))
    assert_allclose(leaf_colour(aspen, "fall"), colour_of(aspen.fall_colour))
    assert leaf_colour(aspen, "spring").sum() > leaf_colour(aspen, "summer").sum()
    for season in ("spring", "fall"):
        assert_allclose(leaf_colour(fir, season), colour_of(fir.leaf_colour))
    assert np.ptp(leaf_colour(fir, "winter")) < 0.85 * np.ptp(leaf_colour(fir, "fall"))  # duller
    scene = TreeScene(grow("lilac", 1), season="fall")
    assert_allclose(scene.wood.bark, np.broadcast_to(scene.bark, scene.wood.bark.shape))


@pytest.mark.parametrize("word", ["red", "#12345", "#gg0000"])
def test_no_colour(word: str) -> None:
    with pytest.raises(InputError, match="bark_colour"):
        load_parameters("lilac").with_changes([f"bark_colour='{word}'"])
