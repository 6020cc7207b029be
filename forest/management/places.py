"""Places at which a scenario plants, against the obstacles that stand then: before it is grown."""

from __future__ import annotations

import numpy as np

from forest.environment.surroundings import Surroundings
from forest.establishment import check_free
from forest.scenario import Scenario
from forest.scenario.acts import Plant
from forest.scenario.model import Explicit
from forest.scenario.shaping import ChangeObstacle
from forest.species.schema import Refusal
from forest.species.text import input_error


def check_places(scenario: Scenario) -> None:
    """Refuse plantings that would be refused in their year for the obstacles that stand there.

    All of it is known that has fixed years. Where a trigger may change obstacles, only the trees
    of the beginning are checked.

    Raises
    ------
    InputError
        If a place lies in an obstacle, or obstacles cannot be built or changed so.
    """
    changes = [act for act in scenario.acts if isinstance(act, ChangeObstacle)]
    if not scenario.obstacles and not changes:
        return
    around = Surroundings(scenario, np.array([s.wood.pipe_exponent for s in scenario.species_list]))
    if isinstance(scenario.planting, Explicit):
        x, y, _ = scenario.planting_positions()
        check_free(around, x, y, where="planting.trees[{}]")
    if any(act.when is not None for act in changes):
        return
    now, solid = scenario.obstacles, around.solid
    for year in scenario.calendar:
        due = [
            (i, act)
            for i, act in enumerate(scenario.acts)
            if act.when is None and act.may_be_in(year, scenario.start_year)
        ]
        for i, act in due:
            if isinstance(act, ChangeObstacle):
                try:
                    now = act.applied(now)
                except Refusal as refused:
                    place = f"acts[{i}].{refused.key} in {year}"
                    raise input_error(
                        refused.what, where=place, expected=refused.expected
                    ) from None
                solid = around.solid_of(now)
        for i, act in due:
            if isinstance(act, Plant) and act.pattern is None:
                where = f"acts[{i}].x_m[{{}}] in {year}"
                check_free(around, act.x_m, act.y_m, where=where, solid=solid)
