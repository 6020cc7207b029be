"""What a table of the run file is made of: columns, and names that a run puts in their levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

#: Levels of a column of species: the run's own list, without or with the entry for all of them.
SPECIES = ("<species>",)
SPECIES_OR_ALL = ("<species>", "all")
#: Levels of the names of a scenario's residual trees, and of their parametric species.
RESIDUAL_NAMES = ("<residual tree>",)
RESIDUAL_SPECIES = ("<parametric species>",)


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name : str
        Name of the dataset.
    dtype : str
        NumPy dtype as stored.
    unit : str
        Unit; empty for counts, codes and shares.
    description : str
        Meaning.
    missing : str
        How a missing value is stored; empty if none can be missing.
    levels : tuple of str
        For codes: the names that 0, 1, 2... stand for.
    """

    name: str
    dtype: str
    unit: str
    description: str
    missing: str = ""
    levels: tuple[str, ...] = ()

    def with_species(self, species_names: Sequence[str]) -> Column:
        """Give the column with the run's own species in place of the placeholder."""
        if self.levels[:1] != SPECIES:
            return self
        return replace(self, levels=(*species_names, *self.levels[1:]))

    def with_residual(self, names: Sequence[str], species: Sequence[str]) -> Column:
        """Give the column with the run's own residual trees in place of the placeholders."""
        if self.levels == RESIDUAL_NAMES:
            return replace(self, levels=tuple(names))
        return replace(self, levels=tuple(species)) if self.levels == RESIDUAL_SPECIES else self


@dataclass(frozen=True)
class Table:
    """One table: what a row is, and its columns."""

    row: str
    columns: tuple[Column, ...]

    def with_species(self, species_names: Sequence[str]) -> Table:
        """Give the table with the run's own species as levels."""
        columns = tuple(column.with_species(species_names) for column in self.columns)
        return replace(self, columns=columns)

    def with_residual(self, names: Sequence[str], species: Sequence[str]) -> Table:
        """Give the table with the run's own residual trees and their species as levels."""
        columns = tuple(column.with_residual(names, species) for column in self.columns)
        return replace(self, columns=columns)
