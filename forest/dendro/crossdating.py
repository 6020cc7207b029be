"""How well series of ring widths agree from year to year."""

from __future__ import annotations

import numpy as np
import pandas as pd

#: Fewest years in common for a correlation.
LEAST_YEARS = 10


def relative_changes(widths: pd.DataFrame) -> pd.DataFrame:
    """Give the relative change from ring to ring, 2 (w_t - w_{t-1}) / (w_t + w_{t-1}).

    Its absolute values are the terms of the mean sensitivity (Douglass 1920). It takes out the
    level and the slope of a series, has the same spread for wide and narrow rings, and is bounded
    by -2 and 2, so that missing rings do no harm. What bends a trend stays in: trees of one age
    agree in it without any weather.
    NaN where two rings in a row are missing, and in the first year of a series.
    """
    before = widths.shift()
    total = widths + before
    return (2.0 * (widths - before) / total.where(total > 0.0)).iloc[1:]


def interseries_correlation(widths: pd.DataFrame) -> pd.Series:
    """Correlate each series with the mean of all others, after `relative_changes`.

    Parameters
    ----------
    widths : pandas.DataFrame
        Widths in mm, indexed by calendar year, one column per series (`RingSeries.widths`).

    Returns
    -------
    pandas.Series
        Pearson's r by series; its mean is the interseries correlation of the collection. NaN
        for a series that has less than ten changes in common with others, or does not change.
    """
    changes = relative_changes(widths).to_numpy(dtype=float)
    there = ~np.isnan(changes)
    value = np.where(there, changes, 0.0)
    total, count = value.sum(axis=1), there.sum(axis=1)
    r = np.full(widths.shape[1], np.nan)
    for k in range(widths.shape[1]):
        rows = there[:, k] & (count > 1)
        if rows.sum() < LEAST_YEARS:
            continue
        one = value[rows, k]
        others = (total[rows] - one) / (count[rows] - 1)
        if one.std() > 0.0 and others.std() > 0.0:
            r[k] = np.corrcoef(one, others)[0, 1]
    return pd.Series(r, index=widths.columns, name="interseries_correlation")
