"""What stands among a stand's trees in a year: residual trees, snags, obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from forest.dynamics.draws import uniforms_of
from forest.dynamics.snags import LYING_CAUSES, SnagSpecies, years_standing
from forest.random import STREAM_SNAG
from forest.scenario.model import Obstacle
from forest.scenario.shaping import ChangeObstacle

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario

#: The `fate` of what stands there dead.
SNAG = "snag"

#: Columns of `/events` that snags are told from.
EVENT_COLUMNS = ("year", "tree_id", "species", "kind", "cause", "dbh_cm", "height_m")
#: Columns of `/trees` that tell where they stand.
PLACE_COLUMNS = ("tree_id", "x_m", "y_m")


def residual_rows(residual: pd.DataFrame) -> pd.DataFrame:
    """Give rows of `/residual` the names of `/trees`, with numbers below 0; those that stand."""
    if "status" in residual:
        residual = residual[residual["status"].astype(str) == "standing"]
    number = -residual["residual_id"].to_numpy(np.int64)
    return residual.assign(tree_id=number, status="living", age=0, fate="").reset_index(drop=True)


def together(parts: Sequence[pd.DataFrame], columns: Sequence[str]) -> pd.DataFrame:
    """Give rows of some tables as one, with these columns."""
    import pandas as pd

    found = [rows.reindex(columns=list(columns)) for rows in parts if len(rows)]
    if not found:
        return parts[0].iloc[:0].reindex(columns=list(columns))
    return pd.concat([rows.astype({"species": object}) for rows in found], ignore_index=True)


def snags_of(scenario: Scenario, events: pd.DataFrame, trees: pd.DataFrame) -> pd.DataFrame:
    """Tell which of the trees that died stand as snags, and until when.

    The years are those of `forest.dynamics.snags`, drawn as the run drew them.

    Parameters
    ----------
    scenario : Scenario
    events : DataFrame
        `EVENT_COLUMNS` of `/events`.
    trees : DataFrame
        `PLACE_COLUMNS` of `/trees`.

    Returns
    -------
    DataFrame
        A row for each snag, bare: what `tree_bodies` takes, `fate`, and `first` and `last`, the
        calendar years at whose ends it stands. None where the scenario has no snags.
    """
    stood = (events["kind"].astype(str) == "died") & (events["dbh_cm"] > 0.0)
    stood &= ~events["cause"].astype(str).isin(LYING_CAUSES) & scenario.mortality.snags
    places = trees.drop_duplicates("tree_id")
    dead = events[stood].merge(places, on="tree_id")
    kinds = list(scenario.species)
    species = np.array([kinds.index(str(name)) for name in dead["species"]], np.int64)
    traits = SnagSpecies.of(scenario.species_list)
    ids = dead["tree_id"].to_numpy(np.int32)
    stands = years_standing(
        uniforms_of(scenario.seed, STREAM_SNAG, ids, 0, 0)[:, 0],
        traits.snag_half_life_years[species],
        traits.snag_fall_exponent[species],
    )
    first = dead["year"].to_numpy(np.int64)
    return dead.drop(columns=["year", "kind", "cause"]).assign(
        base_diameter_cm=np.nan,
        crown_base_m=np.nan,
        crown_radius_m=0.0,
        fate=SNAG,
        first=first,
        last=first + stands - 1,
    )


def in_year(snags: pd.DataFrame, year: int) -> pd.DataFrame:
    """Give the snags that stand at the end of a year."""
    here = (snags["first"] <= year) & (year <= snags["last"])
    return snags[here].drop(columns=["first", "last"]).reset_index(drop=True)


def obstacles_at(
    scenario: Scenario, year: int, treatments: pd.DataFrame | None
) -> tuple[Obstacle, ...]:
    """Give the obstacles that stand at the end of a year of a run.

    Parameters
    ----------
    scenario : Scenario
    year : int
    treatments : DataFrame, optional
        `year`, `number` and `act` of `/treatments`: what was done. Without it, what the scenario
        plans for fixed years. Changes by hand are not on record.
    """
    now = scenario.obstacles
    acts = scenario.acts
    if treatments is None:
        start = scenario.start_year
        done = [
            i
            for y in range(start, year + 1)
            for i, act in enumerate(acts)
            if act.when is None and act.may_be_in(y, start)
        ]
    else:
        rows = treatments[(treatments["year"] <= year) & (treatments["act"] >= 0)]
        rows = rows.drop_duplicates(["year", "number"]).sort_values(["year", "number"])
        done = rows["act"].astype(int).tolist()
    for i in done:
        act = acts[i]
        if isinstance(act, ChangeObstacle):
            now = act.applied(now)
    return now
