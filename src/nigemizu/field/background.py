"""The part of a volume's refractivity that depends on height alone, in closed form."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field.axis import Span
from nigemizu.field.splines import column_slopes, upper_powers
from nigemizu.field.types import Types

__all__ = ["Background", "Line", "Piece", "Polynomials", "chord_pieces", "merged_pieces", "spline_pieces"]


@final
class Piece:
    """A range of heights in which one formula gives the background.

    Attributes
    ----------
    value_and_slope : callable
        Maps a height (Float, m) to the index of the background and its derivative (Float, 1 and 1/m).
    lower, upper : Float, m
    """

    __slots__ = ("lower", "upper", "value_and_slope")

    def __init__(self, value_and_slope: Callable[[Any], tuple[Any, Any]], lower: Any, upper: Any) -> None:
        self.value_and_slope = value_and_slope
        self.lower = lower
        self.upper = upper


class Background(ABC):
    """Index that depends on height alone; what the voxels hold is the deviation from it.

    Attributes
    ----------
    at_nodes : (nz,) float64, 1 — n − 1 of the background at the nodes of the vertical axis
    """

    at_nodes: NDArray[np.float64]

    @abstractmethod
    def value_and_slope(
        self, height: Any, index: Any, fraction: Any, inverse_width: Any, active: Any
    ) -> tuple[Any, Any]:
        """Index and its derivative (1 and 1/m) at a height [m] in the cell and at the fraction given."""

    @abstractmethod
    def piece(self, span: Span, active: Any) -> Piece:
        """The formula that holds in a cell of the vertical axis, and how far beyond it."""


@final
class Line(Background):
    """The straight line nearest to the horizontal means, by least squares: one formula for all heights."""

    def __init__(self, z: NDArray[np.float64], means: NDArray[np.float64], types: Types) -> None:
        height = z - z[0]
        centred = height - height.mean()
        slope = float(centred @ (means - means.mean()) / (centred @ centred))
        intercept = float(means.mean() - slope * height.mean())
        self.at_nodes = intercept + slope * height
        self._base, self._top = float(z[0]), float(z[-1])
        # Opaque: the next instant's values are not compiled into the kernel, which serves them all.
        self._base_index = dr.opaque(types.Float, 1.0 + intercept)
        self._slope = dr.opaque(types.Float, slope)

    def value_and_slope(
        self, height: Any, index: Any, fraction: Any, inverse_width: Any, active: Any
    ) -> tuple[Any, Any]:
        return self._at(dr.clip(height, self._base, self._top))

    def piece(self, span: Span, active: Any) -> Piece:
        return Piece(self._at, -dr.inf, dr.inf)

    def _at(self, height: Any) -> tuple[Any, Any]:
        return dr.fma(height - self._base, self._slope, self._base_index), self._slope


@final
class Polynomials(Background):
    """A cubic in each cell of the vertical axis.

    Parameters
    ----------
    z, means : (nz,) float64, m and 1
        Nodes, and n − 1 at them.
    pieces : (nz − 1, 4) float64, 1
        Coefficients of the powers 0 to 3 of the fraction of the cell, of n − 1.
    types : Types
    tolerance : float, 1/m
        By how much the derivative may be wrong where `piece` joins neighbouring cells; 0 joins none.

    Attributes
    ----------
    base_index : Float, 1
        To be added to what the cubics give.
    """

    def __init__(
        self,
        z: NDArray[np.float64],
        means: NDArray[np.float64],
        pieces: NDArray[np.float64],
        types: Types,
        tolerance: float = 0.0,
    ) -> None:
        self._types = types
        self.at_nodes = means
        reference = float(means.mean())  # taken off so that the coefficients keep their digits
        self.base_index = dr.opaque(types.Float, 1.0 + reference)
        offset = np.array([reference, 0, 0, 0])
        self._table = types.table(pieces - offset)
        self._merged: Any = None
        if tolerance > 0:
            joined, edges = merged_pieces(z, pieces, tolerance)
            lengths = np.diff(edges)
            if len(lengths) < len(pieces):
                # Per cell of the axis the cubic, the two edges and the inverse length of its piece.
                rows = np.column_stack([joined - offset, edges[:-1], edges[1:], 1 / lengths, 0 * lengths])
                of_cell = np.searchsorted(edges, z[:-1], side="right") - 1
                self._merged = types.table(rows[of_cell])

    def value_and_slope(
        self, height: Any, index: Any, fraction: Any, inverse_width: Any, active: Any
    ) -> tuple[Any, Any]:
        return self._at(self.powers(index, active), fraction, inverse_width)

    def piece(self, span: Span, active: Any) -> Piece:
        coefficients, lower, upper, inverse_length = self.joined(span, active)

        def value_and_slope(height: Any) -> tuple[Any, Any]:
            return self._at(coefficients, (height - lower) * inverse_length, inverse_length)

        return Piece(value_and_slope, lower, upper)

    def powers(self, index: Any, active: Any) -> Any:
        """Coefficients (Array4f, 1) of the powers of the fraction of one cell."""
        return dr.gather(self._types.Array4f, self._table, index, active)

    def joined(self, span: Span, active: Any) -> tuple[Any, Any, Any, Any]:
        """The like of the cells that `piece` joins, with their edges (m) and the inverse length (1/m)."""
        if self._merged is None:
            return self.powers(span.index, active), span.lower, span.upper, span.inverse_width
        Array4f = self._types.Array4f
        coefficients = dr.gather(Array4f, self._merged, 2 * span.index, active)
        lower, upper, inverse_length, _ = dr.gather(Array4f, self._merged, 2 * span.index + 1, active)
        return coefficients, lower, upper, inverse_length

    def _at(self, coefficients: Any, w: Any, inverse_length: Any) -> tuple[Any, Any]:
        c0, c1, c2, c3 = coefficients
        value = dr.fma(dr.fma(dr.fma(c3, w, c2), w, c1), w, c0)
        slope = dr.fma(dr.fma(3 * c3, w, 2 * c2), w, c1)
        return self.base_index + value, slope * inverse_length


def spline_pieces(z: NDArray[np.float64], means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (nz − 1, 4) of the interpolating cubics, in powers of the fraction of each cell.

    Their slopes are those of `nigemizu.field.splines.column_slopes`; two or three nodes get a line or a
    parabola.
    """
    widths, rise, slopes = np.diff(z), np.diff(means), column_slopes(z, means)
    begin, end = widths * slopes[:-1], widths * slopes[1:]
    return np.column_stack([means[:-1], begin, *upper_powers(rise, begin, end)])


