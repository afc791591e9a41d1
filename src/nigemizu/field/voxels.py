"""What all volumes on an orthogonal mesh have in common: axes, sides, and air that is only stratified."""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field.axis import Span, make_axis
from nigemizu.field.background import Background
from nigemizu.field.base import BoxedField
from nigemizu.field.cell import Cell
from nigemizu.field.types import Types

__all__ = ["COLUMNS_REACH", "Beyond", "VoxelField", "horizontal_means", "read_mesh"]

Beyond: TypeAlias = Literal["straight", "extend", "mean"]

COLUMNS_REACH: Final = 20e3
"""m, how far uneven air goes on beyond extended sides: over 20 km the round Earth drops by 31 m below it."""


class VoxelField(BoxedField):
    """A field given on the nodes of an orthogonal mesh.

    Parameters
    ----------
    nodes : list of (nx,), (ny,), (nz,) float64, m
    types : Types
    beyond : {"straight", "extend", "mean"}
    reach : float, m
        How far uneven air goes on beyond extended sides.

    Attributes
    ----------
    _background : Background
        What depends on height alone; set by the heir.
    _deviation : array or None
        Voxels that are added to it; None where it is all there is.
    """

    _background: Background
    _deviation: Any

    def __init__(
        self, nodes: list[NDArray[np.float64]], types: Types, beyond: Beyond, reach: float = COLUMNS_REACH
    ) -> None:
        x, y, z = (make_axis(axis, types, key=key) for axis, key in zip(nodes, "xyz", strict=True))
        self._axes = x, y, z
        lower, upper = [float(axis[0]) for axis in nodes], [float(axis[-1]) for axis in nodes]
        self._columns = list(zip(lower[:2], upper[:2], strict=True))
        self._extended = beyond != "straight"
        self._reach = reach
        if self._extended:
            lower[:2], upper[:2] = [-np.inf] * 2, [np.inf] * 2
        super().__init__(types, tuple(lower), tuple(upper))

    @property
    def stratified(self) -> bool:
        return self._deviation is None and self._extended

    def _end_columns(self) -> None:
        """End extended sides where uneven columns cannot go on; called by heirs that store a deviation."""
        if self._extended:
            for number, (first, last) in enumerate(self._columns):
                bounds = first - self._reach, last + self._reach
                self._axes[number].outer = bounds
                self._lower = (*self._lower[:number], bounds[0], *self._lower[number + 1 :])
                self._upper = (*self._upper[:number], bounds[1], *self._upper[number + 1 :])

    def _column(self, position: Any, active: Any) -> tuple[Any, Any]:
        """Index and gradient of air that depends on height alone."""
        index, fraction, inverse_width = self._axes[2].locate(position.z, active)
        n, slope = self._background.value_and_slope(position.z, index, fraction, inverse_width, active)
        return n, self.types.Array3f(0, 0, slope)

    def _column_cell(self, position: Any, direction: Any, active: Any) -> Cell:
        """Cell of air that depends on height alone: as wide as the region."""
        Array3f = self.types.Array3f
        air = self._background.piece(self._axes[2].locate_ahead(position.z, direction.z, active), active)

        def value_and_gradient(point: Any) -> tuple[Any, Any]:
            n, slope = air.value_and_slope(point.z)
            return n, Array3f(0, 0, slope)

        (west, south, _), (east, north, _) = self.lower, self.upper
        return Cell(value_and_gradient, Array3f(west, south, air.lower), Array3f(east, north, air.upper))

    def _spans_ahead(self, position: Any, direction: Any, active: Any) -> tuple[Span, Span, Span]:
        """Cell that a ray is about to cross, by axis; what lies beyond extended sides are cells, too."""
        x, y, z = (
            axis.locate_ahead(position[number], direction[number], active, extended=extended)
            for number, (axis, extended) in enumerate(
                zip(self._axes, (self._extended, self._extended, False), strict=True)
            )
        )
        return x, y, z

    def _outside(self, position: Any) -> tuple[Any, Any]:
        """Whether a position lies beyond the columns in x, and in y."""
        (x_first, x_last), (y_first, y_last) = self._columns
        outside_x = (position.x < x_first) | (position.x > x_last)
        return outside_x, (position.y < y_first) | (position.y > y_last)


def read_mesh(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, refractivity: ArrayLike, beyond: str, *, per_node: int = 1
) -> tuple[list[NDArray[np.float64]], NDArray[Any]]:
    """Nodes by axis (x, y, z) and data (z, y, x), refused unless they make a volume.

    An extended axis of one node is given a second one: the air does not vary along it at all. Where the mean
    goes on beyond the sides, a column of it is put around the volume. The volume will store `per_node`
    numbers for each node.
    """
    if beyond not in ("straight", "extend", "mean"):
        raise InputError(
            "no such continuation", key="beyond", value=beyond, expected="straight, extend or mean"
        )
    data = np.asarray(refractivity)
    nodes = [np.asarray(axis, dtype=np.float64) for axis in (x, y, z)]
    expected = tuple(axis.size for axis in reversed(nodes))
    if data.shape != expected:
        raise InputError(
            "the refractivity does not fit the axes",
            key="refractivity",
            value=data.shape,
            expected=f"shape (z, y, x) = {expected}",
        )
    # Volumes pad their voxels, by three nodes an axis at most, and number them in 32 bits.
    if np.prod([float(size + 3) for size in data.shape]) * per_node >= 2**32:
        raise InputError(
            "the volume has more voxels than can be addressed", key="refractivity", value=data.shape
        )
    if not np.all(np.isfinite(data)):
        raise InputError("the refractivity is not finite everywhere", key="refractivity")
    if beyond != "straight":
        around = horizontal_means(data)[0][:, None, None]
        for number, dimension in ((0, 2), (1, 1)):
            axis = nodes[number]
            if axis.size == 1:
                nodes[number] = axis[0] + np.array([-0.5, 0.5])
                data = np.repeat(data, 2, axis=dimension)
            elif beyond == "mean":
                nodes[number] = np.concatenate([[2 * axis[0] - axis[1]], axis, [2 * axis[-1] - axis[-2]]])
                shape = list(data.shape)
                shape[dimension] = 1
                end = np.broadcast_to(around, shape).astype(data.dtype)
                data = np.concatenate([end, data, end], axis=dimension)
    return nodes, data


def horizontal_means(data: NDArray[Any]) -> tuple[NDArray[np.float64], bool]:
    """Mean of each layer (nz,), exact where a layer is uniform, and whether all of them are."""
    low, high = data.min(axis=(1, 2)), data.max(axis=(1, 2))
    means = np.where(low == high, low, data.mean(axis=(1, 2), dtype=np.float64))
    return means.astype(np.float64), bool(np.all(low == high))
