"""What air takes from light: scattering by its molecules and its aerosol, absorption by ozone."""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from nigemizu.air import _check
from nigemizu.values import Value

__all__ = [
    "Coefficients",
    "Extinction",
    "depolarisation",
    "ozone_cross_section",
    "rayleigh_cross_section",
    "rayleigh_optical_depth",
]

FloatArray: TypeAlias = NDArray[np.float64]

_BOLTZMANN: Final = 1.380649e-23  # J/K
_AVOGADRO: Final = 6.0221367e23  # 1/mol, that of the source
_STANDARD_DENSITY: Final = 2.546899e25  # molecules per m³ at 288.15 K and 1013.25 hPa, that of the source
_DOBSON: Final = 2.687e20  # molecules per m² in a Dobson unit
_OZONE_LAYER: Final = (10e3, 25e3, 40e3)  # m: bottom, peak and top of a triangle
_RANGE: Final = {"low": 360e-9, "high": 830e-9}

# Ozone at 233 K, m²: means over steps of 10 nm, the first from 360 to 370 nm.
_OZONE_START, _OZONE_STEP = 360e-9, 10e-9
_OZONE: Final = 1e-26 * np.array(
    [
        [0.118, 0.02182, 0.02818, 0.06636, 0.1527, 0.2763, 0.552, 0.8451],
        [1.582, 2.316, 3.669, 4.924, 7.752, 9.016, 14.80, 16.02],
        [21.39, 27.55, 30.91, 35.00, 42.66, 46.72, 43.98, 47.01],
        [50.19, 43.05, 37.40, 32.15, 26.62, 22.38, 18.52, 14.73],
        [12.09, 9.423, 7.455, 6.566, 5.105, 4.150, 4.228, 3.237],
        [2.451, 2.801, 2.534, 1.624, 1.465, 2.078, 1.383, 0.7105],
    ]
).reshape(-1)


def rayleigh_cross_section(wavelength: ArrayLike, *, co2_fraction: float = 360e-6) -> FloatArray:
    """Scattering cross section of a molecule of dry air.

    Parameters
    ----------
    wavelength : array_like, m
        In vacuum, 230 nm to 1700 nm.
    co2_fraction : float, 1
        Mole fraction of CO₂.

    Returns
    -------
    ndarray of float64, m²

    Raises
    ------
    InputError
        A wavelength or the fraction is out of range.

    Notes
    -----
    σ = 24π³ (n² − 1)² / (λ⁴ N² (n² + 2)²) · F: n of air with 300 ppm of CO₂ at 288.15 K and 1013.25 hPa by
    Peck and Reeder, (n − 1) × (1 + 0.54 (C − 0.0003)) for a fraction C of CO₂, N = 2.546899e25 m⁻³, and the
    King factor F, the mean of the gases' by volume.

    References
    ----------
    B. A. Bodhaine, N. B. Wood, E. G. Dutton, J. R. Slusser, On Rayleigh optical depth calculations,
    J. Atmos. Oceanic Technol. 16 (1999) 1854, doi:10.1175/1520-0426(1999)016<1854:ORODC>2.0.CO;2, eqs. 2, 5,
    6, 18, 19, 22, 23.

    Examples
    --------
    >>> f"{float(rayleigh_cross_section(550e-9)):.4e}"
    '4.5105e-31'
    """
    light = _check.checked(
        wavelength, "wavelength", "metres from 230e-9 to 1700e-9", low=230e-9, high=1700e-9
    )
    s = (1e6 * light) ** -2
    fraction = float(_check.co2(co2_fraction))
    excess = 1e-8 * (8060.51 + 2480990.0 / (132.274 - s) + 17455.7 / (39.32957 - s))
    n2 = (1.0 + excess * (1.0 + 0.54 * (fraction - 0.0003))) ** 2
    lorentz = (n2 - 1.0) / (n2 + 2.0)
    return np.asarray(
        24 * math.pi**3 * lorentz**2 / (light**4 * _STANDARD_DENSITY**2) * _king(s, 100 * fraction)
    )


def depolarisation(wavelength: ArrayLike, *, co2_fraction: float = 360e-6) -> FloatArray:
    """Depolarisation ratio ρ of air [1] at wavelengths [m], by King's factor (6 + 3ρ)/(6 − 7ρ).

    Examples
    --------
    >>> float(depolarisation(550e-9).round(4))
    0.0283
    """
    king = _king((1e6 * np.asarray(wavelength, dtype=np.float64)) ** -2, 100 * co2_fraction)
    return np.asarray(6 * (king - 1) / (3 + 7 * king))


