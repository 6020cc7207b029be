"""Shape ratio, envelope, taper, flare and lobes (Weber & Penn 1995, 4.3, 4.4, 4.6)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit

#: The names of the shapes, by their number in the paper.
SHAPES = (
    "conical",
    "spherical",
    "hemispherical",
    "cylindrical",
    "tapered_cylindrical",
    "flame",
    "inverse_conical",
    "tend_flame",
    "envelope",
)


@njit
def shape_ratio(shape: Any, ratio: Any, width_peak: Any, low: Any, high: Any, printed: Any) -> Any:
    """ShapeRatio(shape, ratio): relative length of a branch (4.3; shape 8: 4.6).

    Parameters
    ----------
    shape : int
        0 to 8, an index into `SHAPES`.
    ratio : float
        0 at the top of the crown, 1 at its base.
    width_peak, low, high : float
        PruneWidthPeak, PrunePowerLow, PrunePowerHigh; only shape 8 reads them.
    printed : bool
        Whether shape 8 divides by 1 - PruneWidthPeak below its peak, as printed, where it jumps
        unless the peak is at 0.5; else by PruneWidthPeak.
    """
    if shape == 0:
        return 0.2 + 0.8 * ratio
    if shape == 1:
        return 0.2 + 0.8 * np.sin(np.pi * ratio)
    if shape == 2:
        return 0.2 + 0.8 * np.sin(0.5 * np.pi * ratio)
    if shape == 3:
        return 1.0
    if shape == 4:
        return 0.5 + 0.5 * ratio
    if shape == 5:
        return ratio / 0.7 if ratio <= 0.7 else (1.0 - ratio) / 0.3
    if shape == 6:
        return 1.0 - 0.8 * ratio
    if shape == 7:
        return 0.5 + 0.5 * (ratio / 0.7 if ratio <= 0.7 else (1.0 - ratio) / 0.3)
    if ratio <= 0.0 or ratio >= 1.0:
        return 0.0
    if ratio < 1.0 - width_peak:
        return (ratio / (1.0 - width_peak)) ** high
    return ((1.0 - ratio) / (1.0 - width_peak if printed else width_peak)) ** low


@njit
def tapered(radius: Any, taper: Any, z: Any, length: Any) -> Any:
    """Radius of a stem at z, 0 at its base and 1 at its end, m (4.4); no flare."""
    if taper < 1.0:
        return radius * (1.0 - taper * z)
    purely = radius * (1.0 - (2.0 - taper) * z) if taper < 2.0 else radius
    left = (1.0 - z) * length
    depth = 1.0 if taper < 2.0 or left < purely else taper - 2.0
    if taper < 2.0:
        within = left
        if within >= purely:
            return purely
    elif purely <= 0.0:
        return purely
    else:
        within = abs(left - 2.0 * purely * np.floor(left / (2.0 * purely) + 0.5))
    square = purely * purely - (within - purely) ** 2
    return (1.0 - depth) * purely + depth * np.sqrt(max(square, 0.0))


@njit
def flared(flare: Any, z: Any) -> Any:
    """Factor on the trunk's radius near its base (4.4)."""
    y = max(0.0, 1.0 - 8.0 * z)
    return flare * (100.0**y - 1.0) / 100.0 + 1.0


def lobed(lobes: Any, depth: Any, angle_rad: Any) -> Any:
    """Factor on the trunk's radius in a direction of its cross-section (4.4).

    Parameters
    ----------
    lobes : int
        Number of peaks around the trunk.
    depth : float
        Their height as a share of the radius.
    angle_rad : float or array
        Direction from the section's x axis.
    """
    return 1.0 + depth * np.sin(lobes * np.asarray(angle_rad))
