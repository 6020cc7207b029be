"""The usual panels of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from forest.viewer.card import TreeCard
from forest.viewer.light_panel import LightPanel
from forest.viewer.overview import StandPanel
from forest.viewer.plan import PlanPanel

usual_panels: tuple[Callable[[Any], Any], ...] = (StandPanel, TreeCard, PlanPanel, LightPanel)
