"""Scenarios: what the user says about a run, checked once, at the door."""

from forest.scenario.scenario import Scenario
from forest.species.schema import Row, describe

__all__ = ["Row", "Scenario", "describe"]
