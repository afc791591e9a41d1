"""Cubic splines through columns of values that make no extremes of their own."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["column_slopes", "upper_powers"]

FloatArray = NDArray[np.float64]

_STEEPEST: Final = 2.0  # times the flatter of the two chords that meet at a node
_FLATTEST: Final = 0.5
_CURVED: Final = 1.5  # times the slope that parabolas give there, for the top of a smooth hill
_AT_ENDS: Final = 3.0  # times the last chord


def upper_powers(rise: Any, begin: Any, end: Any) -> tuple[Any, Any]:
    """Coefficients of the second and third power of Hermite's cubic over a cell, by the fraction of it.

    Parameters
    ----------
    rise : array, 1
        By how much the value at the end exceeds that at the beginning.
    begin, end : array, 1
        Derivatives there, times the length of the cell.
    """
    third = (begin + end) - 2 * rise
    return rise - (begin + third), third


def column_slopes(z: FloatArray, values: FloatArray) -> FloatArray:
    """Derivatives at the nodes of the cubics through columns of values.

    Parameters
    ----------
    z : (nz,) float64, m
    values : (nz, …) float64, 1

    Returns
    -------
    (nz, …) float64, 1/m

    Notes
    -----
    They are those of the interpolating cubic spline with not-a-knot ends, unless a node lies on a kink, as
    the skin of hot air on a ground does. There the spline swings to and fro, and in air that would be a duct,
    in which light is caught, where there is none. A slope s is left alone within

    |m|/2 ≤ |s| ≤ max(2 |m|, 3/2 |t|), with the sign of t,

    m the flatter of the chords to both sides (0 if one rises and one falls), t the flatter of the slopes here
    of two parabolas, each through one of the chords and bent as the less curved of its ends. Elsewhere the
    weighted harmonic mean of the chords (Fritsch and Butland's) takes its place, or the nearest bound where
    they differ in sign. At the first and last node s has the sign of the only chord, and is no more than
    three times as steep. Then the column is solved for again, with these slopes held, so that their
    neighbours do not swing either.

    The upper bound is that of Huynh's M3 limiter with 2 in place of 3, with which slopes between the nodes
    would still not be monotone. In smooth data, on the top of a hill as well, the bounds do not touch the
    spline, and its order stays.

    References
    ----------
    H. T. Huynh (1993), Accurate monotone cubic interpolation, SIAM Journal on Numerical Analysis 30, 57–100,
    doi:10.1137/0730004; F. N. Fritsch, J. Butland (1984), A method for constructing local monotone piecewise
    cubic interpolants, SIAM Journal on Scientific and Statistical Computing 5, 300–304, doi:10.1137/0905021;
    C. de Boor (2001), A Practical Guide to Splines, revised edition, chapter IV.
    """
    h = np.diff(z).reshape(-1, *[1] * (values.ndim - 1))
    chords = np.diff(values, axis=0) / h
    slopes = np.empty_like(values)
    if len(h) == 1:
        slopes[:] = chords
        return slopes
    bends = _bends(np.diff(z), chords)
    slopes[:-1] = chords - h * (2 * bends[:-1] + bends[1:]) / 3
    slopes[-1] = chords[-1] + h[-1] * (bends[-2] + 2 * bends[-1]) / 3
    if len(h) > 2:  # a parabola is what it is
        low, high = _bounds(h, chords)
        kinked = np.any((slopes < low) | (slopes > high), axis=0)
        if np.any(kinked):
            parts = (part[..., kinked] for part in (slopes, chords, low, high))
            slopes[..., kinked] = _straightened(np.diff(z)[:, None], *parts)
    return slopes


def _straightened(
    h: FloatArray, slopes: FloatArray, chords: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Slopes of columns (nz, n) that leave their bounds."""
    before, after = h[:-1] + 2 * h[1:], 2 * h[:-1] + h[1:]
    one_way = chords[:-1] * chords[1:] > 0
    product = np.where(one_way, chords[:-1] * chords[1:], 1.0)
    weighted = np.where(one_way, before * chords[1:] + after * chords[:-1], 1.0)
    cut = np.clip(slopes, low, high)
    held = cut != slopes
    cut[1:-1] = np.where(held[1:-1] & one_way, (before + after) * product / weighted, cut[1:-1])
    return np.clip(_solve(h, chords, cut, held), low, high)


def _bounds(h: FloatArray, chords: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest slope at each node."""
    curved = np.diff(chords, axis=0) / (h[:-1] + h[1:])
    # of each interval: the less curved of its ends; the outermost have one
    least = np.concatenate([curved[:1], _minmod(curved[:-1], curved[1:]), curved[-1:]])
    parabola = _minmod((chords + h * least)[:-1], (chords - h * least)[1:])
    flatter = np.abs(_minmod(chords[:-1], chords[1:]))
    sign = np.sign(parabola)
    near = sign * _FLATTEST * flatter
    far = sign * np.maximum(_STEEPEST * flatter, _CURVED * np.abs(parabola))
    ends = [_AT_ENDS * chords[:1], _AT_ENDS * chords[-1:]]
    nothing = np.zeros_like(ends[0])
    near = np.concatenate([nothing, near, nothing])
    far = np.concatenate([ends[0], far, ends[1]])
    return np.minimum(near, far), np.maximum(near, far)


def _solve(h: FloatArray, chords: FloatArray, slopes: FloatArray, held: NDArray[np.bool_]) -> FloatArray:
    """Slopes (nz, n) of the splines through columns whose ends keep theirs, and the nodes that are held."""
    # h₁ s₀ + 2 (h₀ + h₁) s₁ + h₀ s₂ = 3 (h₁ chord₀ + h₀ chord₁), and so on
    result = slopes.copy()
    result[1:-1] = np.where(held[1:-1], slopes[1:-1], 3 * (h[1:] * chords[:-1] + h[:-1] * chords[1:]))
    above = np.zeros_like(result)
    for k in range(1, len(h)):
        free = ~held[k]
        below, diagonal = np.where(free, h[k], 0.0), np.where(free, 2 * (h[k - 1] + h[k]), 1.0)
        diagonal -= below * above[k - 1]
        above[k] = np.where(free, h[k - 1], 0.0) / diagonal
        result[k] = (result[k] - below * result[k - 1]) / diagonal
    for k in range(len(h) - 1, 0, -1):
        result[k] -= above[k] * result[k + 1]
    return result


def _minmod(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smaller of two numbers of one sign; 0 if their signs differ."""
    smaller = np.minimum(np.abs(a), np.abs(b))
    return np.asarray(np.where(a * b > 0, np.sign(a) * smaller, 0.0))


def _bends(h: FloatArray, chords: FloatArray) -> NDArray[Any]:
    """Half the second derivative of the splines at the nodes, (nz, …) [1/m²], from two intervals on."""
    last = len(h)
    bends = np.zeros((last + 1, *chords.shape[1:]))
    np.subtract(chords[1:], chords[:-1], out=bends[1:-1])
    if last == 2:
        bends[:] = bends[1] / (h[0] + h[1])
        return bends
    # h₀ q₀ + 2 (h₀ + h₁) q₁ + h₁ q₂ = 3 (chord₁ − chord₀), and so on; the ends follow from the two next
    # to each. The diagonal dominates: elimination needs no pivots, and one layer is done at a time.
    bends[1:-1] *= 3
    below, diagonal, above = h[:-1].copy(), 2 * (h[:-1] + h[1:]), h[1:].copy()
    diagonal[0] += h[0] + h[0] ** 2 / h[1]
    above[0] -= h[0] ** 2 / h[1]
    diagonal[-1] += h[-1] + h[-1] ** 2 / h[-2]
    below[-1] -= h[-1] ** 2 / h[-2]
    for k in range(2, last):
        factor = below[k - 1] / diagonal[k - 2]
        diagonal[k - 1] -= factor * above[k - 2]
        bends[k] -= factor * bends[k - 1]
    bends[last - 1] /= diagonal[-1]
    for k in range(last - 2, 0, -1):
        bends[k] = (bends[k] - above[k - 1] * bends[k + 1]) / diagonal[k - 1]
    bends[0] = bends[1] + (bends[1] - bends[2]) * (h[0] / h[1])
    bends[-1] = bends[-2] + (bends[-2] - bends[-3]) * (h[-1] / h[-2])
    return bends
