"""A field in a scene whose axes, unit or origin differ from the field's own."""

from __future__ import annotations

from typing import Any, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.field.base import Field
from nigemizu.field.cell import Cell

__all__ = ["Placed"]


@final
class Placed(Field):
    """A field moved into the scene by a rotation, one scale and a translation.

    Parameters
    ----------
    field : Field
    to_world : (4, 4) array_like
        Maps the field's metres to the scene's coordinates. Its linear part must be a proper rotation times
        a positive number; anything else would bend light by itself.

    Raises
    ------
    InputError
        When the matrix is something else.

    Notes
    -----
    Positions come, and gradients go, in scene units: n is unchanged, ∇n is rotated and divided by the
    scale. A cell keeps its bounds where the rotation takes axes to axes; after any other rotation its
    reach is that of the straight line to the faces of the inner field's cell.
    """

    def __init__(self, field: Field, to_world: ArrayLike) -> None:
        super().__init__(field.types)
        matrix = np.asarray(to_world, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
            raise InputError("not a 4×4 matrix of numbers", key="to_world", value=matrix.shape)
        linear = matrix[:3, :3]
        determinant = float(np.linalg.det(linear))
        scale = abs(determinant) ** (1 / 3)
        rigid = np.allclose(linear @ linear.T, scale**2 * np.eye(3), rtol=0, atol=1e-6 * scale**2)
        if determinant <= 0 or not rigid or not np.allclose(matrix[3], [0, 0, 0, 1]):
            raise InputError(
                "the transform bends space",
                key="to_world",
                value=matrix.tolist(),
                expected="a rotation, one positive scale and a translation",
            )
        self._field = field
        self._scale = scale
        self._rotation = linear / scale
        self._shift = matrix[:3, 3]
        # Which of the field's axes lies along each of the scene's, if each lies along one.
        rounded = np.round(self._rotation)
        turned = not np.allclose(self._rotation, rounded, rtol=0, atol=1e-12)
        self._axis_along = None if turned else [int(np.argmax(np.abs(row))) for row in rounded]

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self._outwards(self._field.value_and_gradient(self._local_point(position), active))

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        point, ahead = self._local_point(position), dr.normalize(self._local_vector(direction))
        inner = self._field.cell(point, ahead, active)
        lower, upper = None, None
        reach = None if inner.reach is None else inner.reach * self._scale
        if inner.lower is not None and self._axis_along is not None:
            lower, upper = self._turned_bounds(inner, self._axis_along)
        elif inner.lower is not None:
            # A ray that is sent to a face must come to lie on it or beyond: not less than the rounding.
            rounding = dr.max(abs(point)) * (2.0**-19 if self.types.precision == "single" else 2.0**-48)
            to_faces = dr.maximum(inner.exit(point, ahead), rounding) * self._scale
            reach = to_faces if reach is None else dr.minimum(reach, to_faces)

        def value_and_gradient(position: Any) -> tuple[Any, Any]:
            return self._outwards(inner.value_and_gradient(self._local_point(position)))

        return Cell(value_and_gradient, lower, upper, reach)

    @property
    def stratified(self) -> bool:
        return self._field.stratified and bool(abs(self._rotation[2, 2] - 1) < 1e-12)

    def contains(self, position: Any) -> Any:
        return self._field.contains(self._local_point(position))

    def entry(self, origin: Any, direction: Any) -> Any:
        return self._field.entry(self._local_point(origin), self._local_vector(direction))

    def _local_point(self, position: Any) -> Any:
        return self._local_vector(position - self.types.Array3f(*self._shift.tolist()))

    def _local_vector(self, vector: Any) -> Any:
        return self._rotate(self._rotation.T, vector) / self._scale

    def _rotate(self, rotation: np.ndarray[Any, Any], vector: Any) -> Any:
        rows = (self.types.Array3f(*row) for row in rotation.tolist())
        return self.types.Array3f(*(dr.dot(row, vector) for row in rows))

    def _outwards(self, result: tuple[Any, Any]) -> tuple[Any, Any]:
        """Index and gradient of the field, in the scene's axes and unit."""
        n, gradient = result
        return n, self._rotate(self._rotation, gradient) / self._scale

    def _turned_bounds(self, inner: Cell, axis_along: list[int]) -> tuple[Any, Any]:
        """Corners of the inner cell in the scene, where each axis lies along one of the field's."""
        lower, upper = self.types.Array3f(0), self.types.Array3f(0)
        for axis, along in enumerate(axis_along):
            # Not by the matrix: zero times an infinite bound is no number.
            one, other = (
                dr.fma(bound[along], self._scale * float(np.round(self._rotation[axis, along])), shift)
                for bound, shift in ((inner.lower, self._shift[axis]), (inner.upper, self._shift[axis]))
            )
            lower[axis], upper[axis] = dr.minimum(one, other), dr.maximum(one, other)
        return lower, upper
