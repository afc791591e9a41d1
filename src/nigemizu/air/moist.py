"""Thermodynamics of moist air: water vapour, compressibility, density."""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check
from nigemizu.errors import InputError

__all__ = [
    "DRY_AIR_GAS_CONSTANT",
    "MOLAR_GAS_CONSTANT",
    "compressibility",
    "density",
    "enhancement_factor",
    "saturation_vapour_pressure",
    "water_vapour_fraction",
]

FloatArray: TypeAlias = NDArray[np.float64]

MOLAR_GAS_CONSTANT: Final = 8.314510
"""J mol⁻¹ K⁻¹; the CODATA 1986 value, with which Ciddor's constants were fitted."""

DRY_AIR_GAS_CONSTANT: Final = 287.053
"""J kg⁻¹ K⁻¹; specific gas constant of dry air in the US Standard Atmosphere 1976."""

WATER_MOLAR_MASS: Final = 0.018015
"""kg mol⁻¹ (Ciddor 1996)."""

CRITICAL_POINT: Final = 647.096
"""K; of water, above which nothing saturates."""

_ZERO_CELSIUS: Final = 273.15
_TRIPLE_POINT: Final = 273.16
# Ratio of the molar masses of water and of dry air with 400 ppm of CO2.
_WATER_TO_DRY: Final = 0.018015 / 0.0289635


def saturation_vapour_pressure(temperature: ArrayLike) -> FloatArray:
    """Pressure of water vapour in equilibrium with water, or with ice below 0 °C.

    Parameters
    ----------
    temperature : array_like, K

    Returns
    -------
    ndarray of float64, Pa

    Raises
    ------
    InputError
        A temperature is not finite and positive, or above the critical point of water.

    Notes
    -----
    Over water, from the triple point to the critical point at 647.096 K: the saturation line of
    IAPWS-IF97 (its region 4), as in NIST's calculator, which stays valid where the fit to −40…100 °C in
    Ciddor's paper ends and agrees with it to 6e-5 between 20 °C and 60 °C. Over ice:
    ln(e_s/611.657 Pa) = A₁(1 − θ^−1.5) + A₂(1 − θ^−1.25), θ = T/273.16 K. Limits: 190 K to 647.096 K.

    References
    ----------
    W. Wagner et al., J. Eng. Gas Turbines Power 122 (2000) 150, doi:10.1115/1.483186, eq. 30.
    W. Wagner, A. Saul and A. Pruß, J. Phys. Chem. Ref. Data 23 (1994) 515, doi:10.1063/1.555947.

    Examples
    --------
    >>> round(float(saturation_vapour_pressure(293.15)))
    2339
    """
    temperature = _check.checked(
        temperature,
        "temperature",
        "kelvin above 0, at most 647.096 (critical point)",
        above=0.0,
        high=CRITICAL_POINT,
    )
    return saturation_of(temperature)


def enhancement_factor(temperature: ArrayLike, pressure: ArrayLike) -> FloatArray:
    """Factor by which air at pressure p raises the saturation vapour pressure of pure water.

    Parameters
    ----------
    temperature : array_like, K
    pressure : array_like, Pa

    Returns
    -------
    ndarray of float64, 1

    Raises
    ------
    InputError
        A temperature or pressure is not finite and positive.

    Notes
    -----
    f = α + β p + γ t², t in °C (Davis 1992, as in Ciddor 1996, Appendix A).

    Examples
    --------
    >>> round(float(enhancement_factor(293.15, 101325.0)), 5)
    1.00403
    """
    return _enhancement(_check.kelvin(temperature), _check.pascal(pressure))


