"""Weber & Penn 1995 as the paper tells it: recursive, a Python object per stem. Slow."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from forest.parametric.stems import OF_CHILD, OF_CLONE, OF_LEAF, OF_SELF, OF_SPLIT, descend, draw
from forest.species.parametric import Level, Parameters

Matrix = Any


def rot(axis: int, degrees: float) -> Matrix:
    """Rotation matrix about a coordinate axis."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    m = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    m[a, a] = m[b, b] = c
    m[a, b], m[b, a] = -s, s
    return m


def ratio_of(p: Parameters, shape: int, ratio: float) -> float:
    """ShapeRatio, corrected."""
    if shape == 8:
        if not 0 < ratio < 1:
            return 0.0
        peak = p.prune_width_peak
        if ratio < 1 - peak:
            return float((ratio / (1 - peak)) ** p.prune_power_high)
        return float(((1 - ratio) / peak) ** p.prune_power_low)
    tend = ratio / 0.7 if ratio <= 0.7 else (1 - ratio) / 0.3
    return [
        0.2 + 0.8 * ratio,
        0.2 + 0.8 * math.sin(math.pi * ratio),
        0.2 + 0.8 * math.sin(0.5 * math.pi * ratio),
        1.0,
        0.5 + 0.5 * ratio,
        tend,
        1 - 0.8 * ratio,
        0.5 + 0.5 * tend,
    ][shape]


def radius_at(taper: float, radius: float, length: float, z: float) -> float:
    """radius_Z of 4.4, without flare."""
    unit = taper if taper < 1 else max(0.0, 2 - taper)
    pure = radius * (1 - unit * z)
    if taper < 1 or pure <= 0:
        return pure
    z2 = (1 - z) * length
    depth = 1.0 if taper < 2 or z2 < pure else taper - 2
    z3 = z2 if taper < 2 else abs(z2 - 2 * pure * int(z2 / (2 * pure) + 0.5))
    if taper < 2 and z3 >= pure:
        return pure
    return (1 - depth) * pure + depth * math.sqrt(max(0.0, pure**2 - (z3 - pure) ** 2))


@dataclass
class Stem:
    """A stem with its sections: places, frames (columns x, y, z), positions along it."""

    level: int
    clone: bool
    length: float
    radius: float
    share: float
    reach: float
    key: Any
    first: int
    offset: float
    bearer: Stem | None
    place: list[Any] = field(default_factory=list)
    frame: list[Matrix] = field(default_factory=list)
    z: list[float] = field(default_factory=list)
    width: list[float] = field(default_factory=list)


@dataclass
class Spot:
    """Where a family starts."""

    place: Any
    frame: Matrix
    length: float
    longest: float
    parent_length: float
    parent_radius: float
    limit: float
    offset: float
    key: Any
    bearer: Stem | None


