"""A ring in plain Python: Taylor-Hell 2005, sections 4.2, 6.1, 6.2, and maturation strains.

Frames are matrices whose columns are H, L and U; what the kernels do with components is done here
with vectors of the world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


@dataclass
class Wood:
    """A species: moduli in Pa, angles in rad."""

    juvenile: float
    mature: float
    reaction: float
    shear: float
    maturing_years: float
    conifer: bool
    sought: float
    righting_from: float
    righting_span: float
    strain: float
    strain_difference: float
    swell: float
    deviation_limit: float
    rest_share: float


@dataclass
class Piece:
    """A metamer: rates in rad/m and rigidities in N m2 about H, L, U; radius in m."""

    radius: float
    rigidity: Vector
    rest: Vector
    curvature: Vector
    frame: NDArray[np.float64]
    eccentricity: float = 0.0
    thick: Vector = field(default_factory=lambda: np.zeros(3))


def frame_of(quaternion: Vector) -> NDArray[np.float64]:
    """World directions of H, L and U, as columns: v' = q v q^-1, written out."""
    w, axis = quaternion[0], quaternion[1:]
    columns = []
    for v in np.eye(3):
        t = 2.0 * np.cross(axis, v)
        columns.append(v + w * t + np.cross(axis, t))
    return np.array(columns).T


def moment(longer: float, shorter: float) -> float:
    """Eq. 16: I along a, which lies in the direction of bending."""
    return math.pi / 4 * longer**3 * shorter


def polar(a: float, b: float) -> float:
    """J of an ellipse (6.2); pi r^4 / 2 for a circle (section 4)."""
    return math.pi * a**3 * b**3 / (a**2 + b**2)


def ellipse(area: float, ratio: float) -> tuple[float, float]:
    """Semi-axes a, b of an ellipse of an area with a / b = ratio."""
    b = math.sqrt(area / math.pi / ratio)
    return ratio * b, b


def outer_edge(
    a: float, b: float, swell_a: float, swell_b: float, area: float
) -> tuple[float, float]:
    """Find by halving the ring whose widths are as the swells and whose outer edge has an area."""
    low, high = 0.0, math.sqrt(area / math.pi) + a + b
    for _ in range(200):
        width = (low + high) / 2
        if math.pi * (a + swell_a * width) * (b + swell_b * width) > area:
            high = width
        else:
            low = width
    return a + swell_a * low, b + swell_b * low


def reaction(piece: Piece, wood: Wood, righting: str) -> tuple[float, Vector]:
    """Strength of the reaction, and the axis (unit, of the world) about which it turns back."""
    heading, side_l, side_u = piece.frame.T
    if righting == "beta":
        back = piece.rest - piece.curvature
        bending = back[1] * side_l + back[2] * side_u
        size = float(np.linalg.norm(bending))
        return (1.0, bending / size) if size > wood.deviation_limit else (0.0, np.zeros(3))
    if righting == "strain":
        axis = np.cross(heading, UP)
        lean = math.acos(np.clip(heading @ UP, -1, 1)) - wood.sought
        strength = (abs(lean) - wood.righting_from) / wood.righting_span
        unit = axis / np.linalg.norm(axis)
        return float(np.clip(strength, 0, 1)), math.copysign(1.0, lean) * unit
    return 0.0, np.zeros(3)


def maturation(inner: float, outer: float, core: float, modulus: float, strain: float) -> float:
    """Curvature by a strain e cos(theta), summed over many thin layers that mature in turn."""
    curvature, rigidity = 0.0, core
    edges = np.linspace(inner, outer, 4001)
    for a, b in pairwise(edges):
        layer = modulus * math.pi / 4 * (b**4 - a**4)
        curvature += modulus * math.pi * strain * (b**3 - a**3) / 3 / (rigidity + layer / 2)
        rigidity += layer
    return curvature


def lay(piece: Piece, radius: float, wood: Wood, righting: str) -> Piece:
    """Age the wood by a year and lay the ring up to a radius."""
    if piece.radius == 0:
        bend = wood.juvenile * moment(radius, radius)
        twist = wood.juvenile * wood.shear * polar(radius, radius)
        rigidity = np.array([twist, bend, bend])
        return Piece(radius, rigidity, piece.rest, piece.curvature, piece.frame)
    strength, axis = reaction(piece, wood, righting) if radius > piece.radius else (0.0, UP * 0)
    body = piece.frame.T @ axis
    swell_l = swell_u = 1.0
    if righting == "beta" and strength > 0:
        if abs(body[1]) >= abs(body[2]):
            swell_u = wood.swell
        else:
            swell_l = wood.swell
    ratio = math.sqrt(piece.rigidity[2] / piece.rigidity[1])
    l_in, u_in = ellipse(math.pi * piece.radius**2, ratio)
    l_out, u_out = outer_edge(l_in, u_in, swell_l, swell_u, math.pi * radius**2)
    core = np.array([wood.shear * polar(l_in, u_in), moment(u_in, l_in), moment(l_in, u_in)])
    whole = np.array([wood.shear * polar(l_out, u_out), moment(u_out, l_out), moment(l_out, u_out)])
    # Eq. 18 at full strength: half of the ring is reaction wood.
    modulus = wood.juvenile * (1 - strength / 2) + wood.reaction * strength / 2
    stiffer = (wood.mature * core - piece.rigidity) / wood.maturing_years
    ring = modulus * (whole - core)
    ring_rest = piece.curvature
    if righting == "beta" and strength > 0:
        ring_rest = (1 - wood.rest_share) * piece.curvature + wood.rest_share * piece.rest
    aged = piece.rigidity + stiffer
    aged_rest = (piece.rigidity * piece.rest + stiffer * piece.curvature) / aged
    rest = (aged * aged_rest + ring * ring_rest) / (aged + ring)
    eccentricity = strength * (wood.swell - 1)
    if righting == "strain" and strength > 0:
        strain = strength * wood.strain_difference / 2 + eccentricity * wood.strain
        rest = rest + body * maturation(piece.radius, radius, aged[1:].mean(), modulus, strain)
    inside_of_turn = np.cross(axis, piece.frame[:, 0])
    thick = -inside_of_turn if wood.conifer else inside_of_turn
    return Piece(radius, aged + ring, rest, piece.curvature, piece.frame, eccentricity, thick)


def rings_rigidity(radii: list[float], juvenile: float, mature: float, years: float) -> float:
    """EI of a round stem, ring by ring, each with the modulus of its age (6.1)."""
    total = 0.0
    for birth, (a, b) in enumerate(zip([0.0, *radii[:-1]], radii, strict=True)):
        age = len(radii) - 1 - birth
        modulus = mature + (juvenile - mature) * (1 - 1 / years) ** age
        total += modulus * math.pi / 4 * (b**4 - a**4)
    return total
