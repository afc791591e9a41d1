"""Straight pieces of a ray's path, tested against surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, final

import drjit as dr

from nigemizu.trace.surfaces import Surface

__all__ = ["Chord"]

OVERLAP: Final = 1e-6  # relative lengthening of each tested chord, so that nothing slips between two


@final
@dataclass
class Chord:
    """A straight piece of the path, one entry per ray, and the hit on it."""

    origin: Any  #     Array3f  m
    direction: Any  #  Array3f  1    unit length
    length: Any  #     Float    m
    start: Any  #      Float    m    length of the path before it
    found: Any  #      Bool          whether it meets a surface
    distance: Any  #   Float    m    from the origin to the hit (its length, where there is none)
    mark: Any = None  #              what else the surface says of the hit

    @classmethod
    def along(cls, origin: Any, direction: Any, length: Any, start: Any, blank: Any = None) -> Chord:
        """A piece that has not been tested yet; `blank` stands for what a surface says where nothing is."""
        return cls(origin, direction, length, start, dr.mask_t(length)(False), length, blank)

    @classmethod
    def between(cls, begin: Any, end: Any, start: Any) -> Chord:
        """The piece from one point [m] to another."""
        span = end - begin
        length = dr.norm(span)
        return cls.along(begin, span / dr.select(length > 0, length, 1), length, start)

    def test(self, surface: Surface, active: Any) -> Chord:
        """The piece with the surface's answer. Rays that are not active meet nothing."""
        hit, distance, *marks = surface(self.origin, self.direction, self.length * (1 + OVERLAP), active)
        found = hit & active
        mark = marks[0] if marks else None
        return replace(self, found=found, distance=dr.select(found, distance, self.length), mark=mark)

    def replaced(self, later: Chord, active: Any) -> Chord:
        """The later piece where rays are active, this one elsewhere."""
        return Chord(
            origin=dr.select(active, later.origin, self.origin),
            direction=dr.select(active, later.direction, self.direction),
            length=dr.select(active, later.length, self.length),
            start=dr.select(active, later.start, self.start),
            found=dr.select(active, later.found, self.found),
            distance=dr.select(active, later.distance, self.distance),
            mark=self.mark if later.mark is None else dr.select(active, later.mark, self.mark),
        )

    def at(self, distance: Any) -> Any:
        """Point of the piece at a distance [m] from its origin."""
        return dr.fma(self.direction, distance, self.origin)
