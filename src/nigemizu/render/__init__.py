"""Light: the only room of the package that knows Mitsuba.

The values here describe a picture (camera, light, objects, materials) and need no Mitsuba; the functions
that render import it when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

from nigemizu.render.camera import Camera
from nigemizu.render.diffraction import diffract
from nigemizu.render.light import Light, Moon
from nigemizu.render.materials import Asphalt, Checker, Colour, Dots, Masonry, Material, Sand, Texture, Water
from nigemizu.render.noise import Noise, add_noise
from nigemizu.render.objects import (
    Aircraft,
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

if TYPE_CHECKING:
    from nigemizu.render.assembly import build
    from nigemizu.render.frame import Frame, surface_query
    from nigemizu.render.globe import Globe
    from nigemizu.render.media import medium_of
    from nigemizu.render.passes import Picture, picture
    from nigemizu.render.path_tracer import integrator
    from nigemizu.render.sensors import lens_sensors
    from nigemizu.render.settings import Settings
    from nigemizu.render.variant import register, select_variant

__all__ = [
    "Aircraft",
    "Asphalt",
    "Box",
    "Camera",
    "Checker",
    "Colour",
    "Dots",
    "Frame",
    "Globe",
    "Ground",
    "Hills",
    "Light",
    "Masonry",
    "Material",
    "Mesh",
    "MitsubaFile",
    "Moon",
    "Noise",
    "Object",
    "Picture",
    "Pole",
    "Pyramid",
    "Road",
    "Sand",
    "Settings",
    "Sphere",
    "Texture",
    "Vehicle",
    "Water",
    "add_noise",
    "build",
    "diffract",
    "integrator",
    "lens_sensors",
    "medium_of",
    "picture",
    "register",
    "select_variant",
    "surface_query",
]

# Loaded when first used: these modules import Mitsuba.
_NEEDS_MITSUBA: Final = {
    "Frame": "frame",
    "Globe": "globe",
    "Picture": "passes",
    "Settings": "settings",
    "build": "assembly",
    "integrator": "path_tracer",
    "lens_sensors": "sensors",
    "medium_of": "media",
    "picture": "passes",
    "register": "variant",
    "select_variant": "variant",
    "surface_query": "frame",
}


def __getattr__(name: str) -> Any:
    if name in _NEEDS_MITSUBA:
        module = importlib.import_module(f"nigemizu.render.{_NEEDS_MITSUBA[name]}")
        found = globals()[name] = getattr(module, name)
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
