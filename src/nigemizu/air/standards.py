"""Standard atmospheres: temperatures and pressures that were agreed upon."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check
from nigemizu.errors import InputError

__all__ = [
    "STANDARD_TOP",
    "standard_atmosphere",
    "standard_breaks",
    "standard_gravity",
    "standard_temperature",
]

FloatArray: TypeAlias = NDArray[np.float64]
Standard: TypeAlias = Literal["us1976", "isa"]

_EARTH: Final = 6_356_766.0  # m, radius that turns geometric into geopotential heights
_GRAVITY: Final = 9.80665  # m/s², of geopotential heights
_GAS: Final = 8.31432 / 0.0289644  # J/(kg K), of dry air, with the constants of 1976
_PRESSURE: Final = 101_325.0  # Pa, at height 0
# Geopotential heights [m] where layers begin, temperature at the first [K], lapse [K/m] in each.
_BASES: Final = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3])
_LAPSES: Final = np.array([-6.5e-3, 0.0, 1e-3, 2.8e-3, 0.0, -2.8e-3, -2e-3])
_WARMTH: Final = 288.15 + np.concatenate([[0.0], np.cumsum(_LAPSES[:-1] * np.diff(_BASES))])

STANDARD_TOP: Final = {"us1976": 86_000.0, "isa": 80_000.0}
"""Geometric heights [m] at which the standards end (ISA: those of ISO 2533)."""


def standard_temperature(height: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Temperature of the U.S. Standard Atmosphere 1976, and of ISA, which are one up to 80 km.

    Parameters
    ----------
    height : array_like, m
        Geometric, from −5000 to 86 000.

    Returns
    -------
    temperature : ndarray of float64, K
        Above 80 km the molecular-scale temperature, which goes with the molar mass at the ground (the kinetic
        one is up to 0.04 % lower) and gives the density.
    slope : ndarray of float64, K/m
        Its derivative; at a break that of the layer above.

    Examples
    --------
    >>> temperature, _ = standard_temperature([0.0, 11019.0])
    >>> temperature.round(2).tolist()
    [288.15, 216.65]
    """
    h = _check.checked(height, "height", "metres from -5000 to 86000", low=-5000.0, high=86_000.0)
    geopotential, layer = _layer(h)
    temperature = _WARMTH[layer] + _LAPSES[layer] * (geopotential - _BASES[layer])
    return temperature, _LAPSES[layer] * (_EARTH / (_EARTH + h)) ** 2


def standard_breaks() -> FloatArray:
    """Geometric heights [m] at which the lapse rate of the standards changes."""
    return _EARTH * _BASES[1:] / (_EARTH - _BASES[1:])


def standard_gravity(height: ArrayLike) -> FloatArray:
    """Gravity [m/s²] that goes with the standards' geopotential heights, at a geometric height [m]."""
    return np.asarray(_GRAVITY * (_EARTH / (_EARTH + np.asarray(height, dtype=np.float64))) ** 2)


def standard_atmosphere(
    height: ArrayLike, kind: Standard = "us1976"
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Temperature, pressure and density of a standard atmosphere.

    Parameters
    ----------
    height : array_like, m
        Geometric, from −5000 to where the standard ends (`STANDARD_TOP`).
    kind : {"us1976", "isa"}

    Returns
    -------
    temperature, pressure, density : ndarray of float64, K, Pa, kg m⁻³

    Raises
    ------
    InputError
        If a height lies outside.

    Notes
    -----
    In each layer the molecular-scale temperature is linear in the geopotential height H = r₀ h/(r₀ + h), and
    p = p_b (T/T_b)^(−g₀/(R L)), or p_b exp(−g₀ (H − H_b)/(R T_b)) where L = 0.

    References
    ----------
    U.S. Standard Atmosphere, 1976, NOAA-S/T 76-1562, eqs. 23, 33a, 33b, 42. ISO 2533:1975.

    Examples
    --------
    >>> [float(part.round(4)) for part in standard_atmosphere(5000.0)]
    [255.6755, 54048.2861, 0.7364]
    """
    if kind not in STANDARD_TOP:
        raise InputError("no such standard", key="kind", value=kind, expected=" or ".join(STANDARD_TOP))
    top = STANDARD_TOP[kind]
    h = _check.checked(height, "height", f"metres from -5000 to {top:g}", low=-5000.0, high=top)
    temperature, _ = standard_temperature(h)
    bases = [_PRESSURE]
    for base, above, lapse, warmth in zip(_BASES[:-1], _BASES[1:], _LAPSES[:-1], _WARMTH[:-1], strict=True):
        bases.append(bases[-1] * float(_fall(above - base, lapse, warmth)))
    geopotential, layer = _layer(h)
    climb = geopotential - _BASES[layer]
    pressure = np.asarray(bases)[layer] * _fall(climb, _LAPSES[layer], _WARMTH[layer])
    return temperature, pressure, pressure / (_GAS * temperature)


def _layer(height: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Geopotential heights [m], and the layers that hold them; a break belongs to the layer above it."""
    return _EARTH * height / (_EARTH + height), np.searchsorted(standard_breaks(), height, side="right")


def _fall(climb: FloatArray, lapse: FloatArray, warmth: FloatArray) -> FloatArray:
    """Pressure after a geopotential climb [m] in a layer, in units of that at its base."""
    per_kelvin = _GRAVITY / _GAS
    even = np.exp(-per_kelvin * climb / warmth)
    sloping = np.where(lapse == 0, 1.0, lapse)
    power = (1 + sloping * climb / warmth) ** (-per_kelvin / sloping)
    return np.where(lapse == 0, even, power)
