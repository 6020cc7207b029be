"""Hart & Baker 2003, Fig. 1 in numbers, and the response to pruning of section 4."""

from __future__ import annotations

import numpy as np
import pytest

import forest
from analysis.hart_baker import KINDS, SEEDS, Grown, figure_1, load, measure, off_centre
from tests.reference import balance as slow
from tests.reference.plant import read_plant

PRUNED = """
years = 20
mode = "mass_balance"
plot = { size_m = [30, 30], boundary = "open" }
growth = { bud_fate = "balance" }
environment = { shadow = {}, canopy = {} }
planting = { kind = "explicit", trees = [{ x_m = 15, y_m = 15 }] }

[species.generic_deciduous.balance]
min_growth = 0.02
light_gain = 0.0
"""


@pytest.fixture(scope="module")
def trees() -> dict[str, list[Grown]]:
    """The three trees of eight seeds."""
    return figure_1()


def test_the_three_trees_have_one_architecture() -> None:
    species = [load(kind).species_list[0] for kind in KINDS]
    for section in ("architecture", "shoots", "bud_fate", "wood", "leaves"):
        assert len({getattr(s, section) for s in species}) == 1, section
    assert len({(load(kind).years, load(kind).environment) for kind in KINDS}) == 1


def test_a_balanced_tree_stands_over_its_trunk(trees: dict[str, list[Grown]]) -> None:
    """Every balanced tree's centre of mass lies within 20 % of the genetic tree's distance."""
    for balanced, genetic in zip(trees["balanced"], trees["genetic"], strict=True):
        assert balanced.off_centre_m < 0.2 * genetic.off_centre_m
        assert balanced.limbs > 0.5 * genetic.limbs


def test_a_phototropic_tree_needs_few_limbs(trees: dict[str, list[Grown]]) -> None:
    """About the light of the genetic tree with a quarter of its limbs (section 1)."""
    light, limbs = (
        np.mean([getattr(tree, name) for tree in trees["phototropic"]])
        / np.mean([getattr(tree, name) for tree in trees["genetic"]])
        for name in ("light", "limbs")
    )
    assert light >= 0.9
    assert limbs <= 0.4
    alone = [
        (pho.light / gen.light >= 0.9, pho.limbs / gen.limbs <= 0.4)
        for pho, gen in zip(trees["phototropic"], trees["genetic"], strict=True)
    ]
    assert np.sum(alone, axis=0).min() >= 0.75 * len(SEEDS)


def test_limbs_in_the_shade_die() -> None:
    """Section 4.1: under this model, too, in paper mode."""
    with_death, without = (
        forest.Stand(
            load("phototropic").with_overrides(
                [f"species.generic_deciduous.shedding.light_per_internode={threshold}"]
            )
        )
        for threshold in (0.45, 0.0)
    )
    for _ in range(12):
        with_death.step()
        without.step()
    assert measure(with_death).limbs < 0.7 * measure(without).limbs


@pytest.mark.parametrize("mode", ["paper", "mass_balance"])
def test_limbs_support_what_they_carry_as_the_tree_grows(mode: str) -> None:
    """Every limb, every year (eqs 6, 10, 18)."""
    scenario = load("balanced").with_overrides([f"mode={mode}"])
    wood = scenario.species_list[0].wood
    exponent = wood.pipe_exponent if mode == "paper" else 2.0
    traits = slow.Traits(
        density=wood.density_kg_m3,
        exponent=exponent,
        twig=wood.twig_diameter_m / 2,
        cones=mode == "paper",
        unit=(0.2,),
    )
    stand = forest.Stand(scenario)
    loads = []
    for _ in range(scenario.years):
        stand.step()
        nodes = read_plant(stand.arena.metamers, stand.rows, 0)
        trunk = slow.limb_of(nodes[0], traits, lambda _: np.zeros(3), lambda _: False)
        for limb in trunk.above():
            loads.append(limb.supported / traits.supports(limb.base))
    assert max(loads) < 1.0 + 1e-4
    assert (max(loads) > 0.9) == (mode == "paper")  # wood is all that growth costs there


def _prune_one_side(stand: forest.Stand) -> None:
    """Cut the first-order limbs on the side, left or right, that bears more of the tree."""
    tree = stand.skeleton(1)
    limb = np.where(tree.order == 0, -1, np.arange(len(tree)))  # the first-order limb it is on
    for i in range(len(tree)):
        if tree.order[i] > 0 and tree.order[tree.parent[i]] > 0:
            limb[i] = limb[tree.parent[i]]
    heads = np.unique(limb[limb >= 0])
    size = np.array([(limb == head).sum() for head in heads])
    side = np.array([np.sign(tree.end[limb == h, 0].mean() - tree.start[0, 0]) for h in heads])
    heavier = max((-1.0, 1.0), key=lambda s: size[side == s].sum())
    for head in heads[side == heavier]:
        stand.prune(1, int(tree.serial[head]))


def _after_pruning(seed: int, *overrides: str) -> tuple[float, float]:
    """Distance of the centre of mass just after pruning at six years, and ten years later, m."""
    stand = forest.Stand(
        forest.Scenario.from_toml(PRUNED).with_overrides([f"seed={seed}", *overrides])
    )
    for _ in range(6):
        stand.step()
    _prune_one_side(stand)
    pruned = off_centre(stand.skeleton(1))
    for _ in range(10):
        stand.step()
    return pruned, off_centre(stand.skeleton(1))


def test_a_pruned_tree_regains_its_balance() -> None:
    """The centre of mass comes back by more than half; without balance it strays on."""
    seeds = (1, 2, 3, 4)
    pruned, later = np.mean([_after_pruning(seed) for seed in seeds], axis=0)
    assert later < 0.5 * pruned
    same_rate = [
        f"species.generic_deciduous.balance.{k}" for k in ("offset_gain=0", "min_growth=0.5")
    ]
    pruned, later = np.mean([_after_pruning(seed, *same_rate) for seed in seeds], axis=0)
    assert later > pruned
