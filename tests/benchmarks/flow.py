"""What the flow of particles over bark costs."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from forest.parametric import grow
from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.surface.flow import features, flow, heal, prune
from forest.surface.flow.flowing import RECORD_EVERY
from tests.surface.limbs import branched, pole

_STUB_M = 0.13
_RINGS = np.full(10, 0.004)
#: The chain flows over limbs of the crown so thick, in radii of its foot, as `features` lets it.
_CROWN = 0.1


def measure_flow(repeats: int) -> dict[str, Any]:
    """Time the chain over a branching and a crown, bark on a trunk, and ten years of a wound.

    Returns
    -------
    dict
        For each: seconds of wall and processor, and how many particles, steps of particles or
        triangles that is.
    """
    blend = Blend.of(limbs_of(branched()))
    found = flow(blend, unit_m=0.05)
    trunk = pole(0.15, 1.0)
    bark = features(trunk, "maple", age=80.0)
    rest, wound = prune(branched(), 1, stub_m=_STUB_M)
    years = heal(rest, wound, _RINGS[:1])
    crown = _crown()
    over = flow(crown)
    return {
        "crown": _time(lambda: flow(crown), repeats),
        "crown_steps": len(over.trails.place) * RECORD_EVERY,
        "crown_limbs": len(np.unique(crown.limbs.cones.axis)),
        "crown_parted": over.relinked,
        "chain": _time(lambda: flow(blend, unit_m=0.05), repeats),
        "particle_steps": len(found.trails.place) * RECORD_EVERY,
        "maple": _time(lambda: features(trunk, "maple", age=80.0), repeats),
        "triangles": sum(len(piece.triangles) for piece in bark.pieces.values()),
        "wound": _time(lambda: heal(rest, wound, _RINGS), repeats),
        "covering": len(years[0].cover),
    }


def _crown() -> Blend:
    skeleton = grow("quaking_aspen", 1).skeleton()
    foot = float(limbs_of(skeleton).cones.low[0])
    return Blend.of(limbs_of(skeleton, thinnest_m=_CROWN * foot))


def _time(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    spent = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    walls, cpus = zip(*spent, strict=True)
    return statistics.median(walls), statistics.median(cpus)
