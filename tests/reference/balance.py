"""Balance in plain Python: Hart & Baker 2003, sections 3.4 and 4.1, eqs 6-22, limb by limb.

A limb is an axis, a truncated cone that ends in a twig; a lateral bud is a limb of length 0. Eq. 13
is read so that growth goes to the light side; what a bud holds of an internode counts as grown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from tests.reference.plant import Node


@dataclass(frozen=True)
class Traits:
    """Numbers of a species, and of its environment, that balance depends on."""

    density: float = 570.0
    support: float = math.pi * 30.48
    exponent: float = 2.0
    twig: float = 0.001
    cones: bool = True
    min_growth: float = 0.1
    offset_gain: float = 0.45
    light_gain: float = 1.0
    offset_length: float = 10.0
    area: float = 0.01
    most: float = 4.0
    unit: tuple[float, ...] = (0.2, 0.15, 0.1)

    def unit_of(self, order: int) -> float:
        """Length of an internode of an order."""
        return self.unit[min(order, len(self.unit) - 1)]

    def volume(self, length: float, base: float) -> float:
        """v(l, R, r) as printed (eq. 9); a cylinder where both ends are alike."""
        r = self.twig
        if abs(base - r) < 1e-6 * r:
            return math.pi * length * r * r
        return math.pi / 3.0 * length * (base**3 - r**3) / (base - r)

    def centre(self, length: float, base: float) -> float:
        """Distance of the centre of mass from the base as printed (eq. 11)."""
        r = self.twig
        if abs(base - r) < 1e-4 * r:
            return length / 2.0
        bottom = (base - r) * (base**3 - r**3)
        return length / 4.0 * (base**4 - r**3 * (4.0 * base - 3.0 * r)) / bottom

    def supports(self, radius: float) -> float:
        """Mass that a limb can support (eq. 6)."""
        return self.support * self.density * radius**2

    def needs_to_support(self, mass: float) -> float:
        """Radius that supports a mass (eq. 7)."""
        return math.sqrt(mass / (self.support * self.density))


@dataclass(eq=False)
class Limb:
    """A limb with the limbs that it bears; `nodes` is empty where it is still a bud."""

    traits: Traits
    order: int
    at: int  # index of the first metamer, or of the node whose lateral bud it is
    nodes: list[Node]
    start: np.ndarray
    heading: np.ndarray
    length: float
    base: float
    p: float
    grows: bool
    held: float
    children: list[Limb] = field(default_factory=list)

    def above(self) -> Iterator[Limb]:
        """This limb and all that it bears."""
        yield self
        for child in self.children:
            yield from child.above()

    @property
    def m(self) -> float:
        """Mass of the limb."""
        t = self.traits
        if not t.cones:
            promised = self.length - sum(n.length for n in self.nodes)
            wood = [math.pi / 4.0 * n.pipe ** (2.0 / t.exponent) * n.length for n in self.nodes]
            return t.density * (sum(wood) + t.volume(promised, t.twig))
        return self.traits.density * self.traits.volume(self.length, self.base)

    @property
    def supported(self) -> float:
        """M (eq. 10)."""
        return self.m + sum(child.supported for child in self.children)

    @property
    def own_centre(self) -> np.ndarray:
        """x of the limb (eq. 11), on the straight line from its base to its tip."""
        if not self.nodes:
            return self.start
        if not self.traits.cones:
            t = self.traits
            promised = self.length - sum(n.length for n in self.nodes)
            moment = np.zeros(3)
            for n in self.nodes:
                m = t.density * math.pi / 4.0 * n.pipe ** (2.0 / t.exponent) * n.length
                if n is self.nodes[-1]:
                    m += t.density * t.volume(promised, t.twig)
                moment += m * (n.start + n.tip) / 2.0
            return np.asarray(moment / self.m)
        part = self.traits.centre(1.0, self.base)
        return np.asarray(self.start + part * (self.nodes[-1].tip - self.start))

    @property
    def centre(self) -> np.ndarray:
        """X (eq. 12)."""
        moment = self.m * self.own_centre
        for child in self.children:
            moment = moment + child.supported * child.centre
        return np.asarray(moment / max(self.supported, 1e-300))

    @property
    def light(self) -> float:
        """P (eq. 14)."""
        return self.p + sum(child.light for child in self.children if child.nodes)

    def rate(self, trunk: Limb) -> float:
        """g: eq. 13, clamped, and the sum that follows it."""
        t = self.traits
        away = trunk.centre[:2]
        ell = max(t.offset_length * trunk.base, 1e-6)
        offset = max(-1.0, min(1.0, -float(self.heading[:2] @ away) / ell))
        return t.min_growth + t.offset_gain + t.offset_gain * offset + t.light_gain * self.p

    def total(self, trunk: Limb) -> float:
        """G (eq. 15), of what can grow."""
        own = self.rate(trunk) if self.grows else 0.0
        return own + sum(child.total(trunk) for child in self.children)


def limb_of(
    head: Node,
    traits: Traits,
    bud: Callable[[int], np.ndarray],
    may: Callable[[Node], bool],
) -> Limb:
    """Read a limb and all that it bears from its first metamer on."""
    nodes = head.axis()
    start, tip = head.start, nodes[-1].tip
    last = nodes[-1]
    held = last.resource[0] if last.terminal else 0.0
    limb = Limb(
        traits,
        head.order,
        head.index,
        nodes,
        start,
        (tip - start) / np.linalg.norm(tip - start),
        sum(n.length for n in nodes) + held * traits.unit_of(head.order),
        0.5 * head.pipe ** (1.0 / traits.exponent),
        traits.area * sum(n.lit_buds * n.light for n in nodes),
        last.terminal and last.room_terminal,
        last.resource[0],
    )
    for n in nodes:
        if n.branch:
            limb.children.append(limb_of(n.branch, traits, bud, may))
        elif n.lateral:
            limb.children.append(
                Limb(
                    traits,
                    head.order + 1,
                    n.index,
                    [],
                    n.tip,
                    bud(n.index),
                    n.resource[1] * traits.unit_of(head.order + 1),
                    traits.twig,
                    traits.area * n.light,
                    may(n),
                    0.0,
                )
            )
    return limb


def trunk_growth(trunk: Limb, gain: float) -> float:
    """e_0 (eqs 16, 17); never less than the thicker trunk's own wood."""
    t = trunk.traits
    base = trunk.base + gain * trunk.light / trunk.supported
    wood = t.density * (t.volume(trunk.length, base) - t.volume(trunk.length, trunk.base))
    return max(t.supports(base) - trunk.supported, wood)


