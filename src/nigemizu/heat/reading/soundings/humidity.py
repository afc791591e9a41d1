"""Water vapour of measured air: dew points and relative humidities, over water as sondes report them."""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import moist

__all__ = ["from_dew_point", "from_mass_fraction", "from_mixing_ratio", "saturated", "saturation_over_water"]

FloatArray: TypeAlias = NDArray[np.float64]

_TRIPLE_POINT: Final = 273.16  # K
_WATER_TO_DRY: Final = moist.WATER_MOLAR_MASS / 0.0289635  # kg mol⁻¹ of dry air


def saturation_over_water(temperature: ArrayLike) -> FloatArray:
    """Pressure of water vapour in equilibrium with liquid water, supercooled below 0 °C.

    Parameters
    ----------
    temperature : array_like, K

    Returns
    -------
    ndarray of float64, Pa

    Notes
    -----
    From the triple point upwards `nigemizu.air.saturation_vapour_pressure`; below it, where that one is over
    ice, ln(e/Pa) = 54.842763 − 6763.22/T − 4.210 ln T + 0.000367 T + tanh(0.0415 (T − 218.8))
    (53.878 − 1331.22/T − 9.44523 ln T + 0.014025 T). Sondes report relative humidity and dew point over
    liquid water at every temperature. Limits: 123 K to 647 K.

    References
    ----------
    D. M. Murphy and T. Koop, Q. J. R. Meteorol. Soc. 131 (2005) 1539, doi:10.1256/qj.04.94, eq. 10.

    Examples
    --------
    >>> round(float(saturation_over_water(240.0)), 2)  # over ice it would be 27.27
    37.67
    """
    temperature = np.asarray(temperature, dtype=np.float64)
    cold = np.minimum(temperature, _TRIPLE_POINT)
    log = np.log(cold)
    supercooled = np.exp(
        (54.842763 - 6763.22 / cold - 4.210 * log + 0.000367 * cold)
        + np.tanh(0.0415 * (cold - 218.8)) * (53.878 - 1331.22 / cold - 9.44523 * log + 0.014025 * cold)
    )
    warm = moist.saturation_vapour_pressure(np.maximum(temperature, _TRIPLE_POINT))
    return np.where(temperature < _TRIPLE_POINT, supercooled, warm)


def saturated(temperature: FloatArray, pressure: FloatArray) -> FloatArray:
    """Mole fraction f(p, T) e_w(T)/p of vapour at a relative humidity of 1, or at a dew point T."""
    enhancement = moist.enhancement_factor(temperature, pressure)
    return enhancement * saturation_over_water(temperature) / pressure


def from_dew_point(dew_point: FloatArray, pressure: FloatArray) -> FloatArray:
    """Mole fraction of vapour of air that saturates over water at `dew_point`; NaN where that is."""
    known = np.isfinite(dew_point)
    fraction = saturated(np.where(known, dew_point, _TRIPLE_POINT), pressure)
    return np.where(known, fraction, np.nan)


def from_mixing_ratio(ratio: FloatArray) -> FloatArray:
    """Mole fraction of vapour of a mass of vapour per mass of dry air."""
    return ratio / (ratio + _WATER_TO_DRY)


def from_mass_fraction(specific_humidity: FloatArray) -> FloatArray:
    """Mole fraction of vapour of a mass of vapour per mass of moist air."""
    parts = specific_humidity / _WATER_TO_DRY
    return parts / (1.0 - specific_humidity + parts)
