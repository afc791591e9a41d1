"""One frozen, validated model of a whole experiment, the TOML file that holds it, and the built-in scenes."""

from __future__ import annotations

from nigemizu.scene.model import Scene, builtin_scenes, load
from nigemizu.scene.times import FilmSpec, TimeSpec

__all__ = ["FilmSpec", "Scene", "TimeSpec", "builtin_scenes", "load"]
