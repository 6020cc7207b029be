"""Trees and tables in the forms that other programs read and write."""

from forest.interop.fvs import fvs_summary, fvs_treelist
from forest.interop.iland import iland_stand, iland_trees
from forest.interop.simpleforest import read_simpleforest, write_simpleforest
from forest.interop.treeqsm import read_treeqsm, write_treeqsm

__all__ = [
    "fvs_summary",
    "fvs_treelist",
    "iland_stand",
    "iland_trees",
    "read_simpleforest",
    "read_treeqsm",
    "write_simpleforest",
    "write_treeqsm",
]
