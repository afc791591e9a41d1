"""What a refractive-index field is to the rays that cross it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import drjit as dr

from nigemizu.field.cell import Cell
from nigemizu.field.types import Types

__all__ = ["BoxedField", "Field", "UnboundedField"]


class Field(ABC):
    """A refractive index and its gradient at any point, on the compute device.

    Fields are frozen once built. Positions are ``types.Array3f`` in metres (x forward, y left, z up).
    A field fills a convex region; a ray that has left the region goes straight on for ever.
    """

    def __init__(self, types: Types) -> None:
        self._types = types

    @property
    def types(self) -> Types:
        """Array types in which positions come and results go."""
        return self._types

    @abstractmethod
    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        """Refractive index and its gradient.

        Parameters
        ----------
        position : Array3f, m
        active : Bool
            Rays that take part; the others' results mean nothing.

        Returns
        -------
        n : Float, 1 — the full index, not n − 1
        gradient : Array3f, 1/m
        """

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        """The piece of the field that a ray is about to cross.

        Parameters
        ----------
        position : Array3f, m
        direction : Array3f, 1
            Of any length. Where the position lies on a face, the piece ahead is taken.
        active : Bool
            Rays that take part.

        Returns
        -------
        Cell
        """
        return Cell(lambda point: self.value_and_gradient(point, active))

    @property
    def stratified(self) -> bool:
        """Whether the index depends on z alone, in a region that has no bounds in x and y."""
        return False

    @abstractmethod
    def contains(self, position: Any) -> Any:
        """Whether the position (Array3f, m) lies in the region that the field fills (Bool)."""

    @abstractmethod
    def entry(self, origin: Any, direction: Any) -> Any:
        """Distance to the region along a straight line.

        Parameters
        ----------
        origin : Array3f, m
        direction : Array3f, 1

        Returns
        -------
        distance : Float — in units of ``direction``'s length; 0 from inside, infinity where the line
            never meets the region
        """


class UnboundedField(Field):
    """A field that fills all space."""

    def contains(self, position: Any) -> Any:
        return self.types.Bool(True)

    def entry(self, origin: Any, direction: Any) -> Any:
        return self.types.Float(0)


class BoxedField(Field):
    """A field that fills a box whose faces are normal to the axes; a face may lie at infinity."""

    def __init__(self, types: Types, lower: tuple[float, ...], upper: tuple[float, ...]) -> None:
        super().__init__(types)
        self._lower = tuple(float(value) for value in lower)
        self._upper = tuple(float(value) for value in upper)

    @property
    def lower(self) -> tuple[float, ...]:
        """Corner of the box with the least coordinates (x, y, z), m."""
        return self._lower

    @property
    def upper(self) -> tuple[float, ...]:
        """Corner of the box with the greatest coordinates (x, y, z), m."""
        return self._upper

    def contains(self, position: Any) -> Any:
        inside = self.types.Bool(True)
        for axis in range(3):
            if self._lower[axis] > -dr.inf:
                inside &= position[axis] >= self._lower[axis]
            if self._upper[axis] < dr.inf:
                inside &= position[axis] <= self._upper[axis]
        return inside

    def entry(self, origin: Any, direction: Any) -> Any:
        near, far = self._slabs(origin, direction)
        near = dr.maximum(near, 0)
        return dr.select(near <= far, near, dr.inf)

    def _slabs(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """Where the line enters and leaves the box; near > far where it misses."""
        Float = self.types.Float
        near, far = Float(-dr.inf), Float(dr.inf)
        for axis in range(3):
            o, d = origin[axis], direction[axis]
            lower, upper = self._lower[axis], self._upper[axis]
            within = (o >= lower) & (o <= upper)
            parallel = d == 0
            inverse = dr.rcp(dr.select(parallel, 1, d))
            t0, t1 = (lower - o) * inverse, (upper - o) * inverse
            # A line along the faces is within this pair of faces for ever, or never.
            enter = dr.select(parallel, dr.select(within, -dr.inf, dr.inf), dr.minimum(t0, t1))
            leave = dr.select(parallel, dr.select(within, dr.inf, -dr.inf), dr.maximum(t0, t1))
            near, far = dr.maximum(near, enter), dr.minimum(far, leave)
        return near, far
