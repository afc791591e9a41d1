"""A refractive-index volume for air in layers: cubic splines in height, bilinear across."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field.axis import Span
from nigemizu.field.background import Polynomials, spline_pieces
from nigemizu.field.cell import Cell
from nigemizu.field.quiet import QuietBlocks, find_quiet
from nigemizu.field.splines import column_slopes, upper_powers
from nigemizu.field.types import Precision, Types, aligned_zeros
from nigemizu.field.voxels import COLUMNS_REACH, Beyond, VoxelField, horizontal_means, read_mesh

__all__ = ["StratifiedVolume"]

SLAB: Final = 1 << 18  # nodes that are worked on at a time


@final
class StratifiedVolume(VoxelField):
    """Refractive index on the nodes of an orthogonal mesh, smooth in z and bilinear in x and y.

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
    flatness : float, 1/m
        By how much the gradient that `cell` gives may differ from that of `value_and_gradient`, so that
        still air is crossed in one go; 0: not at all.
    storage : {"single", "double"}, optional
        Precision of the stored voxels; by default that of `types`.
    reach : float, m
        How far uneven air goes on beyond extended sides.

    Raises
    ------
    InputError
        When axes do not increase, shapes disagree or the data are not finite.

    Notes
    -----
    n = 1 + b(z) + δ(x, y, z). Along every column of nodes n is the interpolating cubic spline with not-a-knot
    ends (through two or three nodes, a line or a parabola), held back where the data have a kink, so that it
    makes no extremes of its own (`nigemizu.field.splines`). b is the spline through the horizontal means, δ
    the rest, so that small differences survive in single precision. Between the columns δ is bilinear. Stored
    are, side by side for each node, δ and its derivative s; in a cell of height h, with w the fraction of it,
    δ = δ₀ + h s₀ w + c₂ w² + c₃ w³, c₂ = 3 (δ₁ − δ₀) − h (2 s₀ + s₁), c₃ = h (s₀ + s₁) − 2 (δ₁ − δ₀). Where
    the data do not vary horizontally no voxels are stored at all.

    Rays that run along layers meet few faces but those in z, and there n and its first derivative in z are
    continuous, away from kinks the second as well. Beyond the mesh the value and gradient are those of the
    nearest point of the box, except for the horizontal gradient of extended columns, which is 0.

    A block of 4³, 16³ or 64³ cells is quiet if no component of ∇δ varies by more than `flatness` over it;
    `cell` then gives the whole block and a linear δ. It joins cells of b into one cubic where that changes
    db/dz by no more than a quarter of `flatness`.

    Limits: across faces in x and y the gradient jumps. Values are fourth order and gradients third order in
    the cell height; in the cell's length and breadth values are second order and horizontal gradients first.
    It takes twice the memory of `TrilinearVolume`.

    References
    ----------
    C. de Boor (2001), A Practical Guide to Splines, revised edition, Springer, chapter IV.
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
        flatness: float = 0.0,
        storage: Precision | None = None,
        reach: float = COLUMNS_REACH,
    ) -> None:
        if not 0 <= flatness < np.inf:
            raise InputError("must be 0 or positive, and finite", key="flatness", value=flatness)
        nodes, data = read_mesh(x, y, z, refractivity, beyond, per_node=2)
        super().__init__(nodes, types, beyond, reach)
        self._shape = data.shape
        self._row, self._layer = data.shape[2], data.shape[1] * data.shape[2]
        self._deviation = None
        self._quiet: QuietBlocks | None = None

        means, uniform = horizontal_means(data)
        tolerance = flatness / 4 if uniform else 0.0
        if not uniform:
            precision = storage or types.precision
            self._record = types.pair(precision)
            # Beyond the last columns cells read on, times 0: one more row keeps that within.
            stored = aligned_zeros(2 * (data.size + self._row + 2), precision)
            records = stored[: 2 * data.size].reshape(*data.shape, 2)
            _fill(records, data, nodes[2], means)
            self._deviation = types.storage(precision)(stored)
            self._end_columns()
            entries, table = find_quiet(records[..., 0], nodes, flatness, records[..., 1])
            if np.any(entries):
                self._quiet = QuietBlocks(entries, table, self._axes, types)
                tolerance = flatness / 4
        self._air = Polynomials(nodes[2], means, spline_pieces(nodes[2], means), types, tolerance)
        self._background = self._air

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
        powers = self._powers(k * self._layer + (j * self._row + i), dr.rcp(per_dz), active)
        _add_to_first(powers, self._air.powers(k, active))
        n, along_x, along_y, along_z = _evaluate(powers, u, v, w)
        gradient = self.types.Array3f(along_x * per_dx, along_y * per_dy, along_z * per_dz)
        if self._extended:
            outside_x, outside_y = self._outside(position)
            gradient.x = dr.select(outside_x, 0, gradient.x)
            gradient.y = dr.select(outside_y, 0, gradient.y)
        return self._air.base_index + n, gradient

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        Array3f = self.types.Array3f
        if self._deviation is None:
            return self._column_cell(position, direction, active)
        x, y, z = self._spans_ahead(position, direction, active)
        node = Array3f(x.node, y.node, z.node)
        lower, upper = Array3f(x.lower, y.lower, z.lower), Array3f(x.upper, y.upper, z.upper)
        if self._quiet is None:
            powers = self._scaled_powers(x, y, z, active)
            _add_to_first(powers, self._air.powers(z.index, active))
            return Cell(self._formula(node, z.inverse_width, powers), lower, upper)

        quiet, linear, quiet_node, quiet_lower, quiet_upper = self._quiet.look_up((x, y, z), active)
        air, air_lower, air_upper, per_dz = self._air.joined(z, quiet)
        # δ of the block, from the lower end of the joined cells on and in their fraction.
        linear[0] = dr.fma(linear[3], air_lower - quiet_node.z, linear[0])
        quiet_node.z = air_lower
        quiet_lower.z = dr.maximum(quiet_lower.z, air_lower)
        quiet_upper.z = dr.minimum(quiet_upper.z, air_upper)
        per_dz = dr.select(quiet, per_dz, z.inverse_width)
        powers = [[linear[0], linear[1], linear[2], 0], [linear[3] * dr.rcp(per_dz), 0, 0, 0]]
        powers += [[0, 0, 0, 0], [0, 0, 0, 0]]
        if not self._quiet.everywhere:
            # Each is 0 where the other holds.
            rough = active & ~quiet
            voxels = self._scaled_powers(x, y, z, rough)
            powers = [
                [p + q for p, q in zip(*both, strict=True)] for both in zip(powers, voxels, strict=True)
            ]
            air = air + self._air.powers(z.index, rough)
        _add_to_first(powers, air)
        node, lower, upper = (
            dr.select(quiet, of_block, of_cell)
            for of_block, of_cell in ((quiet_node, node), (quiet_lower, lower), (quiet_upper, upper))
        )
        return Cell(self._formula(node, per_dz, powers), lower, upper)

    def _formula(self, node: Any, per_dz: Any, powers: list[list[Any]]) -> Callable[[Any], tuple[Any, Any]]:
        """n and its gradient from offsets [m] in x and y and the fraction of the cell in z."""
        Array3f, base = self.types.Array3f, self._air.base_index

        def value_and_gradient(point: Any) -> tuple[Any, Any]:
            X, Y, Z = point - node
            n, along_x, along_y, along_z = _evaluate(powers, X, Y, Z * per_dz)
            return base + n, Array3f(along_x, along_y, along_z * per_dz)

        return value_and_gradient

    def _scaled_powers(self, x: Span, y: Span, z: Span, active: Any) -> list[list[Any]]:
        """The like of `_powers` for offsets [m] in x and y."""
        corner = z.index * self._layer + (y.index * self._row + x.index)
        per_xy = x.inverse_width * y.inverse_width
        return [
            [one, along_x * x.inverse_width, along_y * y.inverse_width, twist * per_xy]
            for one, along_x, along_y, twist in self._powers(corner, dr.rcp(z.inverse_width), active)
        ]

    def _powers(self, corner: Any, height: Any, active: Any) -> list[list[Any]]:
        """δ in a cell, by the fractions of it: for each power of w the coefficients of 1, u, v, u v."""
        powers: list[list[Any]] = [[], [], [], []]
        below, above = (self._bilinear(layer, active) for layer in (corner, corner + self._layer))
        for (value, slope), (value_above, slope_above) in zip(below, above, strict=True):
            c1 = slope * height
            c2, c3 = upper_powers(value_above - value, c1, slope_above * height)
            for power, coefficient in zip(powers, (value, c1, c2, c3), strict=True):
                power.append(coefficient)
        return powers

    def _bilinear(self, corner: Any, active: Any) -> list[tuple[Any, Any]]:
        """Coefficients of 1, u, v, u v on one layer: of δ and of its slope."""
        Float = self.types.Float
        taps = [
            dr.gather(self._record, self._deviation, corner + offset, active)
            for offset in (0, 1, self._row, self._row + 1)
        ]
        made = []
        for number in range(2):
            t00, t01, t10, t11 = (Float(tap[number]) for tap in taps)
            along_x = t01 - t00
            made.append((t00, along_x, t10 - t00, (t11 - t10) - along_x))
        return list(zip(*made, strict=True))


