"""Succession: the species' shares of basal area over time.

python analysis/succession.py run.h5 --to succession.png
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import (  # noqa: E402
    LIGHT_DEMANDING,
    SHADE_TOLERANT,
    Study,
    enough,
    panels,
    plain,
    script,
)
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402


def basal_areas(run: Run) -> pd.DataFrame:
    """Give basal area, m²/ha: a row per stand age, a column per species."""
    stand = run.read("stand", ["year", "species", "basal_area_m2ha"])
    stand["species"] = stand["species"].astype(str)
    wide = stand.pivot(index="year", columns="species", values="basal_area_m2ha")
    wide = wide[list(run.species_names)]
    wide.index = pd.RangeIndex(1, len(wide) + 1, name="age")
    return wide


def overtaking(share: pd.DataFrame) -> int | None:
    """Give the age from which shade-tolerant species have more than the light-demanding ones."""
    light = share[[name for name in share if name in LIGHT_DEMANDING]].sum(axis=1)
    shade = share[[name for name in share if name in SHADE_TOLERANT]].sum(axis=1)
    behind = share.index[(shade <= light).to_numpy()]
    if not len(behind):
        return int(share.index[0])
    return None if behind[-1] == share.index[-1] else int(behind[-1]) + 1


def table(area: pd.DataFrame) -> pd.DataFrame:
    """Give each species' greatest share of basal area and the age at which it has it.

    Parameters
    ----------
    area : DataFrame
        See `basal_areas`.

    Returns
    -------
    DataFrame
        `species`, `peak_age`, `peak_share`, `last_share` and `last_m2ha`. Years in which no tree
        has a dbh have no shares.
    """
    total = area.sum(axis=1)
    share = area[total > 0.0].div(total[total > 0.0], axis=0)
    return pd.DataFrame(
        {
            "species": share.columns,
            "peak_age": share.idxmax().to_numpy(),
            "peak_share": share.max().to_numpy(),
            "last_share": share.iloc[-1].to_numpy(),
            "last_m2ha": area.iloc[-1].to_numpy(),
        }
    )


def study(run: Run) -> Study:
    """Draw basal area and shares over stand age."""
    area = basal_areas(run)
    total = area.sum(axis=1)
    enough(total[total > 0.0], "tree of 1.3 m", run)
    share = area[total > 0.0].div(total[total > 0.0], axis=0)
    figure, ((left, right),) = panels(2)
    colours = [look_of(name).line for name in area]
    for name, colour in zip(area, colours, strict=True):
        left.plot(area[name], color=colour, lw=1.8, label=plain(name))
    left.plot(total, color="0.6", lw=1.0, ls="--", label="all")
    left.set(xlabel="stand age, years", ylabel="basal area, m²/ha", ylim=(0, None))
    left.legend(frameon=False, fontsize=8)
    right.stackplot(share.index, share.T.to_numpy(), colors=colours, lw=0)
    right.set(xlabel="stand age, years", ylabel="share of basal area", ylim=(0, 1))
    right.margins(x=0.0)
    passed = overtaking(share)
    if passed is not None and share.index[0] < passed:
        right.axvline(passed, color="k", lw=1.0, ls=":")
    return Study(figure, table(area))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
