"""The stands that are timed are what they claim to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.trees.metamers import BYTES_PER_METAMER, FIELDS
from tests.benchmarks.bending import measure_bending
from tests.benchmarks.costs import exponent
from tests.benchmarks.stands import (
    ClockedStand,
    Saved,
    count_metamers,
    fingerprint,
    grow_tile,
    lay_tiles,
    load,
    save,
)
from tests.benchmarks.touching import PHASES, metamer_bytes


@pytest.fixture(scope="module")
def tile() -> Saved:
    return grow_tile(edge_m=6.0, years=4)


def _light(stand: ClockedStand) -> list[np.ndarray]:
    """Light of each tree's metamers after an exposure."""
    stand._clock = stand._cpu_clock = 0.0
    stand._expose()
    extents = zip(stand.rows.start, stand.rows.size, strict=True)
    return [stand.arena.metamers.light[start : start + size].copy() for start, size in extents]


def test_each_copy_has_the_light_of_the_tile(tile: Saved) -> None:
    one = _light(tile.restore())
    copies = _light(lay_tiles(tile, 3).restore())
    assert len(copies) == 9 * len(one)
    for tree, light in enumerate(copies):
        np.testing.assert_array_equal(light, one[tree % len(one)])


def test_a_tiled_stand_grows_and_its_trees_stand_on_the_plot(tile: Saved) -> None:
    stand = lay_tiles(tile, 2).restore()
    before, _ = count_metamers(stand)
    stand.step()
    after, sites = count_metamers(stand)
    assert after > before > 0
    assert 0 < sites < after
    assert np.all(np.diff(stand.rows.tree_id) > 0)
    assert stand.rows.x.max() > 6.0
    assert stand.rows.x.max() < 12.0
    assert stand.seconds.keys() == stand.cpu_seconds.keys()


def test_a_saved_tile_comes_back_whole(tile: Saved, tmp_path: Path) -> None:
    save(tile, tmp_path / "tile.npz")
    assert fingerprint(load(tmp_path / "tile.npz").restore()) == fingerprint(tile.restore())


def test_phases_are_those_of_a_year_and_touch_known_fields(tile: Saved) -> None:
    stand = tile.restore()
    stand.step()
    assert PHASES.keys() <= stand.seconds.keys()
    for phase, touched in PHASES.items():
        assert set(touched.reads) | set(touched.writes) <= FIELDS.keys()
        assert 0 < metamer_bytes(phase) <= 2 * BYTES_PER_METAMER


def test_exponent_of_a_known_power() -> None:
    stands = [
        {"metamers": n, "threads": {"1": {"year": {"wall_ns": 1e9 * n**0.1}}}}
        for n in (10**5, 10**6, 10**7)
    ]
    assert exponent(stands, "1") == pytest.approx(1.1)


def test_parts_of_mechanics_lie_within_its_phase(tmp_path: Path) -> None:
    save(grow_tile("mechanics={}", edge_m=6.0, years=4), tmp_path / "tile.npz")
    found = measure_bending(str(tmp_path / "tile.npz"), 2, 1)
    assert found["same_bits"]
    assert 1.0 <= found["passes"] <= found["most_passes"]
    for timed in found["threads"].values():
        parts = [ns for part, ns in timed["wall_ns"].items() if part != "stability"]
        assert 0.0 < sum(parts) <= timed["bend_ns"] < timed["year_ns"]
        assert min(timed["again_ns"], timed["picture_ns"], timed["year_ratio"]) > 0.0
