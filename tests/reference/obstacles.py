"""Whether a voxel is solid, asked of the obstacle itself."""

from __future__ import annotations

from forest.environment.obstacles import Box


def in_box(box: Box, voxel: tuple[int, int, int], voxel_m: float) -> bool:
    """Tell whether a voxel's centre lies inside a box."""
    return all(
        low < (i + 0.5) * voxel_m < high
        for low, i, high in zip(box.min_m, voxel, box.max_m, strict=True)
    )
