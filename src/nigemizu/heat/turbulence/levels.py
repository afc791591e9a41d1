"""How the levels of the air belong together: the vertical covariance at one horizontal wave number.

A level of horizontal wave number q is a sum over all vertical wave numbers m of waves exp(i m z) with random
amplitudes of the variance Φ(q, m; z), so that the covariance between two levels is

    F_ij(q) = ∫ sqrt(Φ_i Φ_j) cos(m (z_i − z_j)) dm,

which is a covariance whatever the heights of the levels are, and whatever changes with the height (Priestley
1965: an evolutionary spectrum). For m = p sinh(u) with p = sqrt(q² + k0²) a sum over even steps of u is exact
to round-off at one level; between levels each term is blurred by a Gaussian of three quarters of the local
step, so that levels far apart are told apart too, and the sum stays a covariance.

References
----------
M. B. Priestley, J. R. Stat. Soc. B 27 (1965) 204, doi:10.1111/j.2517-6161.1965.tb01488.x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from nigemizu.heat.kernels import compiled
from nigemizu.heat.turbulence.spectrum import INNER, shape

__all__ = ["Spectra", "Table", "coherence_factor", "covariance"]

Table = tuple[np.ndarray, np.ndarray]
"""Logarithms: of wave numbers, (n,), and of a spectrum at them for all levels, (levels, n)."""

STEP: Final = 0.05
"""Step of u. Blurred by 0.75 of it a power law k^(−11/3) is off by 0.03 % before normalisation."""

BLUR: Final = 0.75
"""Width of the Gaussians in steps: they add up to one within 2e-5."""

END: Final = 5.0
"""Wave numbers are followed up to this many km, where exp(−k²/km²) is 1e-11."""

PER_OCTAVE: Final = 48
"""Entries of a table of the spectrum for each factor of two of the wave number."""


@final
@dataclass(frozen=True)
class Spectra:
    """The spectra of all levels for C_T² = 1.

    Parameters
    ----------
    k0 : (1,) or (nz,) float64, m-1
        Wave number of the outer scale; one entry if it is the same at all levels.
    inner_scale : float, m
    largest : float or None, m
    section : bool
        The grid has a single cell along one horizontal axis and is a vertical section through the air:
        wave numbers along that axis are integrated over.
    """

    k0: np.ndarray
    inner_scale: float
    largest: float | None
    section: bool

    @property
    def end(self) -> float:
        """Largest wave number that counts [m⁻¹]."""
        return END * INNER / self.inner_scale

    def reduced(self, low: float) -> Table:
        """The spectrum on the two axes that are left, as a table.

        Parameters
        ----------
        low : float, m-1
            Lowest wave number that will be asked for.

        Returns
        -------
        Table
            ln k and ln Φ; levels as in `k0`.
        """
        octaves = math.log2(self.end / low) + 1
        logarithm = np.linspace(math.log(low), math.log(2 * self.end), math.ceil(octaves * PER_OCTAVE) + 2)
        squared = np.exp(2 * logarithm)
        k0 = self.k0[:, None]
        values = np.empty((k0.size, squared.size))
        if not self.section:
            values[:] = shape(squared, k0, self.inner_scale, self.largest)
        else:
            u = np.arange(0.0, math.asinh(2 * self.end / low) + STEP, STEP)
            for column, number in enumerate(squared):
                scale = np.sqrt(number + k0**2)
                across = scale * np.sinh(u)
                terms = scale * np.cosh(u) * shape(number + across**2, k0, self.inner_scale, self.largest)
                terms[:, 0] *= 0.5
                values[:, column] = 2 * STEP * np.sum(terms, axis=1)
        return logarithm, np.log(np.maximum(values, 1e-300))

    def vertical(self, q: float, table: Table) -> tuple[np.ndarray, ...]:
        """Vertical wave numbers for the horizontal one q.

        Returns
        -------
        roots : (levels, n) float64
            Square roots of the spectrum times the width in m; the sum of their squares over n is F_ii.
        m, blur : (n,) float64, m-1
        """
        scale = math.hypot(q, float(np.min(self.k0)))
        u = np.arange(0.0, math.asinh(self.end / scale) + STEP, STEP)
        m, width = scale * np.sinh(u), STEP * scale * np.cosh(u)
        logarithm = 0.5 * np.log(q * q + m * m)
        spectra = np.array([np.interp(logarithm, table[0], level) for level in table[1]])
        weights = 2 * width  # m and −m
        weights[0] *= 0.5
        return np.exp(0.5 * spectra) * np.sqrt(weights), m, BLUR * width


def covariance(spectra: Spectra, q: float, table: Table, heights: np.ndarray) -> np.ndarray:
    """F_ij at the horizontal wave number q [m⁻¹] between `heights` [m], (nz, nz) float64, for C_T² = 1."""
    roots, m, blur = spectra.vertical(q, table)
    rows = np.zeros(heights.size, dtype=np.int64) if roots.shape[0] == 1 else np.arange(heights.size)
    result = np.empty((heights.size, heights.size))
    _covariance(roots, rows, m, blur, heights, result)
    return result


def coherence_factor(covariance: np.ndarray) -> np.ndarray:
    """Lower triangular L with L Lᵀ = F_ij / sqrt(F_ii F_jj), (nz, nz) float64."""
    spread = np.sqrt(np.diagonal(covariance))
    factor = np.asarray(covariance / (spread[:, None] * spread))
    _factorise(factor)
    return factor


@compiled()
def _covariance(roots, rows, m, blur, heights, out):  # type: ignore[no-untyped-def]
    for i in range(heights.size):
        for j in range(i + 1):
            distance = heights[i] - heights[j]
            total = 0.0
            for n in range(m.size):
                faded = 0.5 * (blur[n] * distance) ** 2
                if faded > 36.0:
                    break
                product = roots[rows[i], n] * roots[rows[j], n]
                if product > 0.0:
                    total += product * math.cos(m[n] * distance) * math.exp(-faded)
            out[i, j] = total
            out[j, i] = total


@compiled()
def _factorise(a):  # type: ignore[no-untyped-def]
    """Cholesky, in place; a level that follows from those below it brings nothing of its own.

    Written out because its bits must not depend on the threads of a linear algebra library.
    """
    size = a.shape[0]
    for j in range(size):
        pivot = a[j, j]
        for k in range(j):
            pivot -= a[j, k] * a[j, k]
        root = math.sqrt(pivot) if pivot > 1e-13 else 0.0
        a[j, j] = root
        for i in range(j + 1, size):
            a[j, i] = 0.0
            if root == 0.0:
                a[i, j] = 0.0
                continue
            rest = a[i, j]
            for k in range(j):
                rest -= a[i, k] * a[j, k]
            a[i, j] = rest / root
