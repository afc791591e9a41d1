"""Files that people open: pictures, films, air, diagrams. Whole or not at all, and saying what made them.

The names are imported when they are first used, so that checking a path needs no codec.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from nigemizu.output.air import write_air
    from nigemizu.output.diagram import ray_diagram
    from nigemizu.output.displacement import displacement_figure
    from nigemizu.output.files import ready_to_write, whole_file, whole_folder
    from nigemizu.output.film import write_film
    from nigemizu.output.frames import FrameFolder
    from nigemizu.output.layers import read_layers, write_layers, write_pixels
    from nigemizu.output.pictures import encoded, read_picture, write_exr, write_picture, write_png
    from nigemizu.output.provenance import Provenance
    from nigemizu.output.side_view import DiagramRay, Outline, Profile, vanishing_line

__all__ = [
    "DiagramRay",
    "FrameFolder",
    "Outline",
    "Profile",
    "Provenance",
    "displacement_figure",
    "encoded",
    "ray_diagram",
    "read_layers",
    "read_picture",
    "ready_to_write",
    "vanishing_line",
    "whole_file",
    "whole_folder",
    "write_air",
    "write_exr",
    "write_film",
    "write_layers",
    "write_picture",
    "write_pixels",
    "write_png",
]

_HOMES: Final = {
    "air": ("write_air",),
    "diagram": ("ray_diagram",),
    "displacement": ("displacement_figure",),
    "files": ("ready_to_write", "whole_file", "whole_folder"),
    "film": ("write_film",),
    "frames": ("FrameFolder",),
    "layers": ("read_layers", "write_layers", "write_pixels"),
    "pictures": ("encoded", "read_picture", "write_exr", "write_picture", "write_png"),
    "provenance": ("Provenance",),
    "side_view": ("DiagramRay", "Outline", "Profile", "vanishing_line"),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"nigemizu.output.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
