"""The refractive-index volume of the paper: voxels, trilinear between eight corners."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeAlias, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.field.axis import Span
from nigemizu.field.background import Line, Piece, Polynomials, chord_pieces, spline_pieces
from nigemizu.field.cell import Cell
from nigemizu.field.quiet import QuietBlocks, find_quiet
from nigemizu.field.types import Precision, Types
from nigemizu.field.voxels import Beyond, VoxelField, horizontal_means, read_mesh

__all__ = ["Profile", "TrilinearVolume"]

Profile: TypeAlias = Literal["linear", "profile"]


@final
class TrilinearVolume(VoxelField):
    """Refractive index on the nodes of an orthogonal mesh, trilinear in between.

    Parameters
    ----------
    x, y, z : (nx,), (ny,), (nz,) array_like, m
        Node coordinates, strictly increasing; equal spacing is recognised and faster.
    refractivity : (nz, ny, nx) array_like, 1
        n − 1 on the nodes.
    types : Types
        Array types of positions and results.
    beyond : {"straight", "extend", "mean"}
        What lies beyond the sides. ``straight``: nothing, rays go straight. ``extend``: the outermost
        columns continue in x and y without a horizontal gradient: for ever where the air varies with
        height alone, else for 20 km, over which the round Earth falls by 31 m. ``mean``: within one cell the
        air passes over to the horizontal mean of the volume, which then goes on as far. Below the lowest and
        above the highest node the rays are straight in all cases.
    background : {"linear", "profile"}
        From what the voxels hold the deviation. ``linear``: the straight line in z nearest to the data;
        n is then trilinear, as in the paper. ``profile``: a cubic spline in z through the horizontal
        means of the data, so that only the deviation from it is trilinear.
    flatness : float, 1/m
        By how much the gradient that `cell` gives may differ from that of `value_and_gradient`, so that
        still air is crossed in one go; 0: not at all.
    storage : {"single", "double"}, optional
        Precision of the stored voxels; by default that of `types`.

    Raises
    ------
    InputError
        When axes do not increase, shapes disagree or the data are not finite.

    Notes
    -----
    Stored is the deviation δ from a background b(z), n = 1 + b(z) + δ, which is evaluated in closed form
    so that small differences of n survive in single precision. The linear one, b = N₀ + s (z − z₀), is
    fitted by least squares; the trilinear interpolant of a linear function is the function itself, so that
    the split changes nothing but round-off. The spline has not-a-knot ends and two continuous derivatives.
    Where the data do not vary horizontally no voxels are stored at all.

    The gradient is that of the interpolant, constant across cell faces only where the data make it so; on
    a face that of the cell above it is taken (on the last face that of the cell below). Beyond the mesh the
    value and gradient are those of the nearest point of the box, except for the horizontal gradient of
    extended columns, which is 0.

    A block of 4³, 16³ or 64³ cells is quiet if no component of ∇δ varies by more than `flatness` over it;
    `cell` then gives the whole block and a linear δ. It joins cells of the spline into one cubic where that
    changes db/dz by no more than a quarter of `flatness`.

    Limits: the interpolant is continuous, its gradient is not. Values are second order, gradients (and
    the angles of rays) first order in the cell size; with ``profile`` and air that is stratified, fourth
    and third.
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
        background: Profile = "linear",
        flatness: float = 0.0,
        storage: Precision | None = None,
    ) -> None:
        if background not in ("linear", "profile"):
            raise InputError(
                "no such background", key="background", value=background, expected="linear or profile"
            )
        if not 0 <= flatness < np.inf:
            raise InputError("must be 0 or positive, and finite", key="flatness", value=flatness)
        nodes, data = read_mesh(x, y, z, refractivity, beyond)
        super().__init__(nodes, types, beyond)
        self._shape = data.shape
        self._row, self._layer = data.shape[2], data.shape[1] * data.shape[2]
        self._voxel_type = types.storage(storage or types.precision)
        self._deviation = None
        self._quiet: QuietBlocks | None = None

        means, uniform = horizontal_means(data)
        if uniform or background == "profile":
            pieces = spline_pieces(nodes[2], means) if background == "profile" else chord_pieces(means)
        if uniform:
            # A broken line has no smooth cells to join.
            tolerance = flatness / 4 if background == "profile" else 0.0
            self._background = Polynomials(nodes[2], means, pieces, types, tolerance)
            return
        line = Line(nodes[2], means, types)
        at_nodes = means if background == "profile" else line.at_nodes
        dtype = np.float32 if (storage or types.precision) == "single" else np.float64
        # Beyond the last columns cells read on, times 0: one more row and layer keeps that within.
        stored = np.zeros(data.size + self._row + 2, dtype=dtype)
        deviation = stored[: data.size].reshape(data.shape)
        np.subtract(data, at_nodes[:, None, None], out=deviation, casting="same_kind")
        self._deviation = self._voxel_type(stored)
        self._end_columns()
        entries, table = find_quiet(deviation, nodes, flatness)
        if np.any(entries):
            self._quiet = QuietBlocks(entries, table, self._axes, types)
        self._background = line
        if background == "profile":
            tolerance = flatness / 4 if self._quiet is not None else 0.0
            self._background = Polynomials(nodes[2], means, pieces, types, tolerance)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes (nz, ny, nx)."""
        nz, ny, nx = self._shape
        return nz, ny, nx

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        if self._deviation is None:
            return self._column(position, active)
        i, u, per_dx = self._axes[0].locate(position.x, active)
        j, v, per_dy = self._axes[1].locate(position.y, active)
        k, w, per_dz = self._axes[2].locate(position.z, active)
        n, slope = self._background.value_and_slope(position.z, k, w, per_dz, active)

        corner = k * self._layer + (j * self._row + i)
        # δ at the eight corners; digits of the names: z, y, x
        (d000, d001, d010, d011), (d100, d101, d110, d111) = self._corners(corner, active)

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
        gradient_z = dr.fma(f1 - f0, per_dz, slope)
        if self._extended:
            outside_x, outside_y = self._outside(position)
            gradient_x = dr.select(outside_x, 0, gradient_x)
            gradient_y = dr.select(outside_y, 0, gradient_y)
        return n + deviation, self.types.Array3f(gradient_x, gradient_y, gradient_z)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        Array3f = self.types.Array3f
        if self._deviation is None:
            return self._column_cell(position, direction, active)
        x, y, z = self._spans_ahead(position, direction, active)
        air = self._background.piece(z, active)
        node = Array3f(x.node, y.node, z.node)
        lower, upper = Array3f(x.lower, y.lower, z.lower), Array3f(x.upper, y.upper, z.upper)
        if self._quiet is None:
            return Cell(_trilinear(node, self._polynomial(x, y, z, active), air, Array3f), lower, upper)

        quiet, linear, quiet_node, quiet_lower, quiet_upper = self._quiet.look_up((x, y, z), active)
        quiet_lower.z = dr.maximum(quiet_lower.z, air.lower)
        quiet_upper.z = dr.minimum(quiet_upper.z, air.upper)
        coefficients = [*linear, 0, 0, 0, 0]
        if not self._quiet.everywhere:
            # Each is 0 where the other holds.
            voxels = self._polynomial(x, y, z, active & ~quiet)
            coefficients = [one + other for one, other in zip(coefficients, voxels, strict=True)]
        node, lower, upper = (
            dr.select(quiet, of_block, of_cell)
            for of_block, of_cell in ((quiet_node, node), (quiet_lower, lower), (quiet_upper, upper))
        )
        return Cell(_trilinear(node, coefficients, air, Array3f), lower, upper)

    def _polynomial(self, x: Span, y: Span, z: Span, active: Any) -> list[Any]:
        """Coefficients of δ for 1, X, Y, Z, XY, XZ, YZ, XYZ, the offsets [m] from the cell's lower corner."""
        corner = z.index * self._layer + (y.index * self._row + x.index)
        (d000, d001, d010, d011), (d100, d101, d110, d111) = self._corners(corner, active)
        x00, x01, x10, x11 = d001 - d000, d011 - d010, d101 - d100, d111 - d110
        xy0, xy1 = x01 - x00, x11 - x10
        y0, z0 = d010 - d000, d100 - d000
        yz = (d110 - d100) - y0
        per_x, per_y, per_z = x.inverse_width, y.inverse_width, z.inverse_width
        per_xy, per_yz = per_x * per_y, per_y * per_z
        return [
            d000,
            x00 * per_x,
            y0 * per_y,
            z0 * per_z,
            xy0 * per_xy,
            (x10 - x00) * (per_x * per_z),
            yz * per_yz,
            (xy1 - xy0) * (per_xy * per_z),
        ]

    def _corners(self, corner: Any, active: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Stored deviation at the corners of a cell, in the precision of the positions: below, above."""
        below, above = (
            tuple(
                self.types.Float(dr.gather(self._voxel_type, self._deviation, layer + offset, active))
                for offset in (0, 1, self._row, self._row + 1)
            )
            for layer in (corner, corner + self._layer)
        )
        return below, above


def _trilinear(node: Any, coefficients: list[Any], air: Piece, Array3f: Any) -> Callable[[Any], Any]:
    """Formula of n and its gradient from the coefficients of δ about a node and a piece of background."""
    one, x, y, z, xy, xz, yz, xyz = coefficients

    def value_and_gradient(point: Any) -> tuple[Any, Any]:
        X, Y, Z = point - node
        n, slope = air.value_and_slope(point.z)
        twist = dr.fma(Z, xyz, xy)
        along_y = dr.fma(Z, yz, y)
        gradient_x = dr.fma(Y, twist, dr.fma(Z, xz, x))
        gradient_y = dr.fma(X, twist, along_y)
        gradient_z = dr.fma(X, dr.fma(Y, xyz, xz), dr.fma(Y, yz, z))
        deviation = dr.fma(X, gradient_x, dr.fma(Y, along_y, dr.fma(Z, z, one)))
        return n + deviation, Array3f(gradient_x, gradient_y, slope + gradient_z)

    return value_and_gradient
