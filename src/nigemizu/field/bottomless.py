"""Air that goes on below its ground, so that the paths of neighbouring rays differ smoothly."""

from __future__ import annotations

from typing import Any, final

import drjit as dr

from nigemizu.field.base import BoxedField
from nigemizu.field.cell import Cell

__all__ = ["Bottomless"]


@final
class Bottomless(BoxedField):
    """A boxed field continued below its lowest face with the gradient that it has there.

    Parameters
    ----------
    field : BoxedField

    Notes
    -----
    Of the rays that just reach the ground of hot air, some turn above it and some would turn below it. With
    the air continued, both belong to one smooth family. What they do below the ground is not light; it is
    for paths that are interpolated, on rays that have met the ground before.
    """

    def __init__(self, field: BoxedField) -> None:
        (x0, y0, floor), upper = field.lower, field.upper
        super().__init__(field.types, (x0, y0, -dr.inf), upper)
        self._field = field
        self._floor = floor

    @property
    def stratified(self) -> bool:
        return self._field.stratified

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self._continued(lambda point: self._field.value_and_gradient(point, active), position)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        cell = self._field.cell(self._raised(position), direction, active)
        lower = cell.lower
        if lower is not None:
            # The lowest cell has no floor.
            lower = type(lower)(lower.x, lower.y, dr.select(lower.z <= self._floor, -dr.inf, lower.z))
        return Cell(
            lambda point: self._continued(cell.value_and_gradient, point), lower, cell.upper, cell.reach
        )

    def _raised(self, position: Any) -> Any:
        return type(position)(position.x, position.y, dr.maximum(position.z, self._floor))

    def _continued(self, formula: Any, position: Any) -> tuple[Any, Any]:
        raised = self._raised(position)
        n, gradient = formula(raised)
        return dr.fma(gradient.z, position.z - raised.z, n), gradient
