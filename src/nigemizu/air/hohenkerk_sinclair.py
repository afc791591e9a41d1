"""The two-layer atmosphere of Hohenkerk and Sinclair, by which almanacs compute refraction."""

from __future__ import annotations

import math
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check

__all__ = ["HohenkerkSinclair"]

FloatArray: TypeAlias = NDArray[np.float64]

_GAS_CONSTANT: Final = 8314.32  # J kmol⁻¹ K⁻¹
_DRY: Final = 28.9644  # kg kmol⁻¹
_WATER: Final = 18.0152  # kg kmol⁻¹
_VAPOUR_EXPONENT: Final = 18.36  # of the vapour pressure in the temperature
_TROPOPAUSE: Final = 11_000.0  # m
_TOP: Final = 80_000.0  # m
_MBAR: Final = 100.0  # Pa; the formulas of the source are in mbar and µm


@final
class HohenkerkSinclair:
    """Air with a constant lapse rate up to 11 km and one temperature from there to 80 km.

    A value of this class is an index: called with heights it returns (n − 1, dn/dh).

    Parameters
    ----------
    temperature : float, K
        At the observer, 100 to 320.
    pressure : float, Pa
        At the observer.
    relative_humidity : float, 1
        At the observer, 0 to 1.
    wavelength : (K,) array_like or float, m
        In vacuum, 300 nm to 1700 nm.
    observer_height : float, m
        Below the tropopause at 11 km.
    latitude : float, rad
    lapse_rate : float, K m⁻¹
        By which the air cools upwards in the troposphere, 0.001 to 0.01.

    Attributes
    ----------
    radius : float, m
        6 378 120, of the sphere that belongs to the model.
    breaks : tuple of float, m
        The tropopause.
    top : float, m
        80 000.

    Raises
    ------
    InputError
        An argument is out of range.

    Notes
    -----
    With τ = T/T₀, γ = g M_d/(R α) and δ = 18.36, the vapour has the pressure p_w = p_w0 τ^δ and the air
    P = (P₀ + w) τ^γ − w τ^δ, w = (1 − M_w/M_d) p_w0 γ/(δ − γ): hydrostatic equilibrium of moist air with the
    gravity g of the whole column. n − 1 = (A(λ) P − 11.2684e-6 p_w)/T (P and p_w in mbar), with A(λ) =
    (287.6155 + 1.62887/λ² + 0.01360/λ⁴)·1e-6·273.15/1013.25 (λ in µm, the IAG resolution of 1999). Above
    the tropopause n − 1 falls exponentially. The saturation pressure, the definition of the humidity by
    the mixing ratio, and g by latitude and height follow SLALIB's ``sla_REFRO`` and its descendant in PAL.

    Limits: visible light and the near infrared; one gravity; vapour by a power law that is no weather.

    References
    ----------
    C. Y. Hohenkerk and A. T. Sinclair, The computation of angular atmospheric refraction at large zenith
    angles, NAO Technical Note 63 (1985).
    P. K. Seidelmann (ed.), Explanatory Supplement to the Astronomical Almanac (1992), section 3.281.
    P. T. Wallace, SLALIB (Starlink User Note 67), ``sla_REFRO`` (the constants as revised up to 2005).
    A. E. Gill, Atmosphere–Ocean Dynamics (1982), appendix 4 (saturation pressure).

    Examples
    --------
    >>> air = HohenkerkSinclair(288.15, 101325.0, wavelength=590e-9)
    >>> excess, slope = air(np.array([0.0, 20e3]))
    >>> (excess * 1e6).round(3).tolist()
    [277.185, 20.055]
    """

    radius: Final = 6_378_120.0
    breaks: Final = (_TROPOPAUSE,)
    top: Final = _TOP

    def __init__(
        self,
        temperature: float,
        pressure: float,
        *,
        relative_humidity: float = 0.0,
        wavelength: ArrayLike = 550e-9,
        observer_height: float = 0.0,
        latitude: float = math.pi / 4,
        lapse_rate: float = 0.0065,
    ) -> None:
        warmth = _check.checked(temperature, "temperature", "kelvin from 100 to 320", low=100.0, high=320.0)
        self.temperature = float(warmth)
        self.observer_height = float(
            _check.checked(
                observer_height, "observer_height", "metres from -1000 to 11000", low=-1e3, high=_TROPOPAUSE
            )
        )
        self.lapse_rate = float(
            _check.checked(lapse_rate, "lapse_rate", "K/m from 0.001 to 0.01", low=1e-3, high=1e-2)
        )
        angle = float(
            _check.checked(latitude, "latitude", "radians from -pi/2 to pi/2", low=-1.5708, high=1.5708)
        )
        light = 1e6 * _check.checked(
            wavelength, "wavelength", "metres from 300e-9 to 1700e-9", low=300e-9, high=1700e-9
        )
        gravity = 9.784 * (1.0 - 0.0026 * math.cos(2.0 * angle) - 2.8e-7 * self.observer_height)
        self._fall = gravity * _DRY / _GAS_CONSTANT  # K/m: T over the scale height of dry air
        self._exponent = self._fall / self.lapse_rate
        total = float(_check.pascal(pressure)) / _MBAR
        self._vapour = _vapour_pressure(self.temperature, total, float(_check.humidity(relative_humidity)))
        lighter = 1.0 - _WATER / _DRY
        self._lift = lighter * self._vapour * self._exponent / (_VAPOUR_EXPONENT - self._exponent)
        self._pressure = total + self._lift
        self._dry = np.asarray(
            (287.6155 + (1.62887 + 0.01360 / light**2) / light**2) * 1e-6 * 273.15 / 1013.25
        )
        edge = np.asarray(_TROPOPAUSE)
        self._edge_temperature = self.temperature - self.lapse_rate * (_TROPOPAUSE - self.observer_height)
        self._edge_excess = self._troposphere(edge)[0]

    def __call__(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """n − 1 [1] and dn/dh [m⁻¹] at heights [m], which broadcast with the wavelengths."""
        height = np.asarray(height, dtype=np.float64)
        excess, slope = self._troposphere(np.minimum(height, _TROPOPAUSE))
        above = height > _TROPOPAUSE
        if not np.any(above):
            return excess, slope
        rate = -self._fall / self._edge_temperature
        high = self._edge_excess * np.exp(rate * np.maximum(height - _TROPOPAUSE, 0.0))
        return np.where(above, high, excess), np.where(above, rate * high, slope)

    def _troposphere(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        warmth = self.temperature - self.lapse_rate * (height - self.observer_height)
        ratio = np.log(warmth / self.temperature)
        air = self._dry * self._pressure * np.exp((self._exponent - 1.0) * ratio) / self.temperature
        lack = (self._dry * self._lift + 11.2684e-6 * self._vapour) / self.temperature
        vapour = lack * np.exp((_VAPOUR_EXPONENT - 1.0) * ratio)
        slope = (self._exponent - 1.0) * air - (_VAPOUR_EXPONENT - 1.0) * vapour
        return np.asarray(air - vapour), np.asarray(-self.lapse_rate / warmth * slope)


def _vapour_pressure(temperature: float, total: float, humidity: float) -> float:
    """Pressure of the vapour [mbar] in air of a relative humidity by the mixing ratio, at mbar and K."""
    celsius = temperature - 273.15
    saturated = 10.0 ** ((0.7859 + 0.03477 * celsius) / (1.0 + 0.00412 * celsius))
    saturated *= 1.0 + total * (4.5e-6 + 6e-10 * celsius**2)
    return float(humidity * saturated / (1.0 - (1.0 - humidity) * saturated / total))