def water_vapour_fraction(
    temperature: ArrayLike, pressure: ArrayLike, relative_humidity: ArrayLike
) -> FloatArray:
    """Mole fraction of water vapour x_w = f(p, T) h e_s(T) / p in air of relative humidity h.

    Parameters
    ----------
    temperature : array_like, K
    pressure : array_like, Pa
    relative_humidity : array_like, 1
        From 0 to 1.

    Returns
    -------
    ndarray of float64, 1

    Raises
    ------
    InputError
        An argument is out of range, or the vapour alone would exceed the pressure of the air (boiling).

    Examples
    --------
    >>> round(float(water_vapour_fraction(293.15, 101325.0, 0.5)), 5)
    0.01159
    """
    temperature, pressure = _check.kelvin(temperature), _check.pascal(pressure)
    fraction = vapour_of(temperature, pressure, _check.humidity(relative_humidity))
    refuse_boiling(fraction)
    return fraction


def compressibility(
    temperature: ArrayLike, pressure: ArrayLike, water_vapour_fraction: ArrayLike = 0.0
) -> FloatArray:
    """Compressibility Z = p V / (R T) of a mole of moist air.

    Parameters
    ----------
    temperature : array_like, K
    pressure : array_like, Pa
    water_vapour_fraction : array_like, 1
        Mole fraction x_w of water vapour, 0 to 1.

    Returns
    -------
    ndarray of float64, 1

    Raises
    ------
    InputError
        An argument is out of range.

    Notes
    -----
    Z = 1 − (p/T)[a₀ + a₁t + a₂t² + (b₀ + b₁t)x + (c₀ + c₁t)x²] + (p/T)²(d + e x²), t in °C:
    Davis (1992), Ciddor (1996, Appendix A). Limits: fitted near one atmosphere and room temperature.

    Examples
    --------
    >>> round(float(compressibility(288.15, 101325.0)), 6)
    0.999592
    """
    temperature, pressure = _check.kelvin(temperature), _check.pascal(pressure)
    fraction = _check.checked(
        water_vapour_fraction, "water_vapour_fraction", "a mole fraction from 0 to 1", low=0.0, high=1.0
    )
    return pressure / temperature / moles_per_gas_constant(temperature, pressure, fraction)


def density(
    temperature: ArrayLike,
    pressure: ArrayLike,
    *,
    relative_humidity: ArrayLike = 0.0,
    co2_fraction: ArrayLike = 450e-6,
    equation_of_state: str = "ideal",
) -> FloatArray:
    """Density of moist air.

    Parameters
    ----------
    temperature : array_like, K
    pressure : array_like, Pa
    relative_humidity : array_like, 1
        From 0 to 1.
    co2_fraction : array_like, 1
        Mole fraction of CO₂; the ideal gas here has the fixed dry gas constant and does not feel it.
    equation_of_state : {"ideal", "bipm1991"}
        ``"ideal"``: ρ = p [1 − x_w(1 − M_w/M_a)] / (R_d T), R_d = 287.053 J/(kg K).
        ``"bipm1991"``: ρ = p M_a [1 − x_w(1 − M_w/M_a)] / (Z R T) (Davis 1992).

    Returns
    -------
    ndarray of float64, kg m⁻³

    Raises
    ------
    InputError
        An argument is out of range, or the equation of state is unknown.

    Notes
    -----
    Limits: the two differ by 4e-4 at 15 °C, the compressibility that an ideal gas lacks.

    Examples
    --------
    >>> round(float(density(300.0, 101325.0)), 4)
    1.1766
    """
    temperature, pressure = _check.kelvin(temperature), _check.pascal(pressure)
    _check.one_of(equation_of_state, ("ideal", "bipm1991"), "equation_of_state")
    humidity = _check.humidity(relative_humidity)
    carbon_dioxide = _check.co2(co2_fraction)
    fraction = vapour_of(temperature, pressure, humidity) if humidity.any() else np.zeros(())
    refuse_boiling(fraction)
    if equation_of_state == "ideal":
        return pressure * (1.0 - fraction * (1.0 - _WATER_TO_DRY)) / (DRY_AIR_GAS_CONSTANT * temperature)
    molar_mass = 1e-3 * (28.9635 + 12.011 * (carbon_dioxide - 400e-6))
    mean_mass = molar_mass + fraction * (WATER_MOLAR_MASS - molar_mass)
    return moles_per_gas_constant(temperature, pressure, fraction) * mean_mass / MOLAR_GAS_CONSTANT


