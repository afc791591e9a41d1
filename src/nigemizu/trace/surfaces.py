"""Surfaces as callbacks: what the marching loop knows of geometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import drjit as dr

__all__ = ["Surface", "combine", "ground_plane"]

Surface: TypeAlias = Callable[[Any, Any, Any, Any], tuple[Any, ...]]
"""``surface(origin, direction, length, active) -> (hit, distance)``: whether and where (m from the origin,
along the unit direction, at most `length`) a straight piece meets a surface. A surface may return a third
value, a mark of what was met, which ends up in `RayEnd.mark`; its attribute ``blank`` is then the mark of
nothing."""


def ground_plane(height: float = 0.0) -> Surface:
    """The horizontal plane at `height` [m], met from above or below, in closed form."""

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        level = direction.z == 0
        distance = (height - origin.z) / dr.select(level, 1, direction.z)
        # A ray that starts on the plane has met it already.
        return active & ~level & (distance > 0) & (distance <= length), distance

    return surface


def combine(first: Surface, second: Surface) -> Surface:
    """Both surfaces at once: the nearer hit counts."""

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        hit_1, distance_1, *_ = first(origin, direction, length, active)
        hit_2, distance_2, *_ = second(origin, direction, length, active)
        distance = dr.minimum(dr.select(hit_1, distance_1, dr.inf), dr.select(hit_2, distance_2, dr.inf))
        return hit_1 | hit_2, distance

    return surface
