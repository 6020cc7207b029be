"""Where trees are planted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.placing import Spots

THREE = {
    "pinus_sylvestris": {"share": 3},
    "picea_abies": {"share": 1},
    "quercus_robur": {"share": 0},
}


def planted(planting: dict[str, object], *, seed: int = 1, boundary: str = "periodic") -> Scenario:
    return Scenario(
        years=1,
        seed=seed,
        plot={"size_m": [20, 10], "boundary": boundary},
        environment={"canopy": {}},
        species=THREE,
        planting=planting,
    )


def torus_distances(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    dx = squareform(pdist(x[:, None]))
    dy = squareform(pdist(y[:, None]))
    distances = np.hypot(np.minimum(dx, 20 - dx), np.minimum(dy, 10 - dy))
    return distances[np.triu_indices(len(x), 1)]


def test_random_keeps_its_distance_across_the_edges() -> None:
    x, y, _ = planted(
        {"kind": "random", "density_ha": 5000, "min_distance_m": 0.8}
    ).planting_positions()
    assert len(x) == 100
    assert torus_distances(x, y).min() >= 0.8
    assert x.min() >= 0
    assert x.max() < 20
    assert y.max() < 10
    assert abs(x.mean() - 10) < 2  # both halves are used


def test_random_depends_on_the_seed_alone() -> None:
    planting = {"kind": "random", "density_ha": 2000}
    one, same, other = (planted(planting, seed=s).planting_positions() for s in (1, 1, 2**63 - 1))
    assert all(np.array_equal(a, b) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one[0], other[0])


def test_species_follow_their_shares() -> None:
    _, _, species = planted({"kind": "random", "density_ha": 50000}).planting_positions()
    shares = np.bincount(species, minlength=3) / len(species)
    assert shares == pytest.approx([0.75, 0.25, 0], abs=0.05)
    assert shares[2] == 0


def test_regular_stands_in_rows_half_a_spacing_from_the_edge() -> None:
    x, y, _ = planted({"kind": "regular", "spacing_m": [4, 5]}).planting_positions()
    assert sorted(set(x)) == [2, 6, 10, 14, 18]
    assert sorted(set(y)) == [2.5, 7.5]
    assert len(x) == 10


def test_regular_wider_than_the_plot_is_one_tree_in_the_middle() -> None:
    x, y, _ = planted({"kind": "regular", "spacing_m": [400, 50]}).planting_positions()
    assert (x.tolist(), y.tolist()) == ([10], [5])


def test_explicit_keeps_places_and_wraps_the_edge_of_a_torus() -> None:
    trees = [
        {"x_m": 20, "y_m": 3, "species": "quercus_robur"},
        {"x_m": 1.25, "y_m": 10, "species": "pinus_sylvestris"},
    ]
    explicit = {"kind": "explicit", "trees": trees}
    x, y, species = planted(explicit).planting_positions()
    assert (x.tolist(), y.tolist(), species.tolist()) == ([0, 1.25], [3, 0], [2, 0])
    x, y, _ = planted(explicit, boundary="open").planting_positions()
    assert (x.tolist(), y.tolist()) == ([20, 1.25], [3, 10])


def test_only_trees_planted_one_by_one_lean() -> None:
    trees = [
        {"x_m": 1, "y_m": 3, "species": "picea_abies", "lean_deg": 30, "lean_azimuth_deg": 90},
        {"x_m": 2, "y_m": 3, "species": "picea_abies"},
    ]
    lean, azimuth = planted({"kind": "explicit", "trees": trees}).planting_leans()
    assert (lean.tolist(), azimuth.tolist()) == ([30, 0], [90, 0])
    rows = planted({"kind": "regular", "spacing_m": [4, 5]})
    assert rows.planting_leans()[0].tolist() == [0.0] * len(rows.planting_positions()[0])
    trees[0]["lean_deg"] = 90
    with pytest.raises(InputError, match=r"trees\[0\].lean_deg"):
        planted({"kind": "explicit", "trees": trees})


@pytest.mark.parametrize(
    ("planting", "message"),
    [
        ({"kind": "random", "density_ha": 5000, "min_distance_m": 1.2}, "min_distance_m.*at most"),
        ({"kind": "regular", "spacing_m": [0.001, 1]}, "spacing_m"),
        ({"kind": "random", "density_ha": 0}, "density_ha"),
    ],
)
def test_impossible_plantings_are_refused(planting: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        planted(planting)


coordinate = st.floats(0, 1)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(coordinate, coordinate), max_size=12),
    st.tuples(coordinate, coordinate),
    st.floats(0.05, 8),
    st.booleans(),
)
def test_spots_find_a_neighbour_as_a_plain_search_does(
    others: list[tuple[float, float]], at: tuple[float, float], distance: float, periodic: bool
) -> None:
    size = (6.0, 4.0)
    spots = Spots(size, distance, periodic=periodic)
    near = False
    for number, (u, v) in enumerate(others):
        x, y = u * size[0], v * size[1]
        spots.take(x, y, number)
        dx, dy = abs(x - at[0] * size[0]), abs(y - at[1] * size[1])
        if periodic:
            dx, dy = min(dx, size[0] - dx), min(dy, size[1] - dy)
        near |= bool(np.hypot(dx, dy) < distance)
    assert (spots.neighbour(at[0] * size[0], at[1] * size[1]) is not None) == near
