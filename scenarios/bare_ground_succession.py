"""Birch, pine, spruce, beech and oak on bare ground for 250 years: who leads when, and why.

    python scenarios/bare_ground_succession.py --out out/succession

Nothing is planted: a thin rain of seed falls from outside, later the plot's own trees add theirs.
Birch grows fastest in the open and closes the canopy. Below it the light falls to what only the
seedlings of spruce and beech survive, so that they alone wait under the birches; they pass them
when these grow old. The script prints each species' part in this, what the stand is like at the
end beside published figures, and draws it (see `analysis/succession.py`, which reads the run file).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.common import save  # noqa: E402
from analysis.succession import pattern, study  # noqa: E402
from scenarios.common import command_line, one_line_errors, report  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")


def main(words: Sequence[str] | None = None) -> None:
    """Grow the stand, print what came of it and draw it."""
    parser = command_line(__doc__, "succession")
    parser.add_argument("--years", type=int, help="years to grow; default: the scenario's")
    asked = parser.parse_args(words)
    given = {"seed": asked.seed, "years": asked.years}
    with one_line_errors():
        scenario = forest.Scenario.load(SCENARIO).with_overrides(
            [f"{key}={value}" for key, value in given.items() if value is not None]
        )
        asked.out.mkdir(parents=True, exist_ok=True)
        to = asked.out / "bare_ground_succession.h5"
        with forest.simulate(
            scenario, to, threads=asked.threads, overwrite=True, progress=True
        ) as run:
            made = study(run)
            save(made.figure, to.with_suffix(".png"))
            report(made.numbers, asked.out / "species.csv")
            report(pattern(run), asked.out / "pattern.csv", "the whole stand")


if __name__ == "__main__":
    main()
