"""What growth kernels know of the species and of the year: plain arrays and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.species import Species

#: Orders told apart where a parameter is given by order; higher orders use the last.
MAX_ORDERS = 8

# Rows of SpeciesTraits.curve_*: which user-drawn curve (Taylor-Hell 2005, 3.1). Not plain numbers:
# numba compiles a kernel anew for each of those.
LENGTH_BY_ORDER = np.int64(0)
SHOOTS_BY_HEIGHT = np.int64(1)
SHOOTS_BY_ORDER = np.int64(2)
SHOOTS_BY_PARENT_LENGTH = np.int64(3)
TROPISM_BY_AGE = np.int64(4)
TROPISM_BY_ORDER = np.int64(5)
_CURVES = (
    ("architecture", "internode_factor_by_order"),
    ("architecture", "shoots_by_height_in_year"),
    ("architecture", "shoots_by_order"),
    ("architecture", "shoots_by_parent_length"),
    ("shoots", "tropism_factor_by_age"),
    ("shoots", "tropism_factor_by_order"),
)


#: Numbers of a species that kernels read, in one record: float64, names and units as in the
#: species files, angles in radians.
TRAITS = (
    "internode_length",
    "branching_angle",
    "divergence_angle",
    "angle_jitter",
    "max_metamers",
    "max_order",
    "sylleptic",
    "sympodial",
    "alpha",
    "apical_bias",
    "w_max",
    "w_min",
    "kappa",
    "light_weight",
    "tropism_weight",
    "tropism_x",
    "tropism_y",
    "tropism_z",
    "shed_below",
    "pipe_exponent",
    "twig_diameter",
    "density",
    "leaf_area",
    "leaf_mass",
    "leaf_lifespan",
    "leaf_retention",
    "light_use",
    "light_half",
    "maintenance",
    "sapwood_years",
    "reserve_fraction",
    "ring_fraction",
    "branch_pipe",
    "hydraulic_length",
    "turgor_limit",
    "first_pipe",
    "suppression_ratio",
    "suppression_years",
    "deficit_years",
    "abortion",
    "support",
    "thickening",
    "min_growth",
    "offset_gain",
    "light_gain",
    "offset_length",
    "fresh_wood",
    "fresh_leaf",
    "sag",
)

#: Standard gravity, m/s2.
_GRAVITY = 9.80665


class SpeciesTraits(NamedTuple):
    """Species parameters as kernels read them.

    One array of records keeps the kernels' signatures small: forty arrays as arguments made
    them take three times as long to compile.

    Attributes
    ----------
    of : record array (species,)
        Fields `TRAITS`.
    apical_until : float64 (species, MAX_ORDERS)
        Age until which axes of an order are under apical control, years.
    curve_n : int64 (species, curves)
        Points of each user-drawn curve; 0 where there is none.
    curve_x, curve_y : float64 (species, curves, points)
        The points.
    """

    of: NDArray[Any]
    apical_until: NDArray[np.float64]
    curve_n: NDArray[np.int64]
    curve_x: NDArray[np.float64]
    curve_y: NDArray[np.float64]


class Year(NamedTuple):
    """What growth kernels know of the year."""

    step: int
    seed: int
    income_factor: NDArray[np.float64]  # (species,)
    full_light: float
    paper: bool
    balance: bool = False


def support(species: Sequence[Species], density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give k of supports(R, d) = k d R^2 (Hart & Baker 2003, 3.4, eqs 6 to 8), m.

    From the height limit h of a cone, k = pi h / 3, whatever the density; or, where a species gives
    its crushing strength sigma, k = pi sigma / (g d), so that pi R^2 sigma / g is supported.

    Parameters
    ----------
    species : sequence of Species
    density : float64 (species,)
        The d with which k will be used, kg/m3.

    Returns
    -------
    float64 (species,)
    """
    k = np.empty(len(species))
    for i, s in enumerate(species):
        strength = s.balance.crushing_strength_mpa
        if strength is None:
            k[i] = np.pi / 3.0 * s.balance.height_limit_m
        else:
            k[i] = np.pi * 1e6 * strength / (_GRAVITY * density[i])
    return k


