"""Numbers with a unit, for the fields of the heat stage's values."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

__all__ = [
    "Degrees",
    "Kelvin",
    "KelvinDifference",
    "Metres",
    "MetresPerSecond",
    "Seconds",
    "SquareMetresPerSecond",
]

Metres = Annotated[float, Field(json_schema_extra={"unit": "m"})]
Seconds = Annotated[float, Field(json_schema_extra={"unit": "s"})]
Kelvin = Annotated[float, Field(json_schema_extra={"unit": "K"})]
KelvinDifference = Annotated[float, Field(json_schema_extra={"unit": "K difference"})]
MetresPerSecond = Annotated[float, Field(json_schema_extra={"unit": "m/s"})]
SquareMetresPerSecond = Annotated[float, Field(json_schema_extra={"unit": "m2/s"})]
Degrees = Annotated[float, Field(json_schema_extra={"unit": "degree"})]
