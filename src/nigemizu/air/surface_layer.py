"""Air near the ground: its temperature from the wind, or from the heat that the ground gives off."""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple, Self, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from nigemizu.air import _check, similarity
from nigemizu.air.similarity import SurfaceFluxes, psi_heat
from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["SurfaceLayer"]

FloatArray: TypeAlias = NDArray[np.float64]

_COLDEST: Final = 100.0  # K, of the ground
_HOTTEST: Final = 2000.0


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
    θ(z) = θ_ground + (θ*/κ) [ln(z/zh) − ψh(z/L) + ψh(zh/L)], and T = θ − gz/cp. Close to the ground the
    straight line from the ground's temperature that touches this curve stands in for the molecular
    sublayer; it ends at e·zh in neutral air. Temperature and its gradient are continuous everywhere.

    Limits: flat, uniform, dry ground and steady wind. The logarithm ends at some tens of metres, or at a few
    times the size of L: higher up give `blending_height`. Stable air is refused where z/L exceeds 6 at a
    height that was given; over a cold sea in a light wind, give the wind from lower down. Molecules carry no
    more heat than k dT/dz: the line is true to them if zh is about D/(e κ u*), D being the thermal
    diffusivity (2.2e-5 m² s⁻¹).

    References
    ----------
    A. S. Monin, A. M. Obukhov, Tr. Geofiz. Inst. Akad. Nauk SSSR 24, 163 (1954). Functions: `psi_momentum`.
    C. W. Fairall et al., J. Climate 16, 571 (2003), doi:10.1175/1520-0442(2003)016<0571:BPOASF>2.0.CO;2.

    Examples
    --------
    >>> road = SurfaceLayer(ground_temperature=330.0, air_temperature=305.0, wind=3.0, roughness=0.002)
    >>> road.temperature([0.0, 0.01, 0.1, 2.0]).round(1).tolist()
    [330.0, 316.8, 309.9, 305.0]
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

    @property
    def fluxes(self) -> SurfaceFluxes:
        """Friction velocity, temperature scale, Obukhov length and heat flux."""
        return _profile(self).fluxes

    @property
    def sublayer_top(self) -> float:
        """Height [m] up to which the temperature is a straight line."""
        return _profile(self).line_top

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
        return _profile(self).potential(z) - similarity.LAPSE * z

    def departure(self, height: ArrayLike) -> FloatArray:
        """Temperature [K] less that of the well-mixed air above, into which the layer fades.

        It goes to 0 above `blending_height`, so that it can be added to any other column of air.

        Raises
        ------
        InputError
            If a height is below 0 or not finite, or if there is no `blending_height`.
        """
        return Departure.of(self)(height)[0]


