"""Trees of rods with matrices: Taylor-Hell 2005, sections 4 and 5, metamer by metamer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass
class Rod:
    """One metamer; `joint` turns the parent's end frame into the frame at its start."""

    parent: int
    length: float
    joint: NDArray[np.float64]
    rest: Vector
    rigidity: Vector
    middle_force: Vector
    tip_force: Vector


@dataclass
class Shape:
    """A metamer in the world: frames as matrices with columns H, L, U."""

    middle: NDArray[np.float64]
    end: NDArray[np.float64]
    tip: Vector


def cross_matrix(v: Vector) -> NDArray[np.float64]:
    """The matrix that takes w to v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rotation(v: Vector) -> NDArray[np.float64]:
    """Rotation about v by |v| (eq. 10, by Rodrigues' formula)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    k = cross_matrix(v / angle)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def branching(divergence: float, deviation: float) -> NDArray[np.float64]:
    """Section 5.1: by the divergence about H, then by the deviation about the turned U."""
    spiral = rotation(np.array([divergence, 0.0, 0.0]))
    normal = spiral @ np.array([0.0, 0.0, 1.0])
    return rotation(deviation * normal) @ spiral


def matrix(q: Vector) -> NDArray[np.float64]:
    """The rotation of a quaternion (w, x, y, z)."""
    q = np.asarray(q, np.float64) / np.linalg.norm(np.asarray(q, np.float64))
    k = cross_matrix(q[1:])
    return np.eye(3) + 2.0 * q[0] * k + 2.0 * k @ k


def shape(rods: list[Rod], omega: NDArray[np.float64]) -> list[Shape]:
    """Base to tips: half of each metamer's turn before its middle, half after it."""
    shapes: list[Shape] = []
    for rod, rate in zip(rods, omega, strict=True):
        below = shapes[rod.parent].end if rod.parent >= 0 else np.eye(3)
        foot = shapes[rod.parent].tip if rod.parent >= 0 else np.zeros(3)
        half = rotation(0.5 * rod.length * rate)
        middle = below @ rod.joint @ half
        shapes.append(Shape(middle, middle @ half, foot + rod.length * middle[:, 0]))
    return shapes


def energy(rods: list[Rod], omega: NDArray[np.float64]) -> float:
    """Elastic energy of the rods and potential energy of the loads, J."""
    total = 0.0
    for rod, rate, s in zip(rods, omega, shape(rods, omega), strict=True):
        total += 0.5 * rod.length * float(rod.rigidity @ (rate - rod.rest) ** 2)
        total -= float(rod.tip_force @ s.tip)
        total -= float(rod.middle_force @ (s.tip - 0.5 * rod.length * s.middle[:, 0]))
    return total


def torques(rods: list[Rod], omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moment of the loads on each metamer, in its own frame (eqs 3, 15): tips to base.

    What lies beyond turns with the metamer's end, its own segment with its middle. A small change
    of the rotation vector turns them by its mean over the half turn that lies between.
    """
    shapes = shape(rods, omega)
    n = len(rods)
    beyond_force = np.array([rod.tip_force for rod in rods])
    beyond = np.zeros((n, 3))  # moment about the tip of what is carried there
    result = np.zeros((n, 3))
    for i in reversed(range(n)):
        rod, s = rods[i], shapes[i]
        segment = rod.length * s.middle[:, 0]
        own = np.cross(segment, beyond_force[i]) + np.cross(0.5 * segment, rod.middle_force)
        half = 0.5 * rod.length * omega[i]
        mean = sum(
            0.5 * w * rotation(0.5 * (1.0 + x) * half)
            for x, w in zip(_NODES, _WEIGHTS, strict=True)
        )
        before = mean @ (s.middle.T @ (own + beyond[i]))
        after = mean.T @ (s.middle.T @ beyond[i])
        result[i] = 0.5 * (before + after)
        if rod.parent >= 0:
            beyond_force[rod.parent] += beyond_force[i] + rod.middle_force
            beyond[rod.parent] += beyond[i] + own
    return result


def relax(
    rods: list[Rod], omega: NDArray[np.float64], alpha: float, cycles: int = 4000
) -> NDArray[np.float64]:
    """Cycles of eqs 3, 5 and 7 until nothing changes any more."""
    rest = np.array([rod.rest for rod in rods])
    rigidity = np.array([rod.rigidity for rod in rods])
    for _ in range(cycles):
        wanted = rest + torques(rods, omega) / rigidity
        if np.abs(wanted - omega).max() < 1e-9:
            return wanted
        omega = (1.0 - alpha) * omega + alpha * wanted
    raise AssertionError("the relaxation does not converge")
