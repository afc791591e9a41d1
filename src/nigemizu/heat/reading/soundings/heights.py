"""Heights of measured air: geopotential and geometric, and what the weight of the air says of gaps."""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.air import moist

__all__ = ["SCALE", "fill_heights", "fill_pressures", "geometric", "geopotential"]

FloatArray: TypeAlias = NDArray[np.float64]

STANDARD_GRAVITY: Final = 9.80665
"""m s⁻²; which makes a geopotential metre of 9.80665 J/kg."""

SCALE: Final = moist.DRY_AIR_GAS_CONSTANT / STANDARD_GRAVITY
"""m K⁻¹; geopotential metres per kelvin of virtual temperature in which the pressure falls by e."""

# WGS 84: semi-major axis, flattening, ω²a²b/GM, and the constants of Somigliana's formula.
_A: Final = 6378137.0
_F: Final = 1.0 / 298.257223563
_M: Final = 0.00344978650684
_EQUATOR: Final = 9.7803253359
_K: Final = 0.00193185265241
_E2: Final = 0.00669437999013


def _earth(latitude: float | None) -> tuple[float, float]:
    """Gravity at sea level over the standard one, and the radius [m] of the inverse square above it."""
    sine = math.sin(math.radians(45.0 if latitude is None else latitude)) ** 2
    gravity = _EQUATOR * (1.0 + _K * sine) / math.sqrt(1.0 - _E2 * sine)
    return gravity / STANDARD_GRAVITY, _A / (1.0 + _F + _M - 2.0 * _F * sine)


def geometric(height: FloatArray, latitude: float | None) -> FloatArray:
    """Metres above sea level of geopotential metres.

    Parameters
    ----------
    height : ndarray, geopotential m
    latitude : float, degree, optional
        Without it, 45.

    Returns
    -------
    ndarray of float64, m

    Notes
    -----
    z = R H / (R γ/g₀ − H): gravity γ of the WGS 84 ellipsoid at the latitude (Somigliana's formula), falling
    upwards as (R/(R + z))², R = a/(1 + f + m − 2 f sin²φ), which has the right slope at sea level.
    Limits: below 100 km, 1 m.

    References
    ----------
    NIMA TR8350.2, World Geodetic System 1984, 3rd ed. (2000), eqs. 4-1 and 4-3.

    Examples
    --------
    >>> round(float(geometric(np.array(10000.0), 45.0)), 1)
    10016.2
    """
    ratio, radius = _earth(latitude)
    return radius * height / (radius * ratio - height)


def geopotential(height: FloatArray, latitude: float | None) -> FloatArray:
    """Geopotential metres of metres above sea level: the inverse of `geometric`."""
    ratio, radius = _earth(latitude)
    return ratio * radius * height / (radius + height)


def fill_heights(height: FloatArray, pressure: FloatArray, virtual: FloatArray) -> FloatArray:
    """Geopotential heights where they are NaN, from the weight of the air.

    Parameters
    ----------
    height : (n,) ndarray, geopotential m
        NaN where unknown; if nowhere known, the first level is at 0.
    pressure : (n,) ndarray, Pa
        Strictly falling; a level may be NaN where the height is known.
    virtual : (n,) ndarray, K
        Virtual temperature.

    Returns
    -------
    (n,) ndarray of float64, geopotential m

    Notes
    -----
    dH = (R_d/g₀) T_v d(−ln p), T_v linear in ln p between levels. Between two known heights the computed
    thicknesses are stretched to fit; beyond the known ones they stand as they are.
    """
    height = height.copy()
    usable = np.isfinite(pressure)
    depth = -np.log(pressure[usable])
    warm = virtual[usable]
    path = np.concatenate([[0.0], np.cumsum(0.5 * (warm[1:] + warm[:-1]) * np.diff(depth))])
    values = height[usable]
    if not np.isfinite(height).any():
        values[0] = 0.0
    height[usable] = _anchored(values, path, SCALE)
    return height


def fill_pressures(pressure: FloatArray, height: FloatArray, virtual: FloatArray) -> FloatArray:
    """Pressures [Pa] where they are NaN, from all geopotential heights and at least one pressure.

    Notes
    -----
    d ln p = −(g₀/R_d) dH/T_v, T_v linear in H between levels; between two known pressures stretched to fit.
    """
    steps, mean = np.diff(height), 0.5 * (virtual[1:] + virtual[:-1])
    contrast = np.diff(virtual) / (virtual[1:] + virtual[:-1])
    # ∫ dH/T of a linear T is (dH/T_mean) artanh(c)/c, c the contrast; the quotient is 1 at c = 0.
    bend = np.divide(np.arctanh(contrast), contrast, out=np.ones_like(contrast), where=contrast != 0.0)
    path = np.concatenate([[0.0], np.cumsum(bend * steps / mean)])
    filled = np.exp(_anchored(np.log(pressure), path, -1.0 / SCALE))
    return np.where(np.isfinite(pressure), pressure, filled)


def _anchored(values: FloatArray, path: FloatArray, slope: float) -> FloatArray:
    """NaN values by the path: linear between known ones, with `slope` beyond the first and the last."""
    known = np.flatnonzero(np.isfinite(values))
    filled = np.interp(path, path[known], values[known])
    first, last = known[0], known[-1]
    filled[:first] = values[first] + slope * (path[:first] - path[first])
    filled[last + 1 :] = values[last] + slope * (path[last + 1 :] - path[last])
    filled[known] = values[known]
    return filled
