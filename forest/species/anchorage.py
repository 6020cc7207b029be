"""How firmly a species stands in the ground."""

from __future__ import annotations

from forest.species.schema import Table, quantity


class Anchorage(Table):
    """What it takes to uproot a tree."""

    turning_moment_nm_kg: float = quantity(
        130.0,
        "bending moment at the ground that turns the root plate over, per fresh mass of the "
        "stem, on well drained mineral soil (slope of tree-pulling tests through the origin)",
        unit="N m/kg",
        gt=0,
        le=2000,
    )
