"""What trees look like from outside, at a given distance."""

from forest.surface.camera import Camera
from forest.surface.description import Description, Drawing, Primitives, describe
from forest.surface.detail import Fractions, Sight, fractions
from forest.surface.frame import Frame, prepare
from forest.surface.instances import Instances, Model
from forest.surface.mesh import Mesh
from forest.surface.shadow import SceneShadow, own_shadows, scene_shadow

__all__ = [
    "Camera",
    "Description",
    "Drawing",
    "Fractions",
    "Frame",
    "Instances",
    "Mesh",
    "Model",
    "Primitives",
    "SceneShadow",
    "Sight",
    "describe",
    "fractions",
    "own_shadows",
    "prepare",
    "scene_shadow",
]
