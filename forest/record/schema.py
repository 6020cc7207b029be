"""The run file's tables: every column with its dtype, unit, meaning and missing value.

The writer makes its datasets from these definitions, the reader its dtypes, the documentation its
tables.
"""

from __future__ import annotations

from collections.abc import Sequence

from forest.record.definition import (
    RESIDUAL_NAMES,
    RESIDUAL_SPECIES,
    SPECIES,
    SPECIES_OR_ALL,
    Column,
    Table,
)

FILE_TYPE = "forest run"
SCHEMA_VERSION = 2

STATUS = ("living", "dead")
EVENT_KINDS = (
    *("planted", "recruited", "died", "felled", "pruned", "windthrown", "marked", "bent"),
    "cracked",
)
CAUSES = (
    "none",
    "suppression",
    "age",
    "background",
    "buckling",
    "wind",
    "thinning",
    "harvest",
    "no_buds",
    "fire",
    "insects",
    "disease",
    "browsing",
    "drought",
    "other",
    "tending",
)

#: What trees die of where they stand, and why trees are felled: columns of `Run.ledger`.
DEATH_CAUSES = (
    "suppression",
    "no_buds",
    "age",
    "background",
    "buckling",
    "fire",
    "insects",
    "disease",
    "browsing",
    "drought",
    "other",
)
FELLING_CAUSES = ("thinning", "harvest", "tending")
#: Events that change nothing in the number of trees.
STAYING_KINDS = ("pruned", "marked", "bent", "cracked")
ACT_KINDS = (
    *("prune", "fell", "plant", "thin", "harvest", "mark", "bend", "obstacle", "stroke"),
    "crack",
)
STAGES = ("before", "after")
RESIDUAL_STATUS = ("standing", "felled")

#: What a storm does to a tree.
STORM_OUTCOMES = ("stood", "broken", "uprooted")

#: Discs at heights that the scenario names, or where the crown begins in the year.
RING_PLACES = ("height", "crown_base")


def _number(name: str, unit: str, description: str, dtype: str = "float32") -> Column:
    return Column(name, dtype, unit, description, missing="NaN")


def _count(name: str, description: str, dtype: str = "int32") -> Column:
    return Column(name, dtype, "", description)


_YEAR = Column("year", "int32", "calendar year", "the year at whose end the row was taken")
_TREE = Column("tree_id", "int32", "", "number of the tree, from 1, never used twice")
_SPECIES = Column("species", "int16", "", "species of the tree", levels=SPECIES)
_SPECIES_OR_ALL = Column("species", "int16", "", "species, or all together", levels=SPECIES_OR_ALL)


TREES = Table(
    "a tree and year",
    (
        _YEAR,
        _TREE,
        _SPECIES,
        Column("x_m", "float32", "m", "place of the stem base"),
        Column("y_m", "float32", "m", "place of the stem base"),
        Column("age", "int32", "years", "years since it was planted or recruited"),
        Column("status", "int8", "", "whether it lives at the end of the year", levels=STATUS),
        _number("dbh_cm", "cm", "stem diameter over bark at 1.3 m"),
        _number("base_diameter_cm", "cm", "stem diameter over bark at the base"),
        _number("height_m", "m", "height of the highest tip"),
        _number("crown_base_m", "m", "height of the lowest living site"),
        _number("crown_radius_m", "m", "mean reach of the crown in eight directions"),
        _number("crown_area_m2", "m2", "area of the octagon of the eight reaches"),
        _number("lean_deg", "degrees", "angle between the vertical and the line from base to top"),
        _number("basal_area_m2", "m2", "cross section over bark at 1.3 m; 0 below that height"),
        _number("stem_volume_m3", "m3", "volume of the stem from base to top, over bark"),
        _number(
            "merchantable_volume_m3", "m3", "its part above the stump that is thick enough to sell"
        ),
        _number("biomass_kg", "kg dry mass", "wood of stem and branches, and leaves"),
        _number("leaf_area_m2", "m2", "one-sided area of its leaves"),
        _number("light", "0..1", "mean relative light of its living sites"),
        _number("ring_width_mm", "mm", "width of this year's ring at 1.3 m"),
        _count("metamers", "number of metamers"),
        _count("buds", "number of living sites"),
    ),
)


