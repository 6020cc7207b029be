"""Stems, their stability and stresses, and reaction wood in plain Python, node by node.

Columns are solved as dense eigenproblems, with the textbook's beam elements (Hermite cubics and
their geometric stiffness), not with the sums along the stem that the kernels use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from tests.reference.plant import Node

G = 9.80665


@dataclass(frozen=True)
class Wood:
    """What the twins must know of a species."""

    exponent: float
    density: float
    support: float
    leaf_mass: float
    leaf_area: float
    modulus: float

    def radius(self, node: Node) -> float:
        return 0.5 * node.pipe ** (1.0 / self.exponent)

    def rigidity(self, node: Node) -> float:
        return self.modulus * math.pi / 4.0 * self.radius(node) ** 4

    def wood(self, node: Node) -> float:
        return self.density * math.pi * self.radius(node) ** 2 * node.length

    def leaves(self, node: Node) -> float:
        return self.leaf_mass * node.buds


def stem_of(nodes: Sequence[Node]) -> list[Node]:
    """The stem: along the main continuation, else along the branch at the last node."""
    stem = [nodes[0]] if nodes else []
    while stem and (onward := stem[-1].onward or stem[-1].branch):
        stem.append(onward)
    return stem


def hanging(stem: Sequence[Node], k: int) -> list[Node]:
    """The metamers beside the stem that hang at station k."""
    onward = stem[k + 1] if k + 1 < len(stem) else None
    return [n for child in stem[k].children() if child is not onward for n in child.above()]


def masses(nodes: Sequence[Node], of: Wood) -> list[tuple[float, np.ndarray]]:
    """Internodes at their middle and leaves at their node."""
    wood = [(of.wood(n), 0.5 * (n.start + n.tip)) for n in nodes]
    return wood + [(of.leaves(n), n.tip) for n in nodes]


def load(stem: Sequence[Node], k: int, of: Wood) -> tuple[float, np.ndarray]:
    """Mass at station k and its first moment."""
    points = [*masses(hanging(stem, k), of), (of.leaves(stem[k]), stem[k].tip)]
    return sum(m for m, _ in points), sum((m * x for m, x in points), np.zeros(3))


def leaf_area(stem: Sequence[Node], k: int, of: Wood) -> tuple[float, float]:
    """Leaf area at station k and its mean height."""
    areas = [(n.buds * of.leaf_area, n.tip[2]) for n in [*hanging(stem, k), stem[k]]]
    area = sum(a for a, _ in areas)
    return area, sum(a * z for a, z in areas) / area if area > 0.0 else stem[k].tip[2]


Pieces = tuple[list[float], list[float], list[float], list[float]]


def pieces_of(nodes: Sequence[Node], of: Wood, least: int) -> Pieces:
    """Length, E I, wood and load at the upper end of a stem's pieces, `least` or more."""
    stem = stem_of(nodes)
    cuts = -(-least // len(stem))
    length, rigidity, wood, loads = [], [], [], []
    for k, node in enumerate(stem):
        length += [node.length / cuts] * cuts
        rigidity += [of.rigidity(node)] * cuts
        wood += [of.wood(node) / cuts] * cuts
        loads += [0.0] * (cuts - 1) + [load(stem, k, of)[0]]
    return length, rigidity, wood, loads


def beam(pieces: Pieces) -> tuple[float, float]:
    """Buckling factor and first frequency (Hz) of a clamped column, one element per piece.

    The weight above is constant within a piece; half its wood swings with either of its ends.
    """
    length, rigidity, wood, loads = pieces
    n = len(length)
    k, m, s = np.zeros((3, 2 * n + 2, 2 * n + 2))
    for j in range(n):
        h = length[j]
        at = np.ix_(range(2 * j, 2 * j + 4), range(2 * j, 2 * j + 4))
        weight = G * (sum(wood[j + 1 :]) + 0.5 * wood[j] + sum(loads[j:]))
        bend = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
        sag = [[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]
        turn = np.outer([1, h, 1, h], [1, h, 1, h])
        k[at] += rigidity[j] / h**3 * turn * bend
        s[at] += weight / (30.0 * h) * turn * sag
        m[2 * j, 2 * j] += 0.5 * wood[j]
        m[2 * j + 2, 2 * j + 2] += 0.5 * wood[j] + loads[j]
    k, m, s = (a[2:, 2:] for a in (k, m, s))
    return 1.0 / _largest(s, k), 1.0 / math.sqrt(_largest(m, k)) / (2.0 * math.pi)


def slopes(pieces: Pieces) -> float:
    """Buckling factor of a column, by the slopes at its nodes and the trapezoidal rule."""
    length, rigidity, wood, loads = pieces
    n = len(length)
    k, w = np.zeros((2, n + 1, n + 1))
    for j in range(n):
        k[j : j + 2, j : j + 2] += rigidity[j] / length[j] * np.array([[1, -1], [-1, 1]])
        weight = G * (sum(wood[j + 1 :]) + 0.5 * wood[j] + sum(loads[j:])) * length[j]
        w[j, j] += 0.5 * weight
        w[j + 1, j + 1] += 0.5 * weight
    return 1.0 / _largest(w[1:, 1:], k[1:, 1:])


def _largest(load: np.ndarray, stiffness: np.ndarray) -> float:
    """Largest eigenvalue; the stiffness spans many decades along a stem, so it is scaled."""
    scale = np.outer(*2 * (1.0 / np.sqrt(np.diag(stiffness)),))
    return float(eigh(load * scale, stiffness * scale, eigvals_only=True)[-1])


def heavy_side(nodes: Sequence[Node], k: int, of: Wood) -> np.ndarray:
    """Horizontal unit vector from the foot of station k to the centre of all masses above it."""
    stem = stem_of(nodes)
    carried = [*stem[k:], *(n for j in range(k, len(stem)) for n in hanging(stem, j))]
    hangs = sum((m * (x - stem[k].start) for m, x in masses(carried, of)), np.zeros(3))
    hangs[2] = 0.0
    size = np.linalg.norm(hangs)
    return hangs / size if size > 0.0 else np.array([1.0, 0.0, 0.0])


def moment(
    nodes: Sequence[Node], k: int, of: Wood, forces: Sequence[float], blows: np.ndarray
) -> float:
    """Bending moment at the foot of station k: of all weights and winds above it."""
    stem = stem_of(nodes)
    foot = stem[k].start
    total = np.zeros(3)
    carried = [*stem[k:], *(n for j in range(k, len(stem)) for n in hanging(stem, j))]
    for mass, place in masses(carried, of):
        total += np.cross(place - foot, [0.0, 0.0, -mass * G])
    for j in range(k, len(stem)):
        up = np.array([0.0, 0.0, leaf_area(stem, j, of)[1] - foot[2]])
        total += np.cross(up, forces[j] * blows)
    along = (stem[k].tip - foot) / np.linalg.norm(stem[k].tip - foot)
    return float(np.linalg.norm(total - (total @ along) * along))


def reaction(base: Node, node: Node, of: Wood, conifer: bool) -> tuple[float, float]:
    """Eccentricity and thick side of a metamer of the limb that starts at `base`."""
    points = masses(list(base.above()), of)
    mass = sum(m for m, _ in points)
    centre = sum((m * x for m, x in points), np.zeros(3)) / mass - base.start
    limb = base.axis()
    trunk = base.below is None
    line = centre if trunk else limb[-1].tip - base.start
    heading = centre if trunk else node.tip - node.start
    length = sum(n.length for n in limb)
    sin_d = math.hypot(line[0], line[1]) / np.linalg.norm(line)
    arm = (centre[:2] @ line[:2]) / np.linalg.norm(line[:2])  # X sin(theta_X)
    force = G * of.support * of.density * of.radius(base) ** 2  # eq. 6
    delta = min(max(mass * G * arm / (force * sin_d), 0.0), length)  # eq. 25
    # supports(R + dr) - supports(R) = F_R / (g cos(theta_R)), solved for dr.
    wide = math.sqrt(of.radius(base) ** 2 * (1.0 + 1.0 / sin_d)) - of.radius(base)
    before = sum(n.length for n in limb[: limb.index(node)])
    t = (before + 0.5 * node.length) / delta if delta > 0.0 else 2.0
    wide *= 1.0 - 3.0 * t**2 + 2.0 * t**3 if t < 1.0 else 0.0
    # y is the part of down (or up) at right angles to the metamer.
    heading = heading / np.linalg.norm(heading)
    y = np.array([0.0, 0.0, -1.0 if conifer else 1.0])
    y = y - (y @ heading) * heading
    size = float(np.linalg.norm(y))
    eccentricity = 0.5 * wide * size / (of.radius(node) + 0.5 * wide)
    flat = upright(heading) @ y
    return eccentricity, math.atan2(flat[1], flat[0])


def upright(heading: np.ndarray) -> np.ndarray:
    """The shortest turn that takes a unit vector to the vertical (Rodrigues' formula)."""
    up = np.array([0.0, 0.0, 1.0])
    v = np.cross(heading, up)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    turn: np.ndarray = np.eye(3) + k + k @ k / (1.0 + heading @ up)
    return turn
