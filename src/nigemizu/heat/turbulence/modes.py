"""The horizontal waves that fit into the box, and how strong each of them is."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from nigemizu.heat.grid import Grid
from nigemizu.heat.turbulence.levels import Spectra, Table, covariance

__all__ = ["Modes", "find_modes", "fold"]

POINTS: Final = (4, 24)
"""Points of the quadrature over the interval of wave numbers of a mode: elsewhere, and across zero."""

PER_OCTAVE: Final = 32
"""Entries of the table of F_ii for each factor of two of the horizontal wave number."""

OUTSIDE_PER_OCTAVE: Final = 16
"""Terms of the sum over what has no room on the grid, for each factor of two."""

IMAGES: Final = 2
"""Images of the spectrum on each side that are folded one by one; the rest is spread over all waves."""


@final
@dataclass(frozen=True)
class Modes:
    """Half of the waves exp(i (kx x + ky y)) of the box; the other half are their conjugates.

    Parameters
    ----------
    mx, my : (n,) int64
        Periods along x and along y, mx ≥ 0; sorted by the horizontal wave number.
    step_x, step_y : float, m-1
        2π over the extent of the box.
    ends : (float, float), m-1
        The grid holds |kx| and |ky| below these.
    middle : (n,) float64, m-1
        Horizontal wave number at the centre of the mode's interval.
    typical : (n,) float64, m-1
        Horizontal wave number of the power in the mode's interval: its geometric mean.
    power : (1 or nz, n) float64
        Variance of the complex amplitude for C_T² = 1; one row if it is the same at all levels.
    table : Table
        Of `Spectra.reduced`.
    diagonal : Table
        F_ii of the levels over the horizontal wave number.
    """

    mx: np.ndarray
    my: np.ndarray
    step_x: float
    step_y: float
    ends: tuple[float, float]
    middle: np.ndarray
    typical: np.ndarray
    power: np.ndarray
    table: Table
    diagonal: Table


def find_modes(grid: Grid, spectra: Spectra) -> Modes:
    """The modes of a grid.

    Every mode carries what the spectrum has in its interval of wave numbers, one step wide along x and y,
    so that a narrow box loses no variance. The mean of the level has no mode, and neither has the Nyquist
    wave number of an even number of cells, which cannot be moved by parts of a cell.
    """
    _, ny, nx = grid.shape
    step_x = 2 * math.pi / float(grid.x_edges[-1] - grid.x_edges[0])
    step_y = 2 * math.pi / float(grid.y_edges[-1] - grid.y_edges[0])
    top_x, top_y = (nx - 1) // 2, (ny - 1) // 2
    mx, my = (m.ravel() for m in np.meshgrid(np.arange(top_x + 1), np.arange(-top_y, top_y + 1)))
    half = (mx > 0) | (my > 0)
    mx, my = mx[half], my[half]
    middle = np.hypot(mx * step_x, my * step_y)
    order = np.lexsort((my, mx, middle))
    mx, my, middle = mx[order], my[order], middle[order]

    low = 1e-3 * min(step_x, step_y)
    high = (2 * IMAGES + 2) * math.hypot((top_x + 1) * step_x, (top_y + 1) * step_y)
    table = spectra.reduced(min(low, 1e-2 * float(np.min(spectra.k0))))
    diagonal = _diagonal(spectra, table, low, high)
    power = np.zeros((diagonal[1].shape[0], mx.size))
    typical = np.zeros(mx.size)
    for group, points in _groups(mx, my, nx, ny):
        q, weights = _interval(mx[group] * step_x, my[group] * step_y, step_x, step_y, points)
        mean = np.zeros(q.shape)
        for level, values in enumerate(diagonal[1]):
            inside = np.exp(np.interp(np.log(q), diagonal[0], values)) * weights
            power[level, group] = np.sum(inside, axis=1)
            mean += inside / np.maximum(power[level, group], 1e-300)[:, None]
        typical[group] = np.exp(np.sum(mean * np.log(q), axis=1) / np.sum(mean, axis=1))
    ends = ((top_x + 0.5) * step_x, (top_y + 0.5) * step_y)
    return Modes(mx, my, step_x, step_y, ends, middle, typical, power, table, diagonal)


def fold(grid: Grid, spectra: Spectra, modes: Modes) -> tuple[np.ndarray, np.ndarray, float]:
    """What has no room on the grid, added to the waves with which it coincides at the centres of the cells.

    Returns
    -------
    power : (1 or nz, n) float64
        As in `Modes`, of this part alone: the nearest images of the spectrum, and the rest of the variance
        outside spread evenly.
    covariance : (nz, nz) float64
        Vertical covariance, the same for all modes.
    typical : float, m-1
        Geometric mean of the horizontal wave number.
    """
    _, ny, nx = grid.shape
    counts, steps = (nx, ny), (modes.step_x, modes.step_y)
    low = min(end for end, count in zip(modes.ends, counts, strict=True) if count > 1)
    octaves = max(math.log2(spectra.end / low), 1.0)
    scale = np.linspace(
        math.log(low), math.log(low) + octaves * math.log(2), math.ceil(octaves * OUTSIDE_PER_OCTAVE)
    )
    weights = np.full(scale.size, scale[1] - scale[0])
    weights[[0, -1]] *= 0.5
    total, logarithm = np.zeros((grid.z.size, grid.z.size)), 0.0
    for q, weight in zip(np.exp(scale), weights, strict=True):
        if (measure := weight * q * q * _outside(q, modes.ends, counts)) == 0.0:
            continue
        part = measure * covariance(spectra, float(q), modes.table, grid.z)
        total += part
        logarithm += math.log(q) * part[-1, -1]

    power = np.zeros_like(modes.power)
    shifts = [range(-IMAGES, IMAGES + 1) if count > 1 else (0,) for count in counts]
    for image_x, image_y in itertools.product(*shifts):
        if image_x == image_y == 0:
            continue
        kx = (modes.mx + image_x * nx) * steps[0]
        ky = (modes.my + image_y * ny) * steps[1]
        q = np.log(np.hypot(kx, ky))
        for level, values in enumerate(modes.diagonal[1]):
            power[level] += np.exp(np.interp(q, modes.diagonal[0], values))
    # the farther images are about the same for all waves
    power *= math.prod(step for step, count in zip(steps, counts, strict=True) if count > 1)
    wanted = 0.5 * (np.diagonal(total) if power.shape[0] > 1 else np.diagonal(total)[:1])
    near = np.sum(power, axis=1)
    power *= np.minimum(1.0, wanted / near)[:, None]
    power += (np.maximum(wanted - near, 0.0) / modes.mx.size)[:, None]
    return power, total, math.exp(logarithm / total[-1, -1])


def _outside(q: float, ends: tuple[float, float], counts: tuple[int, int]) -> float:
    """Measure, over q, of the horizontal wave numbers of this size that the grid does not hold [rad or 1]."""
    if 1 in counts:  # on a line: both directions
        return 2.0 / q if q >= (ends[0] if counts[0] > 1 else ends[1]) else 0.0
    x, y = (min(1.0, end / q) for end in ends)
    return 2 * math.pi - 4 * max(0.0, math.asin(y) - math.acos(x))


def _groups(mx: np.ndarray, my: np.ndarray, nx: int, ny: int) -> list[tuple[np.ndarray, tuple[int, int]]]:
    """Modes that share a quadrature: finer across zero, where the spectrum peaks; none in a section."""
    few, many = POINTS
    parts = (
        (np.flatnonzero((mx > 0) & (my != 0)), (few, few)),
        (np.flatnonzero(my == 0), (few, many if ny > 1 else 0)),
        (np.flatnonzero(mx == 0), (many if nx > 1 else 0, few)),
    )
    return [part for part in parts if part[0].size]


def _interval(
    kx: np.ndarray, ky: np.ndarray, step_x: float, step_y: float, points: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal wave numbers inside each mode's interval, (n, points), and their weights, (points,)."""

    def axis(count: int, step: float) -> tuple[np.ndarray, np.ndarray]:
        if count == 0:  # a section: this axis has been integrated over
            return np.zeros(1), np.ones(1)
        nodes, weights = np.polynomial.legendre.leggauss(count)
        return 0.5 * step * nodes, 0.5 * step * weights

    (at_x, weights_x), (at_y, weights_y) = axis(points[0], step_x), axis(points[1], step_y)
    q = np.hypot((kx[:, None] + at_x)[:, :, None], (ky[:, None] + at_y)[:, None, :])
    return q.reshape(kx.size, -1), (weights_x[:, None] * weights_y).ravel()


def _diagonal(spectra: Spectra, table: Table, low: float, high: float) -> Table:
    """ln F_ii over ln q."""
    count = math.ceil(math.log2(high / low) * PER_OCTAVE) + 2
    logarithm = np.linspace(math.log(low), math.log(high), count)
    values = np.empty((spectra.k0.size, count))
    for place, q in enumerate(np.exp(logarithm)):
        roots, _, _ = spectra.vertical(float(q), table)
        values[:, place] = np.log(np.maximum(np.sum(roots**2, axis=1), 1e-290))
    return logarithm, values
