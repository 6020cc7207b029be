"""What lies under the pointer: the first thing that a line of sight meets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

_LEAST_DETERMINANT = 1e-12


class Ray(NamedTuple):
    """A line of sight.

    Attributes
    ----------
    origin, direction : float64 (3,)
        m; the direction has length 1.
    """

    origin: Vector
    direction: Vector

    def at(self, distance: float) -> Vector:
        """Give the point at a distance (m) from the origin."""
        return self.origin + distance * self.direction

    def on_plane(self, point: Vector, normal: Vector) -> Vector | None:
        """Give where it meets a plane; None if it runs along it or away from it."""
        facing = float(self.direction @ normal)
        if abs(facing) < 1e-9:
            return None
        distance = float((point - self.origin) @ normal) / facing
        return self.at(distance) if distance > 0.0 else None


class Hit(NamedTuple):
    """What was pointed at.

    Attributes
    ----------
    tree_id : int or None
        The tree, if one lies there.
    serial : int or None
        The metamer, where the tree is shown with its branches.
    point_m : float64 (3,) or None
        The point on the tree or else on the ground, m in the plot.
    ray : Ray
        The line of sight.
    pressure : float
        Pressure of the pen, 0 to 1; 0.5 of a mouse's button.
    """

    tree_id: int | None
    serial: int | None
    point_m: Vector | None
    ray: Ray
    pressure: float = 0.5


def first_triangle(
    points: NDArray[np.float32], triangles: NDArray[np.int32], ray: Ray
) -> tuple[int, float] | None:
    """Find the first triangle that a ray meets (Moeller & Trumbore 1997, both sides).

    Parameters
    ----------
    points : float32 (n, 3)
        m.
    triangles : int32 (m, 3)
        Numbers of points.

    Returns
    -------
    (int, float) or None
        Number of the triangle, and its distance from the origin, m.
    """
    if not len(triangles):
        return None
    near = (points.astype(np.float64) - ray.origin).T
    # Along the ray, and across it: most triangles lie aside.
    side = np.cross(ray.direction, (0.0, 0.0, 1.0) if abs(ray.direction[2]) < 0.9 else (1.0, 0, 0))
    side /= np.linalg.norm(side)
    other = np.cross(ray.direction, side)
    u, v = side @ near, other @ near
    a, b, c = triangles.T
    low_u, high_u = (
        np.minimum(np.minimum(u[a], u[b]), u[c]),
        np.maximum(np.maximum(u[a], u[b]), u[c]),
    )
    low_v, high_v = (
        np.minimum(np.minimum(v[a], v[b]), v[c]),
        np.maximum(np.maximum(v[a], v[b]), v[c]),
    )
    chosen = np.flatnonzero((low_u <= 0.0) & (high_u >= 0.0) & (low_v <= 0.0) & (high_v >= 0.0))
    if not len(chosen):
        return None
    corner, second, third = (near[:, triangles[chosen, k]].T for k in range(3))
    one, two = second - corner, third - corner
    p = np.cross(ray.direction, two)
    determinant = np.einsum("ij,ij->i", one, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_one = np.einsum("ij,ij->i", -corner, p) / determinant
        q = np.cross(-corner, one)
        along_two = (q @ ray.direction) / determinant
        distance = np.einsum("ij,ij->i", two, q) / determinant
    met = (np.abs(determinant) > _LEAST_DETERMINANT) & (distance > 0.0)
    met &= (along_one >= 0.0) & (along_two >= 0.0) & (along_one + along_two <= 1.0)
    if not met.any():
        return None
    best = int(np.argmin(np.where(met, distance, np.inf)))
    return int(chosen[best]), float(distance[best])


def nearest_segment(
    start: Vector, end: Vector, radius: Vector, ray: Ray, slack: float
) -> tuple[int, float] | None:
    """Find the segment that a ray passes within its radius and some slack, the nearest first.

    Parameters
    ----------
    start, end : float64 (n, 3)
        m.
    radius : float64 (n,)
        m.
    slack : float
        Half the angle that a pointer covers, radians: a far twig is hit as easily as a near one.

    Returns
    -------
    (int, float) or None
        Number of the segment, and the distance from the origin, m.
    """
    if not len(start):
        return None
    axis = end - start
    away = start - ray.origin
    along = axis @ ray.direction
    squared = np.einsum("ij,ij->i", axis, axis)
    off = np.einsum("ij,ij->i", axis, away)
    depth = away @ ray.direction
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.clip(np.nan_to_num((along * depth - off) / (squared - along**2)), 0.0, 1.0)
    closest = away + t[:, None] * axis
    distance = closest @ ray.direction
    gap = np.linalg.norm(closest - distance[:, None] * ray.direction, axis=1)
    reach = radius + slack * np.maximum(distance, 0.0)
    met = (gap <= reach) & (distance > 0.0)
    if not met.any():
        return None
    # Of those under the pointer the best aimed at; wood in front hides wood behind it.
    score = np.where(met, distance * (1.0 + 0.05 * gap / reach), np.inf)
    best = int(np.argmin(score))
    return best, float(distance[best])
