"""What a column of another program's table is made from, written once: code and documentation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from forest.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run

# Exact by definition: the international inch, foot and acre.
CM_PER_INCH = 2.54
M_PER_FOOT = 0.3048
HA_PER_ACRE = 0.40468564224

_M2_PER_HA = 10_000.0


@dataclass(frozen=True)
class Filled:
    """A column that we fill.

    Attributes
    ----------
    name : str
        What the other program calls it.
    unit : str
        The other program's unit; empty for counts, codes and shares.
    source : str
        What it is made from, in our names.
    of : callable
        Makes it from the table's rows, prepared by its module.
    needs : tuple of str
        Tables besides the row's own that the run must hold; without them the column is left out.
    """

    name: str
    unit: str
    source: str
    of: Callable[[pd.DataFrame], Any]
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class ForeignTable:
    """A table of another program.

    Attributes
    ----------
    program, name : str
        Whose table, and what it is called there.
    row : str
        What a row is, and how it differs from the other program's.
    filled : tuple of Filled
        The columns that we fill, in the other program's order.
    left_out : tuple of (names, reason)
        Its columns that we do not fill.
    """

    program: str
    name: str
    row: str
    filled: tuple[Filled, ...]
    left_out: tuple[tuple[str, str], ...]

    def fill(self, rows: pd.DataFrame, run: Run) -> pd.DataFrame:
        """Make the table from prepared rows; columns that need more than the run holds are out."""
        import pandas as pd

        if not len(run.years):
            raise InputError("holds no years yet", where=str(run.path))
        columns = (c for c in self.filled if set(c.needs) <= set(run.tables))
        return pd.DataFrame({c.name: c.of(rows) for c in columns}, index=rows.index)


@dataclass(frozen=True)
class SpeciesCodes:
    """A species' names in other programs: iLand's, and the symbol of the USDA PLANTS database."""

    iland: str
    plants: str


#: Only what the programs' own species lists say (iLand's species, FVS' translator spctrn.f).
SPECIES_CODES = {
    "betula_pendula": SpeciesCodes("bepe", "BEPE3"),
    "fagus_sylvatica": SpeciesCodes("fasy", "FASY"),
    "picea_abies": SpeciesCodes("piab", "PIAB"),
    "pinus_sylvestris": SpeciesCodes("pisy", "PISY"),
    "quercus_robur": SpeciesCodes("quro", "QURO2"),
}


def plot_hectares(run: Run) -> float:
    """Give the area of a run's plot, ha."""
    width, depth = run.scenario.plot.size_m
    return width * depth / _M2_PER_HA


def cumulative_loss(run: Run, kinds: tuple[str, ...]) -> pd.DataFrame:
    """Sum the stem volume of the trees lost so far, m3/ha, by year (rows) and species (columns)."""
    return _lost(run, kinds).cumsum()


def yearly_loss(run: Run, kinds: tuple[str, ...]) -> pd.Series:
    """Sum the stem volume of the trees lost in each year, m3/ha, over all species."""
    return _lost(run, kinds).sum(axis=1)


def _lost(run: Run, kinds: tuple[str, ...]) -> pd.DataFrame:
    events = run.read("events", ["year", "species", "kind", "volume_m3"])
    lost = events[events["kind"].isin(kinds)]
    table = lost.pivot_table(
        index="year", columns="species", values="volume_m3", aggfunc="sum", observed=False
    )
    everything = table.reindex(index=run.years, columns=list(run.species_names))
    return everything.fillna(0.0) / plot_hectares(run)


def mapping_markdown() -> str:
    """Write the mapping of all tables for the documentation."""
    from forest.interop.fvs import SUMMARY, TREELIST
    from forest.interop.iland import STAND, TREE

    return "\n".join(_markdown(table) for table in (TREE, STAND, TREELIST, SUMMARY))


def _markdown(table: ForeignTable) -> str:
    lines = [
        f"### {table.program}: `{table.name}`",
        "",
        table.row,
        "",
        "| column | unit | made from |",
        "|--|--|--|",
    ]
    for column in table.filled:
        needs = f" (left out if the run has no {' and '.join(column.needs)} table)"
        lines.append(
            f"| `{column.name}` | {column.unit} | {column.source}{needs if column.needs else ''} |"
        )
    lines += ["", "Left out:", ""]
    lines += [f"* {names}: {reason}" for names, reason in table.left_out]
    return "\n".join(lines) + "\n"
