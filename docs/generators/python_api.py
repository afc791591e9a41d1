"""The reference of the Python interface: a page per room, from its ``__all__``."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

from generators.text import heading, write_if_changed

__all__ = ["ROOMS", "write"]

ROOMS = ("air", "heat", "field", "trace", "render", "output", "measure", "scene", "scene.measuring")


def write(folder: Path) -> None:
    pages = ("nigemizu", *(f"nigemizu.{room}" for room in ROOMS))
    for page in pages:
        write_if_changed(folder / f"{page}.rst", _page(page))


def _page(name: str) -> str:
    module = importlib.import_module(name)
    text = heading(name, "=") + f".. automodule:: {name}\n   :no-index:\n\n"
    for member in module.__all__:
        if member.startswith("__"):
            continue
        found = getattr(module, member)
        # What the package only hands on is described in the room that it comes from.
        if name == "nigemizu" and getattr(found, "__module__", name).split(".")[1:2] == ["scene"]:
            continue
        text += heading(member, "-") + _directive(f"{name}.{member}", found)
    return text


def _directive(name: str, found: object) -> str:
    if inspect.isclass(found):
        return f".. autoclass:: {name}\n   :members:\n   :exclude-members: model_config\n\n"
    if inspect.isfunction(found):
        return f".. autofunction:: {name}\n\n"
    return f".. autodata:: {name}\n   :no-value:\n\n"
