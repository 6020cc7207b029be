"""Bark on whole trees: strips on all main axes, grown over the years or shrunk (5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.wood import YearlyWood
from forest.surface.bark.axes import LEAST_RADIUS_M, BarkedTree, lay_strips
from forest.surface.bark.checks import girths_from_birth
from forest.surface.bark.cracks import Crack, Missed, Trigger, torn, triggers_of
from forest.surface.bark.dressing import Dress, Fold
from forest.surface.bark.girth import (
    GirthHistory,
    checked_history,
    present_girths,
    recorded_girths,
    supposed_girths,
)
from forest.surface.bark.growing import Bark, grow_bark
from forest.surface.bark.maps import BarkMaps, bark_maps
from forest.surface.bark.material import Material
from forest.surface.bark.piece import piece_of, rescaled
from forest.surface.bark.presets import Preset, at_girth
from forest.surface.bark.shrinking import shrinking
from forest.surface.bark.viewed import BarkView
from forest.surface.blend.foot import Flare
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

LAWS = ("preset", "conserved")
_STEPS = 20  # of shrinking
_STEPS_BEFORE = 12  # in which what had torn before the first year on record tears
_MOST_ROWS = 4096  # of a map of given columns; more no browser may take
_MOST_PIXELS = 2**22
_FOLD = 0.35  # height of a fold, in radii of the branch
_MOST_FOLD_M = 0.015
_FOLD_OF_STEM = 0.06  # nor more than this part of the radius of what bears the branch


class _Stretch:
    """How the epidermis of each strip stretches: the tables that `grow_bark` follows.

    `first` ends with the girth now, or what of it was there before plates tore again; `again`
    goes on from there. `before` rows precede the first time of the history. `triggers` are what is
    torn by hand on the way, in order; `thin` could not be torn, since no strip is there.
    """

    triggers: tuple[Trigger, ...] = ()
    thin: tuple[Missed, ...] = ()

    def __init__(
        self, first: _Floats, again: _Floats | None, before: int, spread: _Floats | None
    ) -> None:
        self.first, self.again, self.before, self.spread = first, again, before, spread

    @classmethod
    def by_preset(cls, history: GirthHistory, preset: Preset) -> _Stretch:
        """Let so much tear as the preset says stems of each girth have torn.

        What of the girth is epidermis has the length that it will have at the end, times a factor
        for the growth of living bark that widens all alike; the picture's scale is all that
        differs, as in the shrinking mode.
        """
        girth = history.girth
        there = ~np.isnan(girth)
        known = np.where(there, girth, 0.0)
        remains = np.where(there, preset.remains(known), 1.0)
        remains = np.minimum.accumulate(remains, axis=0)
        whole = np.where(there, 1.0 - at_girth(preset.tearing.again, known), 1.0)
        whole = np.minimum.accumulate(whole, axis=0)
        before = 0 if remains[0].min() == 1.0 and whole[0].min() == 1.0 else _STEPS_BEFORE
        now = girth[-1]
        first = _rising(remains, now * whole[-1], before)
        again = _rising(whole, now, before) if whole[-1].min() < 1.0 else None
        return cls(first, again, before, _padded(history.dilatation, before))

    @classmethod
    def conserved(cls, history: GirthHistory) -> _Stretch:
        """Keep the epidermis as long as it was when each strip was made (the paper's tree)."""
        return cls(history.girth, None, 0, history.dilatation)

    @classmethod
    def shrunk(cls, girth: _Floats, preset: Preset) -> _Stretch:
        """Shrink the epidermis of a finished tree to what the preset says remains."""
        whole = 1.0 - at_girth(preset.tearing.again, girth)
        first = shrinking(girth * whole, preset.remains(girth), _STEPS)
        again = shrinking(girth, whole, _STEPS) if whole.min() < 1.0 else None
        return cls(first, again, 0, None)

    def grown(
        self, tree: BarkedTree, material: Material, seed: int, row: int
    ) -> tuple[Bark, tuple[Missed, ...]]:
        """Grow bark up to a row of the history; and the cracks for which it had no room."""
        missed: list[Missed] = []
        rows = self.before + row + 1
        first = girths_from_birth(self.first, len(tree.geometry.axis))
        stops = self._stops(rows)
        begin = stops[0][0] if stops else rows
        spread = _steps(self.spread, 1, begin)
        bark = grow_bark(tree.geometry, first[:begin], material, seed, dilatation=spread)
        bark = self._follow(bark, first, begin, rows, stops, missed)
        if self.again is None:
            return bark, tuple(missed)
        # Plates tear where the first fractures lie at the end, so that none of them moves.
        last = bark
        if rows < len(first):
            later = self._stops(len(first))[len(stops) :]
            last = self._follow(bark, first, rows, len(first), later, [])
        # They begin at the first row: nothing grows in the step up to it.
        spread = _steps(self.spread, 1, rows)
        if spread is not None:
            spread = np.concatenate((np.ones((1, *spread.shape[1:])), spread))
        again = last.refracture(np.maximum(self.again[:rows], last.strips.girth), dilatation=spread)
        return replace(again, surface=bark), tuple(missed)

    def _stops(self, rows: int) -> list[tuple[int, Trigger]]:
        """List what is torn by hand on the way to a row, each with the rows that precede it.

        What is torn before the year that follows the last one on record is there at once.
        """
        stops = [(self.before + trigger.row, trigger) for trigger in self.triggers]
        return [stop for stop in stops if stop[0] < rows or stop[0] == rows == len(self.first)]

    def _follow(
        self,
        bark: Bark,
        first: _Floats,
        done: int,
        rows: int,
        stops: Sequence[tuple[int, Trigger]],
        missed: list[Missed],
    ) -> Bark:
        """Let bark that has followed some rows follow those up to another, torn on the way."""
        for stop, trigger in stops:
            if stop > done:
                bark = bark.grow(first[done:stop], dilatation=_steps(self.spread, done, stop))
                done = stop
            try:
                bark = torn(bark, trigger)
            except InputError:  # no room between the fractures that are there
                missed.append(Missed(trigger.crack, "the bark was already torn there"))
        if rows > done:
            bark = bark.grow(first[done:rows], dilatation=_steps(self.spread, done, rows))
        return bark


def _steps(spread: _Floats | None, begin: int, end: int) -> _Floats | None:
    """Give the dilatation of the steps that lead from a row to another."""
    return None if spread is None else spread[begin - 1 : end - 1]


def _rising(remains: _Floats, now: _Floats, before: int) -> _Floats:
    """Give the girths at the present scale: now * (what remains now) / (what remained then)."""
    table = now * remains[-1] / remains
    early = (np.arange(before) / max(before, 1))[:, None]
    table = np.vstack([now * remains[-1] * (1.0 / remains[0]) ** early, table])
    table[-1] = now
    return np.asarray(np.minimum(np.maximum.accumulate(table, axis=0), now), np.float64)


def _padded(spread: _Floats | None, before: int) -> _Floats | None:
    if spread is None or not before:
        return spread
    return np.concatenate((np.ones((before, *spread.shape[1:])), spread))


@dataclass(frozen=True, eq=False)
class TreeBark:
    """The bark of a whole tree at one time.

    Attributes
    ----------
    tree : BarkedTree
        Its axes and strips.
    bark : BarkView
        Strips, elements, fractures; all in m, sizes around the girth as they are at this time.
    preset : Preset
        What it looks like.
    seed : int
    history : GirthHistory
        The girths up to this time.
    missed : tuple of Missed
        The cracks by hand that are not to be seen, and why.
    """

    tree: BarkedTree
    bark: BarkView
    preset: Preset
    seed: int
    history: GirthHistory
    missed: tuple[Missed, ...]
    _stretch: _Stretch
    _material: Material

    @property
    def time(self) -> float:
        """Calendar year, or step."""
        return float(self.history.times[-1])

    @property
    def axes(self) -> tuple[int, ...]:
        """The axes that have bark."""
        return tuple(path.axis for path in self.tree.paths)

    def at(self, time: float) -> TreeBark:
        """Give the same bark at an earlier time: cracks of it are there later, and wider."""
        history = self.history.upto(time)
        row = len(history.times) - 1
        return _grown(
            self.tree, self.preset, self.seed, history, self._stretch, self._material, row
        )

    def piece(
        self, axis: int = 0, low_m: float | None = None, high_m: float | None = None
    ) -> BarkView:
        """Give the bark of a part of an axis, from `low_m` to `high_m` along it.

        Raises
        ------
        InputError
            No such axis, or fewer than four of its strips lie there at this time.
        """
        path = self.tree.path(axis)
        strips = self.tree.strips_of(axis)
        v = self.tree.geometry.along[strips]
        low = path.low if low_m is None else low_m
        high = path.high if high_m is None else high_m
        grown = ~np.isnan(self.history.girth[-1, strips])
        chosen = strips[(v >= low) & (v <= high) & grown]
        if len(chosen) < 4:
            top = float(v[grown].max(initial=path.low))
            raise InputError(
                f"no bark from {low:g} to {high:g} m on axis {axis}",
                where="bark",
                expected=f"a part of {path.low:.2f} to {top:.2f} m",
            )
        return piece_of(self.bark, chosen)

    def maps(
        self,
        size: int | tuple[int, int] = 1024,
        *,
        axes: tuple[int, ...] | None = None,
        low_m: float | None = None,
        high_m: float | None = None,
        dress: Dress | None = None,
    ) -> dict[int, BarkMaps]:
        """Dress the bark as sets of maps, one for each axis.

        Parameters
        ----------
        size : int or (columns, rows)
            Pixels around and along. With one number it is that around the trunk's foot. Thinner
            axes have fewer, and the rows follow the length, so that all pixels are about as large
            and square: both are powers of two, by rounding. A map has 4096
            rows and 2^22 pixels at most (but as many rows as `size` in any case); pixels of long
            axes are therefore taller than wide.
        axes : tuple of int, optional
            Which axes; all unless given.
        low_m, high_m : float, optional
            Which part of them, m along each.
        dress : Dress, optional
            The preset's textures, made before.
        """
        dress = dress or Dress.of(self.preset, seed=self.seed)
        found = {}
        for axis in self.axes if axes is None else axes:
            piece = self.piece(axis, low_m, high_m)
            length = float(piece.strips.width.sum())
            pixels = self._pixels(axis, size, length) if isinstance(size, int) else size
            folds = self.folds(axis)
            found[axis] = bark_maps(piece, dress, pixels, axis=axis, folds=folds, seed=self.seed)
        return found

    def _pixels(self, axis: int, size: int, length_m: float) -> tuple[int, int]:
        """Fewer pixels where there is less to show."""
        trunk, path = self.tree.paths[0].radius[0], self.tree.path(axis).radius[0]
        columns = _power(size * path / trunk)
        rows = _power(size * length_m / (2.0 * np.pi * trunk))
        most = max(min(_MOST_PIXELS // columns, _MOST_ROWS), size)
        return columns, min(rows, most)

    def folds(self, axis: int) -> list[Fold]:
        """Give the folds of an axis' bark: one in the crotch of each barked branch (section 7)."""
        parent = self.tree.path(axis)
        found = []
        for path in self.tree.paths:
            if path.parent != axis:
                continue
            radius = float(path.radius_at(np.array([path.low]))[0])
            place, heading, *_ = path.frame(np.array([path.low]))
            along, turn, _ = parent.locate(place)
            up = parent.frame(along)[1]
            across = up - heading * np.sum(up * heading)
            length = float(np.linalg.norm(across))
            if length < 0.1:
                continue  # it goes straight on: there is no crotch
            crotch, turn, _ = parent.locate(place + across / length * radius)
            stem = float(parent.radius_at(crotch)[0])
            height = min(_FOLD * radius, _MOST_FOLD_M, _FOLD_OF_STEM * stem)
            found.append(Fold(float(turn[0]), float(crotch[0]), min(2.0 * radius, stem), height))
        return found


def _power(pixels: float) -> int:
    return int(2 ** max(round(float(np.log2(max(pixels, 1.0)))), 6))


def bark_tree(
    skeleton: Skeleton,
    preset: Preset,
    seed: int = 0,
    *,
    wood: YearlyWood | None = None,
    history: GirthHistory | None = None,
    shrink: bool = False,
    law: str = "preset",
    flare: Flare | None = None,
    material: Material | None = None,
    strip_m: float | None = None,
    least_radius_m: float = LEAST_RADIUS_M,
    years: int = 40,
    cracks: Sequence[Crack] = (),
) -> TreeBark:
    """Grow bark on a whole tree.

    Parameters
    ----------
    skeleton : Skeleton
        The tree in the year that is shown, whoever made it.
    preset : Preset
        What bark it has.
    seed : int
        Another seed, other cracks.
    wood : YearlyWood, optional
        Its radii of all years (`forest.record.wood.yearly_wood`): they drive the growth. Without
        them every ring is taken to have been as wide.
    history : GirthHistory, optional
        Girths of your own instead, of the strips that `lay_strips` gives for the same skeleton,
        `strip_m` and `least_radius_m`: those of shapes linked by radial projection
        (`forest.surface.bark.girth.linked_girths`).
    shrink : bool
        Shrink the epidermis of the finished tree instead; nothing but its shape counts.
    law : str
        ``preset``: at each girth so much is torn open as the preset says, because living bark
        widens too. ``conserved``: the epidermis keeps the length it was made with, as in the
        paper; what of it is left on an old stem is little.
    flare : Flare, optional
        Root flare of the surface that the bark is for (`forest.surface.blend`).
    material : Material, optional
        The preset's for the trunk's girth unless given.
    strip_m : float, optional
        Width of strips; the preset's unless given.
    least_radius_m : float
        Thinner wood has no fractures.
    years : int
        How old a tree without a history is taken to be.
    cracks : sequence of Crack, optional
        Fractures that someone started (`forest.surface.bark.cracks.recorded_cracks` of a run).

    Returns
    -------
    TreeBark

    Raises
    ------
    InputError
        No wood is so thick, a parameter is out of its range, or a history does not fit the strips
        or stands beside wood, a root flare or shrinking.
    """
    if law not in LAWS:
        raise InputError(f"law '{law}'", where="bark", expected=" or ".join(LAWS))
    tree = lay_strips(skeleton, strip_m or preset.tearing.strip_m, least_radius_m=least_radius_m)
    if history is not None:
        if wood is not None or flare is not None or shrink:
            raise InputError(
                "girths of your own beside wood, a flare or shrinking",
                where="bark: history",
                expected="one of them",
            )
        history = checked_history(history, len(tree.geometry.axis))
    girth = present_girths(tree) if history is None else history.girth[-1]
    if shrink:
        steps = np.arange(_STEPS + 1.0)
        history = GirthHistory(steps, np.tile(girth, (_STEPS + 1, 1)), None)
        stretch = _Stretch.shrunk(girth, preset)
    else:
        if wood is not None:
            history = recorded_girths(tree, wood, flare=flare)
        elif history is None:
            history = supposed_girths(tree, years)
        of_law = _Stretch.conserved(history) if law == "conserved" else None
        stretch = of_law or _Stretch.by_preset(history, preset)
    stretch.triggers = triggers_of(tree, history, cracks)
    made = {trigger.crack for trigger in stretch.triggers}
    stretch.thin = tuple(
        Missed(crack, f"the stem is thinner than {least_radius_m:g} m of radius there")
        for crack in cracks
        if crack not in made
    )
    if material is None:
        material = preset.material(float(np.nanmean(girth[tree.strips_of(tree.paths[0].axis)])))
    return _grown(tree, preset, seed, history, stretch, material, len(history.times) - 1)


def _grown(
    tree: BarkedTree,
    preset: Preset,
    seed: int,
    history: GirthHistory,
    stretch: _Stretch,
    material: Material,
    row: int,
) -> TreeBark:
    bark, missed = stretch.grown(tree, material, seed, row)
    now = history.girth[-1]
    girth = bark.strips.girth
    sized = rescaled(bark, np.where(np.isnan(now), girth, now) / girth)
    missed = (*stretch.thin, *missed)
    return TreeBark(tree, sized, preset, seed, history, missed, stretch, material)