def _add_to_first(powers: list[list[Any]], column: Any) -> None:
    """Add a cubic in w to one with coefficients that are bilinear."""
    for number, power in enumerate(powers):
        power[0] = power[0] + column[number]


def _evaluate(powers: list[list[Any]], X: Any, Y: Any, w: Any) -> tuple[Any, Any, Any, Any]:
    """Value and derivatives in X, Y, w of a cubic in w whose coefficients are bilinear in X and Y."""
    value, slope = None, None
    gradient_x, gradient_y = None, None
    for one, x, y, xy in reversed(powers):
        along_x, along_y = dr.fma(Y, xy, x), dr.fma(X, xy, y)
        here = dr.fma(X, along_x, dr.fma(Y, y, one))
        if value is None:
            value, gradient_x, gradient_y = here, along_x, along_y
            continue
        slope = value if slope is None else dr.fma(slope, w, value)
        value = dr.fma(value, w, here)
        gradient_x, gradient_y = dr.fma(gradient_x, w, along_x), dr.fma(gradient_y, w, along_y)
    return value, gradient_x, gradient_y, slope


def _fill(
    records: NDArray[Any], data: NDArray[Any], z: NDArray[np.float64], means: NDArray[np.float64]
) -> None:
    """Write the deviation from the means, and its derivative in z, side by side."""
    mean_slopes = column_slopes(z, means)[:, None, None]
    rows = max(1, SLAB // (data.shape[0] * data.shape[2]))
    for first in range(0, data.shape[1], rows):
        slab = data[:, first : first + rows].astype(np.float64, copy=False)
        records[:, first : first + rows, :, 0] = slab - means[:, None, None]
        records[:, first : first + rows, :, 1] = column_slopes(z, slab) - mean_slopes
