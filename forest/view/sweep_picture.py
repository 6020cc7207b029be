"""Stems and basal area over the years, a curve with its band per combination of settings."""

from __future__ import annotations

from pathlib import Path

from forest.record.export import whole_file
from forest.view.sweep_table import HasMeans, means_of_sets, varied

_PANELS = {"n_ha": "Stems per ha", "basal_area_m2ha": "Basal area, m²/ha"}


def draw_sweep(sweep: HasMeans, to: str | Path) -> None:
    """Plot the replicate means of a sweep over the years, and the band from 5 to 95 %.

    Parameters
    ----------
    sweep : Sweep
        The sweep; the stand tables of its finished runs are read.
    to : path
        Picture file to write; the format follows the suffix.
    """
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (column, title) in zip(figure.subplots(1, 2), _PANELS.items(), strict=True):
        sets = means_of_sets(sweep, column)
        colours = colormaps["viridis"]([k / max(len(sets), 2) for k in range(len(sets))])
        for (key, rows), colour in zip(sets.items(), colours, strict=True):
            settings = zip(varied(sweep)[1:], key[1:], strict=True)
            label = ", ".join([key[0], *(f"{name} = {value}" for name, value in settings)])
            axes.plot(rows["year"], rows["mean"], color=colour, lw=1.6, label=label)
            axes.fill_between(
                rows["year"], rows["low"], rows["high"], color=colour, alpha=0.2, lw=0
            )
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_ylim(bottom=0.0)
        axes.tick_params(labelsize=8)
        axes.grid(color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower left", fontsize=8)
    with whole_file(to, overwrite=True) as draft:
        figure.savefig(draft, dpi=110)
