"""Fractures that someone starts on a tree's bark: acts `crack`, and where on its strips they are.

"The user may also trigger a fracture at an element" (Lefebvre and Neyret 2002, 3.2.4); from there
it runs on like any other (`forest.surface.bark.propagation`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.scenario.shaping import Crack as CrackAct
from forest.surface.bark.axes import BarkedTree
from forest.surface.bark.girth import GirthHistory
from forest.surface.bark.growing import Bark
from forest.trees.skeleton import Skeleton

if TYPE_CHECKING:
    from forest.record.run import Run


#: How far someone forces bark open, m: about a knife's blade. Old bark has little strain left to
#: open a fracture, since those that are there have relieved it.
GAP_M = 0.003

_NEAR = 1.5  # radii from the middle of the stem that are still its surface


class Crack(NamedTuple):
    """A fracture that is started at the beginning of a year.

    Attributes
    ----------
    year : int
        Calendar year.
    height_m : float
        Above the stem's foot.
    azimuth_deg : float
        Side of the stem, from x towards y.
    """

    year: int
    height_m: float
    azimuth_deg: float

    def __str__(self) -> str:
        """Tell which crack it is."""
        place = f"{self.height_m:.2f} m, {self.azimuth_deg % 360.0:.0f} degrees"
        return f"the crack of {self.year} at {place}"


class Missed(NamedTuple):
    """A crack that could not be made.

    Attributes
    ----------
    crack : Crack
    why : str
        In words.
    """

    crack: Crack
    why: str

    def __str__(self) -> str:
        """Tell it in a line."""
        return f"{self.crack} is not to be seen: {self.why}"


class Trigger(NamedTuple):
    """The same on strips.

    Attributes
    ----------
    row : int
        How many rows of the girths' history precede it.
    strip : int
    turn : float
        Part of a turn from the seam.
    crack : Crack
        What it stands for.
    """

    row: int
    strip: int
    turn: float
    crack: Crack


def recorded_cracks(run: Run, tree_id: int, year: int) -> tuple[Crack, ...]:
    """List the cracks that a run's acts made in a tree's bark up to a year, in their order.

    Raises
    ------
    InputError
        If the run has such acts with a trigger, and keeps no table that tells when it fired.
    """
    acts = {
        i: act
        for i, act in enumerate(run.scenario.acts)
        if isinstance(act, CrackAct) and act.tree_id == tree_id
    }
    if not acts:
        return ()
    if "treatments" in run.tables:
        done = run.treatments[["year", "act"]].drop_duplicates()
        pairs = list(zip(done["year"].tolist(), done["act"].tolist(), strict=True))
    else:
        if any(act.when is not None for act in acts.values()):
            raise InputError(
                "holds no table 'treatments', which tells when bark was cracked",
                where=str(run.path),
            )
        years = [int(each) for each in run.years]
        start = run.scenario.start_year
        pairs = [(y, i) for y in years for i in acts if acts[i].may_be_in(y, start)]
    return tuple(
        Crack(y, acts[i].height_m, acts[i].azimuth_deg) for y, i in pairs if i in acts and y <= year
    )


def triggers_of(
    tree: BarkedTree, history: GirthHistory, cracks: Iterable[Crack]
) -> tuple[Trigger, ...]:
    """Find the strips and the rows of the history at which cracks start, in order of time.

    Where the stem has no strips, since it is too thin there or ends below, there is no crack.
    """
    path = tree.paths[0]
    strips = tree.strips_of(path.axis)
    found = []
    for crack in cracks:
        if crack.height_m > float(path.place[-1, 2] - path.place[0, 2]):
            continue
        centre, radius = _cut(path.place, path.radius, crack.height_m)
        azimuth = np.radians(crack.azimuth_deg)
        point = centre + radius * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        v, turn, _ = path.locate(point[None])
        if not path.low <= v[0] <= path.high:
            continue
        strip = int(strips[np.argmin(np.abs(tree.geometry.along[strips] - v[0]))])
        born = int(np.argmax(~np.isnan(history.girth[:, strip]))) + 1
        row = max(int(np.searchsorted(history.times, crack.year, side="left")), born)
        found.append(Trigger(row, strip, float(turn[0]), crack))
    return tuple(sorted(found, key=lambda trigger: trigger.row))


def place_on_stem(skeleton: Skeleton, point_m: NDArray[np.float64]) -> tuple[float, float]:
    """Give height (m) and azimuth (degrees) of a point on a stem's surface.

    Raises
    ------
    InputError
        If the point does not lie on the stem.
    """
    rows = skeleton.axis == skeleton.axis[0]
    place = np.vstack((skeleton.start[rows][:1], skeleton.end[rows]))
    height = float(point_m[2] - place[0, 2])
    centre, radius = _cut(place, skeleton.radius[rows], height)
    out = point_m[:2] - centre[:2]
    if height > place[-1, 2] - place[0, 2] or np.linalg.norm(out) > _NEAR * radius:
        raise InputError("that is not the bark of the stem", expected="a place on the stem")
    return max(height, 0.0), float(np.degrees(np.arctan2(out[1], out[0])))


def torn(bark: Bark, trigger: Trigger) -> Bark:
    """Tear bark at a trigger.

    Raises
    ------
    InputError
        Where it is open already, or a fracture is near.
    """
    return bark.trigger(trigger.strip, bark.around(trigger.strip, trigger.turn), GAP_M)


def _cut(
    place: NDArray[np.float64], radius: NDArray[np.floating], height_m: float
) -> tuple[NDArray[np.float64], float]:
    """Cut an axis at a height above its foot: where its middle is, and its radius."""
    up = np.maximum.accumulate(place[:, 2] - place[0, 2])
    centre = np.array([np.interp(height_m, up, place[:, k]) for k in range(3)])
    return centre, float(np.interp(height_m, 0.5 * (up[1:] + up[:-1]), radius))
