# The cells of rings.ipynb, which `make notebook` writes and executes.
# ruff: noqa: E402

# %% [markdown]
# # Rings, from the stand to the chronology
#
# A small pine stand with some beeches is grown, and its rings are read as a dendrochronologist
# would: cores, a chronology beside the weather, the age trend, and Pressler's law along a stem.

# %%
import forest

scenario = forest.Scenario.from_toml("""
title = "pines over beeches"
years = 80
start_year = 1940
seed = 5
plot = { size_m = [15, 15], boundary = "periodic" }
climate = { noise_sd = 0.2 }
environment = { shadow = {}, canopy = {} }
species = { pinus_sylvestris = { share = 3 }, fagus_sylvatica = { share = 1 } }
planting = { kind = "random", density_ha = 4000 }
""")
run = forest.simulate(scenario, out="rings.h5", overwrite=True)
whole = run.stand[run.stand.species == "all"].set_index("year")
whole.loc[1959::20, ["n_ha", "qmd_cm", "top_height_m", "basal_area_m2ha"]].round(1)

# %% [markdown]
# ## Cores
#
# Two cores from each of the eight thickest trees. `about` says whose they are.

# %%
from forest import dendro

cores = dendro.campaign(run.rings, run.trees, year=int(run.years[-1]), n_trees=8, seed=3)
cores.about[["tree_id", "species", "azimuth_deg", "first_year", "pith_offset", "miss_mm"]].head()

# %% [markdown]
# The chronology is the mean of the widths, each divided by its running mean of eleven years. Do the
# cores agree with each other, and does the chronology follow the weather that the run was given?

# %%
chronology = (cores.widths / cores.widths.rolling(11, center=True, min_periods=6).mean()).mean(
    axis=1
)
weather = run.climate.drop_duplicates("year").set_index("year").factor.loc[chronology.index]
print(f"interseries correlation {dendro.interseries_correlation(cores.widths).mean():.2f}")
print(f"chronology and weather  {chronology.corr(weather):.2f}")

# %%
import matplotlib.pyplot as plt

figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 4), sharex=True, layout="constrained")
upper.plot(cores.widths, color="tab:brown", lw=0.5, alpha=0.5)
upper.set(ylabel="ring width, mm", ylim=(0, None))
lower.plot(chronology, color="tab:brown", label="chronology")
lower.plot(weather, color="tab:blue", lw=1, label="factor on income")
lower.legend(frameon=False, ncols=2)
plt.show()

# %% [markdown]
# ## Means beside published ones
#
# All living trees with 30 rings or more, as `analysis/ring_series.py` has them.

# %%
from analysis import ring_series

ring_series.study(run).numbers.round(2)

# %% [markdown]
# ## Pressler's law
#
# The ring widens from the butt to the crown, while its area stays the same: what the crown sends
# down passes every section below it. `analysis/pressler.py` measures it in the trees that have
# three discs or more below their crown; below, the tree with the widest ring among them.

# %%
from analysis import pressler

profiles = pressler.profiles(run)
pressler.table(profiles).round(3)

# %%
widest = profiles.loc[profiles.width_mm.idxmax(), "tree_id"]
profiles[profiles.tree_id == widest].round(2)
