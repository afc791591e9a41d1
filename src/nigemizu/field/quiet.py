"""Blocks of voxels over which the gradient hardly changes: still air, crossed in one go."""

from __future__ import annotations

from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field.axis import Axis, Span
from nigemizu.field.splines import upper_powers
from nigemizu.field.types import Types

__all__ = ["QuietBlocks", "find_quiet"]

LEVELS: Final = 3  # blocks of 4, 16 and 64 cells to a side
LEVEL_BITS: Final = 2  # of an entry of the map, which hold its level; the others hold a row of the table


@final
class QuietBlocks:
    """Map of the quiet blocks and the linear functions that stand for the voxels in them, on the device.

    Parameters
    ----------
    entries, table : ndarray
        As `find_quiet` gives them.
    axes : tuple of Axis
        x, y, z.
    types : Types

    Attributes
    ----------
    everywhere : bool
        Whether all of the volume is quiet.
    """

    def __init__(
        self,
        entries: NDArray[np.uint32],
        table: NDArray[np.float64],
        axes: tuple[Axis, Axis, Axis],
        types: Types,
    ) -> None:
        self._types = types
        self._axes = axes
        self._row, self._layer = entries.shape[2], entries.shape[1] * entries.shape[2]
        self._entries = types.UInt32(entries.ravel())
        self._table = types.table(table)
        self.everywhere = bool(np.all(entries > 0))

    def look_up(self, spans: tuple[Span, Span, Span], active: Any) -> tuple[Any, Any, Any, Any, Any]:
        """The quiet block that holds a cell.

        Returns
        -------
        quiet : Bool — whether there is one; if not, the rest means nothing but that `linear` is 0
        linear : Array4f — deviation at the block's lower corner [1] and its gradient [1/m]
        node, lower, upper : Array3f, m — the lower corner, and the bounds of the block
        """
        types = self._types
        # Beyond the last nodes the outermost cells decide.
        cells = [dr.minimum(span.index, axis.cells - 1) for span, axis in zip(spans, self._axes, strict=True)]
        i, j, k = (cell >> 2 for cell in cells)
        entry = dr.gather(types.UInt32, self._entries, k * self._layer + (j * self._row + i), active)
        level = entry & ((1 << LEVEL_BITS) - 1)
        quiet = active & (level > 0)
        linear = dr.gather(types.Array4f, self._table, entry >> LEVEL_BITS, quiet)
        shift = 2 * level
        node, lower, upper = types.Array3f(0), types.Array3f(0), types.Array3f(0)
        for number, (axis, cell, span) in enumerate(zip(self._axes, cells, spans, strict=True)):
            first = (cell >> shift) << shift
            last = dr.minimum(first + (types.UInt32(1) << shift), axis.cells)
            outside = types.Bool(span.inverse_width == 0)
            corner = axis.node(first, quiet)
            node[number] = dr.select(outside, span.node, corner)
            lower[number] = dr.select(outside, span.lower, corner)
            upper[number] = dr.select(outside, span.upper, axis.node(last, quiet))
            # Beyond the nodes the value is that on the face, and nothing changes along the axis.
            slope = dr.select(outside, linear[number + 1], 0)
            linear[0] = dr.fma(slope, span.node - corner, linear[0])
            linear[number + 1] = linear[number + 1] - slope
        return quiet, linear, node, lower, upper


