"""Deaths, snags and dead wood, tree by tree and year by year in plain numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tests.reference.random import uniforms

DEATH, DISTURBANCE, SNAG = 20, 21, 22


def survival(age: float, longevity: float, share: float, exponent: float) -> float:
    """Share of the trees that reach an age, if they die of age alone."""
    return float(share ** ((age / longevity) ** exponent))


def ageing(age: float, longevity: float, share: float, exponent: float) -> float:
    """Chance to die in the year that ends at an age, for a tree that reached the year before."""
    before = survival(age - 1, longevity, share, exponent)
    return 1.0 - survival(age, longevity, share, exponent) / before


def struck(tree: dict[str, Any], event: Any, size: Sequence[float], periodic: bool) -> bool:
    """Tell whether a disturbance means a tree, before its share is drawn."""
    if event.tree_id is not None:
        return bool(tree["id"] == event.tree_id)
    if event.species is not None and tree["species"] != event.species:
        return False
    dbh = 0.0 if math.isnan(tree["dbh"]) else tree["dbh"]
    if event.min_dbh_cm is not None and dbh < event.min_dbh_cm:
        return False
    if event.max_dbh_cm is not None and dbh > event.max_dbh_cm:
        return False
    if event.radius_m is None:
        return True
    shifts = (-1, 0, 1) if periodic else (0,)
    return any(
        (tree["x"] - event.x_m + i * size[0]) ** 2 + (tree["y"] - event.y_m + j * size[1]) ** 2
        <= event.radius_m**2
        for i in shifts
        for j in shifts
    )


def death(
    tree: dict[str, Any],
    events: Sequence[Any],
    step: int,
    seed: int,
    rules: Any,
    size: Sequence[float],
    periodic: bool,
) -> tuple[str, str] | None:
    """Give the kind and cause of a tree's death in a year, or None: the first cause that holds."""
    for k, event in enumerate(events):
        if struck(tree, event, size, periodic):
            drawn = uniforms(seed, DISTURBANCE, tree["id"], k, step)[0]
            if event.share is None or drawn < event.share:
                return ("windthrown" if event.cause == "wind" else "died"), event.cause
    if tree["bad_years"] >= tree["suppression_years"]:
        return "died", "suppression"
    if tree["buds"] == 0:
        return "died", "no_buds"
    of_age, at_random, _, _ = uniforms(seed, DEATH, tree["id"], 0, step)
    traits = tree["traits"]
    age = max(step - tree["birth"], 1)
    if rules.age and of_age < ageing(
        age, traits.longevity_years, traits.longevity_share, traits.ageing_exponent
    ):
        return "died", "age"
    if rules.background and at_random < traits.background_per_year:
        return "died", "background"
    return None


def years_standing(draw: float, half_life: float, exponent: float) -> int:
    """The first whole year at whose end a snag with this draw has fallen."""
    year = 1
    while 0.5 ** ((year / half_life) ** exponent) > draw:
        year += 1
    return year


def pass_year(
    standing: list[dict[str, Any]],
    lying: dict[int, list[float]],
    dead: Sequence[dict[str, Any]],
    traits: Sequence[Any],
    step: int,
) -> dict[str, dict[int, list[float]]]:
    """Let dead wood decay and fall, take in the dead of the year; give the flows by species.

    Each tree is a dict with species, amounts (volume and mass), fall, and whether it stands.
    """
    flows = {name: {k: [0.0, 0.0] for k in lying} for name in ("input", "fallen", "decayed")}
    for snag in standing:
        lost = 1.0 - math.exp(-traits[snag["species"]].decay_standing_per_year)
        for i in range(2):
            flows["decayed"][snag["species"]][i] += snag["amounts"][i] * lost
            snag["amounts"][i] *= 1.0 - lost
    for k, amounts in lying.items():
        lost = 1.0 - math.exp(-traits[k].decay_lying_per_year)
        for i in range(2):
            flows["decayed"][k][i] += amounts[i] * lost
            amounts[i] *= 1.0 - lost
    for snag in [s for s in standing if s["fall"] <= step]:
        standing.remove(snag)
        for i in range(2):
            flows["fallen"][snag["species"]][i] += snag["amounts"][i]
            lying[snag["species"]][i] += snag["amounts"][i]
    for tree in dead:
        for i in range(2):
            flows["input"][tree["species"]][i] += tree["amounts"][i]
            if not tree["stands"]:
                lying[tree["species"]][i] += tree["amounts"][i]
        if tree["stands"]:
            standing.append(tree)
    return flows


def cone_surface(base_m: float, height_m: float) -> float:
    """Half of the lateral surface of a slender cone, in many slices."""
    n = 10_000
    thick = height_m / n
    return sum(0.5 * math.pi * base_m * (1.0 - (k + 0.5) / n) * thick for k in range(n))
