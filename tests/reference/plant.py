"""A tree as nodes that know their parent and their children, for the slow twins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from forest.trees.metamers import (
    LATERAL,
    MAIN,
    NO_ROOM_LATERAL,
    NO_ROOM_TERMINAL,
    TERMINAL,
    Metamers,
)
from forest.trees.table import Trees


@dataclass(eq=False)
class Node:
    """A metamer: an internode, the node at its upper end, and what that bears."""

    index: int
    serial: int
    order: int
    length: float
    light: float
    pipe: float
    sapwood: float
    birth: int
    start: np.ndarray
    tip: np.ndarray
    terminal: bool
    lateral: bool
    room_terminal: bool
    room_lateral: bool
    resource: tuple[float, float]
    below: Node | None = None
    onward: Node | None = None
    branch: Node | None = None

    @property
    def lit_buds(self) -> int:
        """Living buds at this node that have room, so that their light counts."""
        return (self.terminal and self.room_terminal) + (self.lateral and self.room_lateral)

    @property
    def buds(self) -> int:
        """Living buds at this node."""
        return int(self.terminal) + int(self.lateral)

    def children(self) -> list[Node]:
        """The metamers that stand on this one."""
        return [child for child in (self.onward, self.branch) if child is not None]

    def above(self) -> Iterator[Node]:
        """This metamer and all that it carries."""
        yield self
        for child in self.children():
            yield from child.above()

    def down(self) -> Iterator[Node]:
        """This metamer and all below it, to the ground."""
        yield self
        if self.below is not None:
            yield from self.below.down()

    def axis(self) -> list[Node]:
        """The metamers of the axis from this one on."""
        return [self] + (self.onward.axis() if self.onward else [])


def read_plant(m: Metamers, trees: Trees, row: int) -> list[Node]:
    """Read a tree out of the arena, in its order there; the first node is the base."""
    first = int(trees.start[row])
    nodes: list[Node] = []
    for k in range(int(trees.size[row])):
        i = first + k
        state = int(m.state[i])
        below = nodes[m.parent[i]] if m.parent[i] >= 0 else None
        node = Node(
            index=k,
            serial=int(m.serial[i]),
            order=int(m.order[i]),
            length=float(m.length[i]),
            light=float(m.light[i]),
            pipe=float(m.pipe[i]),
            sapwood=float(m.sapwood[i]),
            birth=int(m.birth[i]),
            start=below.tip if below else np.zeros(3),
            tip=m.tip[i].astype(float),
            terminal=bool(state & TERMINAL),
            lateral=bool(state & LATERAL),
            room_terminal=not state & NO_ROOM_TERMINAL,
            room_lateral=not state & NO_ROOM_LATERAL,
            resource=(float(m.resource[i, 0]), float(m.resource[i, 1])),
            below=below,
        )
        if below is not None:
            if state & MAIN:
                below.onward = node
            else:
                below.branch = node
        nodes.append(node)
    return nodes
