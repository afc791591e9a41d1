"""Incompressibility: the pressure that takes the divergence out of the velocity, to round-off."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import numpy as np
import scipy.fft

from nigemizu.heat.flow.kernels import solve_columns
from nigemizu.heat.grid import Grid

__all__ = ["Poisson", "pivots"]


def pivots(grid: Grid, eigenvalues: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thomas's elimination of ∂²/∂z² − λ, ahead of all right-hand sides.

    Parameters
    ----------
    grid : Grid
    eigenvalues : (rows, columns) float64, m-2
        λ of each pair of waves along x and y; the first pair does not vary.

    Returns
    -------
    lower, upper : (nz,) float64, m-2
        Coefficients of the neighbours below and above.
    inverse : (nz, rows, columns) float64, m2
        One over the pivots.
    """
    z, centres = grid.z_widths, np.diff(grid.z)
    lower, upper = np.zeros_like(z), np.zeros_like(z)
    lower[1:], upper[:-1] = 1 / (centres * z[1:]), 1 / (centres * z[:-1])
    inverse = np.empty((len(z), *eigenvalues.shape))
    previous = np.zeros_like(eigenvalues)
    for k in range(len(z)):
        diagonal = -(lower[k] + upper[k]) - eigenvalues - lower[k] * previous
        if k == len(z) - 1:
            diagonal[0, 0] = -1.0  # the mean is free: any finite number does
        inverse[k] = 1 / diagonal
        previous = upper[k] * inverse[k]
    return lower, upper, inverse


@final
class Poisson:
    r"""Solves ∇²φ = d on the cells, with no gradient through ground, top and walls.

    Parameters
    ----------
    grid : Grid
    walls : (bool, bool)
        Whether the sides along x and y are walls; else periodic.
    share : callable
        ``share(work, count)`` calls ``work(first, last)`` for parts of 0…count, side by side.
    workers : int
        Threads of the transforms.

    Notes
    -----
    Fourier transforms (cosine transforms between walls) along x and y turn the seven-point operator into one
    tridiagonal system in z for each pair of wave numbers, with the eigenvalue
    :math:`(2 \sin(\pi m/N)/\Delta)^2` (m/2N between walls), which elimination solves. The operator is the
    divergence of the gradient that is taken from the velocity, so that what is left is round-off.

    Limits: cells of equal width along x and y; two volumes of memory and those of the transforms.
    """

    def __init__(
        self,
        grid: Grid,
        walls: tuple[bool, bool],
        share: Callable[[Callable[[int, int], None], int], None],
        workers: int,
    ) -> None:
        self._share, self._workers = share, workers
        self._walls = walls
        _, ny, nx = grid.shape
        self._shape = (ny, nx)
        self._transforms: list[tuple[str, int]] = []
        # The real transform comes first: it halves the rest.
        for axis, wall in sorted(((2, walls[0]), (1, walls[1])), key=lambda pair: not pair[1]):
            kind = "cosine" if wall else ("complex" if ("real", 2) in self._transforms else "real")
            self._transforms.append((kind, axis))
        eigenvalues = [self._eigenvalues(grid, axis) for axis in (1, 2)]
        total = np.add.outer(*eigenvalues)
        self._lower, self._upper, self._inverse = pivots(grid, total)

    def _eigenvalues(self, grid: Grid, axis: int) -> np.ndarray:
        count = grid.shape[axis]
        step = grid.horizontal_step("x" if axis == 2 else "y")
        kind = {place: kind for kind, place in self._transforms}[axis]
        modes = np.arange(count)
        if kind == "real":
            modes = modes[: count // 2 + 1]
        period = 2 * count if kind == "cosine" else count
        return np.asarray((2 * np.sin(np.pi * modes / period) / step) ** 2)

    def solve(self, values: np.ndarray) -> np.ndarray:
        """φ (nz, ny, nx) for the divergence `values`, which is overwritten."""
        spectrum: Any = values
        for kind, axis in self._transforms:
            spectrum = self._forward(kind, spectrum, axis)
        spectrum = np.ascontiguousarray(spectrum)

        def work(first: int, last: int) -> None:
            solve_columns(first, last, spectrum, self._inverse, self._lower, self._upper)

        self._share(work, spectrum.shape[1])
        for kind, axis in reversed(self._transforms):
            spectrum = self._backward(kind, spectrum, axis)
        return np.ascontiguousarray(spectrum)

    def _forward(self, kind: str, values: Any, axis: int) -> Any:
        if kind == "cosine":
            return scipy.fft.dct(values, type=2, axis=axis, overwrite_x=True, workers=self._workers)
        if kind == "real":
            return scipy.fft.rfft(values, axis=axis, workers=self._workers)
        return scipy.fft.fft(values, axis=axis, overwrite_x=True, workers=self._workers)

    def _backward(self, kind: str, values: Any, axis: int) -> Any:
        if kind == "cosine":
            return scipy.fft.idct(values, type=2, axis=axis, overwrite_x=True, workers=self._workers)
        if kind == "real":
            count = self._shape[axis - 1]
            return scipy.fft.irfft(values, n=count, axis=axis, overwrite_x=True, workers=self._workers)
        return scipy.fft.ifft(values, axis=axis, overwrite_x=True, workers=self._workers)
