"""A smooth refractive-index volume: cubic splines along all three axes."""

from __future__ import annotations

from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.field.axis import Axis, UniformAxis
from nigemizu.field.background import Line, Polynomials, spline_pieces
from nigemizu.field.cell import Cell
from nigemizu.field.types import Precision, Types
from nigemizu.field.voxels import Beyond, VoxelField, horizontal_means, read_mesh

__all__ = ["TricubicVolume"]

FEWEST_NODES: Final = 4  # that a cubic spline takes


@final
class TricubicVolume(VoxelField):
    """Refractive index on the nodes of an orthogonal mesh, a tensor product of cubic splines in between.

    Parameters
    ----------
    x, y, z : (nx,), (ny,), (nz,) array_like, m
        Node coordinates, strictly increasing; equal spacing is recognised and faster.
    refractivity : (nz, ny, nx) array_like, 1
        n − 1 on the nodes.
    types : Types
        Array types of positions and results.
    beyond : {"straight", "extend", "mean"}
        What lies beyond the sides, as for `TrilinearVolume`.
    storage : {"single", "double"}, optional
        Precision of the stored coefficients; by default that of `types`.

    Raises
    ------
    InputError
        When axes do not increase, shapes disagree or the data are not finite.

    Notes
    -----
    The interpolating spline with not-a-knot ends along each axis: it goes through all data and has two
    continuous derivatives. Axes of two or three nodes get a line or a parabola. Stored are the
    coefficients, one per node and two more per axis, of B-splines whose knots are the nodes, for the
    deviation from the straight line in z nearest to the data. A look-up sums 64 of them. Where the data do
    not vary horizontally no coefficients are stored: the index is one cubic per cell of z.

    Beyond the mesh the value and gradient are those of the nearest point of the box, except for the
    horizontal gradient of extended columns, which is 0.

    Limits: across a step in the data the spline overshoots. Values are fourth order, gradients (and the
    angles of rays) third order in the cell size where the air is smooth; a look-up costs several times as
    much as a trilinear one.

    References
    ----------
    C. de Boor (2001), A Practical Guide to Splines, revised edition, Springer, chapters IV and XVII.
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
        nodes, data = read_mesh(x, y, z, refractivity, beyond)
        self._shape = data.shape
        means, uniform = horizontal_means(data)
        if uniform:
            super().__init__(nodes, types, beyond)
            self._deviation = None
            self._background = Polynomials(nodes[2], means, spline_pieces(nodes[2], means), types)
            return
        for dimension in range(3):
            nodes[2 - dimension], data = _lengthened(nodes[2 - dimension], data, dimension)
        super().__init__(nodes, types, beyond)
        line = Line(nodes[2], horizontal_means(data)[0], types)
        self._background = line
        coefficients = data - line.at_nodes[:, None, None]
        splines = [_Spline(axis, along, types) for axis, along in zip(nodes, self._axes, strict=True)]
        self._splines = splines
        for dimension in range(3):
            coefficients = splines[2 - dimension].coefficients(coefficients, dimension)
        self._row = coefficients.shape[2]
        self._layer = coefficients.shape[1] * coefficients.shape[2]
        self._voxel_type = types.storage(storage or types.precision)
        dtype = np.float32 if (storage or types.precision) == "single" else np.float64
        # Beyond the last columns cells read on, times 0: one more row keeps that within.
        stored = np.zeros(coefficients.size + self._row + 1, dtype=dtype)
        stored[: coefficients.size] = coefficients.ravel()
        self._deviation = self._voxel_type(stored)
        self._end_columns()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes (nz, ny, nx)."""
        nz, ny, nx = self._shape
        return nz, ny, nx

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        if self._deviation is None:
            return self._column(position, active)
        cells = [axis.locate(position[number], active) for number, axis in enumerate(self._axes)]
        deviation, gradient = self._deviate(cells, active)
        n, slope = self._background.value_and_slope(position.z, *cells[2], active)
        if self._extended:
            outside_x, outside_y = self._outside(position)
            gradient.x = dr.select(outside_x, 0, gradient.x)
            gradient.y = dr.select(outside_y, 0, gradient.y)
        gradient.z += slope
        return n + deviation, gradient

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        if self._deviation is None:
            return self._column_cell(position, direction, active)
        spans = self._spans_ahead(position, direction, active)
        air = self._background.piece(spans[2], active)
        Array3f = self.types.Array3f

        def value_and_gradient(point: Any) -> tuple[Any, Any]:
            cells = [
                (span.index, (point[number] - span.node) * span.inverse_width, span.inverse_width)
                for number, span in enumerate(spans)
            ]
            deviation, gradient = self._deviate(cells, active)
            n, slope = air.value_and_slope(point.z)
            gradient.z += slope
            return n + deviation, gradient

        lower, upper = (Array3f(*(getattr(span, end) for span in spans)) for end in ("lower", "upper"))
        return Cell(value_and_gradient, lower, upper)

    def _deviate(self, cells: list[tuple[Any, Any, Any]], active: Any) -> tuple[Any, Any]:
        """Deviation and its gradient, in the cell and at the fraction given for each axis (x, y, z)."""
        types = self.types
        (bx, sx), (by, sy), (bz, sz) = (
            spline.basis(*cell, active) for spline, cell in zip(self._splines, cells, strict=True)
        )
        (i, _, _), (j, _, _), (k, _, _) = cells
        corner = k * self._layer + (j * self._row + i)
        value, gradient = types.Float(0), types.Array3f(0)
        for c in range(4):
            # Sums over a layer: of the values, and with the slopes in x and in y.
            layer, layer_x, layer_y = types.Float(0), types.Float(0), types.Float(0)
            for b in range(4):
                first = corner + (c * self._layer + b * self._row)
                taps = [
                    types.Float(dr.gather(self._voxel_type, self._deviation, first + a, active))
                    for a in range(4)
                ]
                row = _weighted(bx, taps)
                layer = dr.fma(by[b], row, layer)
                layer_x = dr.fma(by[b], _weighted(sx, taps), layer_x)
                layer_y = dr.fma(sy[b], row, layer_y)
            value = dr.fma(bz[c], layer, value)
            gradient.x = dr.fma(bz[c], layer_x, gradient.x)
            gradient.y = dr.fma(bz[c], layer_y, gradient.y)
            gradient.z = dr.fma(sz[c], layer, gradient.z)
        return value, gradient


