"""Air near the ground: the Monin–Obukhov surface layer with the Businger–Dyer functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Final, NamedTuple, Self, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from nigemizu.air import _check
from nigemizu.air.moist import DRY_AIR_GAS_CONSTANT
from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["SurfaceFluxes", "SurfaceLayer", "psi_heat", "psi_momentum", "solve"]

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
_COLDEST, _HOTTEST = 100.0, 2000.0  # K, of the ground


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
    >>> psi_momentum([-1.0, 0.0, 0.5]).round(4).tolist()
    [1.1162, 0.0, -2.5]
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
    >>> psi_heat([-1.0, 0.0, 0.5]).round(4).tolist()
    [1.8811, 0.0, -2.5]
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
    (0.13, -0.65, 298)
    """
    given = {"wind": wind, "air_temperature": air_temperature, "pressure": pressure}
    given |= {"roughness": roughness, "heat_roughness": heat_roughness}
    for key, value in given.items():
        _check.checked(value, key, "a number above 0", above=0.0)
    _check.checked(temperature_difference, "temperature_difference", "a finite number [K]")
    _check.checked(wind_height, "wind_height", "above the roughness [m]", above=roughness)
    _check.checked(air_height, "air_height", "above the heat_roughness [m]", above=heat_roughness)
    potential = air_temperature + _LAPSE * air_height
    demand = GRAVITY * temperature_difference / (potential * wind**2)

    def drag(inverse: float) -> float:
        return _rise(psi_momentum, roughness, wind_height, inverse)

    def heat(inverse: float) -> float:
        return _rise(psi_heat, heat_roughness, air_height, inverse)

    inverse = _inverse_length(demand, drag, heat, air_height, max(air_height, wind_height))
    friction = VON_KARMAN * wind / drag(inverse)
    scale = VON_KARMAN * temperature_difference / heat(inverse)
    flux = -_heat_capacity(pressure, air_temperature) * friction * scale
    return SurfaceFluxes(friction, scale, 1.0 / inverse if inverse else math.inf, flux)