def virtual_factor(fraction: FloatArray) -> FloatArray:
    """Ratio of the virtual temperature (of dry air of the same density) to the temperature."""
    return 1.0 / (1.0 - fraction * (1.0 - _WATER_TO_DRY))


# The unchecked kernels below work on blocks that fit a cache, in place where it pays.


def saturation_of(temperature: FloatArray) -> FloatArray:
    """Saturation vapour pressure, unchecked; infinite above the critical point, where nothing saturates."""
    # Symbols of IF97 eq. 30: the quartic root β = (e_s/1 MPa)^(1/4) of A β² + B β + C = 0, with A, B, C in ϑ.
    shifted = temperature - 650.17534844798  # K below the pole
    theta = temperature - 0.23855557567849 / shifted
    a = (theta + 1167.0521452767) * theta - 724213.16703206
    b = (-17.073846940092 * theta + 12020.82470247) * theta - 3232555.0322333
    c = (14.91510861353 * theta - 4823.2657361591) * theta + 405113.40542057
    with np.errstate(invalid="ignore", divide="ignore"):  # above the critical point
        over_water = 1e6 * (2.0 * c / (np.sqrt(b * b - 4.0 * a * c) - b)) ** 4
    if not temperature.size:
        return over_water
    if temperature.max() > CRITICAL_POINT:
        over_water = np.where(temperature > CRITICAL_POINT, np.inf, over_water)
    if temperature.min() >= _TRIPLE_POINT:
        return over_water
    inverse = _TRIPLE_POINT / np.minimum(temperature, _TRIPLE_POINT)
    over_ice = 611.657 * np.exp(-13.9281690 * (1.0 - inverse**1.5) + 34.7078238 * (1.0 - inverse**1.25))
    return np.where(temperature < _TRIPLE_POINT, over_ice, over_water)


def _enhancement(temperature: FloatArray, pressure: FloatArray) -> FloatArray:
    celsius = temperature - _ZERO_CELSIUS
    return 1.00062 + 3.14e-8 * pressure + 5.6e-7 * celsius**2


def vapour_of(temperature: FloatArray, pressure: FloatArray, relative_humidity: FloatArray) -> FloatArray:
    """Mole fraction of water vapour, unchecked."""
    fraction = _enhancement(temperature, pressure)
    fraction *= saturation_of(temperature)
    fraction *= relative_humidity
    fraction /= pressure
    return fraction


def refuse_boiling(fraction: FloatArray) -> None:
    """Raise `InputError` where the vapour pressure exceeds that of the air."""
    if fraction.size and not fraction.max() <= 1.0:
        raise InputError(
            "the water vapour alone would exceed the pressure of the air (it boils)",
            key="relative_humidity",
            expected="a humidity possible at the hottest temperature",
            remedy="lower the relative humidity or give the mole fraction of the vapour instead",
        )


def moles_per_gas_constant(
    temperature: FloatArray, pressure: FloatArray, fraction: FloatArray | None
) -> FloatArray:
    """p/(Z T), i.e. R times the molar density of the mixture [Pa/K], unchecked; `fraction` None is dry."""
    celsius = temperature - _ZERO_CELSIUS
    virial = np.multiply(celsius, 1.1043e-10)
    virial += -2.9331e-8
    virial *= celsius
    virial += 1.58123e-6
    third: float | FloatArray = 1.83e-11
    if fraction is not None:
        virial = virial + fraction * (
            (5.707e-6 - 2.051e-8 * celsius) + fraction * (1.9898e-4 - 2.376e-6 * celsius)
        )
        third = 1.83e-11 - 0.765e-8 * fraction**2
    ratio = pressure / temperature
    factor = ratio * third
    factor -= virial
    factor *= ratio
    factor += 1.0
    ratio = ratio / factor
    return ratio
