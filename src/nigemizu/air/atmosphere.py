"""The optical properties of the air of a scene that do not vary from place to place."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from nigemizu.air import laws, moist, pressure
from nigemizu.values import Value

__all__ = ["Atmosphere"]

FloatArray: TypeAlias = NDArray[np.float64]


@final
class Atmosphere(Value):
    """Air as an optical medium: everything but its temperature.

    Attributes
    ----------
    surface_pressure : float, Pa
        Pressure at height 0.
    relative_humidity : float, 1
        From 0 to 1.
    humidity_temperature : float, K, optional
        Temperature at which the relative humidity was measured. The vapour's mole fraction is then the same
        everywhere, as in well-mixed air over dry, hot ground. Without it the relative humidity itself is the
        same everywhere, so that hotter air holds more vapour.
    co2_fraction : float, 1
        Mole fraction of CO₂.
    wavelength : float, m
        Vacuum wavelength whose index bends the rays.
    model : {"ciddor1996", "lehn1978", "gladstone-dale", "edlen-nist"}
        Law of refraction: Ciddor (1996); n − 1 proportional to the density, as Lehn and El-Arini (1978) have
        it or with a constant of your own; Edlén's equation as NIST modified it.
    gladstone_dale_constant : float, m³ kg⁻¹, optional
        Needed by, and only by, the model ``"gladstone-dale"``.

    Examples
    --------
    >>> air = Atmosphere(relative_humidity=0.3, humidity_temperature=300.0)
    >>> float(air.refractivity(320.0, 101325.0).round(8))
    0.00024976
    """

    surface_pressure: Annotated[float, Field(ge=1.0, le=1e7, json_schema_extra={"unit": "Pa"})] = 101325.0
    relative_humidity: Annotated[float, Field(ge=0.0, le=1.0, json_schema_extra={"unit": "1"})] = 0.0
    humidity_temperature: Annotated[float, Field(ge=150.0, le=370.0)] | None = Field(
        None, json_schema_extra={"unit": "K"}
    )
    co2_fraction: Annotated[float, Field(ge=0.0, le=0.1, json_schema_extra={"unit": "1"})] = 450e-6
    wavelength: Annotated[float, Field(ge=300e-9, le=1700e-9, json_schema_extra={"unit": "m"})] = 550e-9
    model: Literal["ciddor1996", "lehn1978", "gladstone-dale", "edlen-nist"] = "ciddor1996"
    gladstone_dale_constant: Annotated[float, Field(gt=0.0, le=0.01)] | None = Field(
        None, json_schema_extra={"unit": "m3/kg"}
    )

    @model_validator(mode="after")
    def _constant_belongs_to_model(self) -> Self:
        if (self.model == "gladstone-dale") != (self.gladstone_dale_constant is not None):
            raise ValueError(
                "gladstone_dale_constant goes with the model 'gladstone-dale', and with no other"
            )
        return self

    def refractivity(
        self, temperature: ArrayLike, pressure: ArrayLike, *, relative_humidity: ArrayLike | None = None
    ) -> FloatArray:
        """Refractivity n − 1 of this air.

        Parameters
        ----------
        temperature : array_like, K
        pressure : array_like, Pa
        relative_humidity : array_like, 1, optional
            Local humidity in place of this atmosphere's own.

        Returns
        -------
        ndarray of float64, 1

        Raises
        ------
        InputError
            As `nigemizu.air.refractivity`.
        """
        fraction = self.vapour_fraction() if relative_humidity is None else None
        humidity = 0.0 if fraction is not None else self._humidity(relative_humidity)
        return laws.refractivity(
            temperature,
            pressure,
            relative_humidity=humidity,
            vapour_fraction=fraction,
            wavelength=self.wavelength,
            co2_fraction=self.co2_fraction,
            model=self.model,
            gladstone_dale_constant=self.gladstone_dale_constant,
        )

    def vapour_fraction(self) -> float | None:
        """Mole fraction of water vapour when it is the same everywhere, else None."""
        if self.humidity_temperature is None:
            return None
        return float(
            moist.water_vapour_fraction(
                self.humidity_temperature, self.surface_pressure, self.relative_humidity
            )
        )

    def hydrostatic_pressure(self, height: ArrayLike, temperature: ArrayLike) -> FloatArray:
        """Pressure [Pa] at the heights [m] of a column of temperature [K] at rest."""
        fraction = self.vapour_fraction()
        if fraction is None:
            return pressure.hydrostatic_pressure(
                height,
                temperature,
                surface_pressure=self.surface_pressure,
                relative_humidity=self.relative_humidity,
            )
        virtual = np.asarray(temperature, dtype=np.float64) * moist.virtual_factor(np.asarray(fraction))
        return pressure.hydrostatic_pressure(height, virtual, surface_pressure=self.surface_pressure)

    def _humidity(self, given: ArrayLike | None) -> ArrayLike:
        return self.relative_humidity if given is None else given
