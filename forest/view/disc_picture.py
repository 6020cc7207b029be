"""Discs and sections drawn as one would see them planed: earlywood, latewood, bark, knots."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from forest.dendro.disc import Disc, outlines
from forest.dendro.knots import Knot
from forest.dendro.section import Section
from forest.view.looks import look_of

# Where in a ring, from its inner to its outer edge, the wood has how much of latewood's colour.
_CONIFER = ((0.0, 0.0), (0.45, 0.08), (0.62, 0.22), (0.74, 0.45), (0.84, 0.75), (0.93, 1.0))
_BROADLEAF = ((0.0, 0.0), (0.5, 0.1), (0.8, 0.25), (0.95, 0.9))
_EARLY = {True: (0.95, 0.86, 0.68), False: (0.92, 0.82, 0.68)}
_LATE = {True: (0.66, 0.42, 0.22), False: (0.70, 0.52, 0.35)}

_PITH = (0.36, 0.23, 0.13)
_PITH_M = 0.0015
_INNER_BARK = (0.66, 0.45, 0.28)
_INNER_BARK_SHARE = 0.3
_LIVE_KNOT = ((0.80, 0.56, 0.34), (0.50, 0.29, 0.15))
_DEAD_KNOT = ((0.58, 0.37, 0.22), (0.16, 0.10, 0.07))
_INK = "0.12"

_NEAR_KNOT = np.cos(np.radians(35.0))
_NOTED_OFFSET = 0.03  # share of the radius that the pith is off centre before it is pointed out
_DPI = 120


def draw_disc(disc: Disc, to: str | Path | IO[bytes], *, conifer: bool = True) -> None:
    """Draw a disc as if planed, and save the picture.

    As on a wooden disc, one dot marks the ring of every tenth year, two that of every fiftieth,
    three that of every hundredth.

    Parameters
    ----------
    disc : Disc
    to : path or open file
        File to write; its suffix, such as ``.png`` or ``.svg``, names the format (.png if it is
        open already).
    conifer : bool
        Whether to shade rings as of a conifer, which has much dark latewood.
    """
    figure, axes = _sheet((7.4, 7.8))
    rim = disc.bark_outline
    _fill(axes, [rim], [_darker(look_of(disc.species).bark, 0.62)], edge="0.2")
    live = disc.radius + _INNER_BARK_SHARE * disc.bark_thickness
    _fill(axes, outlines(np.array([live]), disc.centres[-1:]), [_INNER_BARK])
    _fill(axes, *_ring_layers(disc, conifer))
    if disc.undated_radius > 0.0:
        _fill(axes, [disc.undated_outline], [_mix(conifer, 0.3)])
    _knots(axes, disc.knots, disc.outlines[-1:])
    pith = min(_PITH_M, 0.05 * disc.radius)
    _fill(axes, outlines(np.array([pith]), np.zeros((1, 2))), [_PITH])
    reach = float(np.abs(rim).max())
    _mark_decades(axes, disc, reach)
    _point_out_thick_side(axes, disc)
    low, high = rim.min(axis=0), rim.max(axis=0)
    _scale_bar(axes, float(low[0]), float(low[1]) - 0.09 * reach, reach)
    axes.set_xlim(low[0] - 0.12 * reach, high[0] + 0.12 * reach)
    axes.set_ylim(low[1] - 0.2 * reach, high[1] + 0.12 * reach)
    years = f"{disc.years[0]} to {disc.years[-1]}"
    axes.set_title(
        f"Tree {disc.tree_id}, {disc.species.replace('_', ' ')}, {disc.height_m:g} m above ground\n"
        f"{years}: {np.count_nonzero(disc.ring_widths)} rings, "
        f"diameter {200.0 * (disc.radius + disc.bark_thickness):.1f} cm over bark",
        fontsize=10,
        color=_INK,
    )
    figure.savefig(to, dpi=_DPI)


def draw_section(
    section: Section,
    to: str | Path,
    *,
    conifer: bool = True,
    widen: float = 1.0,
    length_m: float | None = None,
) -> None:
    """Draw the section of a stem by a plane, and save the picture.

    Parameters
    ----------
    section : Section
    to : path
        File to write; its suffix names the format.
    conifer : bool
        Colours of a conifer's wood or a broadleaf's.
    widen : float
        How many times wider than high a metre is drawn: rings along a whole stem are seen then.
    length_m : float, optional
        How much of it is drawn, from its lowest point up, m; all if not given.
    """
    points = np.concatenate([loop for loops in section.outlines for loop in loops])
    low, high = points.min(axis=0), points.max(axis=0)
    if length_m is not None:
        high[1] = min(high[1], low[1] + length_m)
        seen = points[points[:, 1] <= high[1]]
        low[0], high[0] = seen[:, 0].min(), seen[:, 0].max()
    width, height = (high - low) * (widen, 1.0)
    scale = 9.0 / max(width, height)
    figure, axes = _sheet((max(3.0, 1.2 * scale * width), max(3.0, 1.1 * scale * height)))
    axes.set_aspect(1.0 / widen)
    for loops in reversed(section.outlines):
        _fill(axes, loops, [_mix(conifer, 0.15)], edge=_mix(conifer, 1.0), line=0.5)
    _knots(axes, section.knots, section.outlines[-1])
    margin = 0.05 * float(max(width, height))
    axes.set_xlim(low[0] - margin / widen, high[0] + margin / widen)
    axes.set_ylim(low[1] - margin, high[1] + (margin if length_m is None else 0.0))
    axes.set_title(
        f"Tree {section.tree_id}, {section.species.replace('_', ' ')}, {section.years[-1]}"
        + (f"\n{widen:g} times as wide as it is" if widen != 1.0 else ""),
        fontsize=9,
        color=_INK,
    )
    room = 0.8 * float(high[0] - low[0])
    _scale_bar(axes, float(low[0]), float(low[1]) - 0.5 * margin, room)
    figure.savefig(to, dpi=_DPI)


def _sheet(size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes


def _fill(
    axes: Any,
    loops: Iterable[NDArray[np.float64]],
    colours: Iterable[Any],
    edge: Any = "none",
    line: float = 0.6,
) -> Any:
    from matplotlib.collections import PolyCollection

    drawn = PolyCollection(list(loops), facecolors=list(colours), edgecolors=edge, linewidths=line)
    return axes.add_collection(drawn)


def _mix(conifer: bool, late: float) -> tuple[float, float, float]:
    early = np.array(_EARLY[conifer])
    red, green, blue = early + late * (np.array(_LATE[conifer]) - early)
    return float(red), float(green), float(blue)


def _darker(colour: tuple[float, float, float], share: float) -> tuple[float, ...]:
    return tuple(share * part for part in colour)


def _ring_layers(disc: Disc, conifer: bool) -> tuple[NDArray[np.float64], list[Any]]:
    """Give the outlines within all rings, the outermost first, and the colour inside each."""
    shades = _CONIFER if conifer else _BROADLEAF
    upto = np.array([share for share, _ in shades[1:]] + [1.0])
    start = np.concatenate((np.zeros((1, 2)), disc.centres[:-1]))
    inner = disc.radii - disc.ring_widths
    there = disc.ring_widths > 0.0
    radii = (inner[there, None] + upto * disc.ring_widths[there, None]).ravel()
    moved = (disc.centres - start)[there, None]
    centre = (start[there, None] + upto[:, None] * moved).reshape(-1, 2)
    colours = [_mix(conifer, late) for _, late in shades] * int(there.sum())
    return outlines(radii, centre)[::-1], colours[::-1]


def _knots(axes: Any, knots: Iterable[Knot], wood: Sequence[NDArray[np.float64]]) -> None:
    """Draw what lies of knots in the wood, darker towards the rim; a dead one has a dark line."""
    from matplotlib.path import Path as Outline

    closed = [np.concatenate((loop, loop[:1])) for loop in wood]
    within = Outline.make_compound_path(*(Outline(loop, closed=True) for loop in closed))
    for knot in knots:
        inside, rim = _LIVE_KNOT if knot.alive else _DEAD_KNOT
        loops = _nested(knot.outline, np.linspace(1.0, 0.2, 6))
        shades = np.linspace(0.55, 0.0, 6)[:, None] * (np.array(rim) - np.array(inside))
        drawn = _fill(axes, loops, [*(np.array(inside) + shades)], [rim] + ["none"] * 5, 0.8)
        drawn.set_clip_path(within, transform=axes.transData)


def _nested(outline: NDArray[np.float64], steps: NDArray[np.float64]) -> list[Any]:
    """Shrink a knot's outline: a spike from the pith about its axis, any other about its middle."""
    middle = outline.mean(axis=0)
    nearest, farthest = np.hypot(*outline.T)[[0, len(outline) // 2]]
    if nearest > 0.08 * farthest:
        return [middle + step * (outline - middle) for step in steps]
    axis = middle / np.hypot(*middle)
    lengthwise = (outline @ axis)[:, None] * axis
    return [lengthwise + step * (outline - lengthwise) for step in steps]


def _mark_decades(axes: Any, disc: Disc, reach: float) -> None:
    """Dot and name every tenth ring, on the side with most room that is free of knots."""
    from matplotlib.patheffects import withStroke

    corner = _free_side(disc)
    outward = disc.outlines[-1][corner] / np.hypot(*disc.outlines[-1][corner])
    beside = np.array((outward[1], -outward[0]))
    turn = float(np.degrees(np.arctan2(beside[1], beside[0])))
    upright = (turn + 90.0) % 180.0 - 90.0
    halo = [withStroke(linewidth=2.2, foreground=(1.0, 0.95, 0.85, 0.9))]
    named = -np.inf
    for k, year in enumerate(disc.years):
        if year % 10 or disc.ring_widths[k] == 0.0:
            continue
        place = disc.outlines[k][corner] - 0.5 * disc.ring_widths[k] * outward
        dots = 1 + (year % 50 == 0) + (year % 100 == 0)
        for dot in range(dots):
            x, y = place + (dot - 0.5 * (dots - 1)) * 0.018 * reach * beside
            axes.plot(x, y, "o", ms=2.6, mfc=_INK, mec="none", zorder=5)
        along = float(place @ outward)
        if along - named < 0.035 * reach:
            continue
        named = along
        axes.text(
            *(place + (0.03 + 0.009 * dots) * reach * beside),
            str(year),
            rotation=upright,
            rotation_mode="anchor",
            ha="left" if abs(upright - turn) < 1.0 else "right",
            va="center",
            fontsize=7,
            color=_INK,
            path_effects=halo,
            zorder=6,
        )


def _free_side(disc: Disc) -> int:
    """Choose the corner with most wood below it and no knot near; upward if alike."""
    room = np.round(np.hypot(*disc.outlines[-1].T) / disc.radius, 3)
    azimuth = np.arange(len(room)) * (2.0 * np.pi / len(room))
    for knot in disc.knots:
        knots_side = np.arctan2(*knot.outline.mean(axis=0)[::-1])
        room[np.cos(azimuth - knots_side) > _NEAR_KNOT] -= 1.0
    best = np.flatnonzero(room == room.max())
    return int(best[np.argmax(np.sin(azimuth[best]))])


def _point_out_thick_side(axes: Any, disc: Disc) -> None:
    """Put an arrowhead at the bark where the rings are widest, if the pith is off centre."""
    centre = disc.centres[-1]
    offset = float(np.hypot(*centre))
    if offset < _NOTED_OFFSET * disc.radius:
        return
    towards = centre / offset
    at = centre + (disc.radius + disc.bark_thickness) * 1.03 * towards
    turn = float(np.degrees(np.arctan2(towards[1], towards[0])))
    axes.plot(*at, marker=(3, 0, turn + 90.0), ms=7, color=_INK, clip_on=False)
    axes.annotate(
        "thick side",
        at,
        xytext=(9.0 * towards[0], 9.0 * towards[1]),
        textcoords="offset points",
        ha="left" if towards[0] > 0.3 else "right" if towards[0] < -0.3 else "center",
        va="bottom" if towards[1] > 0.3 else "top" if towards[1] < -0.3 else "center",
        fontsize=8,
        color=_INK,
    )


def _scale_bar(axes: Any, x: float, y: float, room: float) -> None:
    """Draw a bar of a round length, at most as long as there is room."""
    decade = 10.0 ** np.floor(np.log10(room))
    length = decade * max(s for s in (1.0, 2.0, 5.0) if s == 1.0 or s * decade <= room)
    axes.plot([x, x + length], [y, y], color=_INK, lw=2.5, solid_capstyle="butt")
    text = f"{length:g} m" if length >= 1.0 else f"{100.0 * length:g} cm"
    axes.text(x + length, y, f"  {text}", va="center", fontsize=8, color=_INK)
