"""Mirages and heat shimmer from physics: heated air, bent light, pictures and films.

Six lines from a scene's name to a picture::

    import nigemizu

    scene = nigemizu.load("pyramid")
    picture = scene.render(time=600.0)
    picture.save("mirage.png")

Importing this package is quick: the rooms (`nigemizu.air`, `nigemizu.heat`, `nigemizu.render` …) and the
libraries under them are loaded when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from nigemizu.errors import InputError, MachineError, NigemizuError, NigemizuWarning

if TYPE_CHECKING:
    from nigemizu.scene import Scene, builtin_scenes, load

__all__ = [
    "InputError",
    "MachineError",
    "NigemizuError",
    "NigemizuWarning",
    "Scene",
    "__version__",
    "builtin_scenes",
    "load",
]

_ROOMS = ("air", "field", "heat", "output", "render", "scene", "trace")
_FROM_SCENE = ("Scene", "builtin_scenes", "load")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("nigemizu")
    if name in _ROOMS:
        return importlib.import_module(f"nigemizu.{name}")
    if name in _FROM_SCENE:
        return getattr(importlib.import_module("nigemizu.scene"), name)
    raise AttributeError(f"module 'nigemizu' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_ROOMS})
