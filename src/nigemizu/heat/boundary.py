"""What happens at the ground, the sides and the top of the air."""

from __future__ import annotations

from typing import Annotated, Literal, Self, final

from pydantic import Field, model_validator

from nigemizu.heat.measures import Kelvin
from nigemizu.heat.quantity import Quantity
from nigemizu.values import Value

__all__ = ["ExchangeGround", "FluxGround", "GroundBoundary", "HeldGround", "Sides", "Top"]


def _is_kelvin(name: str, quantity: Quantity) -> None:
    lowest = quantity.bounds()[0]
    if lowest <= 0:
        raise ValueError(
            f"{name}: temperatures are in kelvin and above zero, but this one reaches {lowest:g}"
        )


def _is_not_negative(name: str, quantity: Quantity) -> None:
    lowest = quantity.bounds()[0]
    if lowest < 0:
        raise ValueError(f"{name}: must not be negative at any place or time, but may reach {lowest:g}")


@final
class HeldGround(Value):
    """Ground whose skin is held at a temperature.

    Parameters
    ----------
    temperature : Quantity, K
        Of the skin: a number, or a course in time and a pattern in place.
    """

    kind: Literal["held"] = "held"
    temperature: Quantity = Field(json_schema_extra={"unit": "K"})

    @model_validator(mode="after")
    def _kelvin(self) -> Self:
        _is_kelvin("temperature", self.temperature)
        return self


class _HeatPerVolume(Value):
    density: float = Field(default=1.177, gt=0, json_schema_extra={"unit": "kg/m3"})
    specific_heat: float = Field(default=1006.0, gt=0, json_schema_extra={"unit": "J/kg/K"})

    @property
    def heat_capacity(self) -> float:
        """Heat per volume and kelvin, density times specific heat [J m-3 K-1]."""
        return self.density * self.specific_heat


@final
class FluxGround(_HeatPerVolume):
    """Ground that gives a known heat flux to the air.

    Parameters
    ----------
    heat_flux : Quantity, W m-2
        Positive into the air.
    density : float, kg m-3
        Of the air, which turns a flux of heat into one of temperature (dry air at 300 K, 1013 hPa).
    specific_heat : float, J kg-1 K-1
        Of the air at constant pressure.
    """

    kind: Literal["flux"] = "flux"
    heat_flux: Quantity = Field(json_schema_extra={"unit": "W/m2"})


@final
class ExchangeGround(_HeatPerVolume):
    """Ground that exchanges heat with the air in proportion to the difference of temperature.

    The flux into the air is ``coefficient × (temperature − skin of the air)``.

    Parameters
    ----------
    coefficient : Quantity, W m-2 K-1
        Of heat exchange, between what lies below and the air's skin; zero is an insulated wall. In the course
        of time a step takes the value at its middle. Where a pattern has more than 64 values, columns are
        interpolated between 64 levels (`nigemizu.heat.columns` bounds the error).
    temperature : Quantity, K
        Of what lies below.
    density, specific_heat : float
        As for `FluxGround`.
    """

    kind: Literal["exchange"] = "exchange"
    coefficient: Quantity = Field(json_schema_extra={"unit": "W/m2/K"})
    temperature: Quantity = Field(json_schema_extra={"unit": "K"})

    @model_validator(mode="after")
    def _possible(self) -> Self:
        _is_kelvin("temperature", self.temperature)
        _is_not_negative("coefficient", self.coefficient)
        return self


GroundBoundary = Annotated[HeldGround | FluxGround | ExchangeGround, Field(discriminator="kind")]
"""The ground's boundary condition, told apart by ``kind``."""


@final
class Sides(Value):
    """What lies beyond the sides.

    Parameters
    ----------
    x, y : {"periodic", "insulated"}
        ``periodic``: what leaves on one side comes in on the other. ``insulated``: no heat is conducted
        through the side; wind that blows in carries the temperature of the outermost cell.
    """

    x: Literal["periodic", "insulated"] = "periodic"
    y: Literal["periodic", "insulated"] = "periodic"


@final
class Top(Value):
    """The upper end of the air.

    Parameters
    ----------
    kind : {"held", "insulated"}
        Held at a temperature, or no heat passes.
    temperature : float, K, optional
        For ``held``; left out, the top stays at the mean that it has in the beginning.
    """

    kind: Literal["held", "insulated"] = "held"
    temperature: Kelvin | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _insulated_has_none(self) -> Self:
        if self.kind == "insulated" and self.temperature is not None:
            raise ValueError("temperature: an insulated top has none")
        return self
