"""What stands in a view: trees at their places, ground, grass, sun and haze."""

from forest.view.scenery.build import build_scenery, load_scenery
from forest.view.scenery.file import SceneFile
from forest.view.scenery.from_run import scenery_of_run, scenery_of_stand
from forest.view.scenery.meshed import scene_of
from forest.view.scenery.scenery import Haze, Scenery, Viewpoint

__all__ = [
    "Haze",
    "SceneFile",
    "Scenery",
    "Viewpoint",
    "build_scenery",
    "load_scenery",
    "scene_of",
    "scenery_of_run",
    "scenery_of_stand",
]
