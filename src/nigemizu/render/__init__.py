"""Light: the only room of the package that knows Mitsuba.

The values here describe a picture (camera, light, objects, materials) and need no Mitsuba; the functions
that render import it when they are first used.
"""

from __future__ import annotations

from nigemizu.render.camera import Camera
from nigemizu.render.light import Light
from nigemizu.render.materials import Asphalt, Checker, Colour, Masonry, Material, Sand, Texture
from nigemizu.render.objects import (
    Box,
    Ground,
    Hills,
    Mesh,
    MitsubaFile,
    Object,
    Pole,
    Pyramid,
    Road,
    Sphere,
    Vehicle,
)

__all__ = [
    "Asphalt",
    "Box",
    "Camera",
    "Checker",
    "Colour",
    "Ground",
    "Hills",
    "Light",
    "Masonry",
    "Material",
    "Mesh",
    "MitsubaFile",
    "Object",
    "Pole",
    "Pyramid",
    "Road",
    "Sand",
    "Sphere",
    "Texture",
    "Vehicle",
]
