"""The generator against its slow twin, and over all sorts of parameters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.errors import InputError
from forest.parametric import Parameters, from_paper, grow, grow_many, load_parameters
from forest.parametric.growing import Readings
from forest.species.parametric import parametric_names
from tests.reference.weber_penn import reference_tree

_READINGS: tuple[Readings, ...] = ("paper", "corrected")


def _level(number: int) -> st.SearchStrategy[dict[str, object]]:
    def angle(size: float) -> st.SearchStrategy[float]:
        return st.floats(-size, size)

    share = st.floats(0.1, 1.0)
    return st.fixed_dictionaries(
        {
            "length": share if number else st.just(1.0),
            "length_variation": st.sampled_from([0.0, 0.1 if number else 0.0]),
            "taper": st.floats(0.0, 3.0),
            "splits": st.sampled_from([0.0, 0.3, 1.0, 1.2]),
            "split_angle": st.floats(0, 60),
            "split_angle_variation": st.floats(0, 20),
            "segments": st.integers(1, 4),
            "curve": angle(90),
            "curve_back": st.one_of(st.just(0.0), angle(90)),
            "curve_variation": angle(90),
            "down_angle": angle(120),
            "down_angle_variation": angle(50),
            "rotate": angle(180),
            "rotate_variation": st.floats(0, 30),
            "branches": st.sampled_from([1, 2, 3, 4, -3]),
        }
    )


def _whole(**values: object) -> Parameters:
    """Give the trunk of clones a joint at which they can leave."""
    first, *others = values["level"]  # type: ignore[misc]
    if values["base_splits"]:
        first = {**first, "segments": max(first["segments"], 2)}
    return Parameters(**{**values, "level": (first, *others)})


parameters = st.builds(
    _whole,
    shape=st.integers(0, 8),
    base_size=st.floats(0.0, 0.6),
    scale=st.floats(1.0, 30.0),
    depth=st.integers(1, 3),
    ratio=st.floats(0.005, 0.1),
    flare=st.sampled_from([0.0, 0.7]),
    trunk_scale=st.sampled_from([1.0, 1.2]),
    base_splits=st.integers(0, 3),
    z_scale=st.sampled_from([1.0, 0.4, 2.0, 7.0]),
    z_scale_variation=st.sampled_from([0.0, 0.3]),
    clone_habit=st.sampled_from([0.5, 1.0]),
    leaves=st.integers(-4, 4),
    attraction_up=st.floats(-3, 3),
    prune_ratio=st.sampled_from([0.0, 0.4, 1.0]),
    prune_width=st.floats(0.2, 0.6),
    prune_width_peak=st.floats(0.2, 0.8),
    prune_power_low=st.floats(0.1, 2),
    prune_power_high=st.floats(0.1, 2),
    level=st.tuples(*(_level(number) for number in range(3))),
)


@settings(max_examples=25, deadline=None)
@given(parameters, st.integers(0, 2**40))
def test_twin(p: Parameters, seed: int) -> None:
    tree = grow(p, seed)
    twin = reference_tree(p, seed, tree.scale)
    stems = [s for level in twin.stems for s in level]
    assert tree.stems.level.tolist() == [s.level for s in stems]
    assert tree.stems.is_clone.tolist() == [s.clone for s in stems]
    near = {"rtol": 1e-6, "atol": 1e-7 * tree.scale}
    np.testing.assert_allclose(tree.stems.length, [s.length for s in stems], **near)
    np.testing.assert_allclose(tree.stems.radius, [s.radius for s in stems], **near)
    np.testing.assert_allclose(tree.stems.offset, [s.offset for s in stems], **near)
    np.testing.assert_allclose(tree.nodes.position, [x for s in stems for x in s.place], **near)
    frames = np.array([f for s in stems for f in s.frame])
    np.testing.assert_allclose(tree.nodes.heading, frames[:, :, 2], atol=1e-6)
    np.testing.assert_allclose(tree.nodes.side, frames[:, :, 0], atol=1e-6)
    # Where spheres meet, the radius falls as a square root.
    width = [w for s in stems for w in s.width]
    np.testing.assert_allclose(tree.nodes.radius, width, atol=1e-5 * tree.scale)
    leaves = np.array([x for x, _ in twin.leaves]).reshape(-1, 3)
    np.testing.assert_allclose(tree.leaves.position, leaves, **near)
    turned = np.array([f for _, f in twin.leaves]).reshape(-1, 3, 3)
    np.testing.assert_allclose(tree.leaves.direction, turned[:, :, 2], atol=1e-6)
    np.testing.assert_allclose(tree.leaves.normal, turned[:, :, 1], atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(parameters, st.integers(0, 2**40), st.sampled_from(["corrected", "paper"]))
def test_every_tree_is_finite_and_hangs_together(p: Parameters, seed: int, readings: str) -> None:
    tree = grow(p, seed, readings=readings)  # type: ignore[arg-type]
    for column in (*tree.nodes, *tree.leaves):
        assert np.isfinite(column).all()
    assert (tree.nodes.radius >= 0.0).all()
    skeleton = tree.skeleton()
    assert (skeleton.parent < np.arange(len(skeleton))).all()
    assert (skeleton.parent == -1).sum() == 1
    inner = skeleton.parent >= 0
    parent = skeleton.parent[inner]
    along = skeleton.end[parent] - skeleton.start[parent]
    to = skeleton.start[inner] - skeleton.start[parent]
    part = np.clip((to * along).sum(1) / np.maximum((along**2).sum(1), 1e-30), 0, 1)
    gap = np.linalg.norm(to - part[:, None] * along, axis=1)
    assert gap.max(initial=0.0) < 1e-6 * tree.scale


@pytest.mark.parametrize("change", ["2Curve=10", "Leaves=3", "2SegSplits=0.4", "2Branches=11"])
def test_a_change_in_one_level_leaves_those_below(change: str) -> None:
    species = load_parameters("quaking_aspen")
    before, after = grow(species, 5), grow(species.with_changes([change]), 5)
    kept = before.stems.level < 2
    count = int(kept.sum())
    np.testing.assert_array_equal(before.stems.length[kept], after.stems.length[:count])
    nodes = int(before.stems.nodes[kept].sum())
    np.testing.assert_array_equal(before.nodes.position[:nodes], after.nodes.position[:nodes])


def test_threads_do_not_matter_within_a_tree() -> None:
    willow = load_parameters("weeping_willow").with_changes(["3Branches=4", "Leaves=3"])
    trees = []
    for threads in (1, 3):
        with using_threads(threads):
            trees.append(grow(willow, 4))
    for a, b in zip(*((*t.stems, *t.nodes, *t.leaves) for t in trees), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_fan_of_stems_spreads_from_the_parent_s_end() -> None:
    values = {"Levels": 2, "Scale": 10, "Shape": 3, "0Taper": 0.5, "1Branches": -5, "1Rotate": 120}
    tree = grow(from_paper({**values, "1DownAngle": 0, "1Length": 0.2}), 1)
    end = tree.nodes.position[tree.stems.nodes[0] - 1]
    first = tree.stems.first[1:]
    np.testing.assert_allclose(tree.nodes.position[first], np.tile(end, (5, 1)), atol=1e-9)
    heading = tree.nodes.heading[first]
    angle = np.degrees(np.arctan2(heading[:, 0], heading[:, 2]))
    np.testing.assert_allclose(angle, [-48, -24, 0, 24, 48], atol=1e-6)
    assert (tree.stems.radius[1:] > 0.0).all()


def test_as_printed_a_clone_s_propensity_is_halved_once() -> None:
    values = {"Levels": 1, "0SegSplits": 1, "0CurveRes": 9}
    once, each = (len(grow(from_paper(values), 1, readings=r).stems.level) for r in _READINGS)
    # By hand: 2 stems after the first joint, then half as many more at each of 7 joints.
    assert once == pytest.approx(2 * 1.5**7, rel=0.15)
    assert each < 0.5 * once


def test_threads_do_not_matter() -> None:
    with using_threads(2):
        many = grow_many("queen_palm", range(5))
    for seed, tree in enumerate(many):
        np.testing.assert_array_equal(tree.nodes.position, grow("queen_palm", seed).nodes.position)


def test_quality_keeps_the_area_of_the_leaves() -> None:
    full, half = grow("quaking_aspen", 1), grow("quaking_aspen", 1, quality=0.5)
    area = [float((t.leaves.length * t.leaves.width).sum()) for t in (full, half)]
    assert len(half.leaves.stem) == pytest.approx(0.5 * len(full.leaves.stem), rel=0.05)
    assert area[1] == pytest.approx(area[0], rel=0.05)


@pytest.mark.parametrize("name", parametric_names())
def test_shipped_species_grow(name: str) -> None:
    parameters = load_parameters(name)
    if name == "weeping_willow":  # of its 700,000 twigs a few
        parameters = parameters.with_changes(["3Branches=6", "Leaves=5"])
    assert parameters.source
    tree = grow(parameters, 2)
    assert tree.parameters.name == name
    height = tree.nodes.position[:, 2].max()
    assert 0.4 * tree.scale < height < 1.6 * tree.scale


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("0CurveRes=0", "level[0].segments: 0 is not allowed; expected whole number, 1 to 200"),
        ("ScaleV=14", "smaller than nothing"),
        ("1Brunches=3", "did you mean '1Branches'?"),
        ("level.1.brunches=3", "did you mean 'level.1.branches'?"),
        ("0Length=0", "no length"),
        (
            "0CurveRes=1",
            "base_splits: the trunk is one segment, and splits where its first two meet; expected",
        ),
        ("Scale", "changes nothing"),
    ],
)
def test_refused_parameters(change: str, words: str) -> None:
    species = "weeping_willow" if "base_splits" in words else "quaking_aspen"
    with pytest.raises(InputError) as error:
        load_parameters(species).with_changes([change])
    assert words in str(error.value)


def test_splits_that_explode_are_refused() -> None:
    values = {"Levels": 1, "0SegSplits": 5, "0CurveRes": 30}
    wild = from_paper(values).with_changes(["clone_habit=1"])
    with pytest.raises(
        InputError, match=r"level 0 brings the tree to more than [\d,]+ (stems|cross)"
    ):
        grow(wild)


def test_a_tree_next_to_nothing_is_drawn_again() -> None:
    oak = from_paper({"Scale": 10, "ScaleV": 10, "Levels": 1})
    scales = [grow(oak, seed).scale for seed in range(60)]
    assert 1.0 <= min(scales) < 4.0
    assert 16.0 < max(scales) <= 20.0
