"""A sounding: a column of measured or modelled air, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Sounding"]

FloatArray: TypeAlias = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class Sounding:
    """A column of air: height, pressure, temperature and water vapour, from below upwards.

    Attributes
    ----------
    height : (n,) float64, m
        Strictly increasing. Of files that count from the sea, the zero is the lowest level that could be
        used, which of a radiosonde is the ground of the station; a table whose heights count from the ground
        keeps its own zero.
    pressure : (n,) float64, Pa
        Strictly decreasing.
    temperature : (n,) float64, K
    vapour_fraction : (n,) float64, 1
        Mole fraction of water vapour.
    wind_speed : (n,) float64, m/s, optional
        NaN where it was not measured; None if nowhere.
    wind_direction : (n,) float64, degree, optional
        Where the wind comes from, from north through east; as `wind_speed`.
    station_height : float, m, optional
        Height 0 above the sea, where the file tells it.
    time : datetime.datetime, optional
        In UTC.
    place : (float, float), degree, optional
        Latitude and longitude.
    station : str, optional
        As the file calls it.
    source : str
        Which file, and what it is.
    notes : tuple of str
        What was dropped, merged or filled in, and why.
    """

    height: FloatArray
    pressure: FloatArray
    temperature: FloatArray
    vapour_fraction: FloatArray
    wind_speed: FloatArray | None = None
    wind_direction: FloatArray | None = None
    station_height: float | None = None
    time: datetime | None = None
    place: tuple[float, float] | None = None
    station: str | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in (
            *("height", "pressure", "temperature", "vapour_fraction"),
            *("wind_speed", "wind_direction"),
        ):
            values = getattr(self, name)
            if values is not None:
                values = np.array(values, dtype=np.float64)
                values.flags.writeable = False
                object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        where = f" at {self.place[0]:g}, {self.place[1]:g}" if self.place else ""
        when = f", {self.time:%Y-%m-%d %H:%M} UTC" if self.time else ""
        return (
            f"<Sounding {self.station or 'of no station'}{where}{when}: {self.height.size} levels, "
            f"{self.height[0]:.0f} to {self.height[-1]:.0f} m, {self.temperature[0]:.1f} K and "
            f"{self.pressure[0] / 100.0:.1f} hPa at the lowest>"
        )