def _king(s: FloatArray, co2: float) -> FloatArray:
    """King's factor of air with `co2` percent of CO₂ at a squared wave number [µm⁻²]."""
    nitrogen = 1.034 + 3.17e-4 * s
    oxygen = 1.096 + 1.385e-3 * s + 1.448e-4 * s**2
    whole = 78.084 + 20.946 + 0.934 + co2
    return np.asarray((78.084 * nitrogen + 20.946 * oxygen + 0.934 + 1.15 * co2) / whole)


def rayleigh_optical_depth(
    wavelength: ArrayLike,
    *,
    pressure: float = 101_325.0,
    latitude: float = math.pi / 4,
    altitude: float = 0.0,
    co2_fraction: float = 360e-6,
) -> FloatArray:
    """Optical depth of all the molecules above a place, straight up.

    Parameters
    ----------
    wavelength : array_like, m
    pressure : float, Pa
        At the place.
    latitude : float, rad
    altitude : float, m
        Of the place above the sea.
    co2_fraction : float, 1

    Returns
    -------
    ndarray of float64, 1

    Raises
    ------
    InputError
        An argument is out of range.

    Notes
    -----
    τ = σ p N_A/(m g): m = 28.9595 + 15.0556 C g/mol, and g at the column's centre of mass,
    0.73737 z + 5517.56 m.

    References
    ----------
    As of `rayleigh_cross_section`, eqs. 10, 11, 17, 24, 25, 26.

    Examples
    --------
    >>> float(rayleigh_optical_depth(550e-9).round(5))
    0.09707
    """
    weight = float(_check.pascal(pressure))
    angle = float(
        _check.checked(latitude, "latitude", "radians from -pi/2 to pi/2", low=-1.5708, high=1.5708)
    )
    z = float(_check.checked(altitude, "altitude", "metres from -1000 to 20000", low=-1e3, high=2e4))
    molar = 1e-3 * (28.9595 + 15.0556 * co2_fraction)
    section = rayleigh_cross_section(wavelength, co2_fraction=co2_fraction)
    return np.asarray(section * weight * _AVOGADRO / (molar * _gravity(angle, 0.73737 * z + 5517.56)))


def _gravity(latitude: float, z: float) -> float:
    """Gravity [m/s²] at a latitude [rad] and a height [m], in the formula of the Smithsonian tables."""
    c = math.cos(2 * latitude)
    at_sea = 980.6160 * (1 - 0.0026373 * c + 0.0000059 * c**2)
    fall = (3.085462e-4 + 2.27e-7 * c) * z - (7.254e-11 + 1e-13 * c) * z**2 + (1.517e-17 + 6e-20 * c) * z**3
    return 1e-2 * (at_sea - fall)


def ozone_cross_section(wavelength: ArrayLike) -> FloatArray:
    """Absorption cross section of an ozone molecule at 233 K.

    Parameters
    ----------
    wavelength : array_like, m
        360 nm to 830 nm.

    Returns
    -------
    ndarray of float64, m²

    Raises
    ------
    InputError
        A wavelength is out of range.

    Notes
    -----
    Linear between means over 10 nm, each taken as the value at the lower end of its step, as is customary for
    this table: the Chappuis band lies 5 nm too far to the blue.

    References
    ----------
    V. Gorshelev, A. Serdyuchenko et al., Atmos. Meas. Tech. 7 (2014) 609, doi:10.5194/amt-7-609-2014; the
    means over 10 nm are those of E. Bruneton, Precomputed Atmospheric Scattering, 2017.

    Examples
    --------
    >>> f"{float(ozone_cross_section(600e-9)):.3e}"
    '5.019e-25'
    """
    light = _visible(wavelength)
    return np.interp(light, _OZONE_START + _OZONE_STEP * np.arange(_OZONE.size), _OZONE)


def _visible(wavelength: ArrayLike) -> FloatArray:
    return _check.checked(wavelength, "wavelength", "metres from 360e-9 to 830e-9", **_RANGE)


class Coefficients(NamedTuple):
    """Coefficients of extinction, each (K, nz) float64, 1/m; those of an aerosol include its absorption."""

    rayleigh: FloatArray
    aerosol: FloatArray
    ozone: FloatArray


