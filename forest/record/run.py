"""The reader of run files: pandas tables, read when they are asked for, and sample trees."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest, span_of
from forest.record.identity import check_identity, check_run_file, damage_reported
from forest.record.journal import JournaledFile
from forest.record.schema import ALL_TABLES
from forest.trees.skeleton import Skeleton, number_axes

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from forest.dendro.cores import Core
    from forest.dendro.disc import Disc
    from forest.dendro.life import StemLife
    from forest.dendro.section import Section
    from forest.scenario import Scenario


def open_run(path: str | Path) -> Run:
    """Open a run file, finished or not.

    Of a run that was killed, or that is still being written, one sees the years that were whole
    when the file was opened.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If it is missing, not a run file, of a later schema, cut short or damaged.
    """
    path = Path(path)
    check_run_file(path)
    with damage_reported(path):
        # Neither in the way of a writer nor of the same file opened by plain h5py.
        file = h5py.File(JournaledFile(path, writable=False), "r")
        try:
            check_identity(file, path)
            return Run(path, file)
        except BaseException:
            file.close()
            raise


class Run:
    """An open run file. Use as a context manager, or `close` it.

    Attributes
    ----------
    path : Path
        The file.
    years : int32 array
        Calendar years on file.
    tables : tuple of str
        Tables on file.
    samples : tuple of int
        Ids of the sample trees.
    """

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self._file = file
        steps = {name: dataset[:] for name, dataset in file["steps"].items()}
        self.years: NDArray[np.int32] = steps.pop("year")
        self.tables = tuple(name for name in ALL_TABLES if name in steps)
        self._ends = {name: np.concatenate(([0], steps[name])) for name in self.tables}
        self._frames: dict[str, pd.DataFrame] = {}
        ids = sorted(int(tree_id) for tree_id in file["samples"])
        self.samples = tuple(tree_id for tree_id in ids if len(self.sample_years(tree_id)))

    @property
    def trees(self) -> pd.DataFrame:
        """A row per tree and year."""
        return self._frame("trees")

    @property
    def stand(self) -> pd.DataFrame:
        """A row per year and species, and one for all."""
        return self._frame("stand")

    @property
    def events(self) -> pd.DataFrame:
        """A row per planting, recruitment, death, felling, pruning, windthrow."""
        return self._frame("events")

    @property
    def rings(self) -> pd.DataFrame:
        """A row per tree, stem height and year."""
        return self._frame("rings")

    @property
    def carbon(self) -> pd.DataFrame:
        """A row per year and species, and one for all: the ledger of dry mass."""
        return self._frame("carbon")

    @property
    def stability(self) -> pd.DataFrame:
        """A row per tree and year, where the scenario has mechanics: how safely trees stand."""
        return self._frame("stability")

    @property
    def climate(self) -> pd.DataFrame:
        """A row per year and species: the climate, and the species' factor on income."""
        return self._frame("climate")

    @property
    def regeneration(self) -> pd.DataFrame:
        """A row per year and species, where the scenario has regeneration: seeds and seedlings."""
        return self._frame("regeneration")

    @property
    def treatments(self) -> pd.DataFrame:
        """The stand before and after each act: the columns of `stand`, as the acts left it."""
        return self._frame("treatments")

    @property
    def storms(self) -> pd.DataFrame:
        """A row per tree and storm: the winds that it does not stand, and whether it stood."""
        return self._frame("storms")

    @property
    def residual(self) -> pd.DataFrame:
        """A row per residual tree and year in which it stood, or before which it was felled."""
        return self._frame("residual")

    @property
    def population(self) -> pd.DataFrame:
        """A row per year: the ledger of the living."""
        return self._frame("population")

    @property
    def deadwood(self) -> pd.DataFrame:
        """A row per year and species, and one for all, where the scenario has snags."""
        return self._frame("deadwood")

    @cached_property
    def ledger(self) -> pd.DataFrame:
        """A row per year: who came, and who went by which cause; `events` must be on file.

        See `forest.record.ledger.by_cause`, which checks that it balances.
        """
        from forest.record.ledger import by_cause

        return by_cause(self.population, self.events)

    def read(
        self,
        table: str,
        columns: Sequence[str] | None = None,
        *,
        years: tuple[int, int] | None = None,
    ) -> pd.DataFrame:
        """Read a table, or some of its columns and years, and nothing else.

        Parameters
        ----------
        table : str
            One of `tables`.
        columns : sequence of str, optional
            Columns, in the order wanted; all if not given.
        years : (first, last), optional
            Calendar years, both included; all if not given.

        Returns
        -------
        pandas.DataFrame
            Codes come as categories.

        Raises
        ------
        InputError
            If there is no such table or column, or the file is damaged.
        """
        import pandas as pd

        if table not in self.tables:
            raise InputError(
                f"no table '{table}'", where=str(self.path), expected=self._hint(table)
            )
        with damage_reported(self.path):
            known = [column.name for column in ALL_TABLES[table].columns]
            wanted = known if columns is None else list(columns)
            for name in wanted:
                if name not in known:
                    hint = nearest(name, known)
                    raise InputError(
                        f"no column '{name}' in '{table}'; {hint}", where=str(self.path)
                    )
            first, last = self._rows(table, years)
            data = {name: _column(self._file[table][name], first, last) for name in wanted}
            return pd.DataFrame(data, columns=wanted)

    def count(self, table: str) -> int:
        """Count the rows of one of `tables`."""
        return int(self._ends[table][-1])

    @property
    def scenario_toml(self) -> str:
        """The complete scenario, as text."""
        return str(self._file.attrs["scenario_toml"])

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario that made this run."""
        from forest.scenario import Scenario

        return Scenario.from_toml(self.scenario_toml, where=f"{self.path}: scenario")

    @property
    def species_names(self) -> tuple[str, ...]:
        """The species, in the order of their codes."""
        return tuple(str(name) for name in self._file.attrs["species"])

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Software, machine, seed, time and memory that made this run."""
        from forest.record.provenance import Provenance

        with damage_reported(self.path):
            text = self._file.attrs["provenance"]
            return Provenance.model_validate_json(text).model_dump(mode="json")

    @property
    def digest(self) -> str:
        """Hash of the scenario."""
        return str(self._file.attrs["scenario_sha256"])

    @property
    def complete(self) -> bool:
        """Whether the run came to its end."""
        return bool(self._file.attrs["finished"])

    def skeleton(self, tree_id: int, year: int) -> Skeleton:
        """Give the shape of a sample tree at the end of a year.

        Parameters
        ----------
        tree_id : int
            One of `samples`.
        year : int
            Calendar year in which it lived and was on record.

        Raises
        ------
        InputError
            If the tree or the year is not on record.
        """
        if tree_id not in self.samples:
            expected = ", ".join(map(str, self.samples)) or "none, for this run has no sample trees"
            raise InputError(
                f"tree {tree_id} is no sample tree", where=str(self.path), expected=expected
            )
        years = self.sample_years(tree_id)
        if year not in years:
            raise InputError(
                f"tree {tree_id} is not on record in {year}",
                where=str(self.path),
                expected=span_of(years[0], years[-1]),
            )
        with damage_reported(self.path):
            return self._shape(tree_id, year)

    def sample_years(self, tree_id: int) -> NDArray[np.int32]:
        """List the years at whose end a sample tree lived, of the whole years on file."""
        steps = self._file[f"samples/{tree_id}/steps"]
        years: NDArray[np.int32] = steps["year"][:]
        living = np.diff(steps["radii"][:], prepend=0) > 0
        living_years: NDArray[np.int32] = years[living & np.isin(years, self.years)]
        return living_years

    def sample_group(self, tree_id: int) -> h5py.Group:
        """Give the group that holds a sample tree's life."""
        return self._file[f"samples/{tree_id}"]

    def disc(self, tree_id: int, height_m: float, *, year: int | None = None) -> Disc:
        """Cut a disc out of a stem.

        Parameters
        ----------
        tree_id : int
            A tree that lived.
        height_m : float
            Height of the disc above the ground: of a sample tree any up to its top, of another
            one at which `/rings` has its rings. Only a sample tree's disc shows knots.
        year : int, optional
            Calendar year at whose end it is cut; the tree's last year if not given.

        Raises
        ------
        InputError
            If the tree, the year or the height is not on record.
        """
        from forest.record import wood

        return wood.disc(self, tree_id, height_m, year)

    def section(
        self, tree_id: int, origin: ArrayLike, normal: ArrayLike, *, year: int | None = None
    ) -> Section:
        """Cut the stem of a sample tree by a plane through `origin` (m), square to `normal`.

        Raises
        ------
        InputError
            If the tree or the year is not on record, or the plane misses the stem.
        """
        from forest.record import wood

        return wood.section(self, tree_id, origin, normal, year)

    def core(
        self,
        tree_id: int,
        height_m: float,
        azimuth_deg: float,
        *,
        year: int | None = None,
        aim_sd_deg: float = 0.0,
        seed: int = 1,
    ) -> Core:
        """Take an increment core, where `disc` would cut; see `forest.dendro.core`."""
        from forest.record import wood

        return wood.core(self, tree_id, height_m, azimuth_deg, year, aim_sd_deg, seed)

    def stem(self, tree_id: int, *, year: int | None = None) -> StemLife:
        """Give the stem of a sample tree with the surfaces of all its years on record.

        Raises
        ------
        InputError
            If the tree or the year is not on record.
        """
        from forest.record import wood

        return wood.stem_life(self, tree_id, year)

    def close(self) -> None:
        """Close the file; tables already read stay."""
        self._file.close()

    def __enter__(self) -> Self:
        """Give the run."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def __repr__(self) -> str:
        """Say what is on file."""
        if not len(self.years):
            span = "no years yet"
        else:
            span = f"{self.years[0]} to {self.years[-1]}"
        state = "complete" if self._file and self.complete else "not complete"
        return f"<Run {self.path.name}: {span}, {state if self._file else 'closed'}>"

    def _frame(self, table: str) -> pd.DataFrame:
        if table not in self._frames:
            self._frames[table] = self.read(table)
        return self._frames[table]

    def _hint(self, table: str) -> str:
        if table in ALL_TABLES:
            return "one of the tables that this run stored: " + ", ".join(self.tables)
        return nearest(table, self.tables)

    def _rows(self, table: str, years: tuple[int, int] | None) -> tuple[int, int]:
        ends = self._ends[table]
        if years is None:
            return 0, int(ends[-1])
        first = int(np.searchsorted(self.years, years[0], side="left"))
        last = int(np.searchsorted(self.years, years[1], side="right"))
        return int(ends[first]), int(ends[max(first, last)])

    def _shape(self, tree_id: int, year: int) -> Skeleton:
        group = self._file[f"samples/{tree_id}"]
        step = int(np.flatnonzero(group["steps/year"][:] == year)[0])
        first = int(group["steps/radii"][step - 1]) if step else 0
        last = int(group["steps/radii"][step])
        made = int(group["steps/metamers"][step])
        living = group["radii/serial"][first:last]
        metamers = {name: dataset[:made] for name, dataset in group["metamers"].items()}
        by_serial = np.argsort(metamers["serial"])
        rows = by_serial[np.searchsorted(metamers["serial"], living, sorter=by_serial)]
        parent = _places(living, metamers["parent_serial"][rows])
        bent = slice(*(int(group["steps/shapes"][k]) if k >= 0 else 0 for k in (step - 1, step)))
        if bent.stop > bent.start:
            end = np.stack([group[f"shapes/end_{axis}_m"][bent] for axis in "xyz"], axis=1)
        else:
            end = np.stack([metamers[f"end_{axis}_m"][rows] for axis in "xyz"], axis=1)
        end = end.astype(np.float64)
        start = np.where(parent[:, None] >= 0, end[parent], group.attrs["base_m"])
        return Skeleton(
            parent=parent,
            start=start,
            end=end,
            radius=group["radii/radius_m"][first:last].astype(np.float64),
            axis=number_axes(parent, metamers["main"][rows] != 0),
            order=metamers["order"][rows].astype(np.int32),
            birth_year=metamers["birth_year"][rows],
            leafy=group["radii/leafy"][first:last] != 0,
            serial=living,
            tree_id=tree_id,
            species=self.species_names[int(group.attrs["species"])],
        )


def _column(dataset: h5py.Dataset, first: int, last: int) -> Any:
    import pandas as pd

    values = dataset[first:last]
    levels = dataset.attrs.get("levels")
    if levels is None:
        return values
    return pd.Categorical.from_codes(values, [str(level) for level in levels])


def _places(serials: NDArray[np.int32], wanted: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find where each wanted serial stands among `serials`; -1 stays -1."""
    order = np.argsort(serials)
    place = np.searchsorted(serials, wanted, sorter=order)
    found = order[np.minimum(place, len(serials) - 1)]
    return np.where(wanted >= 0, found, -1).astype(np.int32)
