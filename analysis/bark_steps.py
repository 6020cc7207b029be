"""How little fracture bark hangs on the time step and on how thin strips are, as docs/bark.md says.

    python analysis/bark_steps.py

Each line is one material whose steps are cut into so many parts: the figures an onlooker would
count, and by how much they differ from those of one part.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from forest.surface.bark import Bark, Material, StripGeometry, grow_bark  # noqa: E402
from forest.surface.bark.presets import Preset  # noqa: E402

STRIPS, WIDTH_M, YEARS = 100, 0.02, 20
FIRST_M, LAST_M = 0.6, 1.2
SEEDS = (1, 2, 3)
MATERIALS = {
    "usual": Material(),
    "few fractures": Material(fracture_stiffness=5.0),
    "gripped": Material(attachment=10.0),
    "brittle": Material(arrest=0.0, run_m=np.inf),
    "oak": Preset.load("oak").material(LAST_M),
    "aspen": Preset.load("aspen").material(LAST_M),
}


def bark(material: Material, seed: int, parts: int = 1, finer: int = 1) -> Bark:
    """Grow the bark of a trunk; `finer` makes strips so many times thinner."""
    girth = np.geomspace(FIRST_M, LAST_M, YEARS + 1)[:, None] * np.ones(STRIPS * finer)
    strips = StripGeometry.column(STRIPS * finer, WIDTH_M / finer)
    return grow_bark(strips, girth, material, seed, substeps=parts)


def counted(material: Material, parts: int = 1, finer: int = 1) -> dict[str, float]:
    """Give what one would count on such trunks, over some seeds."""
    area = STRIPS * WIDTH_M * LAST_M
    rows = []
    for seed in SEEDS:
        grown = bark(material, seed, parts, finer)
        f = grown.fractures
        opened = f.length * f.width
        rows.append(
            (
                len(grown.tears.strip) / (STRIPS * finer),
                len(f.length) / area,
                np.average(f.length, weights=opened),
                opened.sum() / f.length.sum(),
                opened.sum() / area,
            )
        )
    names = ("around the girth", "to the m2", "length, m", "width, m", "share")
    return dict(zip(names, np.mean(rows, axis=0).tolist(), strict=True))


def _say(name: str, now: dict[str, float], usual: dict[str, float]) -> None:
    cells = [f"{key} {value:.3g} ({value / usual[key] - 1.0:+.0%})" for key, value in now.items()]
    print(f"{name}: {'; '.join(cells)}", flush=True)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--parts", type=int, nargs="+", default=[4, 8, 16])
    parser.add_argument("--material", choices=list(MATERIALS), nargs="+", default=list(MATERIALS))
    args = parser.parse_args(argv)
    for name in args.material:
        usual = counted(MATERIALS[name])
        _say(f"{name}, 1 part", usual, usual)
        for parts in args.parts:
            _say(f"{name}, {parts} parts", counted(MATERIALS[name], parts), usual)
        _say(f"{name}, strips half as wide", counted(MATERIALS[name], finer=2), usual)


if __name__ == "__main__":
    main()