@final
class Extinction(Value):
    """What the air holds besides its molecules, and how it scatters.

    Parameters
    ----------
    aerosol_depth : float, 1
        Optical depth of the whole aerosol at 550 nm, straight up from the sea: 0.05 is very clear, 0.3 hazy.
    angstrom_exponent : float, 1
        α of the aerosol's optical depth ∝ λ^−α.
    aerosol_height : float, m
        Over which the aerosol falls to 1/e.
    aerosol_albedo : float, 1
        Share of what the aerosol takes that it scatters.
    aerosol_asymmetry : float, 1
        Mean cosine of the angle by which the aerosol scatters.
    ozone : float, DU
        Column of ozone in Dobson units (1e-5 m of pure gas).

    Notes
    -----
    Aerosol: τ(λ) = aerosol_depth (λ/550 nm)^−α, its coefficient falls exponentially. Ozone lies in a layer
    whose density rises linearly from 10 km to 25 km and falls to 0 at 40 km.

    Limits: 360 nm to 830 nm; no water vapour, oxygen bands or nitrogen dioxide; the aerosol's albedo and
    asymmetry are the same for all colours.

    References
    ----------
    A. Ångström, Geografiska Annaler 11 (1929) 156, doi:10.2307/519399 (exponent).

    Examples
    --------
    >>> clear = Extinction(aerosol_depth=0.0)
    >>> beta = clear.coefficients([0.0, 25e3], [288.15, 221.65], [101325.0, 2511.0], 550e-9)
    >>> [f"{value:.3e}" for value in (*beta.rayleigh[0], *beta.ozone[0])]
    ['1.149e-05', '3.701e-07', '0.000e+00', '1.881e-06']
    """

    aerosol_depth: Annotated[float, Field(ge=0, le=10, json_schema_extra={"unit": "1"})] = 0.08
    angstrom_exponent: Annotated[float, Field(ge=-1, le=4, json_schema_extra={"unit": "1"})] = 1.3
    aerosol_height: Annotated[float, Field(ge=50, le=2e4, json_schema_extra={"unit": "m"})] = 1200.0
    aerosol_albedo: Annotated[float, Field(ge=0, le=1, json_schema_extra={"unit": "1"})] = 0.94
    aerosol_asymmetry: Annotated[float, Field(gt=-1, lt=1, json_schema_extra={"unit": "1"})] = 0.72
    ozone: Annotated[float, Field(ge=0, le=1000, json_schema_extra={"unit": "DU"})] = 300.0

    def aerosol_optical_depth(self, wavelength: ArrayLike) -> FloatArray:
        """Optical depth [1] of the whole aerosol at wavelengths [m], straight up from the sea."""
        return np.asarray(self.aerosol_depth * (_visible(wavelength) / 550e-9) ** -self.angstrom_exponent)

    def ozone_optical_depth(self, wavelength: ArrayLike) -> FloatArray:
        """Optical depth [1] of the whole ozone at wavelengths [m], straight up."""
        return np.asarray(self.ozone * _DOBSON * ozone_cross_section(wavelength))

    def coefficients(
        self,
        height: ArrayLike,
        temperature: ArrayLike,
        pressure: ArrayLike,
        wavelength: ArrayLike,
        *,
        co2_fraction: float = 450e-6,
    ) -> Coefficients:
        """Coefficients of extinction in layered air.

        Parameters
        ----------
        height : (nz,) array_like, m
            Above the sea.
        temperature : (nz,) array_like, K
        pressure : (nz,) array_like, Pa
        wavelength : (K,) array_like or float, m
        co2_fraction : float, 1

        Returns
        -------
        Coefficients
            Of molecules, aerosol and ozone, each (K, nz).

        Raises
        ------
        InputError
            An argument is out of range.
        """
        h = _check.checked(height, "height", "metres, finite")
        warmth, weight = _check.kelvin(temperature), _check.pascal(pressure)
        light = np.atleast_1d(_visible(wavelength))[:, None]
        density = weight / (_BOLTZMANN * warmth)
        falling = np.exp(-h / self.aerosol_height) / self.aerosol_height
        bottom, peak, top = _OZONE_LAYER
        layer = np.clip(np.minimum((h - bottom) / (peak - bottom), (top - h) / (top - peak)), 0, 1)
        return Coefficients(
            rayleigh_cross_section(light, co2_fraction=co2_fraction) * density,
            self.aerosol_optical_depth(light) * falling,
            self.ozone_optical_depth(light) * (layer / (0.5 * (top - bottom))),
        )
