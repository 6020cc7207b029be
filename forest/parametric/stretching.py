"""A finished tree that is stretched along z (Weber & Penn 1995, appendix: ZScale)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest.parametric.stems import Sections, Shoots
from forest.trees.leaves import Leaves


def stretched(sections: Sections, leaves: Leaves, factor: float) -> tuple[Sections, Leaves]:
    """Stretch the finished tree along z (ZScale); leaves keep their shape."""
    along = np.array([1.0, 1.0, factor])
    heading = sections.heading * along
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    side = sections.side - heading * np.sum(sections.side * heading, axis=1, keepdims=True)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    sections = sections._replace(position=sections.position * along, heading=heading, side=side)
    return sections, leaves._replace(position=leaves.position * along.astype(np.float32))


def courses(shoots: Shoots, sections: Sections, first: Any) -> tuple[Any, Any]:
    """Measure the stems of a stretched tree: the courses' lengths, and where children leave them.

    A clone's course begins with that of its twin; it leaves it at the node that it starts from.
    """
    places = sections.position
    along = np.cumsum(np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1))
    along -= along[first][sections.stem]  # from the base of each stem
    node, parent = shoots.node, shoots.parent
    begins = np.zeros(len(first))  # of a clone, along its family's course
    while True:  # once for each clone of a clone of a clone
        found = np.where(shoots.clone, begins[parent] + along[node], 0.0)
        if (found == begins).all():
            break
        begins = found
    length = begins + along[first + shoots.nodes - 1]
    apart = np.linalg.norm(places[first] - places[node], axis=1)
    offset = np.where(parent < 0, 0.0, begins[parent] + along[node] + apart)
    return length, offset
