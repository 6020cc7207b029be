"""Stands of any size in moments: a small periodic plot is grown once and laid out as tiles."""

from __future__ import annotations

import hashlib
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.scenario import Scenario
from forest.stand import Stand
from forest.trees.metamers import LATERAL, TERMINAL
from forest.yearbook import YearRecord

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
TILE_M = 12.0
#: The canopy of the tile has closed; about 40,000 metamers, two fifths of which bear a living site.
TILE_YEARS = 25

_PLACE_IN_MEMORY = ("tree_start", "tree_room")


class Saved(NamedTuple):
    """A stand as `Stand.state` gives it, with its scenario."""

    scenario: Scenario
    arrays: dict[str, NDArray[Any]]
    meta: dict[str, Any]

    def restore(self) -> ClockedStand:
        """Build the stand anew."""
        stand = ClockedStand.restore(self.scenario, self.arrays, self.meta)
        assert isinstance(stand, ClockedStand)
        stand.forget_times()
        return stand


class ClockedStand(Stand):
    """A stand that also notes the processor time of each phase.

    Attributes
    ----------
    cpu_seconds : dict of str to float
        Processor time of all threads in each phase so far, beside the wall time in `seconds`.
    """

    cpu_seconds: dict[str, float]

    def step(self) -> YearRecord:
        """Grow for one year."""
        self._cpu_clock = time.process_time()
        return super().step()

    def forget_times(self) -> None:
        """Start both clocks from zero."""
        self.seconds = {}
        self.cpu_seconds = {}

    def _lap(self, phase: str) -> None:
        super()._lap(phase)
        now = time.process_time()
        self.cpu_seconds[phase] = self.cpu_seconds.get(phase, 0.0) + now - self._cpu_clock
        self._cpu_clock = now


def on_square(scenario: Scenario, edge_m: float) -> Scenario:
    """Give the scenario on a square plot."""
    return scenario.with_overrides([f"plot.size_m=[{edge_m:g}, {edge_m:g}]"])


def grow_tile(*changes: str, edge_m: float = TILE_M, years: int = TILE_YEARS) -> Saved:
    """Grow the hectare's stand, changed as `--set` would, on a small periodic plot."""
    scenario = on_square(Scenario.load(SCENARIOS / "hectare.toml"), edge_m)
    scenario = scenario.with_overrides(changes)
    stand = Stand(scenario)
    for _ in range(years):
        stand.step()
    return Saved(scenario, *stand.state())


def lay_tiles(tile: Saved, across: int) -> Saved:
    """Repeat a periodic stand `across` times along x and y, on a plot as much larger.

    The copies stand whole voxels apart, so that each of them has the light of the first. They
    have ids of their own, hence other random numbers, and part in the years that follow.
    """
    shadow = tile.scenario.environment.shadow
    assert shadow is not None
    edge = tile.scenario.plot.size_m[0]
    voxels = round(edge / shadow.voxel_m)
    copies = across * across
    arrays = {
        name: np.tile(array, (copies,) + (1,) * (array.ndim - 1))
        for name, array in tile.arrays.items()
    }
    trees = len(tile.arrays["tree_tree_id"])
    column, row = np.divmod(np.repeat(np.arange(copies), trees), across)
    arrays["tree_tree_id"] = np.arange(1, copies * trees + 1, dtype=np.int32)
    arrays["tree_x"] += column * edge
    arrays["tree_y"] += row * edge
    arrays["tree_base_voxel"][:, 0] += (column * voxels).astype(np.int32)
    arrays["tree_base_voxel"][:, 1] += (row * voxels).astype(np.int32)
    meta = {**tile.meta, "next_id": copies * trees + 1, "pending": []}
    return Saved(on_square(tile.scenario, across * edge), arrays, meta)


def count_metamers(stand: Stand) -> tuple[int, int]:
    """Count the metamers of the living trees, and those of them that bear a living site."""
    rows = stand.rows
    sites = 0
    for start, size in zip(rows.start, rows.size, strict=True):
        state = stand.arena.metamers.state[start : start + size]
        sites += int(np.count_nonzero(state & (TERMINAL | LATERAL)))
    return int(rows.size.sum()), sites


def fingerprint(stand: Stand) -> str:
    """Hash all that the next year needs, but for where in memory a tree lies."""
    arrays, meta = stand.state()
    digest = hashlib.blake2b(json.dumps(meta, sort_keys=True).encode(), digest_size=8)
    for name in sorted(arrays.keys() - set(_PLACE_IN_MEMORY)):
        digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()


def save(saved: Saved, path: Path) -> None:
    """Keep a stand for other processes."""
    meta = np.array([saved.scenario.to_toml(), json.dumps(saved.meta)])
    np.savez(path, _meta=meta, **saved.arrays)


def keep_tile(path: str, *changes: str) -> None:
    """Grow a tile and save it."""
    save(grow_tile(*changes), Path(path))


def load(path: Path) -> Saved:
    """Read what `save` wrote."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files if name != "_meta"}
        toml, meta = (str(text) for text in file["_meta"])
    return Saved(Scenario.from_toml(toml, where=path.name), arrays, json.loads(meta))
