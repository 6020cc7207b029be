"""The development stage of a stand, from what a stand table says of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: In the order in which a stand passes through them; `layered` stands beside that order.
STAGES = ("bare", "regeneration", "thicket", "pole", "timber", "mature", "old", "layered")

#: Least top height and least basal area of a thicket; below either a stand is regeneration.
THICKET_HEIGHT_M = 3.0
THICKET_BASAL_AREA_M2HA = 2.0

#: Least quadratic mean diameter of pole, timber, mature and old stands, cm.
STAGE_DIAMETERS_CM = (7.0, 20.0, 35.0, 50.0)

#: From this top height, and this top height per quadratic mean diameter (m/m), stands are layered.
LAYERED_HEIGHT_M = 10.0
LAYERED_RATIO = 150.0


def development_stage(
    top_height_m: ArrayLike, qmd_cm: ArrayLike, basal_area_m2ha: ArrayLike
) -> NDArray[np.str_]:
    """Name the development stage of stands.

    Parameters
    ----------
    top_height_m, qmd_cm, basal_area_m2ha : array-like (n,)
        Columns of `/stand`; the height of a plot without trees is NaN, and so is the diameter where
        no tree has a dbh.

    Returns
    -------
    str array (n,)
        Of `STAGES`. A plot without trees is `bare`. It is in `regeneration` below 3 m of top height
        or 2 m2/ha of basal area, however high the few trees may be that were left over it. Then
        the quadratic mean diameter decides: `thicket` below 7 cm, `pole` below 20, `timber`
        below 35, `mature` below 50, `old` from there on. Where high trees stand over many thin
        ones this diameter tells nothing: from 10 m of top height on, stands whose top height is
        150 times the diameter or more are `layered` (even-aged ones have about 80 to 120).

    Notes
    -----
    The diameters are near those by which Central European inventories tell thicket, pole and
    timber stands; that of old stands and the rule for layered ones are this program's.
    """
    height, diameter, ground = (
        np.asarray(values, np.float64) for values in (top_height_m, qmd_cm, basal_area_m2ha)
    )
    young = ~(height >= THICKET_HEIGHT_M) | ~(ground >= THICKET_BASAL_AREA_M2HA)
    layered = (height >= LAYERED_HEIGHT_M) & (100.0 * height >= LAYERED_RATIO * diameter)
    place = 2 + np.searchsorted(STAGE_DIAMETERS_CM, diameter, side="right")
    place = np.select([np.isnan(height), young, layered], [0, 1, len(STAGES) - 1], place)
    return np.asarray(np.array(STAGES)[place])
