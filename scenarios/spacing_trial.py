"""A spacing trial: pine and spruce planted 1, 1.5, 2.5 and 4 m apart, three seeds each.

    python scenarios/spacing_trial.py --out out/spacing

Trees that stand close race for the light: they grow tall and thin, lose their lower branches early
and keep those that they have thin. Trees with room grow stout, with thick branches and deep crowns;
so foresters plant densely for timber without knots and widely for stems that snow and wind do not
break. The script grows all plots (files that are there already are kept), prints the trial and what
the rules of Vospernik et al. (2010) say of it, and draws it; `analysis/spacing.py` reads the files.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.common import save  # noqa: E402
from analysis.spacing import rules, study, trial  # noqa: E402
from scenarios.common import one_line_errors, report  # noqa: E402
from scenarios.trials import as_asked, grow_all, trial_line  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")
SPECIES = ("pinus_sylvestris", "picea_abies")
SPACINGS_M = (1.0, 1.5, 2.5, 4.0)


def plots(base: forest.Scenario) -> dict[str, forest.Scenario]:
    """Give the trial's plots by name; each about as wide as the base's: an even number of rows."""
    made = {}
    for species in SPECIES:
        for spacing in SPACINGS_M:
            width = 2.0 * spacing * max(round(0.5 * base.plot.size_m[0] / spacing), 1)
            made[f"{species}_{spacing:g}m"] = base.with_overrides(
                [
                    f"species={{{species}={{}}}}",
                    f"planting.spacing_m=[{spacing}, {spacing}]",
                    f"plot.size_m=[{width}, {width}]",
                ]
            )
    return made


def main(words: Sequence[str] | None = None) -> None:
    """Grow the trial, print what came of it and draw it."""
    asked = trial_line(__doc__, "spacing").parse_args(words)
    with one_line_errors():
        base = as_asked(forest.Scenario.load(SCENARIO), asked)
        runs = grow_all(plots(base), asked)
        table = trial(runs)
        made = study(runs, table)
        save(made.figure, asked.out / "spacing_trial.png")
        report(made.numbers, asked.out / "spacing_trial.csv", f"after {base.years} years")
        report(rules(table), asked.out / "rules.csv", "rules")


if __name__ == "__main__":
    main()