class _Spline:
    """Cubic B-splines along one axis, with a knot at every node: cell i has those numbered i to i + 3."""

    def __init__(self, nodes: NDArray[np.float64], axis: Axis, types: Types) -> None:
        self._types = types
        self._nodes = nodes
        self._powers = _basis_powers(nodes)
        self._uniform = isinstance(axis, UniformAxis)
        self._table: Any = None if self._uniform else types.table(self._powers)

    def coefficients(self, data: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Coefficients of the spline through the data along one of their dimensions, two more than data."""
        count = data.shape[dimension]
        matrix = np.zeros((count + 2, count + 2))
        for node in range(count):
            matrix[node + 1, node : node + 3] = self._powers[node, :3, 0]
        widths = np.diff(self._nodes)
        # Not a knot: the third derivative does not jump at the second node, nor at the last but one.
        for row, node in ((0, 1), (count + 1, count - 2)):
            before, after = node - 1, node
            matrix[row, before : before + 4] += self._powers[before, :, 3] / widths[before] ** 3
            matrix[row, after : after + 4] -= self._powers[after, :, 3] / widths[after] ** 3
            matrix[row] /= np.abs(matrix[row]).max()
        # The full inverse: its product with many columns is far quicker than solving for them by bands.
        inverse = np.linalg.inv(matrix)[:, 1:-1]
        return np.moveaxis(np.tensordot(inverse, data, axes=(1, dimension)), 0, dimension)

    def basis(self, index: Any, w: Any, inverse_width: Any, active: Any) -> tuple[list[Any], list[Any]]:
        """The four B-splines of a cell and their derivatives [1/m] at a fraction of it."""
        if self._uniform:
            rest = 1 - w
            outer, inner = w * w * (0.5 * inverse_width), rest * rest * (0.5 * inverse_width)
            values = [
                rest * rest * rest * (1 / 6),
                dr.fma(w * w, dr.fma(w, 0.5, -1), 2 / 3),
                dr.fma(rest * rest, dr.fma(rest, 0.5, -1), 2 / 3),
                w * w * w * (1 / 6),
            ]
            slopes = [
                -inner,
                w * dr.fma(w, 1.5, -2) * inverse_width,
                -rest * dr.fma(rest, 1.5, -2) * inverse_width,
                outer,
            ]
            return values, slopes
        values, slopes = [], []
        for number in range(4):
            c0, c1, c2, c3 = dr.gather(self._types.Array4f, self._table, 4 * index + number, active)
            values.append(dr.fma(dr.fma(dr.fma(c3, w, c2), w, c1), w, c0))
            slopes.append(dr.fma(dr.fma(3 * c3, w, 2 * c2), w, c1) * inverse_width)
        return values, slopes


def _weighted(weights: list[Any], taps: list[Any]) -> Any:
    total = weights[0] * taps[0]
    for weight, tap in zip(weights[1:], taps[1:], strict=True):
        total = dr.fma(weight, tap, total)
    return total


def _basis_powers(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (cells + 1, 4, 4) of the four B-splines of each cell in powers of its fraction.

    The last row serves what lies beyond the last node, where the value stays that of the node.
    """
    from scipy.interpolate import BSpline

    widths = np.diff(nodes)
    cells = len(widths)
    below = nodes[0] - widths[0] * np.arange(3, 0, -1)
    above = nodes[-1] + widths[-1] * np.arange(1, 4)
    basis = BSpline(np.concatenate([below, nodes, above]), np.eye(cells + 3), 3)
    powers = np.zeros((cells + 1, 4, 4))
    own = np.arange(cells)[:, None] + np.arange(4)
    for order, factorial in enumerate((1, 1, 2, 6)):
        derivative = basis(nodes[:-1], nu=order)
        scale = widths[:, None] ** order / factorial
        powers[:-1, :, order] = np.take_along_axis(derivative, own, axis=1) * scale
    powers[-1, :3, 0] = powers[-2, 1:].sum(axis=1)
    return powers


def _lengthened(
    nodes: NDArray[np.float64], data: NDArray[Any], dimension: int
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Four nodes along a dimension of two or three, on the line or parabola through those given."""
    count = len(nodes)
    if not 2 <= count < FEWEST_NODES:
        return nodes, data
    longer = np.concatenate([np.linspace(nodes[0], nodes[1], FEWEST_NODES - count + 2), nodes[2:]])
    weights = np.ones((FEWEST_NODES, count))
    for one in range(count):
        for other in set(range(count)) - {one}:
            weights[:, one] *= (longer - nodes[other]) / (nodes[one] - nodes[other])
    return longer, np.moveaxis(np.tensordot(weights, data, axes=(1, dimension)), 0, dimension)
