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
    "Newtons",
    "Seconds",
    "SquareMetresPerSecond",
    "Watts",
]

Metres = Annotated[float, Field(json_schema_extra={"unit": "m"})]
Seconds = Annotated[float, Field(json_schema_extra={"unit": "s"})]
Kelvin = Annotated[float, Field(json_schema_extra={"unit": "K"})]
KelvinDifference = Annotated[float, Field(json_schema_extra={"unit": "K difference"})]
MetresPerSecond = Annotated[float, Field(json_schema_extra={"unit": "m/s"})]
SquareMetresPerSecond = Annotated[float, Field(json_schema_extra={"unit": "m2/s"})]
Degrees = Annotated[float, Field(json_schema_extra={"unit": "degree"})]
Watts = Annotated[float, Field(json_schema_extra={"unit": "W"})]
Newtons = Annotated[float, Field(json_schema_extra={"unit": "N"})]
