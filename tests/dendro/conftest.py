"""One small stand with noisy weather, grown once for all tests of this room."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate

# The last year ends in 9.
NOISY_STAND = """
title = "pines over beeches"
years = 60
start_year = 1950
seed = 5
plot = { size_m = [10, 10], boundary = "periodic" }
climate = { noise_sd = 0.3 }
environment = { shadow = {}, canopy = {} }
species = { pinus_sylvestris = {}, fagus_sylvatica = {} }
planting = { kind = "random", density_ha = 1900 }
output = { sample_trees = { ids = [1] } }
"""


@pytest.fixture(scope="session")
def noisy_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    path: Path = tmp_path_factory.mktemp("dendro") / "run.h5"
    with simulate(Scenario.from_toml(NOISY_STAND), path) as run:
        yield run