def find_quiet(
    deviation: NDArray[Any],
    nodes: list[NDArray[np.float64]],
    flatness: float,
    slope: NDArray[Any] | None = None,
) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
    """Largest blocks over which no component of the gradient varies by more than `flatness`.

    Parameters
    ----------
    deviation : (nz, ny, nx) floating point, 1
    nodes : list of (nx,), (ny,), (nz,) float64, m
    flatness : float, 1/m
    slope : (nz, ny, nx) floating point, 1/m
        The derivative in z at the nodes, where the deviation is cubic along every column between them; by
        default it is linear there.

    Returns
    -------
    entries : (bz, by, bx) uint32
        For each block of 4³ cells 0 if it is not quiet; else 4 r + l, with r the row of the table and
        4ˡ the side, in cells, of the quiet block that it is a part of.
    table : (m, 4) float64, 1 and 1/m
        Deviation at the block's lower corner, and its gradient in x, y, z: the middle of its range.
    """
    # A component is bilinear in each cell between the four edges that give it: edges have its extremes.
    ranges = []
    flat: NDArray[np.bool_] = np.ones([-(-(size - 1) // 4) for size in deviation.shape], dtype=np.bool_)
    for number, axis in enumerate((2, 1, 0)):
        if slope is None:
            ranges.append(_edge_ranges(deviation, nodes[number], axis))
        else:
            ranges.append(_spline_ranges(deviation, slope, nodes, axis))
        flat &= ranges[-1][1] - ranges[-1][0] <= flatness
        if not np.any(flat):
            return np.zeros(flat.shape, dtype=np.uint32), np.zeros((0, 4))
    levels = []
    for level in range(1, LEVELS + 1):
        if level > 1:
            ranges = [(_reduced(np.minimum, low), _reduced(np.maximum, high)) for low, high in ranges]
            flat = np.all([high - low <= flatness for low, high in ranges], axis=0)
        middle = np.stack([(low + high) / 2 for low, high in ranges], axis=-1)
        levels.append((level, flat, middle))
    entries: NDArray[np.uint32] = np.zeros(levels[0][1].shape, dtype=np.uint32)
    rows: list[NDArray[np.float64]] = []
    count = 0
    for level, flat, middle in reversed(levels):
        side = 4 ** (level - 1)
        free = flat & (entries[::side, ::side, ::side] == 0)
        numbers = np.zeros(flat.shape, dtype=np.uint32)
        where = np.argwhere(free)
        numbers[free] = ((count + np.arange(len(where))) << LEVEL_BITS) + level
        count += len(where)
        rows.append(_lines(deviation, nodes, 4 * side * where, 4 * side, middle[free]))
        for axis in range(3):
            numbers = np.repeat(numbers, side, axis=axis)
        entries += numbers[: entries.shape[0], : entries.shape[1], : entries.shape[2]]
    return entries, np.concatenate(rows)


def _edge_ranges(
    deviation: NDArray[Any], nodes: NDArray[np.float64], axis: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Least and greatest difference quotient along `axis` in each block of 4³ cells."""
    shape = [1, 1, 1]
    shape[axis] = -1
    quotient = np.diff(deviation, axis=axis)
    quotient *= (1 / np.diff(nodes)).astype(deviation.dtype).reshape(shape)
    low = _reduced(np.minimum, quotient, axis)
    high = _reduced(np.maximum, quotient, axis)
    for other in range(3):
        if other != axis:
            # The edges on a face belong to the blocks on both of its sides.
            low, high = _closed(np.minimum, low, other), _closed(np.maximum, high, other)
    return low, high


def _spline_ranges(
    deviation: NDArray[Any], slope: NDArray[Any], nodes: list[NDArray[np.float64]], axis: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The like of `_edge_ranges` for columns that are cubic splines: bounds, across them not the closest."""
    widths = np.diff(nodes[2]).astype(deviation.dtype)[:, None, None]
    along = nodes[2 - axis].astype(deviation.dtype)
    lows, highs = [], []
    for first in range(0, len(widths), 4):  # one layer of blocks at a time, which takes little memory
        h = widths[first : first + 4]
        values, slopes = (array[first : first + 5] for array in (deviation, slope))
        low, high = _slope_range(values, slopes, h) if axis == 0 else _across(values, slopes, h, along, axis)
        low, high = low.min(axis=0, keepdims=True), high.max(axis=0, keepdims=True)
        for other in (1, 2):
            fold = _reduced if other == axis else _closed
            low, high = fold(np.minimum, low, other), fold(np.maximum, high, other)
        lows.append(low)
        highs.append(high)
    return np.concatenate(lows), np.concatenate(highs)


def _slope_range(values: NDArray[Any], slopes: NDArray[Any], h: NDArray[Any]) -> tuple[Any, Any]:
    """Least and greatest slope of each column in each cell, where it is quadratic in z."""
    begin, end = slopes[:-1], slopes[1:]
    c2, c3 = _powers(values, slopes, h)
    # Where the second derivative changes its sign the slope turns.
    turns = c2 * (c2 + 3 * c3) < 0
    turn = begin - np.divide(c2 * c2, 3 * c3, out=np.zeros_like(c2), where=turns) / h
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    return np.where(turns, np.minimum(low, turn), low), np.where(turns, np.maximum(high, turn), high)


def _powers(values: NDArray[Any], slopes: NDArray[Any], h: NDArray[Any]) -> tuple[Any, Any]:
    """Coefficients of the second and third power of the fraction of each cell."""
    return upper_powers(np.diff(values, axis=0), h * slopes[:-1], h * slopes[1:])


def _across(
    values: NDArray[Any], slopes: NDArray[Any], h: NDArray[Any], along: NDArray[Any], axis: int
) -> tuple[Any, Any]:
    """Bounds of the difference quotient along `axis` (1, 2) in each cell, where it is cubic in z."""
    shape = [1, 1, 1]
    shape[axis] = -1
    inverse = (1 / np.diff(along)).reshape(shape)
    quotient = np.diff(values, axis=axis) * inverse
    c2, c3 = _powers(quotient, np.diff(slopes, axis=axis) * inverse, h)
    # A function leaves its chord by no more than an eighth of its greatest second derivative, w running to 1.
    margin = np.maximum(np.abs(c2), np.abs(c2 + 3 * c3)) / 4
    below, above = quotient[:-1], quotient[1:]
    return np.minimum(below, above) - margin, np.maximum(below, above) + margin


def _reduced(ufunc: Any, values: NDArray[Any], *axes: int) -> NDArray[Any]:
    """Extremes over groups of four along the axes (all of them by default)."""
    for axis in axes or range(3):
        values = ufunc.reduceat(values, np.arange(0, values.shape[axis], 4), axis=axis)
    return values


def _closed(ufunc: Any, values: NDArray[Any], axis: int) -> NDArray[Any]:
    """Extremes over groups of five nodes, of which neighbouring groups share one."""
    values = np.moveaxis(values, axis, 0)
    starts = np.arange(0, len(values) - 1, 4)
    inner = ufunc.reduceat(values[:-1], starts, axis=0)
    shared = values[np.minimum(starts + 4, len(values) - 1)]
    return np.moveaxis(ufunc(inner, shared), 0, axis)


def _lines(
    deviation: NDArray[Any],
    nodes: list[NDArray[np.float64]],
    corners: NDArray[np.int64],
    side: int,
    gradients: NDArray[Any],
) -> NDArray[np.float64]:
    """Rows of the table for blocks given by the cells (z, y, x) of their lower corners."""
    sizes = np.array(deviation.shape)
    middles = (corners + np.minimum(corners + side, sizes - 1)) // 2
    value = deviation[tuple(middles.T)].astype(np.float64)
    gradient = gradients.astype(np.float64)
    for number, axis in enumerate((2, 1, 0)):
        # Carried from a node in the middle, where the line meets the voxels, to the corner.
        value = value - gradient[:, number] * (
            nodes[number][middles[:, axis]] - nodes[number][corners[:, axis]]
        )
    return np.column_stack([value, gradient])
