"""The flow of a chain of particles from the foot of a tree to its tips."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.surface.blend.field import Blend
from forest.surface.blend.whole import READINGS
from forest.surface.flow.chain import (
    DONE,
    FLOWING,
    LEAST_LOOP,
    Chain,
    Forces,
    advance,
    with_room,
)
from forest.surface.flow.laying import Rings, start
from forest.surface.flow.surface import Limbed, limbed
from forest.surface.flow.trails import Trails

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: Steps between two points of a trail.
RECORD_EVERY = 5
#: The chain is stuck when it moves slower than this share of the speed at which it started.
_STUCK = 0.02
#: The flow ends when it takes so many times as long as straight to the farthest tip, or so many
#: times the steps of particles that rings about all limbs would: then chains hang in crotches.
_PATIENCE, _EFFORT = 8.0, 3.0
#: Points of trails so far within the wood, in radii of the limb, lie where limbs cross.
_WITHIN = 0.01


@dataclass(frozen=True)
class FlowRules:
    """Constants of the chain of particles.

    The defaults are those of Hart & Baker 2003, 5.3, but for `steering`, `finest_link` and
    `readings`, which are ours: ``FlowRules(steering=0.0, finest_link=math.inf, readings="paper")``
    is the flow as printed.

    Attributes
    ----------
    steps_per_s : float
        Time steps a second.
    speed : float
        Speed of particles at the start, upward, units/s.
    greatest_link, least_link : float
        Longer links get a new particle, shorter ones lose one; units.
    finest_link : float
        Where this times the limb's radius is less than `greatest_link`, links are shorter, both
        limits in proportion, so that thin limbs part the chain, too. `math.inf`: as printed.
    spring, damping : float
        Between linked particles, 1/s2 and 1/s.
    skeleton_spring, skeleton_damping : float
        Between particles and the skeleton, 1/s2 and 1/s.
    spiral_deg : float
        Angle of the velocity at the start from upward; positive leans to the right seen from
        outside (a right-handed spiral).
    steering : float
        Rate at which velocities turn to `speed` along the limb that a particle is on (leaning by
        `spiral_deg`), 1/s. 0: momentum alone, as printed; then springs pull the chain tight
        and it hangs in crotches, and curls on where it came onto a limb from the side.
    readings : "corrected" or "paper"
        Table 2 with our condition that both parts go around their limbs, or as printed; then a
        particle that steps onto a limb can become a loop of its own.

    Raises
    ------
    InputError
        If a constant is not a number or out of its range, or the longest link is not longer than
        twice the shortest.
    """

    steps_per_s: float = 100.0
    speed: float = 2.0
    greatest_link: float = 0.15
    least_link: float = 0.05
    finest_link: float = 0.6
    spring: float = 100.0
    damping: float = 1.0
    skeleton_spring: float = 100.0
    skeleton_damping: float = 10.0
    spiral_deg: float = 0.0
    steering: float = 2.0
    readings: str = "corrected"

    def __post_init__(self) -> None:
        """Refuse what the chain cannot work with."""
        for name, value in vars(self).items():
            if name == "readings":
                continue
            above = name in ("steps_per_s", "speed", "greatest_link", "least_link", "finest_link")
            if not math.isfinite(value) and not (name == "finest_link" and value > 0.0):
                raise InputError(f"{value:g}", where=f"rules.{name}", expected="a finite number")
            if name == "spiral_deg":
                if not -90.0 < value < 90.0:
                    raise InputError(
                        f"{value:g}", where="rules.spiral_deg", expected="between -90 and 90"
                    )
            elif value < 0.0 or (above and value == 0.0):
                expected = "above 0" if above else "0 or more"
                raise InputError(f"{value:g}", where=f"rules.{name}", expected=expected)
        if not self.greatest_link > 2.0 * self.least_link:
            raise InputError(
                f"links from {self.least_link:g} to {self.greatest_link:g}",
                where="rules.greatest_link",
                expected="more than twice the shortest, so that split links are not merged again",
            )
        if self.readings not in READINGS:
            raise InputError(
                f"unknown readings {self.readings!r}, {nearest(self.readings, READINGS)}",
                where="rules.readings",
            )

    def forces(self, unit_m: float) -> Forces:
        """Give the same in metres."""
        lean = math.radians(self.spiral_deg)
        return Forces(
            step=1.0 / self.steps_per_s,
            greatest=self.greatest_link * unit_m,
            least=self.least_link * unit_m,
            finest=self.finest_link,
            spring=self.spring,
            damping=self.damping,
            skeleton_spring=self.skeleton_spring,
            skeleton_damping=self.skeleton_damping,
            speed=self.speed * unit_m,
            steering=self.steering,
            lean_cos=math.cos(lean),
            lean_sin=math.sin(lean),
            printed=self.readings == "paper",
        )


@dataclass(frozen=True)
class Loops:
    """A chain at one time, as closed loops.

    Attributes
    ----------
    time_s : float
        When.
    place : float64 (n, 3)
        Places of its particles, loop by loop in order, m.
    limb : int32 (n,)
        Axes they are on.
    first : int64 (loops + 1,)
        First particle of each loop.
    """

    time_s: float
    place: _Floats
    limb: NDArray[np.int32]
    first: _Ints

    def __len__(self) -> int:
        """Count the loops."""
        return len(self.first) - 1


@dataclass(frozen=True)
class Flow:
    """What chains of particles left on a surface.

    Attributes
    ----------
    trails : Trails
        The ways of all particles.
    unit_m : float
        Length of one unit of the paper, m.
    relinked : int
        How often the chain was relinked.
    laid : int
        Rings laid anew on limbs past places where the chain hung, and on those it had not reached.
    stuck : int
        Particles that did not come to a tip.
    chains : list of Loops
        The chain itself, now and then.
    """

    trails: Trails
    unit_m: float
    relinked: int
    laid: int
    stuck: int
    chains: list[Loops]


def _loops(chain: Chain, time_s: float) -> Loops:
    """Walk a chain's loops."""
    left = set(chain.live[: chain.tally[1]].tolist())
    order: list[int] = []
    first = [0]
    for i in chain.live[: chain.tally[1]].tolist():
        if i not in left:
            continue
        k = i
        while k in left:
            left.remove(k)
            order.append(k)
            k = int(chain.ahead[k])
        first.append(len(order))
    return Loops(time_s, chain.place[order].copy(), chain.limb[order].copy(), np.array(first))


