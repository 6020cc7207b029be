"""What the brush scripts share: a tree under the brush, whose strokes become a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import forest
from forest.trees.skeleton import Skeleton

#: The deciduous tree of the paper with short internodes, in a plot without markers of its own.
TREE: dict[str, Any] = {
    "mode": "paper",
    "plot": {"size_m": [12.0, 12.0]},
    "environment": {"markers": {"everywhere": False, "spacing_m": 0.12}},
    "species": {
        "generic_deciduous": {
            "architecture": {"internode_length_m": 0.1, "max_metamers_per_shoot": 3},
            "bud_fate": {"alpha": 2.0, "apical_bias": 0.52},
            "shoots": {"light_weight": 0.6, "tropism_weight": 0.05},
            "wood": {"pipe_exponent": 2.3, "twig_diameter_m": 0.005},
        }
    },
    "planting": {"kind": "explicit", "trees": [{"x_m": 6.0, "y_m": 6.0}]},
}


class Session:
    """A stand under the brush: strokes are laid at once, and kept as acts of a scenario."""

    def __init__(self, seed: int | None, **changes: Any) -> None:
        self._base = {**TREE, **changes, "seed": 1 if seed is None else seed}
        self._acts: list[dict[str, Any]] = []
        self.stand = forest.Stand(forest.Scenario(years=1, **self._base))

    def stroke(self, points_m: Any, radius_m: Any, **keys: Any) -> NDArray[np.float64]:
        """Lay a stroke; give its markers."""
        number = self.stand.stroke(points_m, radius_m, **keys)
        act = {"points_m": points_m, "radius_m": radius_m, **keys}
        self._acts.append({"kind": "stroke", "year": self.stand.year + 1, **act})
        before, end = self.stand.strokes["markers"].cumsum().reindex([number - 2, number - 1])
        space = self.stand.surroundings.markers
        assert space is not None
        return space.laid.point[int(0 if np.isnan(before) else before) : int(end)]

    def grow(self, years: int) -> Skeleton:
        """Grow for some years; give the tree's shape."""
        for _ in range(years):
            self.stand.step()
        return self.stand.skeleton(1)

    def nearest(self, place: tuple[float, float, float]) -> int:
        """Pick the metamer whose upper end is nearest to a place; give its serial number."""
        tree = self.stand.skeleton(1)
        return int(tree.serial[np.argmin(np.linalg.norm(tree.end - np.array(place), axis=1))])

    @property
    def laid(self) -> NDArray[np.float64]:
        """All markers that strokes have laid."""
        space = self.stand.surroundings.markers
        assert space is not None
        return space.laid.point

    @property
    def free(self) -> NDArray[np.float64]:
        """The markers that no bud has taken yet, those of the next step included."""
        space = self.stand.surroundings.markers
        assert space is not None
        laid = space.laid
        return laid.point[~laid.gone & (laid.due <= self.stand.steps + 1)]

    def scenario(self) -> forest.Scenario:
        """Give the scenario that grows the same tree."""
        return forest.Scenario(years=max(self.stand.steps, 1), **self._base, acts=self._acts)

    def save(self, to: Path) -> None:
        """Write that scenario."""
        to.write_text(self.scenario().to_toml(), encoding="utf-8")
