"""Small charts as SVG text, for a page that is served without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

WIDTH, HEIGHT = 360, 132
_LEFT, _RIGHT, _TOP, _BOTTOM = 38, 16, 8, 20
_INK, _FAINT, _NOW = "#5d675f", "#e4e7e1", "#c9873a"

Series = Mapping[str, tuple[ArrayLike, str]]


def ticks(low: float, high: float, most: int = 4) -> list[float]:
    """Give round numbers from `low` to `high`, at most so many steps."""
    span = high - low
    if not (isfinite(span) and span > 0.0):
        return [low]
    raw = span / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= raw * (1 - 1e-9))
    first = np.ceil(low / step - 1e-9)
    return [float(step * k) + 0.0 for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


class _Frame:
    """Axes: years across, a quantity upwards."""

    def __init__(self, years: Sequence[int], top: float, year: int) -> None:
        self.first, self.last = years[0], max(years[-1], years[0] + 1)
        self.top = top if isfinite(top) and top > 0.0 else 1.0
        self.year = year

    def x(self, year: ArrayLike) -> NDArray[np.float64]:
        share = (np.asarray(year, np.float64) - self.first) / (self.last - self.first)
        return np.asarray(_LEFT + share * (WIDTH - _LEFT - _RIGHT))

    def y(self, value: ArrayLike) -> NDArray[np.float64]:
        share = np.asarray(value, np.float64) / self.top
        return np.asarray(HEIGHT - _BOTTOM - share * (HEIGHT - _TOP - _BOTTOM))

    def drawn(self, body: str, label: str) -> str:
        """Put axes around what is drawn."""
        floor = HEIGHT - _BOTTOM
        parts = [
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label, True)}" '
            f'font-size="10.5" fill="{_INK}">'
        ]
        for value in ticks(0.0, self.top):
            y = float(self.y(value))
            parts.append(
                f'<line x1="{_LEFT}" x2="{WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}" '
                f'stroke="{_FAINT}"/><text x="{_LEFT - 5}" y="{y + 3.5:.1f}" '
                f'text-anchor="end">{value:g}</text>'
            )
        for value in ticks(self.first, self.last, 5):
            if value == round(value):
                x = float(self.x(value))
                parts.append(
                    f'<text x="{x:.1f}" y="{HEIGHT - 5}" text-anchor="middle">{value:.0f}</text>'
                )
        parts.append(body)
        now = float(self.x(self.year))
        parts.append(
            f'<line class="now" x1="{now:.1f}" x2="{now:.1f}" y1="{_TOP}" y2="{floor}" '
            f'stroke="{_NOW}" stroke-width="1.2"/></svg>'
        )
        return "".join(parts)


def line_chart(years: Sequence[int], series: Series, year: int, label: str) -> str:
    """Draw curves over years, with the year that is shown marked.

    Parameters
    ----------
    years : sequence of int
        In order, at least one.
    series : mapping of name to (values, CSS colour)
        A value for each year, NaN where there is none.
    year : int
        The year that is shown.
    label : str
        What is drawn, for people who do not see it.
    """
    values = [np.asarray(each, np.float64) for each, _ in series.values()]
    known = np.concatenate(values) if values else np.zeros(0)
    known = known[np.isfinite(known)]
    frame = _Frame(years, float(known.max(initial=0.0)) * 1.04, year)
    x = frame.x(years)
    body = []
    for (_, colour), each in zip(series.values(), values, strict=True):
        y = frame.y(each)
        runs = np.split(np.arange(len(x)), np.flatnonzero(np.diff(np.isfinite(y))) + 1)
        for run in runs:
            if len(run) and np.isfinite(y[run[0]]):
                path = " ".join(f"{x[k]:.1f},{y[k]:.1f}" for k in run)
                body.append(
                    f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.8"/>'
                )
        now = np.flatnonzero(np.asarray(years) == year)
        if len(now) and np.isfinite(y[now[0]]):
            body.append(
                f'<circle cx="{x[now[0]]:.1f}" cy="{y[now[0]]:.1f}" r="3" fill="{colour}"/>'
            )
    return frame.drawn("".join(body), label)


def share_chart(years: Sequence[int], series: Series, year: int, label: str) -> str:
    """Draw shares of a whole over years as bands, 0 to 100 %; parameters as for `line_chart`."""
    values = np.array([np.nan_to_num(np.asarray(each, np.float64)) for each, _ in series.values()])
    values = values.reshape(-1, len(years))
    whole = values.sum(axis=0)
    share = np.divide(100.0 * values, whole, out=np.zeros_like(values), where=whole > 0.0)
    frame = _Frame(years, 100.0, year)
    x = frame.x(years)
    upper = np.cumsum(share, axis=0)
    body = []
    for k, (_, colour) in enumerate(series.values()):
        over, under = frame.y(upper[k]), frame.y(upper[k] - share[k])
        ring = [f"{a:.1f},{b:.1f}" for a, b in zip(x, over, strict=True)]
        ring += [f"{a:.1f},{b:.1f}" for a, b in zip(x[::-1], under[::-1], strict=True)]
        body.append(f'<polygon points="{" ".join(ring)}" fill="{colour}" fill-opacity="0.85"/>')
    return frame.drawn("".join(body), label)


def year_at(share: float, years: Sequence[int]) -> int:
    """Give the year nearest to a place in a chart, as a share of its width: for clicks."""
    at = (share * WIDTH - _LEFT) / (WIDTH - _LEFT - _RIGHT)
    wanted = years[0] + at * (years[-1] - years[0])
    return min(years, key=lambda year: abs(year - wanted))
