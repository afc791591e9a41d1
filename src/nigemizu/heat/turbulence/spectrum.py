"""The spectrum of the temperature fluctuations, and the structure function that belongs to it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import gamma

__all__ = ["INERTIAL", "INNER", "outer_wave_number", "shape", "structure_function", "temperature_spectrum"]

INERTIAL: Final = float(gamma(8 / 3)) * math.sin(math.pi / 3) / (4 * math.pi**2)
"""A of Φ(k) = A C² k^(−11/3), which belongs to D(r) = C² r^(2/3): 0.0330."""

INNER: Final = float((3 / (2 * math.pi * INERTIAL * gamma(2 / 3))) ** 0.75)
"""km l0 for which D(r) tends to C² l0^(−4/3) r² below the inner scale: 5.91, printed as 5.92."""


def outer_wave_number(outer_scale: ArrayLike | None) -> np.ndarray:
    """k0 = 2π / L0 [m⁻¹]; 0 for no outer scale."""
    if outer_scale is None:
        return np.asarray(0.0)
    return np.asarray(2 * math.pi / np.asarray(outer_scale, dtype=np.float64))


def shape(
    squared: np.ndarray, k0: ArrayLike = 0.0, inner_scale: float = 0.0, largest: float | None = None
) -> np.ndarray:
    """Φ(k) / C² as a function of the squared wave number.

    Parameters
    ----------
    squared : ndarray of float64, m-2
        k².
    k0 : array_like, m-1
        Wave number of the outer scale; broadcasts against `squared`.
    inner_scale : float, m
    largest : float, m, optional
        See `Turbulence`.

    Returns
    -------
    ndarray of float64, m^(11/3)
    """
    value = INERTIAL * (squared + np.square(k0)) ** (-11 / 6)
    if inner_scale > 0:
        value *= np.exp(-squared * (inner_scale / INNER) ** 2)
    if largest is not None:
        value *= -np.expm1(-np.square(squared * (largest / (2 * math.pi)) ** 2))
    return np.asarray(value)


def temperature_spectrum(
    wave_number: ArrayLike,
    ct2: ArrayLike = 1.0,
    *,
    inner_scale: float = 0.0,
    outer_scale: float | None = None,
    largest: float | None = None,
) -> np.ndarray:
    """Three-dimensional spectrum Φ_T(k): the variance is its integral over all vectors k.

    Parameters
    ----------
    wave_number : array_like, m-1
        k, above zero.
    ct2 : array_like, K2 m-2/3
    inner_scale : float, m
        0: none.
    outer_scale, largest : float, m, optional
        See `Turbulence`, which has the formula and its references.

    Returns
    -------
    ndarray of float64, K2 m3

    Examples
    --------
    >>> round(float(temperature_spectrum(1.0)), 9)
    0.033005391
    """
    squared = np.square(np.asarray(wave_number, dtype=np.float64))
    return np.asarray(ct2 * shape(squared, outer_wave_number(outer_scale), inner_scale, largest))


def structure_function(
    distance: ArrayLike,
    ct2: float = 1.0,
    *,
    inner_scale: float = 0.0,
    outer_scale: float | None = None,
    largest: float | None = None,
) -> np.ndarray:
    """Mean squared temperature difference D_T(r) of two points, by quadrature.

    Parameters
    ----------
    distance : array_like, m
        r, not negative.
    ct2 : float, K2 m-2/3
    inner_scale : float, m
        0: none.
    outer_scale, largest : float, m, optional
        See `Turbulence`.

    Returns
    -------
    ndarray of float64, K2
        D(r) = 8π ∫ k² Φ(k) [1 − sin(kr)/(kr)] dk, to 1e-7 of its value.

    References
    ----------
    V. I. Tatarskii, The Effects of the Turbulent Atmosphere on Wave Propagation (1971), section 1.

    Examples
    --------
    >>> round(float(structure_function(8.0, 0.1)), 7)
    0.4
    """
    k0 = float(outer_wave_number(outer_scale))
    end = math.inf if inner_scale == 0 else 7 * INNER / inner_scale

    def density(k: float) -> float:
        return float(k * k * shape(np.asarray(k * k), k0, inner_scale, largest))

    distances = np.asarray(distance, dtype=np.float64)
    values = [_one_distance(density, float(r), k0, end) for r in distances.ravel()]
    return 8 * math.pi * ct2 * np.asarray(values).reshape(distances.shape)


def _one_distance(density: Callable[[float], float], r: float, k0: float, end: float) -> float:
    if r == 0:
        return 0.0
    # below the split the bracket is smooth; above it the one and the sine are integrated apart
    split = min(4 * math.pi / r, end)

    def bracket(k: float) -> float:
        phase = k * r
        return density(k) * (
            phase**2 / 6 * (1 - phase**2 / 20) if phase < 1e-3 else 1 - math.sin(phase) / phase
        )

    low = min(k0, 1 / r) * 1e-4 if k0 > 0 else 1e-12 / r
    total = _pieces(bracket, low, split, (k0, 1 / r))
    if split == end:
        return total
    total += _pieces(density, split, min(end, split * 1e15), (k0,))
    wave = quad(
        lambda k: density(k) / (k * r), split, end, weight="sin", wvar=r, epsabs=1e-9 * total, limit=500
    )
    return total - float(wave[0])


def _pieces(integrand: Callable[[float], float], low: float, high: float, places: tuple[float, ...]) -> float:
    """Integral over ln k, divided at `places` where they lie between the ends."""
    ends = sorted({math.log(k) for k in (low, high, *(place for place in places if low < place < high))})

    def logarithmic(u: float) -> float:
        return math.exp(u) * integrand(math.exp(u))

    pieces = (quad(logarithmic, a, b, epsabs=0, epsrel=1e-10, limit=200) for a, b in itertools.pairwise(ends))
    return float(sum(piece[0] for piece in pieces))
