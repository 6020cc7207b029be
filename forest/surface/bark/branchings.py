"""How fractures cross from axis to axis: by their places in space (5.3, figure 20).

"The fracture end on a strip is converted from curvilinear coordinates to space coordinates; then
it is converted back to obtain the entry location in the next strip." A fracture that runs into
another axis stops on its own and goes on there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.strips import Crossings

if TYPE_CHECKING:
    from forest.surface.bark.axes import AxisPath

_Floats = NDArray[np.float64]

#: Places around a strip that are looked at: as many directions in which a fracture may cross.
_AROUND = 180
_MARGIN = 2.0  # radii of the branch beyond its foot within which strips of the parent are looked at


class _Place(NamedTuple):
    """Strips of an axis as rows of the geometry."""

    path: AxisPath
    first: int
    strips: int

    @property
    def step(self) -> float:
        return (self.path.high - self.path.low) / self.strips

    def v(self, strip: NDArray[np.int64]) -> _Floats:
        """Give the middles of strips, counted from the axis' lowest one."""
        v = self.path.low + (strip + 0.5) * self.step
        return np.asarray(np.maximum(v, 0.0), np.float64)

    def strip(self, v: _Floats) -> NDArray[np.int64]:
        """Find the strips at some places, the first and the last beyond them."""
        found = np.floor((v - self.path.low) / self.step).astype(np.int64)
        return np.clip(found, 0, self.strips - 1)


def passages(paths: Sequence[AxisPath], first: Sequence[int], counts: Sequence[int]) -> Crossings:
    """Find where fractures pass from parents to children, and back.

    Parameters
    ----------
    paths : sequence of AxisPath
        Axes with strips.
    first, counts : sequences of int
        The first strip of each, and their number.
    """
    places = {
        path.axis: _Place(path, at, count)
        for path, at, count in zip(paths, first, counts, strict=True)
    }
    found = []
    for place in places.values():
        bearer = places.get(place.path.parent)
        if bearer is not None:
            near = _near(bearer, place)
            found += [_across(bearer, place, near, way, onto_child=True) for way in (1, -1)]
            foot = np.arange(min(place.strips, _strips_of_foot(place, bearer)))
            found.append(_across(place, bearer, foot, -1, onto_child=False))
    if not found:
        return Crossings.none()
    return Crossings(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _near(bearer: _Place, branch: _Place) -> NDArray[np.int64]:
    """Strips of the parent around a branch's foot."""
    radius = branch.path.radius[0]
    reach = float(bearer.path.radius.max()) + _MARGIN * radius
    v = np.linspace(branch.path.low, min(branch.path.low + reach, branch.path.v[-1]), 16)
    place, *_ = branch.path.frame(v)
    along, _, _ = bearer.path.locate(place)
    strips = bearer.strip(np.array([along.min() - reach, along.max() + reach]))
    return np.arange(strips[0], strips[1] + 1)


def _strips_of_foot(branch: _Place, bearer: _Place) -> int:
    """Over how many strips a branch's surface comes out of its parent, at most."""
    reach = 2.0 * (float(bearer.path.radius.max()) + float(branch.path.radius[0]))
    return int(np.ceil(reach / branch.step)) + 1


def _across(
    here: _Place, there: _Place, strips: NDArray[np.int64], way: int, *, onto_child: bool
) -> Crossings:
    """Find where a fracture on one axis, running one way, meets the other's surface.

    It does where it is outside the other axis on its strip and inside on the next.
    """
    turn = (np.arange(_AROUND) + 0.5) / _AROUND
    outside, points = _looked_at(here, there, strips, turn)
    beyond, _ = _looked_at(here, there, strips + way, turn)
    row, column = np.nonzero(outside & ~beyond)
    if not len(row):
        return Crossings.none()
    v, enters, _ = there.path.locate(points[row, column])
    ahead = points[row, (column + 1) % _AROUND]
    behind = points[row, column - 1]
    step = there.path.locate(ahead)[1] - there.path.locate(behind)[1]
    step -= np.round(step)
    if onto_child:
        goes = np.ones(len(row), np.int8)  # a branch is met at its base
    else:
        goes = _side(here, there, strips[row], points[row, column], v)
    return Crossings(
        strip=(here.first + strips[row]).astype(np.int32),
        runs=np.full(len(row), way, np.int8),
        angle=turn[column],
        half=np.full(len(row), 0.5 / _AROUND),
        to=(there.first + there.strip(v)).astype(np.int32),
        enters=enters,
        scale=step * (0.5 * _AROUND),
        goes=goes,
    )


def _looked_at(
    here: _Place, there: _Place, strips: NDArray[np.int64], turn: _Floats
) -> tuple[NDArray[np.bool_], _Floats]:
    """Tell which places on strips are outside another axis, and where they are in space."""
    v = np.repeat(here.v(strips), len(turn))
    points = here.path.points(v, np.tile(turn, len(strips)), here.path.radius_at(v))
    along, _, distance = there.path.locate(points)
    begins = _ahead(there, points)
    outside = (distance > there.path.radius_at(along)) | ~begins
    shape = len(strips), len(turn)
    return outside.reshape(shape), points.reshape(*shape, 3)


def _ahead(there: _Place, points: _Floats) -> NDArray[np.bool_]:
    """Tell which points lie before an axis' base: a branch is no ball behind its foot."""
    if there.path.parent < 0:
        return np.ones(len(points), np.bool_)
    away = points - there.path.place[0]
    return np.asarray(away @ there.path.heading[0] > 0.0, np.bool_)


def _side(
    here: _Place, there: _Place, strips: NDArray[np.int64], points: _Floats, v: _Floats
) -> NDArray[np.int8]:
    """Which way a fracture that comes down a branch goes on: down below it, up in the crotch."""
    centre, *_ = here.path.frame(here.v(strips))
    _, heading, _, _ = there.path.frame(v)
    below = np.sum((points - centre) * heading, axis=1) < 0.0
    return np.where(below, -1, 1).astype(np.int8)