def _effort(surface: Limbed, rules: FlowRules, unit: float) -> float:
    """Count the steps of particles that a ring about each limb takes from its base to its tip."""
    cones = surface.field.cones
    length = np.linalg.norm(cones.end - cones.start, axis=1)
    radius = 0.5 * (cones.low + cones.high)
    finer = np.minimum(1.0, rules.finest_link * radius / (rules.greatest_link * unit))
    link = 0.5 * (rules.greatest_link + rules.least_link) * unit * finer
    steps = length * rules.steps_per_s / (rules.speed * unit)
    return float(np.sum(steps * np.maximum(LEAST_LOOP, 2.0 * math.pi * radius / link)))


def flow(
    blend: Blend,
    *,
    unit_m: float | None = None,
    rules: FlowRules | None = None,
    seconds: float | None = None,
    show_every_s: float = 0.5,
) -> Flow:
    """Let ring-shaped chains of particles flow from the feet of a tree's stems to its tips.

    Hart & Baker 2003, section 5.3, with their constants, and a ring for each stem that stands on
    the ground. A chain parts at branchings
    (Table 2); a link that grows too long gets a new particle. After each step particles are put
    back onto the surface, since springs of no length pull them inside.

    Parameters
    ----------
    blend : Blend
        The blended surface of a tree. A limb much thinner than a link does not part the chain.
    unit_m : float, optional
        Length of the paper's unit, m; by default the radius of the trunk at its foot, so that a
        ring there has about 60 particles. A smaller one reaches thinner limbs.
    rules : FlowRules, optional
        The constants.
    seconds : float, optional
        When to stop, s; by default when all loops are at tips, or stuck.
    show_every_s : float
        How often the chain itself is kept.

    Returns
    -------
    Flow
        The trails, and the chain now and then.

    Raises
    ------
    InputError
        If a length or time is not a finite number above 0.
    """
    rules = rules or FlowRules()
    surface = limbed(blend)
    cones = surface.field.cones
    unit = float(cones.low[0]) if unit_m is None else unit_m
    for name, value in (("unit_m", unit), ("seconds", seconds), ("show_every_s", show_every_s)):
        if value is not None and not 0.0 < value < math.inf:
            raise InputError(f"{value:g}", where=name, expected="a finite number above 0")
    forces = rules.forces(unit)
    chain = start(surface, forces)
    far = float(np.linalg.norm(cones.end - cones.start[0], axis=1).max())
    longest = _PATIENCE * far / (rules.speed * unit) if seconds is None else seconds
    rings = Rings(surface, chain, forces) if rules.steering > 0.0 else None
    trails = _Recorder()
    shown = [_loops(chain, 0.0)]
    trails.take(chain, 0.0)
    done, next_show = 0, show_every_s
    bounded = seconds is None and rules.steering > 0.0  # momentum alone takes its time
    effort = _EFFORT * _effort(surface, rules, unit) if bounded else math.inf
    while done < longest * rules.steps_per_s and effort > 0.0:
        taken, flowing = advance(surface, chain, forces, np.int64(RECORD_EVERY))
        done += taken
        effort -= taken * flowing
        if taken < RECORD_EVERY and flowing:
            chain = with_room(chain, 2 * len(chain.live))
            continue
        time_s = done * forces.step
        trails.take(chain, time_s)
        if rings is not None:
            chain = rings.tend(chain, done, flowing)
            flowing = flowing or rings.fresh
        if time_s >= next_show or not flowing:
            shown.append(_loops(chain, time_s))
            next_show += show_every_s
            if not flowing or _is_stuck(chain, rules.speed * unit):
                break
    live = chain.live[: chain.tally[1]]
    return Flow(
        trails=trails.trails(chain, blend),
        unit_m=unit,
        relinked=int(chain.tally[2]),
        laid=rings.laid if rings is not None else 0,
        stuck=int(np.count_nonzero(chain.state[live] != DONE)),
        chains=shown,
    )