class Tree:
    """One tree; `stems[n]` are the stems of level n in the order of their making."""

    def __init__(self, p: Parameters, seed: int, scale: float, trunk: Spot, factor: float) -> None:
        self.p, self.seed, self.scale, self.factor = p, np.uint64(seed), scale, factor
        self.error = [0.0] * p.depth
        self.stems: list[list[Stem]] = [[] for _ in range(p.depth)]
        self.leaves: list[tuple[Any, Matrix]] = []
        self.grow(0, trunk)

    def inside(self, point: Any) -> bool:
        ratio = (self.scale - point[2]) / (self.scale * (1 - self.p.base_size))
        width = self.p.prune_width * ratio_of(self.p, 8, ratio)
        return math.hypot(point[0], point[1]) / self.scale < width

    def grow(self, n: int, spot: Spot) -> None:
        """Probe, then form a family and let it bear."""
        length = spot.length
        if n > 0 and self.p.prune_ratio > 0:
            error = self.error[n]
            short = length if self.inside(spot.place) else 0.0
            while short > 1e-3 * self.scale:
                points = [x for s in self.family(n, spot, short) for x in s.place[1:]]
                self.error[n] = error
                if all(self.inside(x) for x in points):
                    break
                short *= 0.9
            short = short if short > 1e-3 * self.scale else 0.0
            length = (1 - self.p.prune_ratio) * length + self.p.prune_ratio * short
        if length > 1e-3 * self.scale:
            for stem in self.family(n, spot, length):
                self.stems[n].append(stem)
                self.bear(stem)

    def family(self, n: int, spot: Spot, length: float) -> list[Stem]:
        p = self.p
        share = length / spot.longest if spot.longest > 0 else 1.0
        radius = spot.parent_radius * (length / spot.parent_length) ** p.ratio_power
        radius = min(radius, spot.limit)
        reach = spot.offset / spot.parent_length
        stem = Stem(n, False, length, radius, share, reach, spot.key, 0, spot.offset, spot.bearer)
        level = p.of_level(n)
        axis = spot.frame[:, 2].copy()
        frame = spot.frame
        if level.curve_variation < 0:
            frame = frame @ rot(0, -level.curve_variation)
        return self.course(stem, spot.place, frame, axis, 0.0, 0.0, 1.0)

    def course(
        self, stem: Stem, place: Any, f: Matrix, axis: Any, undo: float, later: float, habit: float
    ) -> list[Stem]:
        """Form a stem's segments; its clones, with theirs, follow it."""
        level, clones = self.p.of_level(stem.level), []
        res = level.segments
        per = self.sections(stem.level)
        for s in range(stem.first, res):
            more = 0.0
            if s > stem.first:
                number = self.splits(stem.level, s, habit)
                if number:
                    habit *= self.p.clone_habit
                    f, axis, more, new = self.split(stem, number, s, f, axis)
                    clones += [(*c, place.copy(), undo, later + extra, habit) for *c, extra in new]
            if s > 0:
                f = self.turn(stem, s, f, axis)
                f = f @ rot(0, -undo)
                undo, later = undo + later + more, 0.0
                if stem.level > 1:
                    down = math.degrees(math.acos(max(-1.0, min(1.0, f[2, 2]))))
                    f = f @ rot(0, -self.p.attraction_up * down * f[2, 1] / res)
            if s == stem.first:
                self.section(stem, place, f, s / res)
            else:
                stem.frame[-1] = f
            for k in range(1, per + 1):
                place = place + stem.length / (res * per) * f[:, 2]
                self.section(stem, place, f, (s * per + k) / (res * per))
        found = [stem]
        for key, s, frame, ax, at, u, la, h in clones:
            twin = Stem(
                stem.level, True, stem.length, stem.radius, stem.share, stem.reach, key, s,
                stem.length * s / res, stem,
            )  # fmt: skip
            found += self.course(twin, at, frame, ax, u, la, h)
        return found

    def section(self, stem: Stem, place: Any, f: Matrix, z: float) -> None:
        width = radius_at(self.p.of_level(stem.level).taper, stem.radius, stem.length, z)
        if stem.level == 0:
            y = max(0.0, 1 - 8 * z)
            width *= (self.p.flare * (100**y - 1) / 100 + 1) * self.factor
        stem.place.append(place)
        stem.frame.append(f)
        stem.z.append(z)
        stem.width.append(width)

    def sections(self, n: int) -> int:
        level = self.p.of_level(n)
        fine = level.taper > 2 or (n == 0 and self.p.flare > 0)
        return math.ceil((32 if fine else 8 if level.taper > 1 else 1) / level.segments)

    def splits(self, n: int, s: int, habit: float) -> int:
        if n == 0 and s == 1 and self.p.base_splits:
            return self.p.base_splits
        wanted = self.p.of_level(n).splits * habit
        number = math.floor(wanted + self.error[n] + 0.5)
        self.error[n] -= number - wanted
        return number

    def split(self, stem: Stem, number: int, s: int, f: Matrix, axis: Any) -> tuple[Any, ...]:
        level = self.p.of_level(stem.level)
        down = math.degrees(math.acos(max(-1.0, min(1.0, f[2, 2]))))
        left = max(level.segments - 1 - s, 1)
        u, v, w, _ = draw(self.seed, stem.key, OF_SPLIT + s)
        sign = 1 if w < 0.5 else -1

        def lean(u: float, v: float, factor: int) -> tuple[Matrix, Any, float]:
            angle = level.split_angle + (2 * u - 1) * level.split_angle_variation - down
            angle = max(0.0, angle)
            spread = rot(2, factor * (20 + 0.75 * (30 + abs(down - 90)) * v * v))
            leant = f @ rot(0, angle)
            return spread @ leant, spread @ (leant @ f.T @ axis), angle / left

        new = []
        for k in range(1, number + 1):
            key = np.uint64(descend(self.seed, stem.key, OF_CLONE + 1000 * k + s))
            a, b, _, _ = draw(self.seed, key, OF_SELF)
            factor = 0 if k == 1 else (k + 1) // 2 if k % 2 else -(k // 2)
            frame, ax, extra = lean(a, b, sign * factor)
            new.append((key, s, frame, ax, extra))
        frame, ax, extra = lean(u, v, sign)
        return frame, ax, extra, new

    def turn(self, stem: Stem, s: int, f: Matrix, axis: Any) -> Matrix:
        level = self.p.of_level(stem.level)
        res = level.segments
        if level.curve_variation < 0:
            x, y, z = axis
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            t = 2 * math.pi / res
            return (np.eye(3) + math.sin(t) * cross + (1 - math.cos(t)) * cross @ cross) @ f
        curve = level.curve / res
        if level.curve_back:
            curve = (level.curve if s < res / 2 else level.curve_back) / (res / 2)
        u, v, _, _ = draw(self.seed, stem.key, s)
        about = 360 * v
        chance = (2 * u - 1) * level.curve_variation / res
        return f @ rot(0, curve) @ rot(2, about) @ rot(0, chance) @ rot(2, -about)

    def bear(self, stem: Stem) -> None:
        """Children and leaves, 4.3 and 4.5."""
        p, n = self.p, stem.level
        last = n + 1 == p.depth
        level = p.of_level(n + 1)
        most = abs(p.leaves if last else level.branches)
        share = 1 - 0.5 * stem.reach
        if n == 0:
            share = 1.0
        elif last:
            share = 0.5 + 0.5 * stem.reach
        elif n == 1:
            share = 0.2 + 0.8 * stem.share
        count = math.floor(most * share + 0.5)
        base = p.base_size * self.scale if n == 0 else 0.0
        turned, from_z = None, stem.first / p.of_level(n).segments
        for j in range(count):
            bare = base / stem.length
            z = bare + (1 - bare) * (j + 0.5) / count
            if z < from_z:
                continue
            if turned is None:
                turned = level.rotate * j
            if last:  # a draw serves two leaves
                four = draw(self.seed, stem.key, OF_LEAF + j // 2)
                chance = (*four[2 * (j % 2) : 2 * (j % 2) + 2], 0.0)
            else:
                chance = draw(self.seed, stem.key, OF_CHILD + j)[:3]
            turned = self.child(stem, level, j, count, z, turned, chance, last, base)

    def child(
        self, stem: Stem, level: Level, j: int, count: int, z: float, turned: float,
        chance: tuple[float, float, float], last: bool, base: float,
    ) -> float:  # fmt: skip
        p = self.p
        u, v, w = chance
        fan = (p.leaves if last else level.branches) < 0
        at = 1.0 if fan else z
        near = at + 1e-9 * (stem.z[1] - stem.z[0])
        below = max(i for i in range(len(stem.z) - 1) if i == 0 or stem.z[i] <= near)
        f = stem.frame[below]
        place = stem.place[below] + (at - stem.z[below]) * stem.length * f[:, 2]
        ratio = (stem.length * (1 - z)) / (stem.length - base)
        vary = (2 * u - 1) * level.rotate_variation
        if fan:
            f = f @ rot(1, ((j + 0.5) / count - 0.5) * level.rotate)
        elif level.rotate >= 0:
            turned += level.rotate + vary
            f = f @ rot(2, turned)
        else:
            f = f @ rot(2, (180 + level.rotate + vary) * (1 if j % 2 == 0 else -1))
        down = level.down_angle + (2 * v - 1) * level.down_angle_variation
        if level.down_angle_variation < 0:
            down = level.down_angle + level.down_angle_variation * (1 - 2 * ratio_of(p, 0, ratio))
        f = f @ rot(0, down)
        if last:
            self.leaves.append((place, f))
            return turned
        z = at
        ratio = (stem.length * (1 - z)) / (stem.length - base)
        most = max(0.0, level.length + (2 * w - 1) * level.length_variation)
        length = most * (stem.length - 0.6 * z * stem.length)
        if stem.level == 0:
            length = stem.length * most * ratio_of(p, p.shape, ratio)
        key = np.uint64(descend(self.seed, stem.key, OF_CHILD + j))
        part = (z - stem.z[below]) / (stem.z[below + 1] - stem.z[below])
        limit = stem.width[below] + part * (stem.width[below + 1] - stem.width[below])
        spot = Spot(
            place, f, length, most * stem.length, stem.length, stem.radius, limit,
            z * stem.length, key, stem,
        )  # fmt: skip
        self.grow(stem.level + 1, spot)
        return turned


def reference_tree(p: Parameters, seed: int, scale: float) -> Tree:
    """Grow a tree of a given scale; the trunk's length and radius factor must not vary."""
    length = p.level[0].length * scale
    trunk = Spot(
        np.zeros(3), np.eye(3), length, length, length, length * p.ratio, math.inf, 0.0,
        np.uint64(1), None,
    )  # fmt: skip
    tree = Tree(p, seed, scale, trunk, p.trunk_scale)
    chance = 2 * draw(np.uint64(seed), np.uint64(0), OF_SELF)[2] - 1
    stretch(tree, p.z_scale + chance * p.z_scale_variation)
    return tree


def stretch(tree: Tree, factor: float) -> None:
    """Stretch a tree along z; frames stay at right angles, with their axes along the stems."""
    d = np.diag([1.0, 1.0, factor])
    stems = [stem for level in tree.stems for stem in level]
    for stem in stems:
        stem.place = [d @ x for x in stem.place]
        for k, f in enumerate(stem.frame):
            heading = d @ f[:, 2]
            heading = heading / np.linalg.norm(heading)
            side = f[:, 0] - heading * float(f[:, 0] @ heading)
            side = side / np.linalg.norm(side)
            stem.frame[k] = np.column_stack((side, np.cross(heading, side), heading))
    tree.leaves = [(d @ x, f) for x, f in tree.leaves]
    sizes = []
    for stem in stems:
        at = stem.offset / stem.bearer.length if stem.bearer else 0.0
        sizes.append((metres(stem, 1.0), metres(stem.bearer, at) if stem.bearer else 0.0))
    for stem, size in zip(stems, sizes, strict=True):
        stem.length, stem.offset = size


def metres(stem: Stem, share: float) -> float:
    """Go along a stem's course from its base to what was a share of it before it was stretched."""
    total = metres(stem.bearer, min(share, stem.z[0])) if stem.clone and stem.bearer else 0.0
    for low, high, a, b in zip(stem.z, stem.z[1:], stem.place, stem.place[1:], strict=False):
        part = max(0.0, min(1.0, (share - low) / (high - low)))
        total += part * float(np.linalg.norm(b - a))
    return total