@final
class SurfaceLayer(Value):
    """Temperature of the air above uniform ground, from the wind or from the fluxes.

    Give either `ground_temperature` and `wind`, or `heat_flux` and `friction_velocity`.

    Attributes
    ----------
    air_temperature : float, K
        At `air_height`.
    air_height : float, m
    ground_temperature : float, K, optional
        Of the surface itself, height 0.
    wind : float, m s⁻¹, optional
        At `wind_height`.
    wind_height : float, m
    heat_flux : float, W m⁻², optional
        Sensible heat, upwards positive.
    friction_velocity : float, m s⁻¹, optional
    roughness : float, m
        Of the wind's profile: 2e-4 for open water and smooth sand, some 1e-3 for a road.
    heat_roughness : float, m, optional
        Of the temperature's profile; a tenth of `roughness` when left out. Over water give 1e-4 m or a little
        less: the sea's lies at or below 1.15e-4 m (Fairall et al. 2003).
    blending_height : float, m, optional
        Above it the gradient of potential temperature dies away as exp(−(z − zb)/zb).
    surface_pressure : float, Pa
        Sets the density that turns a temperature scale into a heat flux.

    Notes
    -----
    θ(z) = θ_ground + (θ*/κ) [ln(z/zh) − ψh(z/L) + ψh(zh/L)], and T = θ − gz/cp. Close to the ground the straight
    line from the ground's temperature that touches this curve stands in for the molecular sublayer; it ends
    at e·zh in neutral air. Temperature and its gradient are continuous everywhere.

    Limits
    ------
    Flat, uniform, dry ground and steady wind. The logarithm ends at some tens of metres or at several |L|:
    higher up give `blending_height`. Molecules carry no more heat than k dT/dz: the line is true to them if
    zh is about D/(e κ u*), D being the thermal diffusivity (2.2e-5 m² s⁻¹).

    References
    ----------
    A. S. Monin, A. M. Obukhov, Tr. Geofiz. Inst. Akad. Nauk SSSR 24, 163 (1954). Functions: `psi_momentum`.
    C. W. Fairall et al., J. Climate 16, 571 (2003), doi:10.1175/1520-0442(2003)016<0571:BPOASF>2.0.CO;2.

    Examples
    --------
    >>> road = SurfaceLayer(ground_temperature=330.0, air_temperature=305.0, wind=3.0, roughness=0.002)
    >>> road.temperature([0.0, 0.01, 0.1, 2.0]).round(1).tolist()
    [330.0, 315.2, 309.0, 305.0]
    """

    air_temperature: Annotated[float, Field(ge=150.0, le=400.0, json_schema_extra={"unit": "K"})]
    air_height: Annotated[float, Field(gt=0.0, le=1e3, json_schema_extra={"unit": "m"})] = 2.0
    ground_temperature: Annotated[float, Field(ge=_COLDEST, le=_HOTTEST)] | None = Field(
        None, json_schema_extra={"unit": "K"}
    )
    wind: Annotated[float, Field(gt=0.0, le=150.0)] | None = Field(None, json_schema_extra={"unit": "m/s"})
    wind_height: Annotated[float, Field(gt=0.0, le=1e3, json_schema_extra={"unit": "m"})] = 10.0
    heat_flux: Annotated[float, Field(ge=-1e4, le=1e5)] | None = Field(
        None, json_schema_extra={"unit": "W/m2"}
    )
    friction_velocity: Annotated[float, Field(gt=0.0, le=20.0)] | None = Field(
        None, json_schema_extra={"unit": "m/s"}
    )
    roughness: Annotated[float, Field(gt=0.0, le=10.0, json_schema_extra={"unit": "m"})] = 2e-4
    heat_roughness: Annotated[float, Field(gt=0.0, le=10.0)] | None = Field(
        None, json_schema_extra={"unit": "m"}
    )
    blending_height: Annotated[float, Field(gt=0.0, le=1e4)] | None = Field(
        None, json_schema_extra={"unit": "m"}
    )
    surface_pressure: Annotated[float, Field(ge=1e3, le=1e7, json_schema_extra={"unit": "Pa"})] = 101325.0

    @model_validator(mode="after")
    def _one_way_that_has_a_solution(self) -> Self:
        self._refuse_two_ways()
        for key, floor, name in (
            ("wind_height", self.roughness, "roughness"),
            ("blending_height", self.air_height, "air_height"),
        ):
            height = getattr(self, key)
            unused = key == "wind_height" and self.wind is None
            if height is not None and not unused and height < floor * (1.0 + 1e-9):
                raise InputError(
                    f"not above the {name}", key=key, value=height, expected=f"above {floor:g} m"
                )
        _profile(self)
        return self

    def _refuse_two_ways(self) -> None:
        by_wind, by_flux = ("ground_temperature", "wind"), ("heat_flux", "friction_velocity")
        given = [key for key in (*by_wind, *by_flux) if getattr(self, key) is not None]
        if tuple(given) not in (by_wind, by_flux):
            raise InputError(
                f"{', '.join(given) or 'nothing'} given to settle the surface layer",
                key="ground_temperature, wind, heat_flux, friction_velocity",
                expected="either ground_temperature and wind, or heat_flux and friction_velocity",
                remedy="give the one pair whole and leave the other out",
            )

    @property
    def fluxes(self) -> SurfaceFluxes:
        """Friction velocity, temperature scale, Obukhov length and heat flux."""
        return _profile(self).fluxes

    def temperature(self, height: ArrayLike) -> FloatArray:
        """Temperature of the air.

        Parameters
        ----------
        height : array_like, m
            Above the ground, from 0 up.

        Returns
        -------
        ndarray of float64, K

        Raises
        ------
        InputError
            If a height is below 0 or not finite.
        """
        z = _check.checked(height, "height", "metres from 0 up", low=0.0)
        return _profile(self).potential(z) - _LAPSE * z

    def departure(self, height: ArrayLike) -> FloatArray:
        """Temperature [K] less that of the well-mixed air above, into which the layer fades.

        It goes to 0 above `blending_height`, so that it can be added to any other column of air.

        Raises
        ------
        InputError
            If a height is below 0 or not finite, or if there is no `blending_height`.
        """
        z = _check.checked(height, "height", "metres from 0 up", low=0.0)
        profile = _profile(self)
        if profile.blending is None:
            raise InputError(
                "a layer that never fades departs from nothing",
                key="blending_height",
                remedy="give a blending_height, such as 50 m",
            )
        return profile.potential(z) - profile.mixed


_LAPSE: Final = GRAVITY / SPECIFIC_HEAT  # K/m


