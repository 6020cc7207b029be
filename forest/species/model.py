"""The parameters of a species: what a species file may say.

Symbols in the descriptions are those of Palubicki et al. 2009 unless a source is named.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from forest.errors import nearest
from forest.species.anchorage import Anchorage
from forest.species.curves import Curve, FactorCurve
from forest.species.mortality import Mortality
from forest.species.regeneration import Regeneration
from forest.species.response import Response
from forest.species.schema import Refusal, Table, quantity

Direction = tuple[
    Annotated[float, Field(ge=-1, le=1)],
    Annotated[float, Field(ge=-1, le=1)],
    Annotated[float, Field(ge=-1, le=1)],
]
_Years = Annotated[float, Field(ge=0, le=10000)]


class Architecture(Table):
    """Where metamers and buds stand."""

    internode_length_m: float = quantity(
        0.2, "length of an internode that gets just enough", unit="m", ge=0.005, le=2
    )
    branching_angle_deg: float = quantity(
        45.0, "angle between an axis and its lateral bud", unit="degree", ge=0, le=150
    )
    divergence_angle_deg: float = quantity(
        137.5, "turn around the axis from one lateral bud to the next", unit="degree", ge=0, le=360
    )
    angle_jitter_deg: float = quantity(
        5.0, "largest deviation of both angles, all alike likely", unit="degree", ge=0, le=45
    )
    max_metamers_per_shoot: int = quantity(
        4, "most metamers that a bud makes in a year", ge=1, le=60
    )
    max_order: int = quantity(255, "highest branching order that still shoots", ge=0, le=255)
    ramification: Literal["proleptic", "sylleptic"] = quantity(
        "proleptic", "lateral buds shoot a year later (proleptic) or at once (sylleptic)", unit=""
    )
    axis: Literal["monopodial", "sympodial"] = quantity(
        "monopodial",
        "the terminal bud goes on (monopodial) or flowers and dies (sympodial)",
        unit="",
    )
    internode_factor_by_order: FactorCurve = quantity(
        (), "factor of the internode length by order (Taylor-Hell 2005, 3.1)"
    )
    shoots_by_height_in_year: Curve = quantity(
        (), "f1: a bud's readiness by its place in the year's shoot, 0..1 (Taylor-Hell 2005, 3.1)"
    )
    shoots_by_order: Curve = quantity((), "f2: a bud's readiness by order (Taylor-Hell 2005, 3.1)")
    shoots_by_parent_length: Curve = quantity(
        (), "f3: a bud's readiness by the parent internode's length in m (Taylor-Hell 2005, 3.1)"
    )


class BudFate(Table):
    """How an axis shares its resource among its buds (4.2)."""

    alpha: float = quantity(2.0, "resource per light at the base (alpha)", gt=0, le=100)
    apical_bias: float = quantity(
        0.54, "bias of the main axis in the Borchert-Honda model (lambda)", ge=0, le=1
    )
    priority_w_max: float = quantity(
        1.0, "weight of the first in the priority list (w_max)", gt=0, le=1000
    )
    priority_w_min: float = quantity(
        0.006, "weight from place kappa N of the list on (w_min)", ge=0, le=1000
    )
    priority_kappa: float = quantity(
        0.5, "share of the list over which the weight falls (kappa)", ge=0, le=1
    )
    apical_control_until_age_years: tuple[_Years, ...] = quantity(
        (),
        "age of the tree at which apical control of its axes ends, by their order; the last entry "
        "holds for all higher orders; empty = it never ends",
        unit="year",
        max_length=8,
    )


class Shoots(Table):
    """Which way shoots grow (4.3) and how buds feel for space (4.1)."""

    light_weight: float = quantity(0.4, "weight of the best direction of growth (xi)", ge=0, le=10)
    tropism_weight: float = quantity(0.1, "weight of the tropism (eta)", ge=-10, le=10)
    tropism_direction: Direction = quantity((0.0, 0.0, 1.0), "direction of the tropism, z up")
    tropism_factor_by_age: Curve = quantity((), "factor of the tropism by the tree's age in years")
    tropism_factor_by_order: Curve = quantity((), "factor of the tropism by branching order")
    perception_angle_deg: float = quantity(
        90.0, "full opening angle of a bud's perception cone (theta)", unit="degree", gt=0, le=360
    )
    perception_distance_internodes: float = quantity(
        5.0, "reach of a bud's perception cone (r)", unit="internode", gt=0, le=20
    )
    occupancy_radius_internodes: float = quantity(
        2.0, "radius of the space that a bud occupies (rho)", unit="internode", gt=0, le=20
    )

    @model_validator(mode="after")
    def _has_direction(self) -> Shoots:
        if not any(self.tropism_direction):
            raise Refusal(
                "a direction of length 0",
                key="tropism_direction",
                expected="a vector, e.g. [0, 0, 1]",
            )
        return self


class Shedding(Table):
    """When branches are dropped (4.4)."""

    light_per_internode: float = quantity(
        0.0, "a branch with less light per internode than this is dropped", ge=0, le=10
    )


class Wood(Table):
    """Pipes and wood (4.5)."""

    pipe_exponent: float = quantity(
        2.5, "n of the pipe model d^n in paper mode; mass balance uses 2", ge=1, le=4
    )
    twig_diameter_m: float = quantity(
        0.004, "diameter of an internode that carries one bud", unit="m", ge=0.0001, le=0.1
    )
    density_kg_m3: float = quantity(
        450.0, "dry mass per fresh volume of wood", unit="kg/m3", ge=50, le=1500
    )


class Leaves(Table):
    """The leaves at a bud site."""

    area_m2: float = quantity(0.01, "leaf area of a living site", unit="m2", gt=0, le=10)
    sla_m2_kg: float = quantity(12.0, "leaf area per leaf dry mass", unit="m2/kg", ge=1, le=100)
    lifespan_years: float = quantity(
        2.0, "years over which a leaf's cost is spread", unit="year", ge=0.25, le=20
    )
    retention_years: int = quantity(
        0, "years that a site keeps foliage; 0 = as long as it lives", unit="year", ge=0, le=50
    )
    shade_factor: float = quantity(
        1.0, "shadow of a bud as a multiple of the scenario's a (kept to 1/16)", ge=0, le=16
    )


class Carbon(Table):
    """The annual mass balance of a tree."""

    light_use_efficiency_kg_m2: float = quantity(
        1.3, "yearly income per leaf area at full light (epsilon)", unit="kg/m2", gt=0, le=20
    )
    light_half_saturation: float = quantity(
        0.0,
        "light, as a share of full light, at which leaves earn half of what endless light would "
        "give; the less, the more tolerant of shade (Pacala et al. 1996); 0 = income in proportion "
        "to light",
        ge=0,
        le=100,
    )
    maintenance_per_year: float = quantity(
        0.01, "upkeep as a share of the sapwood's mass", unit="1/year", ge=0, le=1
    )
    sapwood_years: float = quantity(25.0, "rings that are sapwood (tau)", unit="year", ge=1, le=500)
    reserve_fraction: float = quantity(
        0.3, "share of what a tree has that it keeps as reserve (beta)", ge=0, le=0.95
    )
    ring_fraction: float = quantity(
        0.7, "least share of spending that goes into the ring (phi)", ge=0, le=0.99
    )
    branch_pipe_ratio: float = quantity(
        0.35, "cross-section of a pipe along a branch per that along the stem (kappa)", gt=0, le=1
    )
    hydraulic_length_m: float = quantity(
        30.0,
        "path from the ground at which hydraulic limitation halves income "
        "(Ryan and Yoder 1997); 0 = off",
        unit="m",
        ge=0,
        le=10000,
    )
    turgor_limit_m: float = quantity(
        0.0,
        "height at which water tension leaves new internodes no length: they shorten linearly "
        "towards it (Koch et al. 2004); 0 = off",
        unit="m",
        ge=0,
        le=10000,
    )
    first_pipe_diameter_m: float = quantity(
        0.001, "diameter of a new metamer's pipe to the ground; 0 = free", unit="m", ge=0, le=0.05
    )
    suppression_ratio: float = quantity(
        0.25, "net income per income below which a year is bad (theta)", ge=-1, le=1
    )
    suppression_years: int = quantity(
        5, "bad years in a row after which a tree dies", unit="year", ge=1, le=200
    )
    deficit_years: int = quantity(
        2,
        "years in a row that a site may fail to pay before it may abort",
        unit="year",
        ge=1,
        le=200,
    )
    abortion_probability: float = quantity(
        0.2, "chance a year that a site which does not pay aborts", unit="1/year", ge=0, le=1
    )
    vigour_sd: float = quantity(
        0.05, "lasting differences of income between trees, standard deviation", ge=0, le=0.5
    )
    seed_reserve_kg: float = quantity(0.001, "reserve of a seedling", unit="kg", gt=0, le=10)


class Balance(Table):
    """Support, and the allocation that keeps a tree in balance (Hart and Baker 2003, 3.4, 4.1)."""

    height_limit_m: float = quantity(
        91.44,
        "height of the tallest cone of the wood that supports itself (eq. 8: 300 feet)",
        unit="m",
        ge=1,
        le=10000,
    )
    crushing_strength_mpa: float | None = quantity(
        None,
        "stress at which green wood is crushed along the grain; where given, support follows from "
        "it in place of height_limit_m",
        unit="MPa",
        gt=0,
        le=200,
    )
    thickening_m_kg_m2: float = quantity(
        0.0003,
        "radius that the trunk gains in a year per lit leaf area and mass of the tree, in paper "
        "mode (alpha_photosynthesis, eq. 16)",
        unit="m kg/m2",
        ge=0,
        le=10,
    )
    min_growth: float = quantity(0.1, "least growth rate of a limb", ge=0, le=1)
    offset_gain: float = quantity(0.45, "weight of the limb's offset, 1 + o_i", ge=0, le=10)
    light_gain: float = quantity(
        1.0, "weight of the limb's lit leaf area p_i", unit="1/m2", ge=0, le=1000
    )
    offset_length_factor: float = quantity(
        1.0, "length that scales the offset, in radii of the trunk's base", gt=0, le=1000
    )


class Mechanics(Table):
    """How stiff, strong and heavy the wood is, and how it rights leaning axes."""

    modulus_juvenile_gpa: float = quantity(
        6.0, "Young's modulus of new wood (E_juv, Taylor-Hell 2005, 6.1)", unit="GPa", gt=0, le=50
    )
    modulus_mature_gpa: float = quantity(
        10.0, "Young's modulus that old wood approaches (E_mature)", unit="GPa", gt=0, le=50
    )
    maturing_years: float = quantity(
        10.0,
        "years of maturing: wood goes 1/years of the rest of its way a year",
        unit="year",
        ge=1,
        le=500,
    )
    modulus_reaction_gpa: float = quantity(
        11.0, "Young's modulus of reaction wood (E_rw, eq. 18)", unit="GPa", gt=0, le=50
    )
    shear_ratio: float = quantity(
        0.06, "shear modulus per Young's modulus along the grain (G/E)", gt=0, le=0.5
    )
    rupture_mpa: float = quantity(
        60.0, "bending stress at which green wood breaks", unit="MPa", gt=0, le=300
    )
    green_density_kg_m3: float = quantity(
        950.0, "fresh mass, water included, per fresh volume of wood", unit="kg/m3", ge=100, le=1500
    )
    leaf_water_factor: float = quantity(2.5, "fresh mass per dry mass of leaves", ge=1, le=20)
    fruit_mass_kg: float = quantity(
        0.0, "fresh mass of the fruit at a living site in summer", unit="kg", ge=0, le=10
    )
    drag_coefficient: float = quantity(
        0.3, "drag of the crown per frontal area, before leaves stream with the wind", ge=0, le=2
    )
    wind_stress_limit: float = quantity(
        0.05,
        "stress in the usual wind, as a share of rupture_mpa, beyond which a stem thickens first "
        "and spends less on length (wind_growth)",
        gt=0,
        le=1,
    )
    tropic_torque_nm: float = quantity(
        0.0,
        "torque that turns a level new metamer upwards, below 0 downwards (F_tropic with the unit "
        "heading, Taylor-Hell 2005, eqs 4 and 6); 0 = off",
        unit="N m",
        ge=-100,
        le=100,
    )
    stem_angle_deg: float = quantity(
        0.0, "angle to the vertical that a stem seeks", unit="degree", ge=0, le=180
    )
    branch_angle_deg: float = quantity(
        60.0, "angle to the vertical that a branch seeks", unit="degree", ge=0, le=180
    )
    righting_from_deg: float = quantity(
        2.0,
        "departure from that angle from which an axis rights itself",
        unit="degree",
        ge=0,
        le=90,
    )
    righting_span_deg: float = quantity(
        10.0, "departure beyond it at which reaction is full", unit="degree", gt=0, le=180
    )
    ring_strain: float = quantity(
        0.0015,
        "mean maturation strain of a full reaction ring: contraction of tension wood, expansion of "
        "compression wood (e0)",
        ge=0,
        le=0.05,
    )
    ring_strain_difference: float = quantity(
        0.002, "maturation strain of reaction wood beyond the opposite side's (D)", ge=0, le=0.05
    )
    ring_swell: float = quantity(
        1.5, "width of a reaction ring along the bending direction per width across it", ge=1, le=2
    )
    sag_limit_rad: float = quantity(
        0.3,
        "turn by which a level limb may sag at its tip; what would sag more is thickened first "
        "where trees bend, in mass-balance mode (elastic similarity, McMahon and Kronauer 1976)",
        unit="rad",
        gt=0,
        le=10,
    )
    deviation_limit_rad_m: float = quantity(
        0.05,
        "departure from the rest curvature beyond which beta righting sets in (xi)",
        unit="rad/m",
        ge=0,
        le=1000,
    )
    rest_share: float = quantity(
        0.5, "share of the rest curvature in a reaction ring's (beta, eq. 19)", ge=0, le=1
    )


class Mensuration(Table):
    """How foresters measure the species."""

    bark_factor: float = quantity(0.05, "double bark thickness per dbh over bark", ge=0, le=0.5)
    merchantable_top_cm: float = quantity(
        7.0, "diameter over bark down to which a stem is merchantable", unit="cm", ge=0, le=100
    )
    stump_height_m: float = quantity(0.3, "height of the stump", unit="m", ge=0, le=2)
    max_sdi: float = quantity(
        900.0,
        "stand density index (Reineke) of the densest pure stands",
        unit="1/ha",
        ge=100,
        le=5000,
    )


SECTIONS: dict[str, type[Table]] = {
    "architecture": Architecture,
    "bud_fate": BudFate,
    "shoots": Shoots,
    "shedding": Shedding,
    "wood": Wood,
    "leaves": Leaves,
    "carbon": Carbon,
    "balance": Balance,
    "mechanics": Mechanics,
    "mensuration": Mensuration,
    "mortality": Mortality,
    "response": Response,
    "regeneration": Regeneration,
    "anchorage": Anchorage,
}


class Species(Table):
    """A species: its names, its parameters by section and where each value comes from.

    Shipped species are read by `load_species`; a scenario may override any parameter.
    """

    name: str = quantity(..., "name in scenarios and tables", unit="", min_length=1, max_length=60)
    common_name: str = quantity("", "common name", unit="", max_length=60)
    group: Literal["conifer", "broadleaf"] = quantity("conifer", "kind of tree", unit="")
    architecture: Architecture = Architecture()
    bud_fate: BudFate = BudFate()
    shoots: Shoots = Shoots()
    shedding: Shedding = Shedding()
    wood: Wood = Wood()
    leaves: Leaves = Leaves()
    carbon: Carbon = Carbon()
    balance: Balance = Balance()
    mechanics: Mechanics = Mechanics()
    mensuration: Mensuration = Mensuration()
    mortality: Mortality = Mortality()
    response: Response = Response()
    regeneration: Regeneration = Regeneration()
    anchorage: Anchorage = Anchorage()
    sources: dict[str, dict[str, str]] = Field(
        default={},
        description="where each value comes from: a table of texts per section",
        json_schema_extra={"unit": ""},
    )

    @model_validator(mode="after")
    def _sources_name_parameters(self) -> Species:
        for section, entries in self.sources.items():
            if section not in SECTIONS:
                hint = nearest(section, SECTIONS)
                raise Refusal(f"unknown section {section!r}, {hint}", key="sources")
            for key in entries:
                if key not in SECTIONS[section].model_fields:
                    hint = nearest(key, SECTIONS[section].model_fields)
                    raise Refusal(f"unknown key {key!r}, {hint}", key=f"sources.{section}")
        return self