def _stand(name: str, unit: str, description: str) -> Column:
    return _number(name, unit, description, dtype="float64")


STAND = Table(
    "a year and species, and one for all species",
    (
        _YEAR,
        _SPECIES_OR_ALL,
        _stand("n_ha", "1/ha", "living trees"),
        _stand("basal_area_m2ha", "m2/ha", "basal area G over bark"),
        _stand("qmd_cm", "cm", "quadratic mean diameter of the trees that have a dbh"),
        _stand("mean_dbh_cm", "cm", "arithmetic mean diameter of the trees that have a dbh"),
        _stand("top_height_m", "m", "mean height of the 100 thickest trees per ha"),
        _stand("lorey_height_m", "m", "mean height weighted by basal area"),
        _stand("volume_m3ha", "m3/ha", "stem volume over bark"),
        _stand("biomass_tha", "t/ha dry mass", "wood and leaves"),
        _stand("lai", "m2/m2", "leaf area index, one-sided"),
        _stand("floor_light", "0..1", "mean relative light on the ground; for all species only"),
        _stand("canopy_cover", "0..1", "share of the plot under crowns"),
        _stand("sdi", "1/ha", "Reineke's stand density index at 25.4 cm"),
        _stand("recruits_ha", "1/ha", "trees recruited in the year"),
        _stand("deaths_ha", "1/ha", "trees that died in the year"),
        _stand("removed_ha", "1/ha", "trees felled in the year"),
        _stand("removed_volume_m3ha", "m3/ha", "their stem volume"),
        _stand("gini_basal_area", "0..1", "Gini coefficient of the trees' basal areas"),
        _stand("shannon", "", "Shannon index of the species' shares of basal area"),
        _stand("simpson", "0..1", "Simpson index of the species' shares of basal area"),
        _stand("clark_evans", "", "Clark-Evans index: 1 random, above regular, below clustered"),
        _stand("mingling", "0..1", "share of the four nearest neighbours of another species"),
    ),
)

EVENTS = Table(
    "something that happened to a tree",
    (
        _YEAR,
        _TREE,
        _SPECIES,
        Column("kind", "int8", "", "what happened", levels=EVENT_KINDS),
        Column("cause", "int8", "", "why", levels=CAUSES),
        _count("mother_id", "tree that seeded it; 0 if planted or not known"),
        _number("dbh_cm", "cm", "stem diameter over bark at 1.3 m"),
        _number("height_m", "m", "height"),
        _number("volume_m3", "m3", "stem volume"),
    ),
)

RINGS = Table(
    "a tree, stem height and year",
    (
        _YEAR,
        _TREE,
        _SPECIES,
        Column("place", "int8", "", "what the disc's height stands for", levels=RING_PLACES),
        Column("stem_height_m", "float32", "m", "height of the disc above the ground"),
        Column("cambial_age", "int32", "years", "rings from the pith, this one included"),
        _number("width_mm", "mm", "mean width of the ring; the widths add up to the wood radius"),
        _number("eccentricity", "0..1", "how far off-centre the ring is; 0 for a circle"),
        _number("thick_side_deg", "degrees", "azimuth of its thick side, from x towards y"),
    ),
)


def _carbon(name: str, description: str) -> Column:
    return Column(name, "float64", "kg dry mass/ha/year", description)


CARBON = Table(
    "a year and species, and one for all species",
    (
        _YEAR,
        _SPECIES_OR_ALL,
        _carbon("income", "dry mass made from light"),
        _carbon("leaves", "spent on leaves"),
        _carbon("upkeep", "spent on the upkeep of sapwood"),
        _carbon("extension", "spent on new metamers"),
        _carbon("ring", "spent on rings"),
        _carbon("reserve_change", "put aside (taken out, if negative)"),
    ),
)

