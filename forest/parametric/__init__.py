"""Trees that were not simulated, made from parameters by the model of Weber & Penn (1995)."""

from forest.parametric.growing import grow, grow_many
from forest.parametric.tree import Nodes, ParametricTree, Stems
from forest.species.parametric import (
    Level,
    Parameters,
    from_paper,
    load_parameters,
    parametric_names,
)

__all__ = [
    "Level",
    "Nodes",
    "Parameters",
    "ParametricTree",
    "Stems",
    "from_paper",
    "grow",
    "grow_many",
    "load_parameters",
    "parametric_names",
]