def species_traits(
    species: Sequence[Species], *, paper: bool, bending: bool = False
) -> SpeciesTraits:
    """Pack the species' parameters for the kernels.

    In mass-balance mode pipes add by area, whatever the species' pipe exponent. Where trees bend,
    `sag` is d^4 per fresh mass and squared distance that keeps limbs from sagging, m2/kg; else 0.
    """

    def each(section: str, key: str, scale: float = 1.0) -> NDArray[np.float64]:
        return np.array([scale * getattr(getattr(s, section), key) for s in species], np.float64)

    def choice(section: str, key: str, value: str) -> NDArray[np.float64]:
        return np.array([getattr(getattr(s, section), key) == value for s in species], np.float64)

    degree = float(np.pi / 180.0)
    tropism = np.array([s.shoots.tropism_direction for s in species], np.float64).reshape(-1, 3)
    norm = np.linalg.norm(tropism, axis=1)
    tropism = tropism / np.where(norm > 0.0, norm, 1.0)[:, None]
    apical = np.full((len(species), MAX_ORDERS), np.inf)
    for row, s in enumerate(species):
        until = list(s.bud_fate.apical_control_until_age_years)[:MAX_ORDERS]
        if until:
            apical[row] = until[-1]
            apical[row, : len(until)] = until
    curves = [[list(getattr(getattr(s, a), b)) for a, b in _CURVES] for s in species]
    longest = max(1, *(len(c) for row in curves for c in row))
    curve_n = np.array([[len(c) for c in row] for row in curves], np.int64)
    curve_x = np.zeros((len(species), len(_CURVES), longest))
    curve_y = np.ones((len(species), len(_CURVES), longest))
    for row, of_species in enumerate(curves):
        for k, curve in enumerate(of_species):
            for j, (x, y) in enumerate(curve):
                curve_x[row, k, j] = x
                curve_y[row, k, j] = y
    stiffness = each("mechanics", "modulus_juvenile_gpa", 1e9) * each("mechanics", "sag_limit_rad")
    hydraulic = each("carbon", "hydraulic_length_m")
    turgor = each("carbon", "turgor_limit_m")
    values = {
        "internode_length": each("architecture", "internode_length_m"),
        "branching_angle": each("architecture", "branching_angle_deg", degree),
        "divergence_angle": each("architecture", "divergence_angle_deg", degree),
        "angle_jitter": each("architecture", "angle_jitter_deg", degree),
        "max_metamers": each("architecture", "max_metamers_per_shoot"),
        "max_order": each("architecture", "max_order"),
        "sylleptic": choice("architecture", "ramification", "sylleptic"),
        "sympodial": choice("architecture", "axis", "sympodial"),
        "alpha": each("bud_fate", "alpha"),
        "apical_bias": each("bud_fate", "apical_bias"),
        "w_max": each("bud_fate", "priority_w_max"),
        "w_min": each("bud_fate", "priority_w_min"),
        "kappa": each("bud_fate", "priority_kappa"),
        "light_weight": each("shoots", "light_weight"),
        "tropism_weight": each("shoots", "tropism_weight"),
        "tropism_x": np.ascontiguousarray(tropism[:, 0]),
        "tropism_y": np.ascontiguousarray(tropism[:, 1]),
        "tropism_z": np.ascontiguousarray(tropism[:, 2]),
        "shed_below": each("shedding", "light_per_internode"),
        "pipe_exponent": each("wood", "pipe_exponent") if paper else np.full(len(species), 2.0),
        "twig_diameter": each("wood", "twig_diameter_m"),
        "density": each("wood", "density_kg_m3"),
        "leaf_area": each("leaves", "area_m2"),
        "leaf_mass": each("leaves", "area_m2") / each("leaves", "sla_m2_kg"),
        "leaf_lifespan": each("leaves", "lifespan_years"),
        "leaf_retention": each("leaves", "retention_years"),
        "light_use": each("carbon", "light_use_efficiency_kg_m2"),
        "light_half": each("carbon", "light_half_saturation"),
        "maintenance": each("carbon", "maintenance_per_year"),
        "sapwood_years": each("carbon", "sapwood_years"),
        "reserve_fraction": each("carbon", "reserve_fraction"),
        "ring_fraction": each("carbon", "ring_fraction"),
        "branch_pipe": each("carbon", "branch_pipe_ratio"),
        "hydraulic_length": np.where(hydraulic > 0.0, hydraulic, np.inf),
        "turgor_limit": np.where(turgor > 0.0, turgor, np.inf),
        "first_pipe": each("carbon", "first_pipe_diameter_m"),
        "suppression_ratio": each("carbon", "suppression_ratio"),
        "suppression_years": each("carbon", "suppression_years"),
        "deficit_years": each("carbon", "deficit_years"),
        "abortion": each("carbon", "abortion_probability"),
        "support": support(species, each("wood", "density_kg_m3")),
        "thickening": each("balance", "thickening_m_kg_m2"),
        "min_growth": each("balance", "min_growth"),
        "offset_gain": each("balance", "offset_gain"),
        "light_gain": each("balance", "light_gain"),
        "offset_length": each("balance", "offset_length_factor"),
        "fresh_wood": each("mechanics", "green_density_kg_m3") / each("wood", "density_kg_m3"),
        "fresh_leaf": each("mechanics", "leaf_water_factor"),
        "sag": 64.0 * _GRAVITY / np.pi / stiffness if bending else np.zeros(len(species)),
    }
    of = np.zeros(len(species), [(name, np.float64) for name in TRAITS])
    for name in TRAITS:
        of[name] = values[name]
    return SpeciesTraits(of, apical, curve_n, curve_x, curve_y)
