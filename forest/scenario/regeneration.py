"""The table `[regeneration]`: whether and how a stand renews itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from forest.errors import nearest
from forest.species.schema import Refusal, Table, quantity

if TYPE_CHECKING:
    from forest.scenario.model import Environment

_Seeds = Annotated[float, Field(ge=0, le=1e6)]


class Regeneration(Table):
    """Seeds, seedlings and sprouts; a stand without this table does not renew itself."""

    cell_m: float = quantity(
        1.0,
        "edge of the ground's cells that hold seedlings, a little more where the plot is no whole "
        "multiple; at least canopy.voxel_m",
        unit="m",
        ge=0.25,
        le=20,
    )
    handover_height_m: float = quantity(
        1.3, "height at which a seedling becomes a tree of buds", unit="m", ge=0.1, le=5
    )
    seed_rain: dict[str, _Seeds] = quantity(
        {},
        "seeds that fall a year from outside the plot, mean over mast and other years, by species",
        unit="1/m2",
        max_length=200,
    )
    cohorts_per_cell: int = quantity(
        4, "most cohorts of a species in a cell; the lowest are merged", ge=1, le=16
    )


def check_regeneration(
    regeneration: Regeneration | None,
    *,
    mode: str,
    environment: Environment,
    species: Iterable[str],
    planted: bool,
) -> None:
    """Refuse a table that does not fit the rest of the scenario, or bare ground without it."""
    if regeneration is None:
        if not planted:
            raise Refusal(
                "no tree",
                key="planting.trees",
                expected="one at least, or seeds from outside: regeneration.seed_rain",
            )
        return
    if mode == "paper":
        raise Refusal(
            "seedlings hand over dry mass, and paper mode has none",
            key="regeneration",
            expected='mode = "mass_balance"',
        )
    canopy = environment.canopy
    if canopy is None:
        raise Refusal(
            "seedlings live by the light at the ground, which is not known",
            key="regeneration",
            expected="a table environment.canopy",
        )
    if regeneration.cell_m < canopy.voxel_m:
        raise Refusal(
            f"{regeneration.cell_m:g} is finer than the light at the ground",
            key="regeneration.cell_m",
            expected=f"environment.canopy.voxel_m = {canopy.voxel_m:g} or more",
        )
    known = list(species)
    for name in regeneration.seed_rain:
        if name not in known:
            raise Refusal(
                f"unknown species {name[:60]!r}, {nearest(name, known)}",
                key="regeneration.seed_rain",
            )
    if not planted and not any(regeneration.seed_rain.values()):
        raise Refusal(
            "no tree and no seed from outside",
            key="regeneration.seed_rain",
            expected="seeds of a species, or a tree in planting.trees",
        )