def chord_pieces(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (nz − 1, 4) of the piecewise linear interpolant, in the same form."""
    nothing = np.zeros(len(means) - 1)
    return np.column_stack([means[:-1], np.diff(means), nothing, nothing])


def merged_pieces(
    z: NDArray[np.float64], pieces: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Neighbouring cells joined while one cubic can stand for them.

    Parameters
    ----------
    z : (nz,) float64, m
    pieces : (nz − 1, 4) float64, 1
        Cubics that join smoothly.
    tolerance : float, 1/m
        By how much the derivative may be wrong.

    Returns
    -------
    joined : (m, 4) float64, 1 — Hermite's cubics, in powers of the fraction of each joined piece
    edges : (m + 1,) float64, m
    """
    widths = np.diff(z)
    values = np.append(pieces[:, 0], pieces[-1].sum())
    # Derivative at the beginning, the middle and the end of each cell: it is quadratic in between.
    at = np.array([0.0, 0.5, 1.0])
    slopes = (pieces[:, 1, None] + (2 * pieces[:, 2, None] + 3 * pieces[:, 3, None] * at) * at) / widths[
        :, None
    ]
    end_slopes = np.append(slopes[:, 0], slopes[-1, 2])

    def hermite(first: int, last: int) -> NDArray[np.float64]:
        length, rise = z[last] - z[first], values[last] - values[first]
        begin, end = length * end_slopes[first], length * end_slopes[last]
        return np.array([values[first], begin, *upper_powers(rise, begin, end)])

    def error(first: int, last: int) -> float:
        _, c1, c2, c3 = hermite(first, last)
        length = z[last] - z[first]
        w = (z[first:last, None] + at * widths[first:last, None] - z[first]) / length
        wrong = (c1 + (2 * c2 + 3 * c3 * w) * w) / length - slopes[first:last]
        bend = 2 * (wrong[:, 0] + wrong[:, 2] - 2 * wrong[:, 1])
        tilt = wrong[:, 2] - wrong[:, 0] - bend
        turn = np.clip(np.divide(-tilt, 2 * bend, out=np.zeros_like(bend), where=bend != 0), 0, 1)
        at_turn = wrong[:, 0] + (tilt + bend * turn) * turn
        return float(max(np.abs(wrong).max(), np.abs(at_turn).max()))

    edges = [0]
    while edges[-1] < len(pieces):
        last = edges[-1] + 1
        while last < len(pieces) and error(edges[-1], last + 1) <= tolerance:
            last += 1
        edges.append(last)
    joined = [hermite(first, last) for first, last in itertools.pairwise(edges)]
    return np.array(joined), z[np.array(edges)]
