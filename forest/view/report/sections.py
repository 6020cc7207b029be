"""The sections of a report, each from the tables it needs; None where the run has none of it."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from forest.record.export import info
from forest.record.run import Run
from forest.view.looks import look_of
from forest.view.report import charts
from forest.view.report.parts import Picture, Section, gallery, number, pairs, table, text
from forest.view.report.pictures import (
    disc_picture,
    species_key,
    stand_pictures,
    tree_picture,
)

if TYPE_CHECKING:
    import pandas as pd

_ALL = "all"
_MOST_ROWS = 25
_MOST_SAMPLES = 6
_SMALL = (3.3, 2.7)  # of a tree's charts

#: Columns of `/stand` in the stand table: heading, digits.
STAND_COLUMNS = {
    "n_ha": ("N, /ha", 0),
    "basal_area_m2ha": ("G, m²/ha", 1),
    "qmd_cm": ("Dq, cm", 1),
    "top_height_m": ("Htop, m", 1),
    "lorey_height_m": ("HL, m", 1),
    "volume_m3ha": ("V, m³/ha", 1),
    "lai": ("LAI", 2),
    "floor_light": ("floor light", 2),
    "deaths_ha": ("died, /ha", 0),
    "removed_ha": ("felled, /ha", 0),
}
_TREE_COLUMNS = {
    "species": "species",
    "age": "age, years",
    "dbh_cm": "dbh, cm",
    "height_m": "height, m",
    "crown_base_m": "crown base, m",
    "crown_radius_m": "crown radius, m",
    "stem_volume_m3": "stem volume, m³",
    "biomass_kg": "biomass, kg",
    "leaf_area_m2": "leaf area, m²",
    "light": "relative light",
    "ring_width_mm": "last ring at 1.3 m, mm",
}


def _hectares(run: Run) -> float:
    width, depth = run.scenario.plot.size_m
    return float(width * depth / 10_000.0)


def _of_all(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[frame["species"].astype(str) == _ALL]


def stand_section(run: Run) -> Section | None:
    """Tabulate the whole stand: the first year, every so many, the last."""
    if "stand" not in run.tables:
        return None
    whole = _of_all(run.stand).reset_index(drop=True)
    every = max(1, -(-len(whole) // _MOST_ROWS))
    every = next(step for step in (1, 2, 5, 10, 20, 50, 100, 500, 10_000) if step >= every)
    last = len(whole) - 1
    rows = (
        [
            int(row["year"]),
            *(number(row[name], digits) for name, (_, digits) in STAND_COLUMNS.items()),
        ]
        for i, row in whole.iterrows()
        if i in (0, last) or (int(str(i)) + 1) % every == 0
    )
    headings = ["year", *(heading for heading, _ in STAND_COLUMNS.values())]
    chosen = "" if every == 1 else f" (the first, the last, one in {every} between)"
    caption = f"The stand at the end of the years{chosen}; died and felled are of the year alone"
    return Section("Stand table", table(headings, rows, caption=caption, name="stand-table"))


def development_section(run: Run) -> Section | None:
    """Draw the stand's numbers over the years."""
    drawn = []
    if "stand" in run.tables:
        drawn += charts.development(run.stand)
        if len(run.species_names) > 1:
            drawn.append(charts.species_shares(run.stand))
    if "trees" in run.tables:
        trees = run.read("trees", ["year", "status", "dbh_cm"])
        drawn.append(charts.diameters(trees, _hectares(run)))
    return Section("Development", gallery(drawn)) if drawn else None


def picture_section(run: Run) -> Section | None:
    """Show the stand in a few years."""
    if "trees" not in run.tables:
        return None
    side, above = stand_pictures(run)
    key = "".join(
        f'<li><span style="background:{colour}"></span>{escape(name)}</li>'
        for name, colour in species_key(run)
    )
    width, depth = run.scenario.plot.size_m
    told = (
        "Stems as cones and crowns as simple shapes of their measured size, coloured by species. "
        f"The plot is {width:g} × {depth:g} m; in the map north (y) is up."
    )
    body = f'{text(told)}<ul class="key">{key}</ul>{gallery(side)}{gallery(above, name="maps")}'
    return Section("The stand in pictures", body)


def ledger_section(run: Run) -> Section | None:
    """Sum up how trees came and went."""
    if "events" not in run.tables:
        return None
    ledger = run.ledger
    totals = ledger.drop(columns=["living_before", "living"]).sum()
    hectares = _hectares(run)
    rows = [
        [charts.said(str(name)), int(n), number(n / hectares, 0)] for name, n in totals.items() if n
    ]
    rows.append(
        [
            "living at the end",
            int(ledger["living"].iloc[-1]),
            number(ledger["living"].iloc[-1] / hectares, 0),
        ]
    )
    body = table(
        ["", "trees", "per ha"],
        rows,
        caption="Trees that came and went in all years",
        name="ledger",
    )
    drawn = charts.losses(ledger, hectares)
    return Section("Comings and goings", body + (gallery([drawn]) if drawn else ""))


def treatment_section(run: Run) -> Section | None:
    """Tabulate the treatments: the stand before and after each."""
    if "treatments" not in run.tables or not run.count("treatments"):
        return None
    whole = _of_all(run.treatments)
    keys = ["n_ha", "basal_area_m2ha", "qmd_cm", "volume_m3ha"]
    rows = []
    for (year, count), pair in whole.groupby(["year", "number"], observed=True):
        by_stage = pair.set_index(pair["stage"].astype(str))
        before, after = by_stage.loc["before"], by_stage.loc["after"]
        cells = [
            f"{number(before[key], STAND_COLUMNS[key][1])} → "
            f"{number(after[key], STAND_COLUMNS[key][1])}"
            for key in keys
        ]
        rows.append([f"{year}, {count}", str(before["kind"]), *cells])
    headings = ["year, number", "act", *(STAND_COLUMNS[key][0] for key in keys)]
    caption = "The stand before and after each act, done before the growth of its year"
    return Section("Treatments", table(headings, rows, caption=caption, name="treatments"))


