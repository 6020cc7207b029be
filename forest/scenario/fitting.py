"""Whether the parts of a scenario fit together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forest.errors import nearest
from forest.scenario import placing
from forest.scenario.acts import check_acts
from forest.scenario.climate import check_covered
from forest.scenario.complete import check_spots
from forest.scenario.inventory import Inventory
from forest.scenario.model import Explicit, Random, Regular
from forest.scenario.mortality import check_mortality
from forest.scenario.regeneration import check_regeneration
from forest.scenario.residual import check_felled_residual, check_residual
from forest.scenario.shaping import check_shaping
from forest.scenario.strokes import check_strokes
from forest.scenario.wind import check_wind
from forest.species.schema import Refusal

if TYPE_CHECKING:
    from forest.scenario.scenario import Scenario

#: A periodic grid of more columns of voxels than this fits no memory.
_MOST_COLUMNS = 250_000_000
#: Pixels that a picture of the plot may have: its table of tiles then stays small.
_MOST_PIXELS = 4e9


def check_fit(scenario: Scenario) -> None:
    """Refuse a scenario whose parts, each allowed, do not fit together."""
    _wind_has_a_price(scenario)
    _picture_fits(scenario)
    _grid_fits(scenario)
    _trees_fit(scenario)
    check_covered(scenario.climate, scenario.calendar)
    check_regeneration(
        scenario.regeneration,
        mode=scenario.mode,
        environment=scenario.environment,
        species=scenario.species,
        planted=not isinstance(scenario.planting, Explicit) or bool(scenario.planting.trees),
    )
    shares = {name: use.share for name, use in scenario.species.items()}
    regular = isinstance(scenario.planting, Regular)
    check_acts(scenario.acts, scenario.plot, shares, scenario.planned_calendar, regular)
    check_strokes(scenario.acts, scenario.environment, scenario.plot)
    check_shaping(scenario.acts, scenario.obstacles)
    residual = scenario.residual_trees
    check_residual(
        residual, scenario.planting, scenario.plot, scenario.species, scenario.environment
    )
    check_felled_residual(scenario.acts, residual, scenario.planned_calendar)
    check_wind(scenario)
    check_mortality(
        scenario.mortality,
        mechanics=scenario.mechanics is not None,
        plot=scenario.plot,
        species=scenario.species,
        years=scenario.planned_calendar,
    )


def _wind_has_a_price(scenario: Scenario) -> None:
    mechanics = scenario.mechanics
    if scenario.mode == "paper" and mechanics is not None and mechanics.wind_growth:
        raise Refusal(
            "wind_growth shifts dry mass, and paper mode has none",
            key="mechanics.wind_growth",
            expected='mode = "mass_balance"',
        )


def _picture_fits(scenario: Scenario) -> None:
    rendered = scenario.environment.rendered
    if rendered is None:
        return
    if rendered.clearing_radius_m is not None and scenario.plot.boundary == "periodic":
        raise Refusal(
            "a periodic plot has no clearing",
            key="environment.rendered.clearing_radius_m",
            expected='plot.boundary = "open"',
        )
    size_x, size_y = scenario.plot.size_m
    least = (size_x * size_y / _MOST_PIXELS) ** 0.5
    if rendered.pixel_m < least:
        raise Refusal(
            f"{rendered.pixel_m:g} is too fine for a plot of {size_x:g} x {size_y:g} m",
            key="environment.rendered.pixel_m",
            expected=f"at least {least:.3g}",
        )


def _grid_fits(scenario: Scenario) -> None:
    shadow, canopy = scenario.environment.shadow, scenario.environment.canopy
    edge = canopy.voxel_m if canopy else shadow.voxel_m if shadow else None
    if edge is None:
        return
    fine = shadow.voxel_m if shadow else edge
    name = "shadow" if shadow else "canopy"
    size_x, size_y = scenario.plot.size_m
    if size_x * size_y / fine**2 > _MOST_COLUMNS:
        least = (size_x * size_y / _MOST_COLUMNS) ** 0.5
        raise Refusal(
            f"{fine:g} is too fine for a plot of {size_x:g} x {size_y:g} m",
            key=f"environment.{name}.voxel_m",
            expected=f"at least {least:.3g}",
        )
    if scenario.plot.boundary == "periodic":
        fit = [max(round(size / edge), 1) * edge for size in scenario.plot.size_m]
        if any(abs(a - b) > 1e-6 for a, b in zip(fit, scenario.plot.size_m, strict=True)):
            raise Refusal(
                f"{list(scenario.plot.size_m)} is not a whole multiple of the voxel edge {edge:g}",
                key="plot.size_m",
                expected=f"on a periodic plot for example [{fit[0]:g}, {fit[1]:g}]",
            )


def _trees_fit(scenario: Scenario) -> None:
    planting, size = scenario.planting, scenario.plot.size_m
    if isinstance(planting, Explicit):
        _check_trees(scenario, planting)
    elif isinstance(planting, Inventory):
        return  # its trees were checked when they were read
    elif not any(use.share > 0 for use in scenario.species.values()):
        raise Refusal("every share is 0", key="species", expected="a share above 0")
    elif isinstance(planting, Random):
        placing.random_count(size, planting.density_ha, planting.min_distance_m)
    elif isinstance(planting, Regular):
        step = planting.spacing_m
        if (size[0] / step[0]) * (size[1] / step[1]) > placing.MOST_TREES:
            raise Refusal(
                "too many trees",
                key="planting.spacing_m",
                expected=f"at most {placing.MOST_TREES} trees on the plot",
            )


def _check_trees(scenario: Scenario, planting: Explicit) -> None:
    for i, tree in enumerate(planting.trees):
        key = f"planting.trees[{i}]"
        if not tree.species and len(scenario.species) > 1:
            raise Refusal("missing key 'species'", key=key, expected="a species' name")
        if tree.species and tree.species not in scenario.species:
            hint = nearest(tree.species, scenario.species)
            raise Refusal(f"unknown species {tree.species!r}, {hint}", key=f"{key}.species")
    check_spots(planting.trees, scenario.plot, key="planting.trees")
