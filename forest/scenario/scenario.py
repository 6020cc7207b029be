"""A scenario: all that a user says about a run, checked once, at the door."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PrivateAttr, ValidationError, ValidationInfo, field_validator, model_validator

from forest.scenario import placing
from forest.scenario.acts import Act
from forest.scenario.climate import Climate, embed_file
from forest.scenario.complete import complete, embed_stem_map
from forest.scenario.fitting import check_fit
from forest.scenario.inventory import Inventory, inventory_places
from forest.scenario.inventory_file import embed_inventory
from forest.scenario.model import (
    Environment,
    Explicit,
    Growth,
    Mechanics,
    Obstacle,
    Output,
    Planting,
    Plot,
    Random,
    Regular,
    Site,
    SpeciesUse,
    StemMap,
)
from forest.scenario.mortality import Mortality
from forest.scenario.overrides import Changes
from forest.scenario.regeneration import Regeneration
from forest.scenario.residual import ResidualTree, number_seeds
from forest.scenario.wind import Wind
from forest.species.model import Species
from forest.species.schema import Refusal, Table, as_plain, quantity, refusal
from forest.species.text import parse_toml, read_text, to_toml


class Scenario(Table):
    """What to grow, where, for how long, by which rules, and what to record.

    Build one with `load`, `from_toml` or from Python with the same keys, tables as dicts::

        Scenario(years=10, plot={"size_m": [10, 10]}, environment={"shadow": {}},
                 species={"pinus_sylvestris": {}}, planting={"kind": "random", "density_ha": 4000})

    Files that it names (stem maps, climates, marker clouds) are read at once, and species are
    completed from the shipped ones, so a scenario and its `to_toml` stand for themselves.

    Raises
    ------
    InputError
        In one line: what is wrong, in which file and key, and what was expected.
    """

    title: str = quantity("", "what the run is about", unit="", max_length=1000)
    years: int = quantity(..., "years to simulate", unit="year", ge=1, le=10000)
    planned_years: int | None = quantity(
        None,
        "years that were meant where fewer are grown, as by --years: acts, deaths and storms may "
        "then be due in years that are not reached; filled in",
        unit="year",
        ge=1,
        le=10000,
    )
    start_year: int = quantity(
        2000, "first calendar year of growth", unit="year", ge=-20000, le=20000
    )
    seed: int = quantity(1, "seed of all random numbers", unit="", ge=0, le=2**63 - 1)
    mode: Literal["mass_balance", "paper"] = quantity(
        "mass_balance",
        "mass_balance: growth costs dry mass; paper: Palubicki et al. 2009, without costs",
        unit="",
    )
    plot: Plot
    site: Site = Site()
    climate: Climate = Climate()
    growth: Growth = Growth()
    mechanics: Mechanics | None = None
    mortality: Mortality = Mortality()
    regeneration: Regeneration | None = None
    wind: Wind | None = None
    environment: Environment
    species: dict[str, SpeciesUse] = quantity(
        ...,
        "the species, by name; any parameter of a species may be overridden",
        unit="",
        min_length=1,
        max_length=200,
    )
    planting: Planting
    obstacles: tuple[Obstacle, ...] = quantity(
        (), "what blocks growth and casts shade", unit="", max_length=10000
    )
    residual_trees: tuple[ResidualTree, ...] = quantity(
        (),
        "trees that were not simulated: they stand, shade and take room until they are felled",
        unit="",
        max_length=1000,
    )
    acts: tuple[Act, ...] = quantity(
        (),
        "what is pruned, thinned, harvested and planted between years",
        unit="",
        max_length=100_000,
    )
    output: Output = Output()

    _given: dict[str, Any] = PrivateAttr()
    _folder: Path = PrivateAttr()

    def __init__(self, /, **fields: Any) -> None:
        self._fill(fields, where="", folder=Path.cwd())

    def _fill(
        self, data: dict[str, Any], *, where: str | Callable[[str], str], folder: Path
    ) -> None:
        try:
            self.__pydantic_validator__.validate_python(
                data, self_instance=self, context={"folder": folder}
            )
        except ValidationError as error:
            raise refusal(error, type(self), where=where) from None
        self._given = as_plain(data)
        self._folder = folder

    @classmethod
    def _build(
        cls, data: dict[str, Any], *, where: str | Callable[[str], str], folder: Path
    ) -> Scenario:
        scenario = cls.__new__(cls)
        scenario._fill(data, where=where, folder=folder)
        return scenario

    @classmethod
    def load(
        cls,
        path: str | Path,
        overrides: Iterable[str] = (),
        *,
        years: int | None = None,
        seed: int | None = None,
    ) -> Scenario:
        """Read a scenario file; files that it names are looked for beside it.

        Parameters
        ----------
        path : path
            The file.
        overrides : iterable of str
            Keys to change before the whole is checked; see `with_overrides`.
        years, seed : int, optional
            The same for these two.

        Raises
        ------
        InputError
            If the file cannot be read or is not a valid scenario.
        """
        path = Path(path)
        data = parse_toml(read_text(path, where=path.name), where=path.name)
        changes = Changes(overrides, years=years, seed=seed)
        return cls._build(
            changes.apply(data),
            where=lambda key: changes.place(key, path.name),
            folder=path.parent,
        )

    @classmethod
    def from_toml(cls, text: str, *, where: str = "scenario", folder: str | Path = ".") -> Scenario:
        """Build a scenario from TOML text; `where` names it in messages.

        Raises
        ------
        InputError
            If the text is not a valid scenario.
        """
        return cls._build(parse_toml(text, where=where), where=where, folder=Path(folder))

    # --- checks and completion -------------------------------------------------------------

    @model_validator(mode="before")
    @classmethod
    def _climate_was_weather(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "weather" in data:
            raise Refusal("unknown key 'weather', did you mean 'climate'?")
        return data

    @field_validator("species", mode="before")
    @classmethod
    def _complete_species(cls, species: Any) -> Any:
        species = as_plain(species)
        if not isinstance(species, dict):
            return species
        return {name: complete(name, given) for name, given in species.items()}

    @field_validator("residual_trees", mode="before")
    @classmethod
    def _number_seeds(cls, trees: Any) -> Any:
        return number_seeds(trees)

    @field_validator("climate")
    @classmethod
    def _read_climate(cls, climate: Climate, info: ValidationInfo) -> Climate:
        return embed_file(climate, info)

    @field_validator("planting")
    @classmethod
    def _read_stem_map(cls, planting: Planting, info: ValidationInfo) -> Planting:
        if isinstance(planting, StemMap):
            return embed_stem_map(planting, info)
        if isinstance(planting, Inventory):
            return embed_inventory(planting, info)
        return planting

    @model_validator(mode="after")
    def _release_markers(self) -> Scenario:
        markers = self.environment.markers
        if self.mode == "paper" and markers and "release" not in markers.model_fields_set:
            kept = markers.model_copy(update={"release": False})
            environment = self.environment.model_copy(update={"markers": kept})
            self.__dict__["environment"] = environment
        return self

    @model_validator(mode="after")
    def _parts_fit(self) -> Scenario:
        check_fit(self)
        return self

    @model_validator(mode="after")
    def _samples_exist(self) -> Scenario:
        samples = self.output.sample_trees
        planned = self.planned_calendar
        if samples.at_year is None:
            samples = samples.model_copy(update={"at_year": self.calendar[-1]})
            self.__dict__["output"] = self.output.model_copy(update={"sample_trees": samples})
        elif samples.at_year not in planned:
            raise Refusal(
                f"{samples.at_year} is not a year of the run",
                key="output.sample_trees.at_year",
                expected=f"a calendar year, {planned[0]} to {planned[-1]}",
            )
        planted = self._count_trees()
        for tree_id in samples.ids:
            if tree_id > planted:
                raise Refusal(
                    f"no tree {tree_id} is planted",
                    key="output.sample_trees.ids",
                    expected=f"1 to {planted}",
                )
        return self

    def _count_trees(self) -> int:
        planting, size = self.planting, self.plot.size_m
        if isinstance(planting, Explicit | Inventory):
            return len(planting.trees)
        if isinstance(planting, Random):
            return placing.random_count(size, planting.density_ha, planting.min_distance_m)
        if isinstance(planting, Regular):
            return len(placing.regular_spots(size, planting.spacing_m)[0])
        raise TypeError(planting)  # a stem map has become explicit when the scenario was read

    # --- use -------------------------------------------------------------------------------

    @property
    def calendar(self) -> range:
        """The calendar years of the run."""
        return range(self.start_year, self.start_year + self.years)

    @property
    def planned_calendar(self) -> range:
        """The calendar years in which something may be due; the last may be beyond the run."""
        most = max(self.years, self.planned_years or 0)
        return range(self.start_year, self.start_year + most)

    @property
    def species_list(self) -> tuple[Species, ...]:
        """The species with all their parameters, in the order of the file."""
        return tuple(self.species.values())

    def planting_positions(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Place the trees of the first year.

        Returns
        -------
        x, y : float64 arrays, m
            Positions inside the plot, one per tree.
        species : int64 array
            Index into `species_list`.

        Raises
        ------
        InputError
            If a random planting finds no room for a tree.
        """
        planting, size = self.planting, self.plot.size_m
        periodic = self.plot.boundary == "periodic"
        if isinstance(planting, Explicit):
            names = list(self.species)
            x = np.array([tree.x_m for tree in planting.trees])
            y = np.array([tree.y_m for tree in planting.trees])
            if periodic:
                x, y = x % size[0], y % size[1]
            index = [names.index(tree.species) if tree.species else 0 for tree in planting.trees]
            return x, y, np.array(index, dtype=np.int64)
        if isinstance(planting, Inventory):
            x, y, kind = inventory_places(planting.trees, list(self.species))
            return (x % size[0], y % size[1], kind) if periodic else (x, y, kind)
        if isinstance(planting, Regular):
            x, y = placing.regular_spots(size, planting.spacing_m)
        elif isinstance(planting, Random):
            distance = planting.min_distance_m
            count = placing.random_count(size, planting.density_ha, distance)
            x, y = placing.random_spots(size, count, distance, self.seed, periodic=periodic)
        else:  # a stem map has become explicit when the scenario was read
            raise TypeError(planting)
        shares = [use.share for use in self.species.values()]
        return x, y, placing.draw_species(shares, len(x), self.seed)

    def planting_leans(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Tell how the trees of the first year lean when they are planted.

        Returns
        -------
        lean_deg, azimuth_deg : float64 arrays
            Angle to the vertical, and direction from x to y; one per tree of
            `planting_positions`. Only trees that are planted one by one lean.
        """
        if isinstance(self.planting, Explicit):
            trees = self.planting.trees
            lean = np.array([tree.lean_deg for tree in trees])
            return lean, np.array([tree.lean_azimuth_deg for tree in trees])
        upright = np.zeros(self._count_trees())
        return upright, upright

    def with_overrides(self, overrides: Iterable[str]) -> Scenario:
        """Change keys and check the whole again, files included.

        Where `years` are made fewer, acts, deaths and storms of later years are not reached.

        Parameters
        ----------
        overrides : iterable of str
            ``"key.path=value"``; the value is read as TOML, or as text if it is none.

        Raises
        ------
        InputError
            If a key is unknown, a value is not allowed, or an override is not ``key=value``.
        """
        changes = Changes(overrides)
        return self._build(
            changes.apply(self._given),
            where=lambda key: changes.place(key, ""),
            folder=self._folder,
        )

    def lived(self, acts: Iterable[Mapping[str, Any]], *, years: int, planned: int) -> Scenario:
        """Give the scenario of so many years with further acts, of which the last may be to come.

        Parameters
        ----------
        acts : iterable of mapping
            Entries of `acts`, behind those that there are.
        years : int
            Years to simulate.
        planned : int
            Years in which these acts may be due; those that this scenario plans stay planned.

        Raises
        ------
        InputError
            If an act is not right.
        """
        data = self.model_dump()
        planned = max(planned, len(self.planned_calendar))
        data.update(years=years, planned_years=planned if planned > years else None)
        data["acts"] = (*data["acts"], *acts)
        return self._build(data, where="", folder=self._folder)

    def to_toml(self) -> str:
        """Write the complete scenario, species and positions included, as TOML."""
        return to_toml(self.model_dump())

    def digest(self) -> str:
        """Give the SHA-256 of the complete scenario, in hexadecimal."""
        return hashlib.sha256(self.to_toml().encode()).hexdigest()

    def __eq__(self, other: object) -> bool:
        """Tell whether both say the same; how they were given does not matter."""
        return isinstance(other, Scenario) and self.model_dump() == other.model_dump()

    def __hash__(self) -> int:
        return hash(self.digest())