STABILITY = Table(
    "a tree and year, where the scenario has mechanics",
    (
        _YEAR,
        _TREE,
        _SPECIES,
        _number("safety_factor", "", "load at which the stem buckles per load (Greenhill)"),
        _number("critical_height_m", "m", "height at which a stem of this shape buckles"),
        _number("frequency_hz", "Hz", "first frequency at which the stem sways"),
        _number("stress_share", "0..1", "largest stress of own weight per modulus of rupture"),
        _number("stress_height_m", "m", "height along the stem where it is"),
        _number("wind_stress_share", "0..1", "the same with the scenario's wind; 1 breaks"),
        _number("wind_stress_height_m", "m", "height along the stem where it is"),
        _number("base_moment_nm", "N m", "bending moment at the base, of weight and wind"),
    ),
)

_WOOD_OF = "of the stems, less what has decayed"
_MASS_OF = "of stems and branches, less what has decayed"

DEADWOOD = Table(
    "a year and species, and one for all species, where the scenario has snags",
    (
        _YEAR,
        _SPECIES_OR_ALL,
        _stand("snags_ha", "1/ha", "dead trees that stand"),
        _stand("new_snags_ha", "1/ha", "trees that died in the year and stand"),
        _stand("fallen_snags_ha", "1/ha", "snags that fell in the year"),
        _stand("standing_m3ha", "m3/ha", f"snags: volume {_WOOD_OF}"),
        _stand("lying_m3ha", "m3/ha", f"lying dead wood: volume {_WOOD_OF}"),
        _stand("input_m3ha", "m3/ha", "volume of the trees that died in the year"),
        _stand("fallen_m3ha", "m3/ha", "what came from standing to lying in the year"),
        _stand("decayed_m3ha", "m3/ha", "what decayed in the year"),
        _stand("standing_tha", "t/ha dry mass", f"snags: mass {_MASS_OF}"),
        _stand("lying_tha", "t/ha dry mass", f"lying dead wood: mass {_MASS_OF}"),
        _stand("input_tha", "t/ha dry mass", "mass of the trees that died in the year"),
        _stand("fallen_tha", "t/ha dry mass", "what came from standing to lying in the year"),
        _stand("decayed_tha", "t/ha dry mass", "what decayed in the year"),
    ),
)

CLIMATE = Table(
    "a year and species: the year's climate, and what the species makes of it",
    (
        _YEAR,
        _SPECIES,
        _number("temperature_c", "°C", "mean annual temperature", dtype="float64"),
        _number("precipitation_mm", "mm", "annual precipitation", dtype="float64"),
        _number("drought_index", "", "drought index; below 0 dry", dtype="float64"),
        Column("growth_index", "float64", "", "factor on the income of all species"),
        Column("factor", "float64", "", "factor on the species' income, growth index included"),
    ),
)

REGENERATION = Table(
    "a year and species, where the scenario has regeneration",
    (
        _YEAR,
        _SPECIES,
        _stand("mast", "", "factor of the year on the species' seeds; 1 in the mean"),
        _stand("seeds_ha", "1/ha", "viable seeds that are expected to fall"),
        _stand("germinated_ha", "1/ha", "seedlings that outlived their first summer"),
        _stand("sprouts_ha", "1/ha", "sprouts from stumps"),
        _stand("died_ha", "1/ha", "older seedlings that died in the year's light"),
        _stand("crowded_ha", "1/ha", "seedlings that found no room"),
        _stand("recruits_ha", "1/ha", "seedlings that became trees; their events are next year's"),
        _stand("n_ha", "1/ha", "seedlings at the end of the year"),
        _stand("n_low_ha", "1/ha", "those below 0.1 m"),
        _stand("n_high_ha", "1/ha", "those of 0.5 m and more"),
        _stand("mean_height_m", "m", "their mean height"),
        _stand("lai", "m2/m2", "their leaf area index, one-sided"),
        _stand("reserve_kg_ha", "kg dry mass/ha", "what they have stored"),
    ),
)