@dataclass
class Grown:
    """What a year gives: base radii by limb, metamers by bud, and what no limb could take."""

    base: dict[int, float] = field(default_factory=dict)
    main: dict[int, float] = field(default_factory=dict)
    side: dict[int, float] = field(default_factory=dict)
    left: float = 0.0


def hand_up(limb: Limb, e: float, trunk: Limb, out: Grown) -> None:
    """Eqs 18 to 22 for a limb and, with what is left, for all that it bears."""
    t = limb.traits
    metamer_length = t.unit_of(limb.order)
    if not limb.nodes:
        metamer = t.density * t.volume(metamer_length, t.twig)
        v = min(e / metamer, t.most)
        out.side[limb.at] = v if v >= 1.0 else 0.0
        out.left += e - out.side[limb.at] * metamer
        return
    base = max(limb.base, t.needs_to_support(limb.supported + e))
    dm = t.density * (t.volume(limb.length, base) - t.volume(limb.length, limb.base))
    if dm > e:  # it cannot pay for that: as thick as it can, found by bisection
        low, high = limb.base, base
        for _ in range(200):
            base = (low + high) / 2.0
            dm = t.density * (t.volume(limb.length, base) - t.volume(limb.length, limb.base))
            low, high = (low, base) if dm > e else (base, high)
    out.base[limb.at] = base
    e -= dm
    total = limb.total(trunk)
    if total == 0.0:
        out.left += e
        return
    if limb.grows:
        own = limb.rate(trunk) / total * e
        m = limb.m + dm + own
        longer = m / t.density / t.volume(1.0, base)  # eq. 21 for a truncated cone
        v = min((longer - limb.length) / metamer_length, max(0.0, t.most - limb.held))
        out.main[limb.nodes[-1].index] = v
        out.left += own - v * metamer_length * t.density * t.volume(1.0, base)
    for child in limb.children:
        if child.total(trunk) > 0.0:
            hand_up(child, child.total(trunk) / total * e, trunk, out)


def hand_up_priced(
    limb: Limb, e: float, trunk: Limb, price: Callable[[Node, int], float], out: Grown
) -> None:
    """Eqs 17, 20, 22 where a metamer has a price; a limb gets what it can support as it is."""
    total = limb.total(trunk)
    e = min(e, max(0.0, limb.traits.supports(limb.base) - limb.supported))
    if limb.grows:
        last = limb.nodes[-1]
        out.main[last.index] = limb.rate(trunk) / total * e / price(last, limb.order)
    for child in limb.children:
        if child.total(trunk) == 0.0:
            continue
        share = child.total(trunk) / total * e
        if child.nodes:
            hand_up_priced(child, share, trunk, price, out)
        else:
            node = next(n for n in limb.nodes if n.index == child.at)
            out.side[child.at] = share / price(node, child.order)


def cone_pipes(head: Node, traits: Traits) -> dict[int, float]:
    """d^n of an axis whose diameter falls along its length from its base to a twig."""
    nodes = head.axis()
    whole = sum(n.length for n in nodes)
    twig = 2.0 * traits.twig
    base = max(head.pipe ** (1.0 / traits.exponent), twig)
    found, below = {}, 0.0
    for n in nodes:
        diameter = base + (twig - base) * below / whole
        found[n.index] = max(n.pipe, diameter**traits.exponent)
        below += n.length
    return found