class _Profile(NamedTuple):
    """Potential temperature [K], ready to be evaluated."""

    fluxes: SurfaceFluxes
    ground: float
    heat_roughness: float
    line_top: float
    blending: float | None

    def potential(self, z: FloatArray) -> FloatArray:
        top = np.inf if self.blending is None else self.blending
        inside = np.clip(z, self.line_top, top)
        step = self.fluxes.temperature_scale / VON_KARMAN
        curve = self.ground + step * _rises(psi_heat, self.heat_roughness, inside, self._inverse)
        value = np.where(z < self.line_top, self.ground + self._slope(self.line_top) * z, curve)
        if self.blending is None:
            return value
        fade = -np.expm1(-np.maximum(z - top, 0.0) / top)
        return np.asarray(value + self._slope(top) * top * fade)

    @property
    def mixed(self) -> float:
        """Potential temperature [K] of the well-mixed air above."""
        top = self.blending or math.inf
        return float(self.potential(np.asarray(top))) + self._slope(top) * top

    @property
    def _inverse(self) -> float:
        return 1.0 / self.fluxes.obukhov_length

    def _slope(self, z: float) -> float:
        return self.fluxes.temperature_scale / (VON_KARMAN * z) * _phi_heat(z * self._inverse)


def _profile(layer: SurfaceLayer) -> _Profile:
    rough = layer.roughness / 10.0 if layer.heat_roughness is None else layer.heat_roughness
    _check.checked(layer.air_height, "air_height", f"above the heat_roughness, {rough:g} m", above=rough)
    potential = layer.air_temperature + _LAPSE * layer.air_height
    if layer.wind is not None and layer.ground_temperature is not None:
        ground = layer.ground_temperature
        fluxes = solve(
            temperature_difference=potential - ground,
            air_temperature=layer.air_temperature,
            wind=layer.wind,
            air_height=layer.air_height,
            wind_height=layer.wind_height,
            roughness=layer.roughness,
            heat_roughness=rough,
            pressure=layer.surface_pressure,
        )
    else:
        fluxes = _from_fluxes(layer, potential)
        rise = _rise(psi_heat, rough, layer.air_height, 1.0 / fluxes.obukhov_length)
        ground = potential - fluxes.temperature_scale / VON_KARMAN * rise
        _check.checked(
            ground,
            "heat_flux, friction_velocity",
            f"a pair that leaves the ground between {_COLDEST:g} and {_HOTTEST:g} K",
            low=_COLDEST,
            high=_HOTTEST,
        )
    line_top = _line_top(rough, 1.0 / fluxes.obukhov_length)
    _check.checked(layer.air_height, "air_height", f"above the sublayer, {line_top:.3g} m", above=line_top)
    return _Profile(fluxes, ground, rough, line_top, layer.blending_height)


def _from_fluxes(layer: SurfaceLayer, potential: float) -> SurfaceFluxes:
    flux, friction = layer.heat_flux or 0.0, layer.friction_velocity or math.nan
    scale = -flux / (_heat_capacity(layer.surface_pressure, layer.air_temperature) * friction)
    inverse = VON_KARMAN * GRAVITY * scale / (friction**2 * potential)
    if inverse * layer.air_height > MOST_STABLE:
        raise InputError(
            f"too stable: z/L is {inverse * layer.air_height:.3g} at air_height",
            key="heat_flux",
            value=flux,
            expected=f"z/L up to {MOST_STABLE:g}",
            remedy="give more friction_velocity, less heat_flux downwards or a lower air_height",
        )
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
    return sign * _root(missing, low, high)


def _line_top(rough: float, inverse: float) -> float:
    """Height [m] at which a line from the ground's temperature touches the curve: H(z) = φh(z/L)."""

    def above(log: float) -> float:
        z = rough * math.exp(log)
        return _rise(psi_heat, rough, z, inverse) - _phi_heat(z * inverse)

    return rough * math.exp(_root(above, 0.0, 1.0 + STABLE))  # H ≥ ln(z/zh) and φh ≤ 6, or earlier


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where `function` passes 0 from below, to the last bit."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return high


def _rises(psi: Callable[[ArrayLike], FloatArray], low: float, z: FloatArray, inverse: float) -> FloatArray:
    return np.asarray(np.log(z / low) - psi(z * inverse) + psi(low * inverse))


def _rise(psi: Callable[[ArrayLike], FloatArray], low: float, high: float, inverse: float) -> float:
    return float(_rises(psi, low, np.asarray(high), inverse))


def _psi_stable(zeta: FloatArray) -> FloatArray:
    return np.asarray(-STABLE * (np.clip(zeta, 0.0, 1.0) + np.log(np.maximum(zeta, 1.0))))


def _phi_heat(zeta: float) -> float:
    return 1.0 / math.sqrt(1.0 - UNSTABLE * zeta) if zeta < 0.0 else 1.0 + STABLE * min(zeta, 1.0)


def _heat_capacity(pressure: float, temperature: float) -> float:
    return SPECIFIC_HEAT * pressure / (DRY_AIR_GAS_CONSTANT * temperature)