TREATMENTS = Table(
    "a treatment (an act that was done), before and after it, and species, and one for all species",
    (
        Column("year", "int32", "calendar year", "the year before whose growth it was done"),
        _count("number", "of the treatment in its year, from 1, in the order in which it was done"),
        _count("act", "of the act in the scenario's list, from 0; -1 if done by hand"),
        Column("kind", "int8", "", "kind of act", levels=ACT_KINDS),
        Column("stage", "int8", "", "before or after it", levels=STAGES),
        *STAND.columns[1:],
    ),
)

STORMS = Table(
    "a tree and storm",
    (
        _YEAR,
        _TREE,
        _SPECIES,
        Column("storm", "int16", "", "number of the storm in its year, from 1"),
        Column("x_m", "float32", "m", "place of the stem base"),
        Column("y_m", "float32", "m", "place of the stem base"),
        Column("storm_m_s", "float32", "m/s", "mean wind at the canopy's top over open land"),
        Column("direction_deg", "float32", "degrees", "azimuth towards which it blew, from x to y"),
        _number("wind_m_s", "m/s", "mean wind at the tree's top, as exposed in the end"),
        _number("edge", "0..1", "share in an edge's exposure: 0 within the stand, 1 at its edge"),
        _number("critical_break_m_s", "m/s", "storm that breaks the stem, as exposed in the end"),
        _number("critical_uproot_m_s", "m/s", "storm that uproots it, as exposed in the end"),
        Column("outcome", "int8", "", "what the storm did", levels=STORM_OUTCOMES),
        _count("round", "round in which it fell, from 1; 0 if it stood", "int16"),
        _number("dbh_cm", "cm", "stem diameter over bark at 1.3 m"),
        _number("height_m", "m", "height of the highest tip"),
    ),
)

RESIDUAL = Table(
    "a residual tree and year in which it stood, and one for the year before whose growth it was "
    "felled; where the scenario has residual trees",
    (
        _YEAR,
        _count("residual_id", "of the tree in the scenario's list, from 1"),
        Column("name", "int16", "", "its name", levels=RESIDUAL_NAMES),
        Column("species", "int16", "", "its parametric species", levels=RESIDUAL_SPECIES),
        Column("status", "int8", "", "whether it still stood", levels=RESIDUAL_STATUS),
        Column("x_m", "float32", "m", "place of the stem base"),
        Column("y_m", "float32", "m", "place of the stem base"),
        _number("height_m", "m", "height of the highest tip"),
        _number("dbh_cm", "cm", "stem diameter over bark at 1.3 m"),
        _number("crown_base_m", "m", "height of the lowest leaf-bearing tip"),
        _number("crown_radius_m", "m", "mean reach of the crown in eight directions"),
        _number("leaf_area_m2", "m2", "one-sided area of its leaves"),
        _number("stem_volume_m3", "m3", "volume of the stem, over bark"),
    ),
)

POPULATION = Table(
    "a year: the ledger of the living",
    (
        _YEAR,
        _count("living_before", "living trees at the end of the year before"),
        _count("planted", "trees planted"),
        _count("recruited", "trees recruited"),
        _count("died", "trees that died standing"),
        _count("felled", "trees felled"),
        _count("windthrown", "trees thrown by wind"),
        _count("living", "living trees at the end of the year"),
    ),
)

#: The tables that a scenario may choose.
TABLES: dict[str, Table] = {
    "trees": TREES,
    "stand": STAND,
    "events": EVENTS,
    "rings": RINGS,
    "carbon": CARBON,
    "stability": STABILITY,
    "deadwood": DEADWOOD,
    "climate": CLIMATE,
    "regeneration": REGENERATION,
    "treatments": TREATMENTS,
    "storms": STORMS,
    "residual": RESIDUAL,
}

