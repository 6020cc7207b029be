"""Leaves of simulated trees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.species import load_species
from forest.stand import Stand
from forest.trees.leaves import (
    LEAF_SHAPES,
    OUTLINES,
    OVAL,
    SPRAY,
    leaves_of,
    living_sites,
    no_leaves,
    outline_area,
)
from tests.surface.bushes import bush
from tests.tiny import tiny

SPECIES = {name: load_species(name) for name in ("fagus_sylvatica", "picea_abies")}


@given(
    st.integers(0, 2**32 - 1), st.integers(1, 60), st.sampled_from(sorted(SPECIES)),
    st.integers(1, 4),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_each_site_has_its_area_of_leaves(seed: int, n: int, name: str, per_site: int) -> None:
    tree, species = bush(seed, n), SPECIES[name]
    leaves = leaves_of(tree, species, per_site=per_site)
    sites = [i for i in range(n) if tree.leafy[i] for _ in range(1 if i in tree.parent else 2)]
    assert len(leaves.area) == per_site * len(sites)
    by_site = leaves.area.reshape(-1, per_site).sum(axis=1)
    np.testing.assert_allclose(by_site, species.leaves.area_m2)
    assert list(leaves.stem) == list(tree.axis[sites].repeat(per_site))
    for vector in (leaves.direction, leaves.normal):
        np.testing.assert_allclose(np.linalg.norm(vector, axis=1), 1.0)
    np.testing.assert_allclose(np.sum(leaves.direction * leaves.normal, axis=1), 0.0, atol=1e-9)
    assert (leaves.normal[:, 2] >= -1e-9).all()
    assert (leaves.width <= leaves.length * (1 + 1e-9)).all()


def test_grown_trees_have_the_leaf_area_that_they_are_measured_with() -> None:
    """A skeleton does not hold the number of sites; they are told from what a site bears."""
    stand = Stand(tiny())
    for _ in range(8):
        stand.step()
    assert len(stand.trees) > 5
    for tree_id, measured in zip(stand.trees.tree_id, stand.trees.leaf_area_m2, strict=True):
        tree = stand.skeleton(int(tree_id))
        area = leaves_of(tree, load_species(tree.species)).area.sum()
        assert area == pytest.approx(measured, rel=0.05)


def test_needles_lie_along_the_shoot_and_blades_stand_at_its_end() -> None:
    tree = bush(3, 40)
    deep = tree.start - 10.0 * (np.arange(len(tree)) == 0)[:, None]
    tree = dataclasses.replace(tree, start=deep)  # no leaf reaches the ground
    sites = np.repeat(np.arange(len(tree)), living_sites(tree))
    at = np.flatnonzero(tree.length[sites] > 0.0)
    sites = sites[at]
    heading = (tree.end - tree.start)[sites] / tree.length[sites, None]
    for name, shape, place, angle in (
        ("picea_abies", SPRAY, tree.start, 15.0), ("fagus_sylvatica", OVAL, tree.end, 55.0)
    ):  # fmt: skip
        leaves = leaves_of(tree, SPECIES[name])
        assert (leaves.shape == shape).all()
        np.testing.assert_array_equal(leaves.position[at], place[sites])
        cosine = np.sum(leaves.direction[at] * heading, axis=1)
        np.testing.assert_allclose(cosine, np.cos(np.radians(angle)))


@pytest.mark.parametrize("name", LEAF_SHAPES)
def test_outlines_fill_their_box_and_are_filled_by_fans(name: str) -> None:
    outline = OUTLINES[LEAF_SHAPES.index(name)]
    assert (outline[:, 0].min(), outline[:, 0].max()) == (0.0, 1.0)
    assert (outline[:, 1].min(), outline[:, 1].max()) == (-0.5, 0.5)
    first, second = outline[1:-1], outline[2:]
    fan = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert (fan > 0.0).all()
    assert outline_area(outline) == pytest.approx(fan.sum())


def test_leaves_of_low_shoots_lie_on_the_ground() -> None:
    tree = bush(4, 40)
    low = dataclasses.replace(
        tree, start=tree.start * (1.0, 1.0, 0.01), end=np.abs(tree.end * (1.0, 1.0, 0.01))
    )
    for species in SPECIES.values():
        leaves = leaves_of(low, species)
        above = leaves.position[:, 2] >= low.start[0, 2]
        tip = (leaves.position + leaves.length[:, None] * leaves.direction)[above, 2]
        assert tip.min() == pytest.approx(low.start[0, 2], abs=1e-12)  # some were lifted


def test_a_bare_tree_has_none() -> None:
    assert len(no_leaves().area) == 0


def test_no_leaf_for_a_site_is_refused() -> None:
    with pytest.raises(InputError, match="per_site is 0; expected 1 or more"):
        leaves_of(bush(1, 5), SPECIES["picea_abies"], per_site=0)
