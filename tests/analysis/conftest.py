"""A dense stand of pines with some beeches, grown once for all tests of this room."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate

DENSE_STAND = """
title = "crowded pines among beeches"
years = 40
start_year = 1960
seed = 3
plot = { size_m = [10, 10], boundary = "periodic" }
climate = { noise_sd = 0.2 }
environment = { shadow = {}, canopy = {} }
species = { pinus_sylvestris = { share = 3 }, fagus_sylvatica = { share = 1 } }
planting = { kind = "random", density_ha = 6000 }
output = { sample_trees = { ids = [1], dbh_quantiles = [0.8, 0.9, 0.95, 1.0], at_year = 1975 } }
"""


@pytest.fixture(scope="session")
def dense_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    path: Path = tmp_path_factory.mktemp("analysis") / "run.h5"
    with simulate(Scenario.from_toml(DENSE_STAND), path) as run:
        yield run
