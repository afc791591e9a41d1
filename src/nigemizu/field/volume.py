"""The refractive-index volume of the paper: voxels, trilinear between eight corners."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field.axis import make_axis
from nigemizu.field.base import BoxedField
from nigemizu.field.types import Precision, Types

__all__ = ["Beyond", "TrilinearVolume"]

Beyond: TypeAlias = Literal["straight", "extend"]


@final
class TrilinearVolume(BoxedField):
    """Refractive index on the nodes of an orthogonal mesh, trilinear in between.

    Parameters
    ----------
    x, y, z : (nx,), (ny,), (nz,) array_like, m
        Node coordinates, strictly increasing; equal spacing is recognised and faster.
    refractivity : (nz, ny, nx) array_like, 1
        n − 1 on the nodes.
    types : Types
        Array types of positions and results.
    beyond : {"straight", "extend"}
        What lies beyond the sides. ``straight``: nothing, rays go straight. ``extend``: the outermost
        columns continue for ever in x and y without a horizontal gradient. Below the lowest and above
        the highest node the rays are straight in both cases.
    storage : {"single", "double"}, optional
        Precision of the stored voxels; by default that of `types`.

    Raises
    ------
    InputError
        When axes do not increase, shapes disagree or the data are not finite.

    Notes
    -----
    Stored is the deviation δ from a background that is linear in height, n = 1 + N₀ + s (z − z₀) + δ,
    with N₀ and s fitted to the data by least squares and evaluated in closed form, so that small
    differences of n survive in single precision. The trilinear interpolant of a linear function is the
    function itself: the split changes nothing but round-off. The gradient is that of the interpolant,
    constant across cell faces only where the data make it so; on a face that of the cell above it is
    taken (on the last face that of the cell below). Beyond the mesh the value and gradient are those of
    the nearest point of the box, except for the horizontal gradient of extended columns, which is 0.

    Limits: the interpolant is continuous, its gradient is not. Values are second order, gradients (and
    the angles of rays) first order in the cell size.
    """

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike,
        refractivity: ArrayLike,
        types: Types,
        beyond: Beyond = "straight",
        *,
        storage: Precision | None = None,
    ) -> None:
        if beyond not in ("straight", "extend"):
            raise InputError(
                "no such continuation", key="beyond", value=beyond, expected="straight or extend"
            )
        data = np.asarray(refractivity)
        nodes = [np.asarray(axis, dtype=np.float64) for axis in (x, y, z)]
        _check(nodes, data)
        if beyond == "extend":
            nodes, data = _widen_single_columns(nodes, data)
        self._axes = tuple(make_axis(axis, types, key=key) for axis, key in zip(nodes, "xyz", strict=True))
        lower, upper = [float(axis[0]) for axis in nodes], [float(axis[-1]) for axis in nodes]
        if beyond == "extend":
            lower[:2], upper[:2] = [-np.inf] * 2, [np.inf] * 2
        super().__init__(types, tuple(lower), tuple(upper))
        self._extended = beyond == "extend"
        self._columns = [(float(axis[0]), float(axis[-1])) for axis in nodes[:2]]

        self._base_height = float(nodes[2][0])
        self._top_height = float(nodes[2][-1])
        intercept, slope = _linear_background(nodes[2], data)
        height = (nodes[2] - self._base_height)[:, None, None]
        deviation = data - (intercept + slope * height)
        # Opaque: the next instant's values are not compiled into the kernel, which serves them all.
        self._base_index = dr.opaque(types.Float, 1.0 + intercept)
        self._slope = dr.opaque(types.Float, slope)
        self._stored: Precision = storage or types.precision
        dtype = np.float32 if self._stored == "single" else np.float64
        self._voxel_type = types.storage(self._stored)
        self._deviation = self._voxel_type(np.ascontiguousarray(deviation, dtype=dtype).ravel())
        self._row = data.shape[2]
        self._layer = data.shape[1] * data.shape[2]
        self._shape = data.shape

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes (nz, ny, nx)."""
        nz, ny, nx = self._shape
        return nz, ny, nx

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        i, u, per_dx = self._axes[0].locate(position.x, active)
        j, v, per_dy = self._axes[1].locate(position.y, active)
        k, w, per_dz = self._axes[2].locate(position.z, active)

        corner = k * self._layer + (j * self._row + i)
        # δ at the eight corners; digits of the names: z, y, x
        d000, d001 = self._pair(corner, active)
        d010, d011 = self._pair(corner + self._row, active)
        d100, d101 = self._pair(corner + self._layer, active)
        d110, d111 = self._pair(corner + (self._layer + self._row), active)

        # along x, then y, then z: value and the differences that make the gradient
        x00, x01, x10, x11 = d001 - d000, d011 - d010, d101 - d100, d111 - d110
        e00, e01 = dr.fma(u, x00, d000), dr.fma(u, x01, d010)
        e10, e11 = dr.fma(u, x10, d100), dr.fma(u, x11, d110)
        y0, y1 = e01 - e00, e11 - e10
        x0, x1 = dr.fma(v, x01 - x00, x00), dr.fma(v, x11 - x10, x10)
        f0, f1 = dr.fma(v, y0, e00), dr.fma(v, y1, e10)

        deviation = dr.fma(w, f1 - f0, f0)
        gradient_x = dr.fma(w, x1 - x0, x0) * per_dx
        gradient_y = dr.fma(w, y1 - y0, y0) * per_dy
        gradient_z = dr.fma(f1 - f0, per_dz, self._slope)
        if self._extended:
            (x_first, x_last), (y_first, y_last) = self._columns
            outside_x = (position.x < x_first) | (position.x > x_last)
            outside_y = (position.y < y_first) | (position.y > y_last)
            gradient_x = dr.select(outside_x, 0, gradient_x)
            gradient_y = dr.select(outside_y, 0, gradient_y)
        height = dr.clip(position.z, self._base_height, self._top_height) - self._base_height
        n = self._base_index + dr.fma(height, self._slope, deviation)
        return n, self.types.Array3f(gradient_x, gradient_y, gradient_z)

    def _pair(self, index: Any, active: Any) -> tuple[Any, Any]:
        """Stored deviation of a node and of its neighbour in x, in the precision of the positions."""
        first = dr.gather(self._voxel_type, self._deviation, index, active)
        second = dr.gather(self._voxel_type, self._deviation, index + 1, active)
        return self.types.Float(first), self.types.Float(second)


