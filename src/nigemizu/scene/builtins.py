"""The built-in scenes: TOML files beside this package's code."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable

__all__ = ["builtin_names", "builtin_text"]


def builtin_text(name: str) -> str:
    """The TOML of a built-in scene."""
    return _folder().joinpath(f"{name}.toml").read_text(encoding="utf-8")


def builtin_names() -> tuple[str, ...]:
    """The names, in order."""
    names = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def _folder() -> Traversable:
    return resources.files("nigemizu.scene") / "builtin"
