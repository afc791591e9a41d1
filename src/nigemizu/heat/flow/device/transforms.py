"""Waves along x and y: orthonormal real transforms as products with matrices.

A graphics card has arithmetic to spare, and a product of matrices needs no library of its own: for 256 cells
across it takes a few hundred multiplications per cell, in full double precision.
"""

from __future__ import annotations

from typing import Any, final

import drjit as dr
import numpy as np
import scipy.fft

__all__ = ["Waves", "wave_basis"]


def wave_basis(count: int, wall: bool) -> tuple[np.ndarray, np.ndarray]:
    """An orthonormal basis of the functions on a row of cells, in which second differences are diagonal.

    Parameters
    ----------
    count : int
    wall : bool
        Whether there are walls at both ends; else periodic.

    Returns
    -------
    basis : (count, count) float64
        Its rows: sines and cosines; between walls cosines. The first is constant.
    eigenvalues : (count,) float64
        4 sin²(πm/N) of each (πm/2N between walls): of minus the second difference.
    """
    if wall:
        modes = np.arange(count)
        basis = scipy.fft.dct(np.eye(count), type=2, norm="ortho", axis=0)
        return basis, 4 * np.sin(np.pi * modes / (2 * count)) ** 2
    row = np.arange(count)
    modes = (row + 1) // 2  # 0, 1, 1, 2, 2, …: a cosine, then a sine, of each wave number
    phase = 2 * np.pi * np.mod(np.outer(modes, row), count) / count
    basis = np.where((row % 2 == 1)[:, None], np.cos(phase), np.sin(phase)) * np.sqrt(2 / count)
    basis[0] = np.sqrt(1 / count)
    if count % 2 == 0:
        basis[-1] /= np.sqrt(2)  # of the shortest wave there is the cosine alone
    return basis, 4 * np.sin(np.pi * modes / count) ** 2


@final
class Waves:
    """Transform along one axis of an array, there and back.

    Parameters
    ----------
    types : nigemizu.field.Types
    basis : (count, count) float64
    before, after : int
        Product of the lengths of the axes before and after; the latter in fours.
    """

    def __init__(self, types: Any, basis: np.ndarray, before: int, after: int) -> None:
        assert after % 4 == 0
        self._types, self._before, self._quads = types, before, after // 4
        self._count = len(basis)
        self._there, self._back = (
            types.Float(part.ravel()) for part in (basis, np.ascontiguousarray(basis.T))
        )

    def there(self, values: Any) -> Any:
        """To the coefficients of the waves."""
        return self._product(self._there, values)

    def back(self, values: Any) -> Any:
        """To the values at the cells."""
        return self._product(self._back, values)

    def _product(self, matrix: Any, values: Any) -> Any:
        if self._count == 1:
            return values
        return _product(self._types, matrix, values, self._before, self._count, self._quads)


@dr.syntax
def _product(types: Any, matrix: Any, values: Any, before: int, count: int, quads: int) -> Any:
    """Σ over m of matrix[r, m] values[b, m, q], four numbers at a time."""
    UInt32, Array4f = types.UInt32, types.Array4f
    result = dr.empty(types.Float, before * count * quads * 4)
    place = dr.arange(UInt32, before * count * quads)
    whole = place // quads
    quad, batch = place - whole * quads, whole // count
    row = (whole - batch * count) * count
    at = batch * (count * quads) + quad
    total, m = dr.zeros(Array4f), UInt32(0)
    while dr.hint(m < count, label="waves", exclude=[result]):
        weight = dr.gather(types.Float, matrix, row + m)
        total = dr.fma(dr.gather(Array4f, values, at + m * quads), weight, total)
        m += 1
    dr.scatter(result, total, place)
    return result
