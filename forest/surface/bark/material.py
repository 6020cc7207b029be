"""What bark is made of, as the fracture model sees it (Lefebvre and Neyret, figure 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError


class Curve(NamedTuple):
    """A piecewise straight curve, flat beyond its ends."""

    at: NDArray[np.float64]
    value: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Bark's parameters: mechanics, where it tears, and how tears run on.

    Stiffnesses are per metre of strip width and only their ratios matter: `stiffness` over
    `fracture_stiffness` is a length, about the distance between fractures that growth keeps up.
    """

    #: R, tension per strain of the epidermis, N/m.
    stiffness: float = 1.0
    #: K_f, tension per metre of opening, N/m2: one number, or K_f(l0) as pairs (width in m, K_f).
    fracture_stiffness: float | tuple[tuple[float, float], ...] = 20.0
    #: S, the lengthening (now / rest) at which epidermis breaks; None: the girth's growth ratio.
    threshold: float | None = None
    #: Spread of the strain that grains bear: standard deviation of its logarithm. A piece is as
    #: strong as its weakest grain.
    threshold_jitter: float = 0.3
    #: K_a, grip of the substrate, N/m3 (per metre of strip width and of epidermis); 0 slides.
    attachment: float = 0.0
    #: Spread of weakness from place to place, beside a weakness map's 0 to 1.
    place_jitter: float = 1.0
    #: How much more strain the strong parts of a weakness map bear than the weak ones.
    weakness_contrast: float = 1.0
    #: Size of the places that differ in strength, m around the girth and along the axis.
    grain_m: float = 0.004
    grain_along_m: float = 0.05
    #: No two fractures tear nearer to one another, m of epidermis.
    least_piece_m: float = 0.004
    #: A new fracture is at least this long, m.
    flaw_m: float = 0.02
    #: Length over width beyond which a fracture runs on (Inglis ratio).
    inglis: float = 4.0
    #: Share of its threshold that the next strip must bear for a fracture to run into it; 0 is the
    #: paper's rule, by the Inglis ratio alone.
    arrest: float = 0.6
    #: The most by which an end of a fracture runs on in one step, m: brittle bark tears at once
    #: (the paper's rule, without limit), ductile bark slowly, so that fractures taper.
    run_m: float = 0.05
    #: a': a fracture bends the course of others within this many times its mean width.
    influence: float = 3.0
    #: A fracture ends rather than come nearer to another than this many times its mean width.
    stand_off: float = 0.5
    #: Most by which a fracture strays from its course, degrees.
    stray_deg: float = 10.0

    def __post_init__(self) -> None:
        """Refuse what has no meaning."""
        positive = ("stiffness", "grain_m", "grain_along_m", "least_piece_m")
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, (int, float)):
                endless = field.name == "run_m" and value == math.inf
                if not (math.isfinite(value) or endless) or value < 0.0:
                    raise _refused(field.name, value, "a number of 0 or more")
                if field.name in positive and value <= 0.0:
                    raise _refused(field.name, value, "a number above 0")
        if self.threshold is not None and self.threshold <= 1.0:
            raise _refused("threshold", self.threshold, "a lengthening S above 1")
        if self.stray_deg > 80.0:
            raise _refused("stray_deg", self.stray_deg, "an angle of 0 to 80 degrees")
        curve = self.curve
        if not (len(curve.at) and np.all(np.diff(curve.at) > 0) and np.all(curve.value > 0)):
            raise _refused(
                "fracture_stiffness",
                self.fracture_stiffness,
                "a number above 0, or pairs of rising widths (m) and stiffnesses above 0",
            )

    @property
    def curve(self) -> Curve:
        """K_f against the fracture's width."""
        pairs = self.fracture_stiffness
        if not isinstance(pairs, tuple):
            pairs = ((0.0, float(pairs)),)
        table = np.array(pairs, np.float64).reshape(-1, 2)
        return Curve(np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1]))

    @property
    def spacing_m(self) -> float:
        """R / K_f of a new fracture, m: how much epidermis yields as much as a fracture does."""
        curve = self.curve
        return self.stiffness / float(np.interp(0.0, curve.at, curve.value))


def _refused(name: str, value: Any, expected: str) -> InputError:
    return InputError(f"{name} = {value}", where="bark material", expected=expected)


class Physics(NamedTuple):
    """A material as kernels take it."""

    stiffness: float
    curve_at: NDArray[np.float64]
    curve_value: NDArray[np.float64]
    threshold_jitter: float
    attachment: float
    place_jitter: float
    weakness_contrast: float
    grain_m: float
    grain_along_m: float
    least_piece_m: float
    flaw_m: float
    inglis: float
    arrest: float
    run_m: float
    influence: float
    stand_off: float
    stray: float  # tangent
    begins: bool  # whether this part of a step is its first
    ends: bool  # or its last

    @classmethod
    def of(cls, material: Material, *, begins: bool = True, ends: bool = True) -> Physics:
        """Take over what the kernels need in a step, or a part of one."""
        same = {name: float(getattr(material, name)) for name in cls._fields if name in _SAME}
        return cls(
            **same,  # type: ignore[arg-type]
            begins=begins,
            ends=ends,
            curve_at=material.curve.at,
            curve_value=material.curve.value,
            stray=math.tan(math.radians(material.stray_deg)),
        )


_SAME = {field.name for field in fields(Material)} - {"fracture_stiffness", "threshold"}


def fracture_range(
    material: Material, growth: NDArray[np.float64], rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give the least threshold S that relieves a whole ring by one fracture (3.2.3).

    1 + (e / l0) K_f / (K_s + K_f), with e / l0 = growth - 1 and K_s = R / l0. Above `growth`
    nothing breaks.

    Parameters
    ----------
    growth : float64 (n,)
        The girth's growth ratio in one step.
    rest : float64 (n,)
        The epidermis' own length l0, m.
    """
    soft = material.stiffness / material.spacing_m
    bound: NDArray[np.float64] = 1.0 + (growth - 1.0) * soft / (material.stiffness / rest + soft)
    return bound
