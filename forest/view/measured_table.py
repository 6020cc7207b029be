"""Measured trees and cut logs for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

    from forest.measure.gaps import Gaps


def species_table(trees: pd.DataFrame, hectares: float) -> Table:
    """Give a table of measured trees: a row per species, and one for all of several.

    Parameters
    ----------
    trees : pandas.DataFrame
        As `forest.measure.tables.measure_run` gives them.
    hectares : float
        Area of the plot.

    Returns
    -------
    rich.table.Table
        Stems, basal area and stem volume per ha; quadratic mean diameter, mean height, mean
        slenderness and mean crown ratio of the trees that have a dbh; above-ground dry mass and
        carbon per ha.
    """
    table = _table(
        "species", "N\n/ha", "G\nm²/ha", "Dq\ncm", "H\nm", "H/D\n", "crown\nratio", "V\nm³/ha",
        "mass\nt/ha", "carbon\nt/ha",
    )  # fmt: skip
    groups = [(str(name), rows) for name, rows in trees.groupby("species", observed=True)]
    for name, rows in [*groups, ("all", trees)] if len(groups) != 1 else groups:
        thick = rows[rows["dbh_cm"].notna()]
        means = (
            (float(np.sqrt((thick["dbh_cm"] ** 2).mean())), 1),
            (float(thick["height_m"].mean()), 1),
            (float(thick["slenderness"].mean()), 0),
            (float(thick["crown_ratio"].mean()), 2),
        )
        table.add_row(
            name.replace("_", " "),
            f"{len(rows) / hectares:.0f}",
            f"{rows['basal_area_m2'].sum() / hectares:.1f}",
            *("–" if np.isnan(value) else f"{value:.{digits}f}" for value, digits in means),
            f"{rows['stem_volume_m3'].sum() / hectares:.0f}",
            f"{rows['above_ground_kg'].sum() / hectares / 1000:.1f}",
            f"{rows['carbon_kg'].sum() / hectares / 1000:.1f}",
        )
    return table


def gaps_line(gaps: Gaps) -> str:
    """Say in a line how much of the plot lies in canopy gaps, and in what sizes."""
    area = gaps.area_m2
    if not len(area):
        return f"no gap between the crowns of trees above {gaps.taller_than_m:.1f} m"
    if not gaps.share() < 1.0:
        return "the whole plot is a gap"
    number = f"{len(area)} gaps, the largest" if len(area) > 1 else "1 gap"
    return (
        f"gaps between the crowns of trees above {gaps.taller_than_m:.1f} m: "
        f"{100.0 * gaps.share():.0f} % of the plot; {number} {area.max():.1f} m²"
    )


def assortment_table(sums: pd.DataFrame) -> Table:
    """Give a table of `forest.measure.bucking.assortments`, with a row for all."""
    table = _table("product", "logs", "volume\nm³", "value")
    rows = [tuple(row) for row in sums.itertuples(index=False)]
    rows.append(("all", *(sums[name].sum() for name in ("logs", "volume_m3", "value"))))
    for name, logs, volume, value in rows:
        table.add_row(str(name), f"{logs:,.0f}", f"{volume:,.2f}", f"{value:,.0f}")
    return table


def _table(first: str, *headings: str) -> Table:
    from rich.table import Table

    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column(first, vertical="bottom")
    for heading in headings:
        table.add_column(heading, justify="right", vertical="bottom")
    return table


def residual_lines(rows: pd.DataFrame) -> list[str]:
    """Say of each residual tree of a year, rows of `/residual`, what it measures."""
    return [
        f"residual tree {tree.name} ({tree.species}, {tree.status}): {tree.height_m:.1f} m, "
        f"dbh {tree.dbh_cm:.1f} cm, crown from {tree.crown_base_m:.1f} m, "
        f"radius {tree.crown_radius_m:.1f} m, {tree.leaf_area_m2:.0f} m2 of leaves"
        for tree in rows.itertuples()
    ]