def storm_section(run: Run) -> Section | None:
    """Tabulate the storms."""
    if "storms" not in run.tables or not run.count("storms"):
        return None
    rows = []
    for (year, count), trees in run.storms.groupby(["year", "storm"]):
        did = trees["outcome"].astype(str).value_counts()
        rows.append(
            [
                f"{year}, {count}",
                number(trees["storm_m_s"].iloc[0], 1),
                number(trees["direction_deg"].iloc[0], 0),
                len(trees),
                int(did.get("broken", 0)),
                int(did.get("uprooted", 0)),
            ]
        )
    headings = ["year, number", "wind, m/s", "towards, degrees", "trees", "broken", "uprooted"]
    return Section("Storms", table(headings, rows, caption="Storms, and what they did"))


def flow_section(run: Run) -> Section | None:
    """Draw the yearly balances: carbon, dead wood, regeneration, climate."""
    drawn = []
    if "climate" in run.tables and run.count("climate"):
        drawn += _climate(run.climate)
    if "carbon" in run.tables and run.count("carbon"):
        names = {
            name: name.replace("_", " ")
            for name in ("income", "leaves", "upkeep", "extension", "ring", "reserve_change")
        }
        whole = _of_all(run.carbon)
        if np.nan_to_num(whole["income"].to_numpy(np.float64)).any():
            drawn.append(charts.curves(whole, names, "Dry mass earned and spent, kg/ha and year"))
    if "deadwood" in run.tables and run.count("deadwood"):
        names = {"standing_m3ha": "standing", "lying_m3ha": "lying"}
        drawn.append(charts.curves(_of_all(run.deadwood), names, "Dead wood, m³/ha"))
    if "regeneration" in run.tables and run.count("regeneration"):
        summed = run.regeneration.groupby("year", as_index=False)[["n_ha", "recruits_ha"]].sum()
        names = {"n_ha": "seedlings", "recruits_ha": "recruits of the year"}
        drawn.append(charts.curves(summed, names, "Regeneration, per ha"))
    return Section("Climate and balances", gallery(drawn)) if drawn else None


def _climate(climate: pd.DataFrame) -> list[Picture]:
    drawn = []
    factors = climate.assign(species=climate["species"].astype(str)).pivot(
        index="year", columns="species", values="factor"
    )
    if np.nanstd(factors.to_numpy()) > 0.0:
        apart = float(np.ptp(factors.to_numpy(), axis=1).max()) > 0.0
        names = {
            str(name): str(name).replace("_", " ") if apart else "all species"
            for name in (factors if apart else factors.columns[:1])
        }
        title = "Climate: factor on each species' income"
        colours = {name: look_of(name).line for name in names}
        frame = factors.reset_index()
        drawn.append(charts.curves(frame, names, title, colours=colours))
    first = climate.drop_duplicates("year")
    for column, title in (
        ("temperature_c", "Mean annual temperature, °C"),
        ("precipitation_mm", "Annual precipitation, mm"),
        ("drought_index", "Drought index; below 0 dry"),
    ):
        if first[column].notna().any():
            drawn.append(charts.curves(first, {column: title}, title))
    return drawn


def sample_section(run: Run) -> Section | None:
    """Give each sample tree a card: numbers, curves, its shape and a disc."""
    if not run.samples or "trees" not in run.tables:
        return None
    chosen = run.samples[:_MOST_SAMPLES]
    trees = run.read("trees", ["year", "tree_id", *_TREE_COLUMNS])
    cards = []
    for tree_id in chosen:
        mine = trees[trees["tree_id"] == tree_id]
        year = int(run.sample_years(tree_id)[-1])
        row = mine[mine["year"] == year].iloc[0]
        lines = [(label, _value(row[name])) for name, label in _TREE_COLUMNS.items()]
        drawn = [tree_picture(run.skeleton(tree_id, year), year)]
        disc = disc_picture(run, tree_id, year)
        drawn += [disc] if disc else []
        if len(mine) > 1:
            for column, title in (("height_m", "Height, m"), ("dbh_cm", "Dbh, cm")):
                if mine[column].notna().any():
                    name = f"{title}, tree {tree_id}"
                    drawn.append(charts.curves(mine, {column: title}, name, size=_SMALL))
        cards.append(
            f'<div class="card" id="tree-{tree_id}"><h3>Tree {tree_id}</h3>'
            f"{pairs(lines)}{gallery(drawn, name='tree')}</div>"
        )
    note = ""
    if len(run.samples) > len(chosen):
        rest = ", ".join(map(str, run.samples[len(chosen) :]))
        note = text(f"Further sample trees on file: {rest}.")
    return Section("Sample trees", "".join(cards) + note)


def _value(value: object) -> str:
    if isinstance(value, str):
        return value.replace("_", " ")
    return f"{float(str(value)):.4g}" if value == value else "–"


def provenance_section(run: Run) -> Section:
    """Say what made the run, and give the scenario."""
    lines = [("file", run.path.name), *info(run)[1:]]  # not where it lies
    versions = run.provenance["sessions"][-1]["software"]
    lines.append(("versions", ", ".join(f"{name} {version}" for name, version in versions.items())))
    scenario = (
        "<details><summary>The scenario, complete</summary>"
        f"<pre>{escape(run.scenario_toml)}</pre></details>"
    )
    return Section("Provenance", pairs(lines) + scenario)
