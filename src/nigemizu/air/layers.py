"""What lies on top of a profile: inversions, hot and cold layers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Literal, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nigemizu.values import Value

__all__ = ["ExponentialLayer", "GaussianLayer", "Inversion", "Layer", "ProfileLayer"]

FloatArray: TypeAlias = NDArray[np.float64]

Difference = Annotated[float, Field(json_schema_extra={"unit": "K difference"})]
Length = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"})]
Height = Annotated[float, Field(ge=0, json_schema_extra={"unit": "m"})]


class ProfileLayer(Value, ABC):
    """A difference of temperature that depends on the height and is added to a profile."""

    @abstractmethod
    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Difference [K] and its derivative [K/m] at heights [m]."""

    @property
    @abstractmethod
    def scales(self) -> tuple[tuple[float, float], ...]:
        """(height, extent) [m] around which the profile has to be looked at closely."""


@final
class Inversion(ProfileLayer):
    """A smooth step: the air above it is warmer.

    Parameters
    ----------
    jump : float, K
        By how much, with J/2 (1 + tanh((h − height)/(thickness/2))): 76 % of it within the thickness.
    height : float, m
        Of the middle of the step.
    thickness : float, m
        Of the step.
    decay : float, m, optional
        Height over which the warmth fades to 1/e above the step; left out, it stays.
    """

    kind: Literal["inversion"] = "inversion"
    jump: Difference
    height: Height
    thickness: Length
    decay: Length | None = None

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        scaled = (height - self.height) * (2 / self.thickness)
        step = 0.5 * self.jump * (1 + np.tanh(scaled))
        slope = self.jump / self.thickness / np.cosh(np.clip(scaled, -300, 300)) ** 2
        if self.decay is None:
            return step, slope
        # ln cosh: the fading begins as smoothly as the step.
        above = np.logaddexp(0.0, 2 * scaled) * (self.thickness / 4)
        fading = np.exp(-above / self.decay)
        return step * fading, fading * (slope - step * 0.5 * (1 + np.tanh(scaled)) / self.decay)

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return ((self.height, self.thickness),)


@final
class ExponentialLayer(ProfileLayer):
    """A layer at the ground that is warmer, or colder, and fades with the height.

    Parameters
    ----------
    excess : float, K
        At the ground; negative over a cold sea.
    height : float, m
        Over which it fades to 1/e.
    """

    kind: Literal["exponential"] = "exponential"
    excess: Difference
    height: Length

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        value = self.excess * np.exp(-height / self.height)
        return value, -value / self.height

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return ((0.0, self.height),)


@final
class GaussianLayer(ProfileLayer):
    """A layer aloft that is warmer, or colder, than what is above and below.

    Parameters
    ----------
    excess : float, K
        In its middle.
    height : float, m
        Of its middle.
    width : float, m
        w of excess × exp(−((h − height)/w)²).
    """

    kind: Literal["gaussian"] = "gaussian"
    excess: Difference
    height: Height
    width: Length

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        scaled = (height - self.height) / self.width
        value = self.excess * np.exp(-(scaled**2))
        return value, -2 * scaled / self.width * value

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return ((self.height, self.width),)


Layer = Annotated[Inversion | ExponentialLayer | GaussianLayer, Field(discriminator="kind")]
"""Any of the layers, told apart by its ``kind``."""
