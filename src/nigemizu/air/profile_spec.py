"""The section of a scene that states air in layers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal, Protocol, Self, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nigemizu.air.courses import Continued, Course, Linear, Near, Smooth, Standard, Summed
from nigemizu.air.earth import Earth
from nigemizu.air.layers import Layer
from nigemizu.air.profile import Profile
from nigemizu.air.standards import STANDARD_TOP, standard_gravity
from nigemizu.air.surface_layer import SurfaceLayer
from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["MeasuredAir", "ProfileSpec"]

FloatArray: TypeAlias = NDArray[np.float64]

_HUMID: Final = 12_000.0  # m, over which a standard's relative humidity falls to 0
_FADING: Final = 3_000.0  # m, over which what continues a table forgets it
_DRYING: Final = 2_000.0  # m, over which the vapour above a table falls to 1/e
_BLENDING: Final = 50.0  # m, above which a surface layer fades
_PRESSURE: Final = 101_325.0
_COLD, _HOT = 120.0, 400.0  # K: beyond these a temperature is in another unit
_THIN: Final = 2_000.0  # Pa at the ground: less is in hPa
_LEAST: Final = 2  # levels

Numbers = tuple[float, ...]


class MeasuredAir(Protocol):
    """A column that was read from a file (`nigemizu.heat.read_sounding`)."""

    @property
    def height(self) -> FloatArray: ...
    @property
    def pressure(self) -> FloatArray: ...
    @property
    def temperature(self) -> FloatArray: ...
    @property
    def vapour_fraction(self) -> FloatArray: ...


@final
class ProfileSpec(Value):
    """Air in layers: a standard atmosphere, a table or a sounding, and what lies on top of it.

    Parameters
    ----------
    kind : {"us1976", "isa", "table", "file"}
        U.S. Standard Atmosphere 1976 or ISA, which are one up to 80 km; `heights` and `temperatures`; or a
        file.
    surface_temperature : float, K, optional
        Of a standard atmosphere at height 0: the difference to 288.15 K fades linearly to the tropopause.
    surface_pressure : float, Pa, optional
        At the lowest height; 101 325 unless given here or by the data.
    relative_humidity : float, 1
        Of a standard atmosphere at height 0; falls linearly to 0 at 12 km.
    heights : list of float, m
        Of a table, increasing.
    temperatures : list of float, K
        At them.
    relative_humidities : list of float, 1
        At them, linear between and fading above; dry if left out.
    file : path, optional
        A sounding (University of Wyoming, IGRA), a column of a model (netCDF) or a table (CSV, TOML).
    smoothing : float, m, optional
        Straight lines through the points whose corners are rounded over this length; 0 leaves the corners
        (which make false folds in an image). Left out: cubics through the points with a continuous slope,
        without extremes of their own.
    beyond : {"standard", "isothermal"}
        Above a table: the standard atmosphere, to which the last temperature fades over 3 km; or as warm as
        the last point.
    layers : list of layers
        Added on top: ``inversion``, ``exponential``, ``gaussian``.
    surface_layer : SurfaceLayer, optional
        Air that the ground warms or cools while the wind mixes it; its `blending_height` is 50 m where it is
        not given. The profile is shifted, by a difference that fades over 3 km, to meet its air temperature.
    top : float, m
        Where the air ends; 86 km for the standard of 1976, 80 km for ISA.

    Notes
    -----
    Pressures follow from the temperatures, from that at the lowest height up: pressures of a table or
    sounding that do not are overruled. Of a standard atmosphere gravity is the standard's; of tables and
    soundings that of the Earth's latitude.
    """

    kind: Literal["us1976", "isa", "table", "file"] = "us1976"
    surface_temperature: Annotated[float, Field(ge=_COLD, le=_HOT)] | None = Field(
        None, json_schema_extra={"unit": "K"}
    )
    surface_pressure: Annotated[float, Field(ge=_THIN, le=1e6)] | None = Field(
        None, json_schema_extra={"unit": "Pa"}
    )
    relative_humidity: Annotated[float, Field(ge=0, le=1, json_schema_extra={"unit": "1"})] = 0.0
    heights: Annotated[Numbers, Field(json_schema_extra={"unit": "m"})] = ()
    temperatures: Annotated[Numbers, Field(json_schema_extra={"unit": "K"})] = ()
    relative_humidities: Annotated[Numbers, Field(json_schema_extra={"unit": "1"})] = ()
    file: Path | None = None
    smoothing: Annotated[float, Field(ge=0)] | None = Field(None, json_schema_extra={"unit": "m"})
    beyond: Literal["standard", "isothermal"] = "standard"
    surface_layer: SurfaceLayer | None = None
    layers: tuple[Layer, ...] = ()
    top: Annotated[float, Field(gt=1000, le=86_000)] | None = Field(None, json_schema_extra={"unit": "m"})

    @model_validator(mode="after")
    def _is_one_profile(self) -> Self:
        table = {"heights": self.heights, "temperatures": self.temperatures}
        for name, numbers in (*table.items(), ("relative_humidities", self.relative_humidities)):
            if numbers and self.kind != "table":
                raise InputError("goes with a table only", key=name, remedy='set kind = "table"')
        if (self.file is not None) != (self.kind == "file"):
            raise InputError(
                "is missing" if self.kind == "file" else "goes with a file only",
                key="file",
                remedy="name the sounding" if self.kind == "file" else 'set kind = "file"',
            )
        if self.kind == "table":
            self._check_table()
        elif self.kind == "file" and self.surface_temperature is not None:
            raise InputError("belongs to a standard atmosphere", key="surface_temperature")
        return self

    def _check_table(self) -> None:
        if len(self.heights) < _LEAST:
            raise InputError("a table needs two rows at least", key="heights", value=list(self.heights))
        for name in ("temperatures", "relative_humidities"):
            numbers = getattr(self, name)
            if len(numbers) != len(self.heights) and (numbers or name == "temperatures"):
                raise InputError(
                    f"{len(numbers)} rows beside {len(self.heights)} heights",
                    key=name,
                    expected="one for each height",
                )
        for row, (below, above) in enumerate(zip(self.heights[:-1], self.heights[1:], strict=True), start=2):
            if above <= below:
                raise InputError(
                    f"row {row} does not lie above row {row - 1}",
                    key="heights",
                    value=above,
                    expected=f"metres above {below:g}",
                )
        for row, temperature in enumerate(self.temperatures, start=1):
            if not _COLD < temperature < _HOT:
                others = [value for value in self.temperatures if _COLD < value < _HOT]
                mixed = "; the other rows are kelvins" if others else ""
                raise InputError(
                    f"row {row} is no temperature of air in K{mixed}",
                    key="temperatures",
                    value=temperature,
                    expected=f"kelvins from {_COLD:g} to {_HOT:g}",
                    remedy=f"is it {temperature:g} °C? that is {temperature + 273.15:g} K"
                    if abs(temperature) < 70
                    else None,
                )
        for row, humidity in enumerate(self.relative_humidities, start=1):
            if not 0 <= humidity <= 1:
                raise InputError(
                    f"row {row} is no relative humidity",
                    key="relative_humidities",
                    value=humidity,
                    expected="from 0 to 1",
                    remedy=f"if it is in per cent, write {humidity / 100:g}" if 1 < humidity <= 100 else None,
                )

    def build(self, earth: Earth, measured: MeasuredAir | None = None) -> Profile:
        """The profile over an Earth.

        Parameters
        ----------
        earth : Earth
            Its gravity counts, unless the profile is a standard.
        measured : MeasuredAir, optional
            What was read from `file`.

        Raises
        ------
        InputError
            If the file has not been read, or data lie above `top`.
        """
        top = self.top or STANDARD_TOP["isa" if self.kind == "isa" else "us1976"]
        if self.kind in ("us1976", "isa"):
            offset = 0.0 if self.surface_temperature is None else self.surface_temperature - 288.15
            humidity = Continued(
                Linear(np.array([0.0, _HUMID]), np.array([self.relative_humidity, 0.0])), _HUMID, None, 1.0
            )
            return self._profile(
                Standard(offset), humidity, "relative humidity", gravity=standard_gravity, top=top
            )
        if self.kind == "table":
            heights, temperatures = np.array(self.heights), np.array(self.temperatures)
            given = self.relative_humidities or (0.0,) * len(heights)
            vapour, vapour_is, pressure = np.array(given), "relative humidity", _PRESSURE
        else:
            if measured is None:
                raise InputError("has not been read", key="profile.file", value=str(self.file))
            heights, temperatures = measured.height, measured.temperature
            vapour, vapour_is, pressure = measured.vapour_fraction, "fraction", float(measured.pressure[0])
        last = float(heights[-1])
        if last >= top:
            raise InputError("the data reach above the top of the air", key="profile.top", value=top)
        other = Standard() if self.beyond == "standard" else None
        course: Course = Continued(self._through(heights, temperatures), last, other, _FADING)
        dry = Linear(np.array([0.0, top]), np.zeros(2))
        humid = Continued(Linear(heights, vapour), last, dry, _DRYING) if np.any(vapour > 0) else dry
        note = f"above {last:g} m the {self.beyond} continuation, not data"
        return self._profile(
            course,
            humid,
            vapour_is,
            gravity=earth.gravity,
            top=top,
            base=float(heights[0]),
            pressure=pressure,
            measured_top=last,
            notes=(note,),
        )

    def _through(self, heights: FloatArray, values: FloatArray) -> Course:
        if self.smoothing is None and len(heights) > _LEAST:
            return Smooth(heights, values)
        return Linear(heights, values, self.smoothing or 0.0)

    def _profile(
        self,
        course: Course,
        vapour: Course,
        vapour_is: str,
        *,
        base: float = 0.0,
        pressure: float = _PRESSURE,
        **rest: Any,
    ) -> Profile:
        if self.surface_layer is not None:
            layer = self.surface_layer
            if layer.blending_height is None:
                layer = layer.model_copy(update={"blending_height": _BLENDING})
            course = Near(course, layer, _FADING)
        if self.layers:
            course = Summed(course, self.layers)
        at_base = pressure if self.surface_pressure is None else self.surface_pressure
        return Profile(course, vapour, vapour_is, base=base, surface_pressure=at_base, **rest)
