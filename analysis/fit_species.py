"""Fit the free parameters of the species to yield tables and pattern figures.

`python analysis/fit_species.py --species pinus_sylvestris --evaluations 200` searches with the
method of Nelder and Mead from the values in the species file and prints what it finds;
`--write` puts it into the file. Without `--species` nothing is fitted: all stands are grown with
the values in the files and docs/fit.md is written.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.fit_page import write_page  # noqa: E402
from analysis.fit_stand import grow_towards, misfit  # noqa: E402
from analysis.fit_targets import GOALS, Goal  # noqa: E402
from forest.species import load_species  # noqa: E402

FILES = ROOT / "forest" / "species"

_FIRST_STEP = 0.12  # of the way between a parameter's bounds


def present(species: str, goal: Goal) -> NDArray[np.float64]:
    """Give the places of the species file's values between their bounds."""
    of = load_species(species)
    values = [getattr(getattr(of, key[0]), key[1]) for key in (f.key.split(".") for f in goal.free)]
    return np.array([free.place(value) for free, value in zip(goal.free, values, strict=True)])


def values_at(goal: Goal, places: NDArray[np.float64]) -> dict[str, float]:
    """Give the parameters at places between their bounds."""
    return {free.key: free.value(x) for free, x in zip(goal.free, places, strict=True)}


def search(
    cost: Callable[[NDArray[np.float64]], float], start: NDArray[np.float64], evaluations: int
) -> NDArray[np.float64]:
    """Minimise over the unit cube by the method of Nelder and Mead, from `start`.

    The first simplex steps towards the middle of the cube, so that none of it is outside.
    """
    from scipy.optimize import minimize

    simplex = np.vstack([start, np.tile(start, (len(start), 1))])
    for k, x in enumerate(start):
        simplex[k + 1, k] = x + (_FIRST_STEP if x < 0.5 else -_FIRST_STEP)
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(start),
        options={
            "maxfev": evaluations,
            "initial_simplex": simplex,
            "adaptive": True,
            "xatol": 1e-3,
            "fatol": 1e-3,
        },
    )
    return np.asarray(found.x)


def fit(
    species: str, evaluations: int, plot_m: float, seeds: Sequence[int]
) -> tuple[dict[str, float], float, float]:
    """Fit a species; give its parameters and the misfit before and after.

    Ctrl-C ends the search with the best so far.
    """
    goal = GOALS[species]
    costs: list[float] = []
    best = start = present(species, goal)

    def cost(places: NDArray[np.float64]) -> float:
        nonlocal best
        values = values_at(goal, places)
        tables = [grow_towards(species, goal, plot_m, seed, values) for seed in seeds]
        costs.append(misfit(tables, goal.targets))
        if costs[-1] <= min(costs):
            best = places.copy()
            print(f"{len(costs):4d}  misfit {costs[-1]:.3f}", file=sys.stderr, flush=True)
        return costs[-1]

    with contextlib.suppress(KeyboardInterrupt):
        search(cost, start, evaluations)
    return values_at(goal, best), costs[0], min(costs)


def write_values(file: Path, values: Mapping[str, float], source: str) -> None:
    """Put parameters, `section.key`: value, into a species file, and what they were fitted to."""
    text = file.read_text(encoding="utf-8")
    told = f"fitted with analysis/fit_species.py to {source}"
    for name, value in values.items():
        section, key = name.split(".")
        head, rest = text.split(f"[{section}]\n", 1)
        rest = re.sub(rf"^{key} = .*$", f"{key} = {value!r}", rest, count=1, flags=re.MULTILINE)
        rest = re.sub(rf'^{name} = ".*$', f'{name} = "{told}"', rest, count=1, flags=re.MULTILINE)
        text = f"{head}[{section}]\n{rest}"
    file.write_text(text, encoding="utf-8")


def main(words: Sequence[str] | None = None) -> None:
    """Fit one species, or grow all stands and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--species", choices=sorted(GOALS), help="species to fit")
    parser.add_argument("--evaluations", type=int, default=200, help="stands' parameters to try")
    parser.add_argument("--plot", type=float, default=16.0, help="edge of the plot, m")
    parser.add_argument("--seeds", type=int, default=1, help="stands grown for each trial")
    parser.add_argument("--write", action="store_true", help="put what is found into the file")
    asked = parser.parse_args(words)
    if asked.species is None:
        write_page()
        return
    seeds = range(1, asked.seeds + 1)
    values, before, after = fit(asked.species, asked.evaluations, asked.plot, seeds)
    for key, value in values.items():
        print(f"{key} = {value!r}")
    print(f"misfit {before:.3f} before, {after:.3f} after")
    if asked.write:
        write_values(FILES / f"{asked.species}.toml", values, GOALS[asked.species].source)


if __name__ == "__main__":
    main()