def _check(nodes: list[NDArray[np.float64]], data: NDArray[Any]) -> None:
    expected = tuple(axis.size for axis in reversed(nodes))
    if data.shape != expected:
        raise InputError(
            "the refractivity does not fit the axes",
            key="refractivity",
            value=data.shape,
            expected=f"shape (z, y, x) = {expected}",
        )
    if data.size >= 2**32:
        raise InputError(
            "the volume has more voxels than can be addressed", key="refractivity", value=data.shape
        )
    if not np.all(np.isfinite(data)):
        raise InputError("the refractivity is not finite everywhere", key="refractivity")


def _widen_single_columns(
    nodes: list[NDArray[np.float64]], data: NDArray[Any]
) -> tuple[list[NDArray[np.float64]], NDArray[Any]]:
    """Give an extended axis of one node a second one: the air does not vary along it at all."""
    for number, dimension in ((0, 2), (1, 1)):
        if nodes[number].size == 1:
            nodes[number] = nodes[number][0] + np.array([-0.5, 0.5])
            data = np.repeat(data, 2, axis=dimension)
    return nodes, data


def _linear_background(z: NDArray[np.float64], data: NDArray[Any]) -> tuple[float, float]:
    """Intercept at z[0] and slope of the straight line nearest to the data, by least squares."""
    profile = data.mean(axis=(1, 2), dtype=np.float64)
    height = z - z[0]
    centred = height - height.mean()
    slope = float(centred @ (profile - profile.mean()) / (centred @ centred))
    return float(profile.mean() - slope * height.mean()), slope
