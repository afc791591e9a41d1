"""A field in a scene whose axes, unit or origin differ from the field's own."""

from __future__ import annotations

from typing import Any, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.field.base import Field

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
    scale.
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

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        n, gradient = self._field.value_and_gradient(self._local_point(position), active)
        return n, self._rotate(self._rotation, gradient) / self._scale

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
