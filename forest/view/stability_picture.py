"""A picture of how safely trees stand: safety factor and wind stress over slenderness."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forest.record.export import whole_file

if TYPE_CHECKING:
    import pandas as pd

_PANELS = {
    "safety_factor": "Buckling load per load",
    "wind_stress_share": "Largest stress in the wind per modulus of rupture",
}


def draw_stability(trees: pd.DataFrame, to: str | Path) -> None:
    """Plot safety factor and wind stress over slenderness, a colour per species.

    Parameters
    ----------
    trees : DataFrame
        See `forest.view.stability_table.stability_of_year`; trees without a dbh are left out.
    to : path
        Picture file to write; the format follows the suffix.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    thick = trees[trees["dbh_cm"].notna()]
    for axes, (column, title) in zip(figure.subplots(1, 2), _PANELS.items(), strict=True):
        for name, group in thick.groupby(thick["species"].astype(str)):
            slenderness = 100.0 * group["height_m"] / group["dbh_cm"]
            size = 4.0 + 2.0 * group["dbh_cm"]
            axes.scatter(slenderness, group[column], s=size, alpha=0.7, lw=0, label=name)
        axes.axhline(1.0, color="0.4", lw=0.8, ls="--")
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel("slenderness H/D")
        if (thick[column] > 0.0).any():
            axes.set_yscale("log")
        axes.grid(color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    if len(thick):
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower left", fontsize=8)
    with whole_file(to, overwrite=True) as draft:
        figure.savefig(draft, dpi=110)
