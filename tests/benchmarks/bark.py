"""What fracture bark costs: the paper's tree of 225 strips, and more of everything."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np

from forest.surface.bark import Bark, Crossings, Material, StripGeometry, grow_bark, shrinking

#: Lefebvre & Neyret 2002, section 6, on a Pentium III 900: seconds for 225 strips.
PAPER_S = 341.0

_TRUNK, _BRANCH, _BRANCHES = 105, 30, 4
_STEPS = 40


def branched(finer: int = 1) -> StripGeometry:
    """A trunk of 105 strips and four branches of 30, each 0.2 of a turn wide at its base."""
    sizes = np.array([_TRUNK] + _BRANCHES * [_BRANCH]) * finer
    width = 0.02 / finer
    starts = np.concatenate([[0], np.cumsum(sizes)])
    strip = np.arange(starts[-1])
    axis = np.repeat(np.arange(len(sizes)), sizes)
    is_last = strip == starts[axis + 1] - 1
    is_first = strip == starts[axis]
    rows = []
    for k in range(1, _BRANCHES + 1):
        base, angle = starts[k], 0.2 * k
        low, high = (20 * k - 2) * finer, (20 * k + 3) * finer
        rows += [
            (low, 1, angle, 0.1, base, 0.0, 2.5, 1),  # from below, onto its lower side
            (high, -1, angle, 0.1, base, 0.5, -2.5, 1),  # from above, onto its upper side
            (base, -1, 0.0, 0.25, low, angle, 0.4, -1),  # and back to the trunk
        ]
    kinds = (np.int32, np.int8, float, float, np.int32, float, float, np.int8)
    columns: list[Any] = [
        np.array(column, kind) for column, kind in zip(zip(*rows, strict=True), kinds, strict=True)
    ]
    return StripGeometry(
        axis=axis.astype(np.int32),
        along=(strip - starts[axis] + 0.5) * width,
        width=np.full(len(strip), width),
        neighbour_up=np.where(is_last, -1, strip + 1).astype(np.int32),
        neighbour_down=np.where(is_first, -1, strip - 1).astype(np.int32),
        width_around=np.ones((len(strip), 1)),
        crossings=Crossings(*columns),
    )


def paper_bark(finer: int = 1, softer: float = 1.0, **material: Any) -> Bark:
    """Bark of the paper's size by its shrinking strategy: about 20 fractures around the trunk."""
    geometry = branched(finer)
    girth = np.where(geometry.axis == 0, 1.0, 0.4) * (1.0 - 0.1 * geometry.along)
    settings = {"fracture_stiffness": 20.0 / softer, "grain_along_m": 0.05, **material}
    return grow_bark(geometry, shrinking(girth, 0.6, _STEPS), Material(**settings), 1)


def measure_bark(repeats: int) -> dict[str, Any]:
    """Time the paper's tree, the same with thinner strips, and with more fractures.

    Returns
    -------
    dict
        Of each case wall and CPU seconds, elements, and CPU microseconds an element and step.
    """
    paper_bark()
    found: dict[str, Any] = {"paper_s": PAPER_S}
    cases: dict[str, dict[str, Any]] = {
        "225 strips": {},
        "900 strips": {"finer": 4},
        "3600 strips": {"finer": 16},
        "225 strips, four times the fractures": {
            "softer": 0.25,
            "least_piece_m": 0.001,
            "grain_m": 0.001,
        },
        "225 strips, gripped": {"attachment": 100.0},
    }
    for name, case in cases.items():
        wall, cpu = [], []
        for _ in range(repeats):
            start, worked = time.perf_counter(), time.process_time()
            bark = paper_bark(**case)
            wall.append(time.perf_counter() - start)
            cpu.append(time.process_time() - worked)
        elements = len(bark.elements.kind)
        found[name] = {
            "wall_s": statistics.median(wall),
            "cpu_s": statistics.median(cpu),
            "elements": elements,
            "element_us": 1e6 * statistics.median(cpu) / elements / _STEPS,
        }
    return found
