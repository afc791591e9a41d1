"""Air that goes on below its ground, so that the paths of neighbouring rays differ smoothly."""

from __future__ import annotations

from typing import Any, Final, final

import drjit as dr

from nigemizu.field.base import BoxedField
from nigemizu.field.cell import Cell

__all__ = ["Bottomless"]

_NEAR: Final = 1e-7  # of the volume's height,
_HIGH: Final = (
    10.0  # m, or of this: of air that reaches up to space the lowest layer may be thinner than a mm
)


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
    for paths that are interpolated, on rays that have met the ground before. The floor stays a face of cells,
    so that steps end on both sides of it.
    """

    def __init__(self, field: BoxedField) -> None:
        (x0, y0, floor), upper = field.lower, field.upper
        super().__init__(field.types, (x0, y0, -dr.inf), upper)
        self._field = field
        self._floor = floor
        # As near to the floor as this, a ray is on the side that it moves to.
        self._near = _NEAR * min(max(upper[2] - floor, 0.0), _HIGH)

    @property
    def stratified(self) -> bool:
        return self._field.stratified

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self._continued(lambda point: self._field.value_and_gradient(point, active), position)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        cell = self._field.cell(self._raised(position), direction, active)
        lower, upper = cell.lower, cell.upper
        if lower is not None:
            below = position.z < self._floor + dr.select(direction.z < 0, self._near, -self._near)
            lower = type(lower)(lower.x, lower.y, dr.select(below, -dr.inf, lower.z))
            upper = type(upper)(upper.x, upper.y, dr.select(below, self._floor, upper.z))
        return Cell(lambda point: self._continued(cell.value_and_gradient, point), lower, upper, cell.reach)

    def _raised(self, position: Any) -> Any:
        return type(position)(position.x, position.y, dr.maximum(position.z, self._floor))

    def _continued(self, formula: Any, position: Any) -> tuple[Any, Any]:
        raised = self._raised(position)
        n, gradient = formula(raised)
        return dr.fma(gradient.z, position.z - raised.z, n), gradient