@final
class Departure(NamedTuple):
    """What a layer departs from the well-mixed air above it, solved once for many heights."""

    profile: _Profile

    @classmethod
    def of(cls, layer: SurfaceLayer) -> Self:
        """That of a layer with a blending height, or an `InputError`."""
        profile = _profile(layer)
        if profile.blending is None:
            raise InputError(
                "a layer that never fades departs from nothing",
                key="blending_height",
                remedy="give a blending_height, such as 50 m",
            )
        return cls(profile)

    def __call__(self, height: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Potential temperature [K] less that of the mixed air, and its derivative [K/m]."""
        z = _check.checked(height, "height", "metres from 0 up", low=0.0)
        return self.profile.potential(z) - self.profile.mixed, self.profile.slope(z)

    @property
    def breaks(self) -> FloatArray:
        """Heights [m] at which a higher derivative jumps, the top of the sublayer first."""
        profile = self.profile
        top = math.inf if profile.blending is None else profile.blending
        corner = profile.fluxes.obukhov_length  # φ has one at z = L in stable air
        inner = [corner] if profile.line_top < corner < top else []
        return np.array([profile.line_top, *inner, top])


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
        step = self.fluxes.temperature_scale / similarity.VON_KARMAN
        curve = self.ground + step * similarity.rises(psi_heat, self.heat_roughness, inside, self._inverse)
        value = np.where(z < self.line_top, self.ground + self._slope(self.line_top) * z, curve)
        if self.blending is None:
            return value
        fade = -np.expm1(-np.maximum(z - top, 0.0) / top)
        return np.asarray(value + self._slope(top) * top * fade)

    @property
    def mixed(self) -> float:
        """Potential temperature [K] of the well-mixed air above."""
        top = self.blending or math.inf
        return float(self.potential(np.asarray(top)) + self._slope(top) * top)

    @property
    def _inverse(self) -> float:
        return 1.0 / self.fluxes.obukhov_length

    def slope(self, z: FloatArray) -> FloatArray:
        """dθ/dz [K/m]."""
        top = np.inf if self.blending is None else self.blending
        curve = self._slope(np.clip(z, self.line_top, top))
        return curve if self.blending is None else curve * np.exp(-np.maximum(z - top, 0.0) / top)

    def _slope(self, z: FloatArray | float) -> FloatArray:
        gradient = self.fluxes.temperature_scale / (similarity.VON_KARMAN * z)
        return np.asarray(gradient * similarity.phi_heat(z * self._inverse))


def _profile(layer: SurfaceLayer) -> _Profile:
    rough = layer.roughness / 10.0 if layer.heat_roughness is None else layer.heat_roughness
    _check.checked(layer.air_height, "air_height", f"above the heat_roughness, {rough:g} m", above=rough)
    potential = layer.air_temperature + similarity.LAPSE * layer.air_height
    match (layer.ground_temperature, layer.wind, layer.heat_flux, layer.friction_velocity):
        case (float(ground), float(wind), None, None):
            fluxes = similarity.solve(
                temperature_difference=potential - ground,
                air_temperature=layer.air_temperature,
                wind=wind,
                air_height=layer.air_height,
                wind_height=layer.wind_height,
                roughness=layer.roughness,
                heat_roughness=rough,
                pressure=layer.surface_pressure,
            )
        case (None, None, float(heat_flux), float(friction)):
            fluxes = _of_fluxes(layer, heat_flux, friction, potential)
            rise = similarity.rise(psi_heat, rough, layer.air_height, 1.0 / fluxes.obukhov_length)
            ground = potential - fluxes.temperature_scale / similarity.VON_KARMAN * rise
            _refuse_impossible_ground(ground)
        case _:
            raise _neither_way(layer)
    line_top = _line_top(rough, 1.0 / fluxes.obukhov_length)
    _check.checked(layer.air_height, "air_height", f"above the sublayer, {line_top:.3g} m", above=line_top)
    return _Profile(fluxes, ground, rough, line_top, layer.blending_height)


def _of_fluxes(layer: SurfaceLayer, heat_flux: float, friction: float, potential: float) -> SurfaceFluxes:
    scale = -heat_flux / (similarity.heat_capacity(layer.surface_pressure, layer.air_temperature) * friction)
    inverse = similarity.VON_KARMAN * similarity.GRAVITY * scale / (friction**2 * potential)
    ratio = inverse * layer.air_height
    if ratio > similarity.MOST_STABLE:
        raise InputError(
            f"too stable: z/L is {ratio:.3g} at air_height",
            key="heat_flux",
            value=heat_flux,
            expected=f"z/L up to {similarity.MOST_STABLE:g}",
            remedy="give more friction_velocity, less heat downwards or a lower air_height",
        )
    return SurfaceFluxes(friction, scale, 1.0 / inverse if inverse else math.inf, heat_flux)


def _refuse_impossible_ground(temperature: float) -> None:
    _check.checked(
        temperature,
        "heat_flux, friction_velocity",
        f"a pair that leaves the ground between {_COLDEST:g} and {_HOTTEST:g} K",
        low=_COLDEST,
        high=_HOTTEST,
    )


def _neither_way(layer: SurfaceLayer) -> InputError:
    keys = ("ground_temperature", "wind", "heat_flux", "friction_velocity")
    given = [key for key in keys if getattr(layer, key) is not None]
    return InputError(
        f"{', '.join(given) or 'nothing'} given to settle the surface layer",
        key=", ".join(keys),
        expected="either ground_temperature and wind, or heat_flux and friction_velocity",
        remedy="give one pair whole and leave the other out",
    )


def _line_top(rough: float, inverse: float) -> float:
    """Height [m] at which a line from the ground's temperature touches the curve: H(z) = φh(z/L)."""

    def above(log: float) -> float:
        z = rough * math.exp(log)
        return similarity.rise(psi_heat, rough, z, inverse) - float(similarity.phi_heat(z * inverse))

    # H is at least ln(z/zh), and φh at most 1 + β, in stable air; in unstable air they meet below e zh.
    return rough * math.exp(similarity.root(above, 0.0, 1.0 + similarity.STABLE))
