"""A small young forest in which all happens that can: what it needs, and how it is varied."""

from __future__ import annotations

from forest.scenario import Scenario

YEARS = 14

TOML = f"""
title = "everything at once"
years = {YEARS}
start_year = 2001
seed = 5
plot = {{ size_m = [10, 10], boundary = "periodic" }}
environment = {{ shadow = {{}}, canopy = {{}}, markers = {{}} }}
planting = {{ kind = "random", density_ha = 9000, min_distance_m = 0.3 }}
output = {{ checkpoint_every_years = 3, sample_trees = {{ ids = [1, 2], dbh_quantiles = [0.9] }} }}

[climate]
series = [{{ year = 2001, drought_index = 0.2 }}, {{ year = 2002, drought_index = -1.5 }}]
extreme_years = [{{ year = 2012, factor = 0.2 }}]
noise_sd = 0.1
[climate.generator]
extreme_probability = 0.2
drought_index = {{ mean = 0, sd = 1, autocorrelation = 0.5, extreme_shift_sd = -2 }}

[species.pinus_sylvestris]
share = 1
mortality = {{ longevity_years = 14, snag_half_life_years = 2 }}
[species.betula_pendula]
share = 2
mortality = {{ background_per_year = 0.08 }}
regeneration = {{ maturity_height_m = 1.0, seeds_per_leaf_m2 = 500 }}
[species.fagus_sylvatica]
share = 2
carbon = {{ suppression_years = 1 }}

[regeneration]
handover_height_m = 0.5
seed_rain = {{ pinus_sylvestris = 10, fagus_sylvatica = 4 }}

[mortality]
age = true
background = true
snags = true
events = [
    {{ year = 2005, x_m = 9, y_m = 1, radius_m = 2.5, cause = "fire" }},
    {{ year = 2008, share = 0.1, cause = "insects" }},
    {{ year = 2009, share = 0.1, max_dbh_cm = 3, cause = "wind" }},
    {{ year = 2004, tree_id = 3 }},
]

[wind]
from_height_m = 1.8
anchorage = 0.1
storms = [{{ year = 2011, speed_m_s = 14, direction_deg = 30 }}]
yearly = {{ mode_m_s = 5, dispersion_m_s = 3 }}

[[acts]]
kind = "thin"
when = "n_ha > 6000"
from_year = 2004
wait_years = 3
method = "random"
share_n = 0.15

[[acts]]
kind = "thin"
when = "age >= 8"
at_most = 1
method = "selective"
crop_trees_ha = 500
cause = "tending"

[[acts]]
kind = "prune"
every_years = 4
from_year = 2005
thickest_ha = 500
below_share = 0.3

[[acts]]
kind = "mark"
year = 2003
tree_ids = [9, 12]
mark = "crop"

[[acts]]
kind = "prune"
year = 2006
marked = "crop"
below_m = 0.35

[[acts]]
kind = "bend"
year = 2003
tree_id = 9
metamer = 1
to_m = [3.7, 6.11, 0.38]

[[acts]]
kind = "crack"
years = [2003, 2005]
tree_id = 9
height_m = 0.1
azimuth_deg = 250

[[acts]]
kind = "obstacle"
year = 2004
add = {{ kind = "box", name = "wall", min_m = [4.0, 3.0, 0.4], max_m = [4.6, 7.0, 1.0] }}

[[acts]]
kind = "obstacle"
year = 2006
move = "wall"
by_m = [0.4, 0.0, 0.2]

[[acts]]
kind = "obstacle"
year = 2009
remove = "wall"

[[acts]]
kind = "stroke"
year = 2004
points_m = [[3.0, 3.0, 0.5], [6.0, 6.0, 1.5]]
radius_m = [0.3, 0.8]
steps = 4
rotation = {{ x_m = 5.0, y_m = 5.0, times = 2 }}

[[acts]]
kind = "stroke"
year = 2005
tree_id = 9
metamer = 1
from_metamer = 1
points_m = [[4.0, 6.11, 0.9]]
radius_m = 0.4
hold_steps = 2

[[acts]]
kind = "harvest"
year = 2010
method = "gap"
gap = {{ kind = "circle", x_m = 0, y_m = 5, radius_m = 2.5 }}

[[acts]]
kind = "plant"
years = [2010, 2013]
pattern = "random"
density_ha = 1500
"""

#: What of the forest's physics is varied.
VARIANTS = {
    "upright": (),
    "bending": (
        "mechanics={wind_m_s=12, wind_growth=true}",
        "mortality.buckling=true",
        "species.betula_pendula.mechanics.modulus_juvenile_gpa=0.02",
    ),
}


def everything(*overrides: str) -> Scenario:
    """Give the scenario, changed as `--set` would."""
    return Scenario.from_toml(TOML).with_overrides(overrides)
