"""The similarity theory of Monin and Obukhov, with the functions of Businger and Dyer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check
from nigemizu.air.moist import DRY_AIR_GAS_CONSTANT
from nigemizu.errors import InputError

__all__ = ["SurfaceFluxes", "psi_heat", "psi_momentum", "solve"]

FloatArray: TypeAlias = NDArray[np.float64]

VON_KARMAN: Final = 0.4
UNSTABLE: Final = 16.0
"""γ in φh = φm² = (1 − γζ)^(−1/2), for ζ < 0 (Dyer 1974)."""
STABLE: Final = 5.0
"""β in φh = φm = 1 + βζ, for 0 < ζ < 1 (Dyer 1974); 1 + β from there on (Webb 1970)."""
MOST_STABLE: Final = 6.0
"""The largest ζ that Webb (1970) observed."""
GRAVITY: Final = 9.80665  # m s⁻²
SPECIFIC_HEAT: Final = 3.5 * DRY_AIR_GAS_CONSTANT  # J kg⁻¹ K⁻¹, dry air as a gas of stiff dumb-bells
LAPSE: Final = GRAVITY / SPECIFIC_HEAT  # K/m: of dry air that rises unheated


class SurfaceFluxes(NamedTuple):
    """What a surface layer carries.

    Attributes
    ----------
    friction_velocity : float, m s⁻¹
    temperature_scale : float, K
        θ* = −heat_flux / (ρ cp u*): below 0 over hot ground.
    obukhov_length : float, m
        L = u*² θ / (κ g θ*): below 0 over hot ground, infinite when no heat goes.
    heat_flux : float, W m⁻²
        Sensible heat, upwards positive.
    """

    friction_velocity: float
    temperature_scale: float
    obukhov_length: float
    heat_flux: float


def psi_momentum(zeta: ArrayLike) -> FloatArray:
    """Stability correction of the wind profile, ψm = ∫₀^ζ (1 − φm)/ζ′ dζ′.

    Parameters
    ----------
    zeta : array_like, 1
        Height over Obukhov length.

    Returns
    -------
    ndarray of float64, 1

    Notes
    -----
    φm is (1 − 16ζ)^(−1/4) below 0, 1 + 5ζ from 0 to 1, and 6 from there on.

    References
    ----------
    C. A. Paulson, J. Appl. Meteorol. 9, 857 (1970), doi:10.1175/1520-0450(1970)009<0857:TMROWS>2.0.CO;2.
    A. J. Dyer, Boundary-Layer Meteorol. 7, 363 (1974), doi:10.1007/BF00240838.
    E. K. Webb, Q. J. R. Meteorol. Soc. 96, 67 (1970), doi:10.1002/qj.49709640708: ζ from 1 to 6.

    Examples
    --------
    >>> psi_momentum([-1.0, 0.1, 2.0]).round(4).tolist()
    [1.1162, -0.5, -8.4657]
    """
    ratio = np.asarray(zeta, dtype=np.float64)
    x = (1.0 - UNSTABLE * np.minimum(ratio, 0.0)) ** 0.25
    unstable = (
        2.0 * np.log((1.0 + x) / 2.0) + np.log((1.0 + x * x) / 2.0) - 2.0 * np.arctan(x) + math.pi / 2.0
    )
    return np.where(ratio < 0.0, unstable, _psi_stable(ratio))


def psi_heat(zeta: ArrayLike) -> FloatArray:
    """Stability correction of the temperature profile, ψh = ∫₀^ζ (1 − φh)/ζ′ dζ′.

    As `psi_momentum`, but φh is (1 − 16ζ)^(−1/2) below 0.

    Parameters
    ----------
    zeta : array_like, 1
        Height over Obukhov length.

    Returns
    -------
    ndarray of float64, 1

    Examples
    --------
    >>> psi_heat([-1.0, 0.1, 2.0]).round(4).tolist()
    [1.8812, -0.5, -8.4657]
    """
    ratio = np.asarray(zeta, dtype=np.float64)
    root = np.sqrt(1.0 - UNSTABLE * np.minimum(ratio, 0.0))
    return np.where(ratio < 0.0, 2.0 * np.log((1.0 + root) / 2.0), _psi_stable(ratio))


def solve(
    *,
    temperature_difference: float,
    air_temperature: float,
    wind: float,
    air_height: float = 2.0,
    wind_height: float = 10.0,
    roughness: float = 2e-4,
    heat_roughness: float = 2e-5,
    pressure: float = 101325.0,
) -> SurfaceFluxes:
    """Fluxes that belong to a temperature difference and a wind.

    Parameters
    ----------
    temperature_difference : float, K
        Potential temperature of the air at `air_height` less that of the ground.
    air_temperature : float, K
        At `air_height`; it sets the density and the buoyancy.
    wind : float, m s⁻¹
        Above 0.
    air_height, wind_height : float, m
    roughness, heat_roughness : float, m
        Where the logarithmic profiles of wind and temperature reach the ground's values.
    pressure : float, Pa

    Returns
    -------
    SurfaceFluxes

    Raises
    ------
    InputError
        If a number is impossible, or if the air is so stable that z/L would exceed 6 at one of the heights:
        turbulence then no longer ties the air to the ground.

    Notes
    -----
    With M = ln(zu/z0) − ψm(zu/L) + ψm(z0/L) for the wind and H likewise for heat, u* = κU/M and θ* = κΔθ/H,
    so that L is the root of H/(L M²) = gΔθ/(θU²). Unstable air has exactly one; of several in stable air, the
    one nearest to neutral is taken. It is bracketed and then halved down to the last bit.

    Examples
    --------
    >>> road = solve(temperature_difference=-25.0, air_temperature=305.0, wind=3.0)
    >>> round(road.friction_velocity, 3), round(road.obukhov_length, 2), round(road.heat_flux)
    (0.141, -1.44, 174)
    """
    given = {"wind": wind, "air_temperature": air_temperature, "pressure": pressure}
    given |= {"roughness": roughness, "heat_roughness": heat_roughness}
    for key, value in given.items():
        _check.checked(value, key, "a number above 0", above=0.0)
    _check.checked(temperature_difference, "temperature_difference", "a finite number [K]")
    _check.checked(wind_height, "wind_height", "above the roughness [m]", above=roughness)
    _check.checked(air_height, "air_height", "above the heat_roughness [m]", above=heat_roughness)
    potential = air_temperature + LAPSE * air_height
    demand = GRAVITY * temperature_difference / (potential * wind**2)

    def drag(inverse: float) -> float:
        return rise(psi_momentum, roughness, wind_height, inverse)

    def heat(inverse: float) -> float:
        return rise(psi_heat, heat_roughness, air_height, inverse)

    inverse = _inverse_length(demand, drag, heat, air_height, max(air_height, wind_height))
    friction = VON_KARMAN * wind / drag(inverse)
    scale = VON_KARMAN * temperature_difference / heat(inverse)
    flux = -heat_capacity(pressure, air_temperature) * friction * scale
    return SurfaceFluxes(friction, scale, 1.0 / inverse if inverse else math.inf, flux)


def _inverse_length(
    demand: float,
    drag: Callable[[float], float],
    heat: Callable[[float], float],
    air_height: float,
    highest: float,
) -> float:
    """1/L [1/m] with which H/(L M²) is `demand`, that nearest to neutral."""
    if demand == 0.0:
        return 0.0
    sign = math.copysign(1.0, demand)
    limit = MOST_STABLE / highest if demand > 0.0 else math.inf

    def missing(size: float) -> float:
        return size * heat(sign * size) / drag(sign * size) ** 2 - abs(demand)

    low = min(abs(demand) * drag(0.0) ** 2 / heat(0.0), limit) / 64.0
    while missing(low) > 0.0:
        low /= 2.0
    high = low
    while missing(high) < 0.0:
        if high == limit:
            scale = air_height  # bulk Richardson number: g Δθ z / (θ U²)
            raise InputError(
                f"too stable: bulk Richardson number {demand * scale:.3g} over air_height",
                key="wind",
                expected=f"at most {(demand + missing(limit)) * scale:.3g}, where z/L is {MOST_STABLE:g}",
                remedy="give more wind, a warmer ground or lower heights, or a measured temperature profile",
            )
        low, high = high, min(high * 1.05, limit)
    return sign * root(missing, low, high)


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where `function` passes 0 from below, to the last bit."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return high


def rises(psi: Callable[[ArrayLike], FloatArray], low: float, z: FloatArray, inverse: float) -> FloatArray:
    return np.asarray(np.log(z / low) - psi(z * inverse) + psi(low * inverse))


def rise(psi: Callable[[ArrayLike], FloatArray], low: float, high: float, inverse: float) -> float:
    return float(rises(psi, low, np.asarray(high), inverse))


def _psi_stable(zeta: FloatArray) -> FloatArray:
    return np.asarray(-STABLE * (np.clip(zeta, 0.0, 1.0) + np.log(np.maximum(zeta, 1.0))))


def phi_heat(zeta: ArrayLike) -> FloatArray:
    ratio = np.asarray(zeta, dtype=np.float64)
    unstable = 1.0 / np.sqrt(1.0 - UNSTABLE * np.minimum(ratio, 0.0))
    return np.where(ratio < 0.0, unstable, 1.0 + STABLE * np.clip(ratio, 0.0, 1.0))


def heat_capacity(pressure: float, temperature: float) -> float:
    return SPECIFIC_HEAT * pressure / (DRY_AIR_GAS_CONSTANT * temperature)
