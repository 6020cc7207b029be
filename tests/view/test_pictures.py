"""Pictures: the right size, something on them, and geometry that is where the tree is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from forest.trees.skeleton import Skeleton
from forest.view.looks import look_of
from forest.view.shading import LightVolume
from forest.view.shapes import gather_leaves, gather_wood, polylines
from forest.view.stand_picture import draw_stand
from forest.view.tree_picture import draw_tree, draw_trees


def small_tree(
    x: float = 0.0, y: float = 0.0, n: int = 12, tree_id: int = 1, species: str = "picea_abies"
) -> Skeleton:
    """A stem of `n` half metres with a branch of two internodes at every second node."""
    parent, axis, order, end = [], [], [], []
    for k in range(n):
        parent.append(k - 1)
        axis.append(0)
        order.append(0)
        end.append((x, y, 0.5 * (k + 1)))
    for b, k in enumerate(range(n // 3, n, 2)):
        for step in (1, 2):
            parent.append(k if step == 1 else len(parent) - 1)
            axis.append(b + 1)
            order.append(1)
            end.append(
                (x + 0.5 * step * np.cos(2.4 * k), y + 0.5 * step * np.sin(2.4 * k), end[k][2])
            )
    ends, parents, orders = (
        np.array(end, float),
        np.array(parent, np.int32),
        np.array(order, np.int32),
    )
    starts = np.where(parents[:, None] < 0, (x, y, 0.0), ends[parents])
    count = len(parents)
    return Skeleton(
        parent=parents,
        start=starts,
        end=ends,
        radius=np.where(orders == 0, 0.10 - 0.09 * ends[:, 2] / ends[:, 2].max(), 0.01),
        axis=np.array(axis, np.int32),
        order=orders,
        birth_year=np.zeros(count, np.int32),
        leafy=orders > 0,
        serial=np.arange(count, dtype=np.int32),
        tree_id=tree_id,
        species=species,
    )


def pixels(path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), float)


def test_a_stand_picture(tmp_path):
    trees = [small_tree(2.0, 2.0), small_tree(6.0, 3.0, 9, 2, "fagus_sylvatica")]
    draw_stand(trees, (8.0, 5.0), tmp_path / "stand.png", window=(200, 120))
    draw_stand(trees, (8.0, 5.0), tmp_path / "bare.png", leaves=False, window=(200, 120))
    draw_stand([], (8.0, 5.0), tmp_path / "empty.png", window=(200, 120))
    stand, bare, empty = (pixels(tmp_path / f"{n}.png") for n in ("stand", "bare", "empty"))
    assert stand.shape == (120, 200, 3)
    assert stand.std() > 20
    assert empty.std() > 5  # sky and ground

    def green(picture):
        return np.mean(picture[..., 1] > 1.12 * picture[..., [0, 2]].max(axis=-1))

    assert green(stand) > green(bare) + 0.005
    assert np.abs(bare - stand).mean() > 0.5


def test_a_tree_picture_shows_it_on_white(tmp_path):
    draw_tree(small_tree(30.0, -7.0), tmp_path / "tree.png", window=(90, 160))
    picture = pixels(tmp_path / "tree.png")
    assert picture.shape == (160, 90, 3)
    drawn = picture.min(axis=-1) < 200
    rows = np.flatnonzero(drawn.any(axis=1))
    assert rows[0] < 25 and rows[-1] > 130  # fills the height
    assert not drawn[:, [0, -1]].any()
    low, high = drawn[rows[-1] - 10].sum(), drawn[rows[0] + 4].sum()
    assert low > high  # the stem tapers


def test_panels_keep_the_scale(tmp_path):
    pair = [small_tree(n=16), small_tree(n=8)]
    draw_trees(pair, ["tall", ""], tmp_path / "pair.png", panel=(80, 140))
    picture = pixels(tmp_path / "pair.png")
    assert picture.shape == (140, 160, 3)
    height = [
        np.ptp(np.flatnonzero((half.min(axis=-1) < 200).any(axis=1)))
        for half in (picture[40:, :80], picture[40:, 80:])
    ]
    assert height[1] < 0.7 * height[0]


def test_polylines_follow_the_axes():
    tree = small_tree(n=6)
    wood = gather_wood([tree, small_tree(5.0, n=6)])
    lines = polylines(wood)
    cells, k = [], 0
    while k < len(lines.cells):
        cells.append(lines.cells[k + 1 : k + 1 + lines.cells[k]])
        k += 1 + lines.cells[k]
    assert [len(cell) for cell in cells] == [7, 3, 3] * 2
    assert lines.points[cells[0]][:, 2] == pytest.approx(np.arange(7) * 0.5)
    assert lines.points[cells[3]][0] == pytest.approx((5.0, 0.0, 0.0))
    assert lines.points[cells[1]][0] == pytest.approx(tree.start[6])


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 20))
def test_a_part_of_the_wood_is_all_drawn(seed, n):
    wood = gather_wood([small_tree(n=n), small_tree(3.0, n=4)])
    chosen = np.random.default_rng(seed).random(len(wood.radius)) < 0.6
    part = wood.part(chosen)
    lines = polylines(part)
    drawn = set()
    k = 0
    while k < len(lines.cells):
        points = lines.points[lines.cells[k + 1 : k + 1 + lines.cells[k]]]
        drawn |= {(*a, *b) for a, b in pairwise(points)}
        k += 1 + lines.cells[k]
    wanted = np.concatenate((wood.start[chosen], wood.end[chosen]), axis=1)
    assert drawn == {tuple(row) for row in wanted}


@pytest.mark.parametrize("species", ["generic_deciduous", "picea_abies"])
def test_leaves_left_out_are_made_up_for(species):
    trees = [small_tree(n=40, tree_id=k, species=species) for k in range(1, 6)]
    every, one = gather_leaves(trees, 10_000)
    some, scale = gather_leaves(trees, 60)
    none, _ = gather_leaves([], 10)
    assert one == 1.0 and len(none.place) == 0
    assert len(every.place) == sum(int(t.leafy.sum()) for t in trees)
    assert len(some.cards(scale)[0]) == pytest.approx(60, abs=10)
    assert some.area.sum() * scale**2 == pytest.approx(every.area.sum(), rel=1e-6)
    cards, site = every.cards(1.0)
    diagonals = np.cross(cards[:, 2] - cards[:, 0], cards[:, 3] - cards[:, 1])
    area = np.bincount(site, 0.5 * np.linalg.norm(diagonals, axis=1))
    assert area == pytest.approx(every.area, rel=1e-6)


def test_needles_are_fine_and_slant_along_their_shoot():
    spruces = [small_tree(n=40, tree_id=k) for k in (1, 2)]
    leaves, _ = gather_leaves(spruces, 10_000)
    cards, site = leaves.cards(1.0)
    assert leaves.blades > 10 and set(np.bincount(site)) == {leaves.blades}
    blade = cards[:, 2] - cards[:, 0]
    shoot = leaves.along[site]
    length = np.linalg.norm(shoot, axis=1)
    slant = np.einsum("ij,ij->i", blade, shoot) / np.linalg.norm(blade, axis=1) / length
    assert np.degrees(np.arccos(slant)) == pytest.approx(32.0)
    share = np.einsum("ij,ij->i", cards[:, 0] - (leaves.place[site] - shoot), shoot) / length**2
    assert share.min() > 0.0 and share.max() < 1.0  # they stand on the internode
    wood = gather_wood(spruces)
    assert not np.allclose(wood.bark, look_of("picea_abies").bark)  # hidden among needles


def test_light_is_less_below_leaves():
    rng = np.random.default_rng(1)
    leaves = rng.uniform((0, 0, 4), (10, 10, 6), (4000, 3))
    volume = LightVolume(leaves, np.full(4000, 0.1), (np.zeros(3), np.array([10.0, 10.0, 8.0])))
    sun, sky = volume.at(np.array([[5, 5, 7.9], [5, 5, 5.0], [5, 5, 1.0]]))
    assert sun[0] == pytest.approx(1.0) and sky[0] == pytest.approx(1.0)
    assert sun[0] > sun[1] > sun[2] > 0
    # 4 m2 of leaf per m2 of ground, Beer-Lambert
    assert sky[2] == pytest.approx(np.exp(-0.16 * 4), rel=0.15)


def test_an_unknown_species_keeps_its_look():
    assert look_of("acer_x") == look_of("acer_x")
    assert look_of("picea_abies").needles