#: The tables that a run file may hold.
ALL_TABLES: dict[str, Table] = {**TABLES, "population": POPULATION}

_SERIAL = Column("serial", "int32", "", "number of the metamer, counted per tree, never changed")

#: The tables of a sample tree, each a group of `/samples/<tree_id>`.
SAMPLE_TABLES: dict[str, Table] = {
    "metamers": Table(
        "a metamer, parents before children",
        (
            _SERIAL,
            Column("parent_serial", "int32", "", "serial of its parent; -1 at the base", "-1"),
            Column("end_x_m", "float32", "m", "its upper end, from the plot's corner"),
            Column("end_y_m", "float32", "m", "its upper end, from the plot's corner"),
            Column("end_z_m", "float32", "m", "its upper end, above the ground"),
            Column("order", "uint8", "", "branching order; 0 on the trunk"),
            Column("main", "uint8", "", "1 if it continues its parent's axis, 0 if it starts one"),
            Column("birth_year", "int32", "calendar year", "year in which it was made"),
        ),
    ),
    "dead": Table(
        "a metamer that was shed, pruned or lost",
        (_SERIAL, Column("year", "int32", "calendar year", "year in which that happened")),
    ),
    "radii": Table(
        "a metamer and year; one year's rows follow each other, parents before children",
        (
            _SERIAL,
            Column("radius_m", "float32", "m", "radius under bark at the end of the year"),
            Column("leafy", "uint8", "", "1 if a living leaf-bearing site stands at its end"),
        ),
    ),
    "shapes": Table(
        "a row of `radii`, where the scenario has mechanics",
        (
            Column("end_x_m", "float32", "m", "its upper end then, from the plot's corner"),
            Column("end_y_m", "float32", "m", "its upper end then, from the plot's corner"),
            Column("end_z_m", "float32", "m", "its upper end then, above the ground"),
            _number("eccentricity", "0..1", "how far off-centre its ring of the year is"),
            _number(
                "thick_side_deg",
                "degrees",
                "azimuth of the ring's thick side, from x towards y, once the metamer is upright",
            ),
        ),
    ),
    "steps": Table(
        "a year of the tree's life on record",
        (
            Column("year", "int32", "calendar year", "the year"),
            Column("metamers", "int64", "", "rows of `metamers` up to its end"),
            Column("dead", "int64", "", "rows of `dead` up to its end"),
            Column("radii", "int64", "", "rows of `radii` up to its end"),
            Column("shapes", "int64", "", "rows of `shapes` up to its end"),
        ),
    ),
}


def steps_table(tables: Sequence[str]) -> Table:
    """Define `/steps`: the whole years on file, and the rows of each table up to their end."""
    counts = (Column(name, "int64", "", f"rows of `/{name}` up to its end") for name in tables)
    return Table("a whole year", (Column("year", "int32", "calendar year", "the year"), *counts))


def columns_markdown() -> str:
    """Write the tables of all columns for the documentation."""
    parts = []
    for path, table in (
        *((f"/{name}", table) for name, table in ALL_TABLES.items()),
        *((f"/samples/<tree_id>/{name}", table) for name, table in SAMPLE_TABLES.items()),
    ):
        lines = [
            f"### `{path}`",
            "",
            f"One row for {table.row}.",
            "",
            "| column | type | unit | missing | meaning |",
            "|--|--|--|--|--|",
        ]
        for column in table.columns:
            levels = f": {', '.join(column.levels)}" if column.levels else ""
            levels = levels.replace("<species>", "the run's species")
            lines.append(
                f"| `{column.name}` | {column.dtype} | {column.unit} | {column.missing} "
                f"| {column.description}{levels} |"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    print(columns_markdown(), end="")
