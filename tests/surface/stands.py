"""Small random stands of small random trees for tests of frames and shadows."""

from __future__ import annotations

import numpy as np

from forest.species import load_species
from forest.surface import Camera, Instances, Model
from forest.surface.detail import SEASONS
from forest.trees.leaves import LEAF_SHAPES, leaves_of
from tests.surface.bushes import bush

FOLIAGE = {season: (0.1 * k + 0.1, 0.4, 0.2) for k, season in enumerate(SEASONS)}
BARK = (0.4, 0.35, 0.3)


def bushy(seed: int, n: int, *, evergreen: bool = False) -> Model:
    """Make a model of a bush with leaves of several outlines."""
    tree = bush(seed, n)
    leaves = leaves_of(tree, load_species(tree.species), per_site=2)
    shape = np.random.default_rng(seed).integers(0, len(LEAF_SHAPES), len(leaves.shape))
    leaves = leaves._replace(shape=shape.astype(np.int8))
    return Model.of(tree, leaves, evergreen=evergreen, bark=BARK, foliage=FOLIAGE)


def scattered(seed: int, n: int, models: int, *, size_m: float) -> Instances:
    """Put trees of random models and scales at random places."""
    rng = np.random.default_rng(seed)
    return Instances.of(
        rng.integers(0, models, n), rng.uniform(0.0, size_m, (n, 3)), rng.uniform(0.5, 2.0, n)
    )


def random_camera(seed: int, size_m: float) -> Camera:
    """Look at some place from another, near or far."""
    rng = np.random.default_rng(seed)
    eye, towards = rng.uniform(-size_m, 2.0 * size_m, (2, 3))
    width, height = (int(n) for n in rng.integers(50, 2000, 2))
    return Camera(tuple(eye), tuple(towards), width, height, float(rng.uniform(20.0, 120.0)))