def _is_stuck(chain: Chain, speed: float) -> bool:
    """Whether what still flows hardly moves."""
    live = chain.live[: chain.tally[1]]
    live = live[chain.state[live] == FLOWING]
    return float(np.abs(chain.velocity[live]).max(initial=0.0)) < _STUCK * speed


class _Recorder:
    """Keeps the places of particles over time."""

    def __init__(self) -> None:
        self._number: list[_Ints] = []
        self._place: list[_Floats] = []
        self._limb: list[NDArray[np.int32]] = []
        self._off: list[_Floats] = []
        self._radius: list[_Floats] = []
        self._time: list[float] = []
        self._ended = np.zeros(0, np.bool_)

    def take(self, chain: Chain, time_s: float) -> None:
        if len(self._ended) < len(chain.live):
            self._ended = np.append(
                self._ended, np.zeros(len(chain.live) - len(self._ended), np.bool_)
            )
        live = chain.live[: chain.tally[1]]
        live = live[~self._ended[live]]
        self._ended[live[chain.state[live] == DONE]] = True
        self._number.append(live)
        self._place.append(chain.place[live])
        self._limb.append(chain.limb[live])
        self._off.append(chain.off[live])
        self._radius.append(chain.radius[live])
        self._time.append(time_s)

    def trails(self, chain: Chain, blend: Blend) -> Trails:
        number = np.concatenate(self._number)
        time = np.repeat(self._time, [len(part) for part in self._number])
        order = np.argsort(number, kind="stable")  # by particle, then by time
        place = np.concatenate(self._place)[order]
        radius = np.concatenate(self._radius)[order]
        outside = blend.value(place) >= -_WITHIN * radius
        place, order = place[outside], order[outside]
        number = number[order]
        names, first = np.unique(number, return_index=True)
        return Trails(
            place=place,
            time_s=time[order],
            limb=np.concatenate(self._limb)[order],
            off_m=np.concatenate(self._off)[order],
            first=np.append(first, len(number)),
            mother=chain.mother[names],
            particle=names,
        )
